//! What to build, and how fine.

use crate::{LightBuffer, Method};

/// What light buffers and neighbourhoods together may take at most: with more lights each gets too few queries to pay for its own.
pub(super) const LIGHTS_BYTES: u64 = 1 << 30;

/// What to build.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProverOptions {
    /// The method.
    pub method: Method,
    /// Side of a voxel in world units; positive. Of no matter where the method needs no voxels for these lights.
    pub voxel_size: f64,
    /// The largest number of voxels that may be built; `amr` takes 8 bytes for each.
    pub max_voxels: u64,
    /// The most memory in bytes that the voxels, the field and what is kept for lights may take together. Building takes
    /// some more for a while: for each thread that builds the neighbourhood of an area light three bits a voxel, and by hops a byte
    /// for that of any light.
    pub max_bytes: u64,
    /// Texels along each side of a face of a light buffer, rounded up to a power of two of at least 64; `None` chooses.
    pub texels: Option<u32>,
}

impl Default for ProverOptions {
    /// `lb` with voxels of 1 unit where it needs any, at most 2²⁹ of them and 4 GiB.
    fn default() -> Self {
        Self { method: Method::default(), voxel_size: 1.0, max_voxels: 1 << 29, max_bytes: 4 << 30, texels: None }
    }
}

impl ProverOptions {
    /// Texels along each side of a face of a light buffer, for so many occluding triangles and point lights. Where none are asked for there are about as
    /// many in all as triangles, and no more than fit. With more than four lights a buffer is asked less often, and half as many along each side have to do.
    #[must_use]
    pub fn texels_for(&self, triangles: usize, lights: usize) -> u32 {
        let bytes_for_each = self.max_bytes.min(LIGHTS_BYTES) / (lights as u64).max(1);
        self.texels.unwrap_or_else(|| {
            let few = (triangles as f64).sqrt() as u32;
            let one = few.next_power_of_two().clamp(128, 1024);
            let mut side = if lights > 4 { one / 2 } else { one };
            // Lists and records take about as much as texels.
            while side > 64 && LightBuffer::texel_bytes(side) * 2 > bytes_for_each {
                side /= 2;
            }
            side
        })
    }
}
