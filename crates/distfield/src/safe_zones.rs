//! What every distance field can do: prove a pair of voxels mutually visible.

use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::FieldError;

/// A distance field with a safe zone around each voxel (Def. 8 in \[Houska2013\]).
pub trait SafeZones: Sync {
    /// True if `b` is in the safe zone of `a`, or `a` in that of `b`: then the cuboid that the two voxels span has no
    /// occupied voxel, so no segment between a point of the one and a point of the other touches an occluder.
    /// False says nothing.
    ///
    /// Symmetric, and never true if one of the voxels is occupied. Both must be voxels of the field's grid; for others
    /// the answer means nothing.
    fn proves(&self, a: Voxel, b: Voxel) -> bool;

    /// The resolution of the field's grid.
    fn resolution(&self) -> Resolution;

    /// The memory of the field in bytes.
    fn bytes(&self) -> usize;

    /// Checks the field against the voxels that it was built from, cheap checks first:
    ///
    /// 1. the resolutions are equal;
    /// 2. a distance is 0 just where a voxel is occupied: proves that no occupied voxel is taken for free;
    /// 3. each distance is one more than the least of its neighbours' from which it may come, saturated. With 2 this
    ///    proves that the field is its definition, everywhere: the head of `validate.rs` shows why. The extents of
    ///    [`Dual`](crate::Dual) are checked by a recurrence of their own, to the same effect.
    ///
    /// Takes time proportional to the size of the field, in parallel over slices.
    ///
    /// # Errors
    /// The first value found that is not what it must be.
    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError>;
}
