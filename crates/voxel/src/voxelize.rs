//! Conservative voxelization: Σ′, the voxels that touch an occluder (3.3.1 in \[Houska2013\]).

mod atomic_bits;
mod offset_polygon;
mod separating_axes;
mod slices;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use self::atomic_bits::AtomicBits;
use crate::{VoxelError, VoxelGrid, VoxelSet};

/// How triangles become voxels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Voxelizer {
    /// Slices.
    #[default]
    Slices,
    /// Offset polygon.
    OffsetPolygon,
    /// Separating axes.
    SeparatingAxes,
}

/// The first and last voxel along each axis.
type Bounds = [[u32; 2]; 3];

/// The voxels of `grid` that touch one of the triangles.
///
/// Triangles come as a parallel iterator over vertices in world units, so that a caller need not copy its meshes:
/// `triangles.par_iter().map(|t| t.vertices)`.
///
/// # Errors
/// If a vertex is not finite.
pub fn voxelize<T>(grid: &VoxelGrid, triangles: T) -> Result<VoxelSet, VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3]>,
{
    voxelize_with(Voxelizer::default(), grid, triangles)
}

/// voxelize with.
///
/// # Errors
/// If a vertex is not finite.
pub fn voxelize_with<T>(voxelizer: Voxelizer, grid: &VoxelGrid, triangles: T) -> Result<VoxelSet, VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3]>,
{
    match voxelizer {
        Voxelizer::Slices => scan_all(grid, triangles, slices::scan),
        Voxelizer::OffsetPolygon => scan_all(grid, triangles, offset_polygon::scan),
        Voxelizer::SeparatingAxes => scan_all(grid, triangles, |bits, vertices, bounds, dilation| {
            separating_axes::scan(vertices, bounds, dilation, |[i, j, k]| bits.insert_run(j, k, [i, i]));
        }),
    }
}

fn scan_all<T>(
    grid: &VoxelGrid,
    triangles: T,
    scan: impl Fn(&AtomicBits, &[DVec3; 3], &Bounds, f64) + Sync,
) -> Result<VoxelSet, VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3]>,
{
    let bits = AtomicBits::new(grid.resolution());
    triangles.into_par_iter().try_for_each(|triangle| {
        if !triangle.iter().all(|v| v.is_finite()) {
            return Err(VoxelError::NonFiniteTriangle);
        }
        // Adding zero turns −0.0 into 0.0.
        let vertices = triangle.map(|v| grid.grid_coordinates(v.as_dvec3()) + DVec3::ZERO);
        let [a, b, c] = vertices;
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let dilation = grid.dilation_reaching(min.abs().max(max.abs()).max_element());

        let resolution = grid.resolution();
        let limits = [resolution.x, resolution.y, resolution.z];
        let [Some(x), Some(y), Some(z)] =
            [0, 1, 2].map(|axis| touched(min[axis] - dilation, max[axis] + dilation, limits[axis]))
        else {
            return Ok(());
        };
        // The triangle is inside one voxel. (Not: only one voxel is left after clipping; that one it may miss.)
        if (min - dilation).floor() == (max + dilation).floor() {
            bits.insert_run(y[0], z[0], x);
            return Ok(());
        }
        scan(&bits, &vertices, &[x, y, z], dilation);
        Ok(())
    })?;
    Ok(bits.into_set())
}

/// The first and last of the voxels 0…`limit` − 1 along one axis whose closed interval meets [low, high], if there are any.
#[inline]
fn touched(low: f64, high: f64, limit: u32) -> Option<[u32; 2]> {
    if high < 0.0 {
        return None;
    }
    // Conversion truncates, which is to round down here, and takes negative numbers to 0.
    let below = low as u32;
    let first = if f64::from(below) == low { below.saturating_sub(1) } else { below };
    let last = (high as u32).min(limit - 1);
    (first <= last).then_some([first, last])
}

#[cfg(test)]
mod tests;
