//! Conservative voxelization: Σ′, the voxels that touch an occluder (3.3.1 in \[Houska2013\]).
//!
//! *Idea.* Each triangle is carried to grid coordinates in `f64`, and a method of [`Voxelizer`] finds its voxels. The
//! default clips the triangle to slices of the grid and the slices to rows; its slow and obvious twin, for tests and
//! for [`VoxelSet::validate`](crate::VoxelSet::validate), tests voxel by voxel. The thesis's own, by an offset polygon, is there to be
//! compared with.
//!
//! *Guarantee.* A voxel is in the set if its closed cube, dilated by 24u·(1 + M), meets the closed triangle of the
//! converted vertices; that is what the rounding of end points and vertices requires. These two methods aim at the dilation
//! δ of [`VoxelGrid::dilation`] and lose less than δ − 24u·(1 + M) to their own rounding; no voxel is in the set that,
//! dilated by 2δ, misses the triangle. Both bounds are derived in `docs/numerics.md`. Degenerate triangles are the
//! segments or points that they are. A triangle in a common face of two voxels marks both.
//!
//! *Cost.* Parallel over triangles, with an atomic OR for each word; since OR commutes, the result does not depend on
//! threads.
//!
//! *Limits.* What lies outside the grid is not represented: proofs hold if the grid covers all triangles.

mod atomic_bits;
mod offset_polygon;
pub(crate) mod separating_axes;
mod slices;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

pub(crate) use self::atomic_bits::AtomicBits;
use crate::{Voxel, VoxelError, VoxelGrid, VoxelSet, grid::GridPoint};

/// How triangles become voxels. All methods keep the guarantee of [`voxelize`]; the sets of slices and separating axes differ at most in voxels
/// that miss a triangle by less than 2δ.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Voxelizer {
    /// Clips a triangle to slices and rows of the grid, and fills runs of voxels. The fastest.
    #[default]
    Slices,
    /// Tests voxels one by one by 13 axes: the slow twin, at a half to a quarter of the speed, with no step in common
    /// with the other but the conversion to grid coordinates and the box of voxels around a triangle.
    SeparatingAxes,
    /// Scans the offset polygon of the triangle's projection and fills the depths of its plane: the thesis's way (3.5.1 in \[Houska2013\]), slower
    /// and less tight. For comparison only.
    OffsetPolygon,
}

/// The voxels of `grid` that touch one of the triangles, by the default method.
///
/// Triangles come as a parallel iterator over vertices in world units, so that a caller need not copy its meshes:
/// `triangles.par_iter().map(|t| t.vertices)`. The set does not depend on their order nor on the number of threads.
///
/// # Errors
/// If a vertex is not finite.
pub fn voxelize<T>(grid: &VoxelGrid, triangles: T) -> Result<VoxelSet, VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3]>,
{
    voxelize_with(Voxelizer::default(), grid, triangles)
}

/// The voxels of `grid` that touch one of the triangles, by a method of choice; see [`voxelize`].
///
/// # Errors
/// If a vertex is not finite.
pub fn voxelize_with<T>(voxelizer: Voxelizer, grid: &VoxelGrid, triangles: T) -> Result<VoxelSet, VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3]>,
{
    match voxelizer {
        Voxelizer::Slices => scan_all(grid, triangles, slices::scan),
        Voxelizer::SeparatingAxes => {
            scan_all(grid, triangles, |triangle, bits| triangle.scan_by_axes(|[i, j, k]| bits.insert_run(j, k, [i; 2])))
        }
        Voxelizer::OffsetPolygon => scan_all(grid, triangles, offset_polygon::scan),
    }
}

/// The box of voxels around a triangle: the first and the last voxel of all that [`voxelize`] may add for it, `None` if
/// there are none. Some of the box's voxels may not touch the triangle, but no voxel beyond the box is added for it.
///
/// # Errors
/// If a vertex is not finite.
pub fn voxel_bounds(grid: &VoxelGrid, triangle: [Vec3; 3]) -> Result<Option<[Voxel; 2]>, VoxelError> {
    let triangle = GridTriangle::new(grid, triangle, 1.0)?;
    Ok(triangle.map(|GridTriangle { bounds: [x, y, z], .. }| [0, 1].map(|end| Voxel::new(x[end], y[end], z[end]))))
}

fn scan_all<T>(
    grid: &VoxelGrid,
    triangles: T,
    scan: impl Fn(&GridTriangle, &AtomicBits) + Sync,
) -> Result<VoxelSet, VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3]>,
{
    let bits = AtomicBits::new(grid.resolution());
    triangles.into_par_iter().try_for_each(|triangle| {
        if let Some(triangle) = GridTriangle::new(grid, triangle, 1.0)? {
            scan(&triangle, &bits);
        }
        Ok(())
    })?;
    Ok(bits.into_set())
}

/// A triangle in grid coordinates, and what of the grid it can touch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GridTriangle {
    vertices: [GridPoint; 3],
    /// The first and the last voxel along each axis that the dilated bounds of the triangle touch.
    bounds: [[u32; 2]; 3],
    dilation: f64,
    /// Along two axes or all three the dilated bounds lie inside one voxel. Then the triangle touches all the voxels of
    /// `bounds`, because it is connected. (Not: `bounds` has one voxel; at the grid's border the triangle may miss
    /// that.)
    fills_bounds: bool,
}

impl GridTriangle {
    /// Converts vertices; `None` if they are off the grid. The dilation is `share` of the grid's.
    #[inline]
    pub(crate) fn new(grid: &VoxelGrid, triangle: [Vec3; 3], share: f64) -> Result<Option<Self>, VoxelError> {
        if !triangle.iter().all(|v| v.is_finite()) {
            return Err(VoxelError::NonFiniteTriangle);
        }
        let vertices = triangle.map(|v| grid.grid_coordinates(v.as_dvec3()));
        let [GridPoint(a), GridPoint(b), GridPoint(c)] = vertices;
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let dilation = share * grid.dilation_reaching(min.abs().max(max.abs()).max_element());
        let (low, high) = (min - dilation, max + dilation);
        let resolution = grid.resolution();
        let (Some(x), Some(y), Some(z)) = (
            touched(low.x, high.x, resolution.x()),
            touched(low.y, high.y, resolution.y()),
            touched(low.z, high.z, resolution.z()),
        ) else {
            return Ok(None);
        };
        let corner = DVec3::new(x[0].into(), y[0].into(), z[0].into());
        let inside = low.cmpge(corner) & high.cmplt(corner + 1.0);
        let fills_bounds = inside.bitmask().count_ones() >= 2;
        Ok(Some(Self { vertices, bounds: [x, y, z], dilation, fills_bounds }))
    }

    /// Visits the voxels that the separating-axis test finds.
    pub(crate) fn scan_by_axes(&self, visit: impl FnMut([u32; 3])) {
        separating_axes::scan(&self.vertices, &self.bounds, self.dilation, visit);
    }
}

/// The first and the last of the voxels 0…`limit` − 1 along one axis whose closed interval meets [low, high], if there
/// are any.
#[inline]
fn touched(low: f64, high: f64, limit: u32) -> Option<[u32; 2]> {
    if high < 0.0 {
        return None;
    }
    // Conversion truncates, which here is rounding down, and takes what is negative to 0: no call of `floor`.
    let below = low as u32;
    let first = if f64::from(below) == low { below.saturating_sub(1) } else { below };
    let last = (high as u32).min(limit - 1);
    (first <= last).then_some([first, last])
}

#[cfg(test)]
mod tests;
