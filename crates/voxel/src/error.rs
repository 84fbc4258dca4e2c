//! What can be wrong with a grid or with the triangles to voxelize.

/// A grid or a set of triangles that cannot be used; each message says what to change.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum VoxelError {
    /// A bound of the scene is NaN, infinite or beyond the single-precision range of the geometry.
    #[error("the bounds of the scene are not finite single-precision numbers")]
    NonFiniteBounds,
    /// The lower bound exceeds the upper one: there is no scene to cover.
    #[error("the bounds of the scene are empty: the minimum exceeds the maximum")]
    EmptyBounds,
    /// The voxel size is NaN, infinite, zero, negative or absurdly large.
    #[error("the voxel size must be a positive finite number, not {size}")]
    InvalidVoxelSize {
        /// The size asked for.
        size: f64,
    },
    /// Voxels are so small that neighbouring single-precision coordinates are whole voxels apart.
    #[error(
        "a voxel size of {size} is below the single-precision resolution of the scene's coordinates: \
         the smallest usable voxel size is {smallest}"
    )]
    TooFine {
        /// The size asked for.
        size: f64,
        /// A size that works.
        smallest: f64,
    },
    /// The grid would have more voxels than allowed.
    #[error(
        "a voxel size of {size} gives {voxels:.3e} voxels, more than the budget of {budget}: \
         the smallest usable voxel size is {smallest}"
    )]
    TooManyVoxels {
        /// The size asked for.
        size: f64,
        /// How many voxels it gives.
        voxels: f64,
        /// How many are allowed.
        budget: u64,
        /// A size that works.
        smallest: f64,
    },
    /// A triangle has a vertex that is NaN or infinite.
    #[error("a triangle has a vertex that is not finite")]
    NonFiniteTriangle,
}
