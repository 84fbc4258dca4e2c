//! Conservative voxelization: Σ′, the voxels that touch an occluder (3.3.1 in \[Houska2013\]).
//!
//! *Idea.* Each triangle is tested against the voxels near it by the separating-axis test, in grid coordinates and `f64`
//! (3.5.1 in \[Houska2013\] rasterizes conservatively instead; the test is tighter and easier to trust).
//! Columns of voxels along the dominant axis of the normal are visited; a column that the triangle's
//! projection misses is skipped, the plane of the triangle bounds the run of voxels in it, and only these are tested
//! against the other two projections.
//!
//! *Guarantee.* A voxel is in the set if its closed cube, dilated by [`VoxelGrid::dilation`], meets the closed
//! triangle: superset in exact terms, and larger only by voxels that the triangle misses by some 2⁻⁴⁵·M voxels.
//! Degenerate triangles are the segments or points that they are. A triangle in a common face of two voxels
//! marks both.
//!
//! *Cost.* O(n²) for a triangle across a grid of n³; a triangle inside one voxel costs one bit. Parallel over
//! triangles, with an atomic OR for each voxel; since OR commutes, the result does not depend on threads.
//!
//! *Limits.* What lies outside the grid is not represented: proofs hold if the grid covers all triangles.

use std::ops::RangeInclusive;
use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::sat::{Projection, Slab};
use crate::set::{bit_address, words_per_row};
use crate::{Resolution, Voxel, VoxelError, VoxelGrid, VoxelSet};

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
    let bits = AtomicBits::new(grid.resolution());
    triangles.into_par_iter().try_for_each(|triangle| add_triangle(grid, &bits, triangle))?;
    Ok(bits.into_set())
}

fn add_triangle(grid: &VoxelGrid, bits: &AtomicBits, triangle: [Vec3; 3]) -> Result<(), VoxelError> {
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
        bits.insert([*x.start(), *y.start(), *z.start()]);
        return Ok(());
    }
    scan(bits, &vertices, &[x, y, z], dilation);
    Ok(())
}

/// The voxels along one axis whose closed interval meets [low, high], if there are any.
fn touched(low: f64, high: f64, limit: u32) -> Option<RangeInclusive<u32>> {
    let first = (low - 1.0).ceil().max(0.0);
    let last = high.floor().min(f64::from(limit) - 1.0);
    (first <= last).then_some(first as u32..=last as u32)
}

/// Tests the voxels of a box around the triangle, column by column.
fn scan(bits: &AtomicBits, vertices: &[DVec3; 3], bounds: &[RangeInclusive<u32>; 3], dilation: f64) {
    let radius = 0.5 + dilation;
    let slab = Slab::new(vertices, radius);
    let w = slab.axis;
    let (u, v) = ((w + 1) % 3, (w + 2) % 3);
    let along_w = Projection::new(vertices, u, v, radius);
    let along_u = Projection::new(vertices, v, w, radius);
    let along_v = Projection::new(vertices, w, u, radius);

    for cv in bounds[v].clone() {
        let y = f64::from(cv) + 0.5;
        for cu in bounds[u].clone() {
            let x = f64::from(cu) + 0.5;
            if !along_w.touches(x, y) {
                continue;
            }
            let (near, far) = slab.depths(x, y);
            // From centres to indices; 4δ covers the rounding of the depths.
            let first = (near - 0.5 - 4.0 * dilation).ceil().max(f64::from(*bounds[w].start()));
            let last = (far - 0.5 + 4.0 * dilation).floor().min(f64::from(*bounds[w].end()));
            if first > last {
                continue;
            }
            for cw in first as u32..=last as u32 {
                let z = f64::from(cw) + 0.5;
                if along_u.touches(y, z) && along_v.touches(z, x) {
                    let mut voxel = [0; 3];
                    (voxel[u], voxel[v], voxel[w]) = (cu, cv, cw);
                    bits.insert(voxel);
                }
            }
        }
    }
}

/// A voxel set under construction by many threads.
struct AtomicBits {
    resolution: Resolution,
    words_per_row: usize,
    words: Vec<AtomicU64>,
}

impl AtomicBits {
    fn new(resolution: Resolution) -> Self {
        let words_per_row = words_per_row(resolution);
        let count = words_per_row * resolution.y as usize * resolution.z as usize;
        Self { resolution, words_per_row, words: std::iter::repeat_with(AtomicU64::default).take(count).collect() }
    }

    #[inline]
    fn insert(&self, [i, j, k]: [u32; 3]) {
        let (index, bit) = bit_address(self.resolution, self.words_per_row, Voxel::new(i, j, k));
        let (word, mask) = (&self.words[index], 1 << bit);
        // Reading first keeps a word that many threads hit shared between their caches.
        if word.load(Ordering::Relaxed) & mask == 0 {
            word.fetch_or(mask, Ordering::Relaxed);
        }
    }

    fn into_set(self) -> VoxelSet {
        VoxelSet::from_words(self.resolution, self.words.into_iter().map(AtomicU64::into_inner).collect())
    }
}

#[cfg(test)]
mod tests;
