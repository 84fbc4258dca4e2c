//! The errors of this crate.

/// Why provers could not be built or are not what they must be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VisibilityError {
    /// The voxel size does not fit the scene.
    #[error(transparent)]
    Voxel(#[from] vdf_voxel::VoxelError),
    /// The system does not have the memory of the voxels and the field over them.
    #[error(
        "a voxel size of {size:?} needs {bytes} bytes of memory, which are not there; use larger voxels, or a method that stores less"
    )]
    NoMemory {
        /// The size asked for.
        size: f64,
        /// How many bytes it takes.
        bytes: u64,
    },
    /// The [`Progress`](crate::Progress) asked to stop.
    #[error("stopped")]
    Cancelled,
    /// A distance field or a neighbourhood is not what its occluders make it.
    #[error(transparent)]
    Field(#[from] vdf_distfield::FieldError),
}
