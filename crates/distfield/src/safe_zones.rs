//! What every distance field can do: prove a pair of voxels mutually visible.

use vdf_voxel::{Resolution, Voxel};

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
}
