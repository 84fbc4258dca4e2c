//! The non-directional distance field, `ndf`.
//!
//! *Idea.* Each voxel knows how far the nearest occupied voxel is in any direction: inside that cube nothing is.
//!
//! *Definition.* Dist(V) = min over occupied U of d_CD(U, V); safe(V) = { U : d_CD(U, V) < Dist(V) } (Def. 4 and 8
//! in \[Houska2013\]). One byte, saturated at 255. Beyond the grid there is nothing: the border is no obstacle.
//!
//! *Guarantee.* If d_CD(A, B) < Dist(A), all voxels of the cuboid of A and B are in the open ball around A: they are
//! free.
//!
//! *Cost.* X·Y·Z bytes; two loads a query. Two builders give the same bytes: the thesis's wavefront from the occupied
//! voxels (3.5.3), and sweeps along the axes. [`Ndf::build`] takes the one that was measured to be the faster.
//!
//! *Limits.* One near wall on any side shrinks the zone in all directions. Nothing is proved over 255 voxels or more.

mod sweeps;
mod wavefront;

use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{FieldError, SafeZones, bytes::Bytes, chessboard_distance, validate};

/// How an [`Ndf`] is built. All builders give the same bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum NdfBuilder {
    /// Sweeps along x, y and z over whole rows. Takes the same time whatever is occupied.
    #[default]
    Sweeps,
    /// A shell of equal distance a step, 64 voxels a word (3.5.3 in \[Houska2013\]). Takes a time in proportion to the
    /// greatest distance.
    Wavefront,
}

/// The non-directional chessboard distance field; see the head of its source file.
#[derive(Clone, Debug)]
pub struct Ndf {
    resolution: Resolution,
    distances: Bytes,
}

impl Ndf {
    /// Builds the field of these occupied voxels by the default builder, in parallel on the current rayon pool.
    #[must_use]
    pub fn build(occupied: &VoxelSet) -> Self {
        Self::build_with(NdfBuilder::default(), occupied)
    }

    /// [`Self::build`], if `next` says so: it is asked once before each plane of one byte a voxel, from any thread; and if it says
    /// no, there is no field.
    #[must_use]
    pub fn build_while(occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        next().then(|| Self::build(occupied))
    }

    /// Builds the field of these occupied voxels by a builder of choice; see [`Self::build`].
    #[must_use]
    pub fn build_with(builder: NdfBuilder, occupied: &VoxelSet) -> Self {
        let resolution = occupied.resolution();
        let mut distances = Bytes::zeroed(resolution.voxel_count());
        match builder {
            NdfBuilder::Sweeps => sweeps::distances(occupied, &mut distances),
            NdfBuilder::Wavefront => wavefront::distances(occupied, &mut distances),
        }
        Self { resolution, distances }
    }

    /// The distance of a voxel from the nearest occupied one, in voxels, at most 255; 0 for a voxel that the grid does
    /// not have.
    #[must_use]
    pub fn distance(&self, voxel: Voxel) -> u8 {
        if self.resolution.contains(voxel) { self.at(voxel) } else { 0 }
    }

    /// [`Self::distance`] of one of the grid's voxels.
    #[inline]
    fn at(&self, voxel: Voxel) -> u8 {
        debug_assert!(self.resolution.contains(voxel));
        self.distances.get(self.resolution.linear_index(voxel)).copied().unwrap_or(0)
    }
}

impl SafeZones for Ndf {
    #[inline]
    fn proves(&self, a: Voxel, b: Voxel) -> bool {
        let distance = chessboard_distance(a, b);
        distance < u32::from(self.at(a)) || distance < u32::from(self.at(b))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_damaged_byte_is_found() {
        validate::tests::assert_damage_is_found(Ndf::build, |field| &mut field.distances);
    }
}
