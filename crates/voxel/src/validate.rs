//! Validation of a set of occupied voxels against the triangles that it was made from.
//!
//! *Idea.* Proofs of visibility are as good as the set that they rest on. So the set is checked against its definition
//! by the slow twin of the voxelization, which shares no step with the fast one but the conversion to grid coordinates
//! and the box of voxels around a triangle.
//!
//! *Guarantee.* If validation passes, every voxel whose closed cube touches a triangle, with the vertices converted to
//! grid coordinates, is in the set. The twin runs at a dilation of δ/4, 16u·(1 + M), which covers its own rounding and
//! no more: what it finds dilated by δ/2 touches, and that much every voxelization covers, so a sound set is never
//! refused.
//!
//! *Cost.* That of [`Voxelizer::SeparatingAxes`](crate::Voxelizer), two to four times the voxelization.

use glam::Vec3;
use rayon::prelude::*;

use crate::set::padding_mask;
use crate::voxelize::{AtomicBits, GridTriangle};
use crate::{Voxel, VoxelError, VoxelGrid, VoxelSet};

/// The share of the grid's dilation that the twin needs for its own rounding.
const TWIN_SHARE: f64 = 0.25;

impl VoxelSet {
    /// Checks that the set holds every voxel of `grid` that touches one of `triangles`; returns the number of *excess*
    /// voxels, which none of them touches: 0 but for triangles that miss a voxel by less than 2δ.
    ///
    /// From cheap to dear: the resolution is the grid's; the bits that pad the rows are clear; the voxels of all
    /// vertices inside the grid are in the set; so are all voxels that the exact test finds. The first failure is
    /// returned, with the least number of a triangle and its least voxel, whatever the number of threads. Triangles are
    /// given in world units, as to [`voxelize`](crate::voxelize()), and are iterated twice.
    ///
    /// # Errors
    /// [`VoxelError::ResolutionMismatch`], [`VoxelError::PaddingNotClear`] or [`VoxelError::NotOccupied`] if the set is
    /// wrong; [`VoxelError::NonFiniteTriangle`] if a vertex is not finite.
    pub fn validate<T>(&self, grid: &VoxelGrid, triangles: T) -> Result<usize, VoxelError>
    where
        T: IntoParallelIterator<Item = [Vec3; 3], Iter: IndexedParallelIterator> + Clone,
    {
        if self.resolution() != grid.resolution() {
            return Err(VoxelError::ResolutionMismatch { set: self.resolution(), grid: grid.resolution() });
        }
        self.validate_padding()?;
        first_error(triangles.clone(), |number, triangle| self.validate_vertices(grid, number, triangle))?;
        let touched = AtomicBits::new(grid.resolution());
        first_error(triangles, |number, triangle| self.validate_triangle(grid, &touched, number, triangle))?;
        // All that is touched is in the set, so the difference of the numbers is the number of the difference.
        Ok(self.count() - touched.into_set().count())
    }

    fn validate_padding(&self) -> Result<(), VoxelError> {
        let resolution = self.resolution();
        let padding = !padding_mask(resolution);
        for (j, k) in (0..resolution.z()).flat_map(|k| (0..resolution.y()).map(move |j| (j, k))) {
            let extra = self.row(j, k).last().copied().unwrap_or_default() & padding;
            if extra != 0 {
                let i = (resolution.x() - 1) / 64 * 64 + extra.trailing_zeros();
                return Err(VoxelError::PaddingNotClear { voxel: Voxel::new(i, j, k) });
            }
        }
        Ok(())
    }

    fn validate_vertices(&self, grid: &VoxelGrid, number: usize, triangle: [Vec3; 3]) -> Result<(), VoxelError> {
        let voxels = triangle.iter().filter_map(|vertex| grid.voxel_containing(vertex.as_dvec3()));
        missing(number, voxels.filter(|&voxel| !self.contains(voxel)).min_by_key(|&voxel| grid.linear_index(voxel)))
    }

    fn validate_triangle(
        &self,
        grid: &VoxelGrid,
        touched: &AtomicBits,
        number: usize,
        triangle: [Vec3; 3],
    ) -> Result<(), VoxelError> {
        let mut least: Option<Voxel> = None;
        if let Some(triangle) = GridTriangle::new(grid, triangle, TWIN_SHARE)? {
            triangle.scan_by_axes(|[i, j, k]| {
                let voxel = Voxel::new(i, j, k);
                touched.insert_run(j, k, [i; 2]);
                if !self.contains(voxel) && least.is_none_or(|l| grid.linear_index(voxel) < grid.linear_index(l)) {
                    least = Some(voxel);
                }
            });
        }
        missing(number, least)
    }
}

fn missing(triangle: usize, voxel: Option<Voxel>) -> Result<(), VoxelError> {
    voxel.map_or(Ok(()), |voxel| Err(VoxelError::NotOccupied { triangle, voxel }))
}

/// The error of the first triangle that has one, in the order of the triangles.
fn first_error<T>(
    triangles: T,
    check: impl Fn(usize, [Vec3; 3]) -> Result<(), VoxelError> + Sync,
) -> Result<(), VoxelError>
where
    T: IntoParallelIterator<Item = [Vec3; 3], Iter: IndexedParallelIterator>,
{
    let errors = triangles.into_par_iter().enumerate().map(|(number, triangle)| check(number, triangle).err());
    errors.find_map_first(|error| error).map_or(Ok(()), Err)
}

#[cfg(test)]
mod tests;
