//! The non-directional distance field, `ndf`.
//!
//! *Idea.* Each voxel knows how far the nearest occupied voxel is in any direction: inside that cube nothing is.
//!
//! *Definition.* Dist(V) = min over occupied U of d_CD(U, V); safe(V) = { U : d_CD(U, V) < Dist(V) } (Def. 4 and 8
//! in \[Houska2013\]). One byte, saturated at 255. Beyond the grid there is nothing: the border is no obstacle.
//!
//! *Guarantee.* If d_CD(A, B) < Dist(A), all voxels of the cuboid of A and B are in the open ball around A: they are free.
//!
//! *Cost.* X·Y·Z bytes; two loads a query. The thesis builds by a wavefront from the occupied voxels (3.5.3); here two raster
//! sweeps (Rosenfeld and Pfaltz 1966) give the same field: for the chessboard metric a sweep forwards over half of the 26
//! neighbours and one backwards over the other half are exact. They read memory in order, need no queue, and
//! their row operations vectorize.
//!
//! *Limits.* One near wall on any side shrinks the zone in all directions. Nothing is proved over 255 voxels or more.

use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{FieldError, SafeZones, chessboard_distance, rows, validate};

/// The non-directional chessboard distance field; see the head of its source file.
#[derive(Clone, Debug)]
pub struct Ndf {
    resolution: Resolution,
    distances: Vec<u8>,
}

impl Ndf {
    /// Builds the field of these occupied voxels.
    #[must_use]
    pub fn build(occupied: &VoxelSet) -> Self {
        let resolution = occupied.resolution();
        let mut distances = vec![0; resolution.voxel_count()];
        let (width, height) = (resolution.x as usize, resolution.y as usize);
        for (row, index) in distances.chunks_exact_mut(width).zip(0usize..) {
            let [j, k] = [index % height, index / height];
            rows::expand(occupied.row(j as u32, k as u32), row);
        }

        let mut nearest = Nearest::new(width);
        let row_count = height * resolution.z as usize;
        for row in 0..row_count {
            let (done, rest) = distances.split_at_mut(row * width);
            nearest.clear();
            let j = row % height;
            let finished = |back: usize| row.checked_sub(back).and_then(|r| done.chunks_exact(width).nth(r));
            nearest.add(finished(1).filter(|_| j > 0));
            nearest.add(finished(height + 1).filter(|_| j > 0));
            nearest.add(finished(height));
            nearest.add(finished(height - 1).filter(|_| j + 1 < height));
            let current = &mut rest[..width];
            nearest.relax(current);
            rows::sweep_up(current);
        }
        for row in (0..row_count).rev() {
            let (rest, done) = distances.split_at_mut((row + 1) * width);
            nearest.clear();
            let j = row % height;
            let finished = |ahead: usize| done.chunks_exact(width).nth(ahead - 1);
            nearest.add(finished(1).filter(|_| j + 1 < height));
            nearest.add(finished(height + 1).filter(|_| j + 1 < height));
            nearest.add(finished(height));
            nearest.add((height > 1).then(|| finished(height - 1)).flatten().filter(|_| j > 0));
            let current = &mut rest[row * width..];
            nearest.relax(current);
            rows::sweep_down(current);
        }
        Self { resolution, distances }
    }

    /// The distance of a voxel from the nearest occupied one, at most 255. The voxel must be one of the grid's.
    #[must_use]
    #[inline]
    pub fn distance(&self, voxel: Voxel) -> u8 {
        debug_assert!(self.resolution.contains(voxel));
        self.distances.get(self.resolution.linear_index(voxel)).copied().unwrap_or(0)
    }
}

impl SafeZones for Ndf {
    #[inline]
    fn proves(&self, a: Voxel, b: Voxel) -> bool {
        let distance = chessboard_distance(a, b);
        distance < u32::from(self.distance(a)) || distance < u32::from(self.distance(b))
    }

    fn resolution(&self) -> Resolution {
        self.resolution
    }

    fn bytes(&self) -> usize {
        self.distances.len()
    }

    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        validate::same_resolution(self.resolution, occupied)?;
        validate::zero_where_occupied(occupied, "ndf", |voxel| self.distance(voxel))?;
        validate::recurrence(occupied, "ndf", &validate::chessboard_steps(|_| true), |voxel| self.distance(voxel))
    }
}

/// The minimum over finished rows and, in the end, over the neighbours along x.
struct Nearest {
    rows: Vec<u8>,
    widened: Vec<u8>,
}

impl Nearest {
    fn new(width: usize) -> Self {
        Self { rows: vec![rows::FAR; width], widened: vec![rows::FAR; width] }
    }

    fn clear(&mut self) {
        self.rows.fill(rows::FAR);
    }

    fn add(&mut self, row: Option<&[u8]>) {
        if let Some(row) = row {
            rows::min_with(&mut self.rows, row);
        }
    }

    fn relax(&mut self, row: &mut [u8]) {
        rows::min_with_next(&mut self.widened, &self.rows);
        rows::min_with(self.widened.get_mut(1..).unwrap_or_default(), &self.rows);
        rows::relax(row, &self.widened);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_damaged_byte_is_found() {
        validate::tests::assert_damage_is_found(Ndf::build, |field| &mut field.distances);
    }
}
