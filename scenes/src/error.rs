//! The errors of this crate.

/// Why a scene could not be generated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ScenesError {
    /// A generated scene cannot have so few or so many triangles.
    #[error("triangles must be from {min} to {max}, not {found}")]
    Triangles {
        /// The fewest.
        min: u32,
        /// The most.
        max: u32,
        /// How many were asked for.
        found: u32,
    },
    /// A generated volume cannot have so few or so many voxels.
    #[error("voxels must be from {min} to {max}, not {found}")]
    Voxels {
        /// The fewest.
        min: u32,
        /// The most.
        max: u32,
        /// How many were asked for.
        found: u32,
    },
    /// The size of a scene was given in what it is not measured in.
    #[error("{other} is not the size of {name}: write --{measure}")]
    Measure {
        /// The scene.
        name: &'static str,
        /// `triangles` or `voxels`.
        measure: &'static str,
        /// What was written.
        other: &'static str,
    },
}
