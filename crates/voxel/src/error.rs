//! What can be wrong with a grid, with the triangles to voxelize or with a set of voxels.

use crate::{Resolution, Voxel};

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
    #[error("the voxel size must be a positive number of at most 1e60, not {size:?}")]
    InvalidVoxelSize {
        /// The size asked for.
        size: f64,
    },
    /// Voxels are so small that neighbouring single-precision coordinates are whole voxels apart.
    #[error(
        "a voxel size of {size:?} is below the single-precision resolution of the scene's coordinates: \
         the smallest usable voxel size is {smallest:?}"
    )]
    TooFine {
        /// The size asked for.
        size: f64,
        /// A size that works.
        smallest: f64,
    },
    /// The grid would have more voxels than allowed.
    #[error(
        "a voxel size of {size:?} gives {voxels:.3e} voxels, more than the budget of {budget}: \
         the smallest usable voxel size is {smallest:?}"
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
    /// What is to be stored for the grid's voxels would take more memory than allowed.
    #[error(
        "a voxel size of {size:?} takes {:.3} GiB of memory, more than the limit of {:.3} GiB: \
         the smallest usable voxel size is {smallest:?}",
        gib(*bytes), gib(*limit)
    )]
    TooMuchMemory {
        /// The size asked for.
        size: f64,
        /// How many bytes it takes.
        bytes: u64,
        /// How many are allowed.
        limit: u64,
        /// A size that works.
        smallest: f64,
    },
    /// A triangle has a vertex that is NaN or infinite.
    #[error("a triangle has a vertex that is not finite")]
    NonFiniteTriangle,
    /// A set of voxels and a grid do not belong together.
    #[error("the set has {set} voxels but the grid {grid}: voxelize the scene in this grid again")]
    ResolutionMismatch {
        /// The resolution of the set.
        set: Resolution,
        /// The resolution of the grid.
        grid: Resolution,
    },
    /// A bit behind the last voxel of a row is set, where rows are padded to whole words.
    #[error("the bit of voxel {voxel} is set, but the grid ends before it: the set is damaged, voxelize again")]
    PaddingNotClear {
        /// Where the voxel would be.
        voxel: Voxel,
    },
    /// A triangle touches a voxel that is not in the set: proofs that rest on the set may be wrong.
    #[error(
        "triangle {triangle} touches voxel {voxel}, which is not occupied: the set is damaged or of other triangles"
    )]
    NotOccupied {
        /// The number of the triangle, from 0.
        triangle: usize,
        /// The least such voxel.
        voxel: Voxel,
    },
}

fn gib(bytes: u64) -> f64 {
    bytes as f64 / f64::from(1 << 30)
}

impl VoxelError {
    /// A voxel size that would work in place of the one that was asked for, if that is what is wrong.
    #[must_use]
    pub const fn smallest_usable(&self) -> Option<f64> {
        match *self {
            Self::TooFine { smallest, .. }
            | Self::TooManyVoxels { smallest, .. }
            | Self::TooMuchMemory { smallest, .. } => Some(smallest),
            _ => None,
        }
    }
}
