//! The errors of this crate.

use std::path::PathBuf;

use vdf_render::RenderError;

/// Why something could not be measured or checked.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LabError {
    /// A scene could not be prepared or rendered.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// A scene could not be loaded.
    #[error(transparent)]
    Scene(#[from] vdf_scene::SceneError),
    /// Provers could not be built, or are not what their occluders make them.
    #[error(transparent)]
    Visibility(#[from] vdf_visibility::VisibilityError),
    /// An image could not be read, written or compared.
    #[error(transparent)]
    Image(#[from] vdf_image::ImageError),
    /// A file of visibility queries cannot be read, or is none, or was recorded in another scene.
    #[error("{}: {message}", path.display())]
    Queries {
        /// The file.
        path: PathBuf,
        /// What is wrong, and how to mend it.
        message: String,
    },
    /// There is nothing to replay.
    #[error("no {kind} queries to measure: {help}")]
    NoQueries {
        /// Which queries are missing.
        kind: &'static str,
        /// How to mend it.
        help: &'static str,
    },
    /// A replayed query was answered otherwise than it must be. This is a bug of the program, never of a scene.
    #[error("WRONG ANSWER: {0}")]
    WrongAnswer(Box<crate::queries::WrongAnswer>),
    /// A pass that was timed answers otherwise than when it was checked. This is a bug of the program or of the machine.
    #[error("WRONG ANSWER: {method} says yes {found} times in a timed pass but {expected} times when checked")]
    UnstableAnswers {
        /// The method.
        method: &'static str,
        /// Proofs, or unoccluded queries, in the timed pass.
        found: usize,
        /// The same when checked.
        expected: usize,
    },
}

impl From<vdf_voxel::VoxelError> for LabError {
    fn from(e: vdf_voxel::VoxelError) -> Self {
        Self::Visibility(e.into())
    }
}

impl LabError {
    /// The error that option `option` is out of range.
    pub(crate) fn option(option: &'static str, message: impl Into<String>) -> Self {
        RenderError::option(option, message).into()
    }
}
