//! Safe neighbourhoods, the suffix `-sn`.
//!
//! *Idea.* All queries to a point light end in the same voxel: ask the field once for each voxel and keep the answers as bits.
//!
//! *Definition.* neigh(V) = { U : U in safe(V) or V in safe(U) } (Def. 14 in \[Houska2013\]), over any field.
//!
//! *Guarantee.* Exactly the answers of the field, [`SafeZones::proves`]; so its guarantee.
//!
//! *Cost.* X·Y·Z bits per light; one load a query, and the voxel of the light is not needed. The build asks the field for every
//! voxel, in parallel over slices.
//!
//! *Limits.* One set per light. A light in an occupied voxel proves nothing.

use vdf_voxel::{Voxel, VoxelSet};

use crate::SafeZones;

/// The voxels that a field proves visible from one voxel; see the head of its source file.
#[derive(Clone, Debug)]
pub struct SafeNeighbourhood {
    voxels: VoxelSet,
}

impl SafeNeighbourhood {
    /// The safe neighbourhood of the voxel `light` in a field that was built from `occupied`; empty if `light` is
    /// occupied.
    #[must_use]
    pub fn new<F: SafeZones>(field: &F, occupied: &VoxelSet, light: Voxel) -> Self {
        let resolution = field.resolution();
        if occupied.contains(light) || !resolution.contains(light) {
            return Self { voxels: VoxelSet::new(resolution) };
        }
        let voxels = VoxelSet::from_rows(resolution, |j, k, row| {
            for (word, first) in row.iter_mut().zip((0..resolution.x).step_by(64)) {
                for i in first..resolution.x.min(first.saturating_add(64)) {
                    *word |= u64::from(field.proves(light, Voxel::new(i, j, k))) << (i - first);
                }
            }
        });
        Self { voxels }
    }

    /// True if no segment between the light's voxel and `voxel` can be occluded. False says nothing.
    #[must_use]
    #[inline]
    pub fn proves(&self, voxel: Voxel) -> bool {
        self.voxels.contains(voxel)
    }

    /// The voxels of the neighbourhood.
    #[must_use]
    pub fn voxels(&self) -> &VoxelSet {
        &self.voxels
    }

    /// The number of voxels in the neighbourhood.
    #[must_use]
    pub fn count(&self) -> usize {
        self.voxels.count()
    }

    /// The memory of the bits in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.voxels.bytes()
    }
}
