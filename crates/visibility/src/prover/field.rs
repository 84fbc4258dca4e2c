//! The distance field: proofs about any two points.
//!
//! *Idea.* If the voxel of one end lies in the safe zone of the other's, the cuboid between them is free (3.3 in \[Houska2013\]), or at
//! least the part of it that the segment can enter.
//!
//! *Definition.* Those of the fields: Def. 8 to 13, in `vdf-distfield`; for `dsz` also by the face through which the
//! segment leaves the voxel of its end, if both ends are in the grid (4.2.2). A segment is clipped to the grid first, outside of which there is
//! nothing.
//!
//! *Guarantee.* "Unoccluded" only if no occluder meets the closed segment, exactly: the field's voxels are those of a conservative
//! voxelization.
//!
//! *Cost.* Two loads for `ndf` and `amr`, up to eight for `dual`, mostly cache misses.
//!
//! *Limits.* It never says "occluded".

use glam::DVec3;
use vdf_distfield::{Amr, Dsz, Dual, FieldError, Ndf, SafeZones as _};
use vdf_voxel::{Span, VoxelGrid, VoxelSet};

use super::Answer;
use crate::FieldKind;

/// One of the fields.
#[derive(Debug)]
pub enum DistanceField {
    /// See [`FieldKind::Ndf`].
    Ndf(Ndf),
    /// See [`FieldKind::Amr`].
    Amr(Amr),
    /// See [`FieldKind::Dsz`].
    Dsz(Dsz),
    /// See [`FieldKind::Dual`].
    Dual(Dual),
}

/// Does `$body` with whichever field it is.
macro_rules! each_field {
    ($field:expr, $f:ident => $body:expr) => {
        match $field {
            DistanceField::Ndf($f) => $body,
            DistanceField::Amr($f) => $body,
            DistanceField::Dsz($f) => $body,
            DistanceField::Dual($f) => $body,
        }
    };
}
pub(crate) use each_field;

impl DistanceField {
    /// The field of that kind over these occupied voxels. Runs on the current rayon pool.
    #[must_use]
    pub fn build(kind: FieldKind, occupied: &VoxelSet) -> Self {
        match kind {
            FieldKind::Ndf => Self::Ndf(Ndf::build(occupied)),
            FieldKind::Amr => Self::Amr(Amr::build(occupied)),
            FieldKind::Dsz => Self::Dsz(Dsz::build(occupied)),
            FieldKind::Dual => Self::Dual(Dual::build(occupied)),
        }
    }

    /// [`Self::build`], as long as `next` says so: it is asked once before each of the [`planes`](Self::planes) of the field, from any thread;
    /// if it says no, there is no field.
    #[must_use]
    pub fn build_while(kind: FieldKind, occupied: &VoxelSet, next: &(dyn Fn() -> bool + Sync)) -> Option<Self> {
        Some(match kind {
            FieldKind::Ndf => Self::Ndf(Ndf::build_while(occupied, next)?),
            FieldKind::Amr => Self::Amr(Amr::build_while(occupied, next)?),
            FieldKind::Dsz => Self::Dsz(Dsz::build_while(occupied, next)?),
            FieldKind::Dual => Self::Dual(Dual::build_while(occupied, next)?),
        })
    }

    /// The bytes that a field of that kind has for each voxel: it is built in as many planes.
    #[must_use]
    pub const fn planes(kind: FieldKind) -> u64 {
        match kind {
            FieldKind::Ndf => 1,
            FieldKind::Amr => 8,
            FieldKind::Dsz => 6,
            FieldKind::Dual => 7,
        }
    }

    /// Its memory in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        each_field!(self, f => f.bytes())
    }

    /// Checks the field against the voxels that it was built from.
    ///
    /// # Errors
    /// The first value that is wrong.
    pub fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        each_field!(self, f => f.validate(occupied))
    }
}

/// A field and its grid.
#[derive(Debug)]
pub struct FieldProver {
    grid: VoxelGrid,
    field: DistanceField,
}

impl FieldProver {
    pub(crate) const fn new(grid: VoxelGrid, field: DistanceField) -> Self {
        Self { grid, field }
    }

    /// The field.
    #[must_use]
    pub const fn field(&self) -> &DistanceField {
        &self.field
    }

    /// What is known of the closed segment between two points.
    #[inline]
    #[must_use]
    pub fn answer(&self, a: DVec3, b: DVec3) -> Answer {
        Answer::unoccluded_if(match self.grid.voxel_span(a, b) {
            Span::Inside(u, v) => each_field!(&self.field, f => f.proves(u, v)) || self.proves_by_face(a, b),
            // The grid covers all occluders.
            Span::Outside => true,
        })
    }

    /// Whether `dsz` proves the segment by the faces through which it leaves the voxels of its ends.
    #[inline]
    fn proves_by_face(&self, a: DVec3, b: DVec3) -> bool {
        let DistanceField::Dsz(field) = &self.field else { return false };
        // Where a segment from outside enters is known by rounding outwards: good for a cuboid, not for a face.
        let (Some(u), Some(v)) = (self.grid.voxel_containing(a), self.grid.voxel_containing(b)) else { return false };
        field.proves_leaving(u, v, || self.grid.leaves_through(a, b), || self.grid.leaves_through(b, a))
    }
}
