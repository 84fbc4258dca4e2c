//! The errors of this crate.

/// Why provers could not be built or are not what they must be.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VisibilityError {
    /// The voxel size does not fit the scene.
    #[error(transparent)]
    Voxel(#[from] vdf_voxel::VoxelError),
    /// The [`Progress`](crate::Progress) asked to stop.
    #[error("stopped")]
    Cancelled,
    /// A distance field or a neighbourhood is not what its occluders make it.
    #[error(transparent)]
    Field(#[from] vdf_distfield::FieldError),
}
