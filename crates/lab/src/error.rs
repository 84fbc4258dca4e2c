//! The errors of this crate.

use std::{io, path::PathBuf};

use vdf_image::shown;
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
    /// A built-in scene could not be made.
    #[error(transparent)]
    Scenes(#[from] vdf_scenes::ScenesError),
    /// There is no such built-in scene.
    #[error("no built-in scene is called '{0}'")]
    UnknownScene(String),
    /// Provers could not be built, or are not what their occluders make them.
    #[error(transparent)]
    Visibility(#[from] vdf_visibility::VisibilityError),
    /// An image could not be read, written or compared.
    #[error(transparent)]
    Image(#[from] vdf_image::ImageError),
    /// A file of visibility queries cannot be read, or is none, or was recorded in another scene.
    #[error("{}: {message}", shown(path))]
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
    /// A file or folder could not be written.
    #[error("cannot write {}", shown(path))]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// There is no place for the references of a convergence report.
    #[error("cannot keep references in {}; choose another folder as the cache", shown(folder))]
    References {
        /// The folder.
        folder: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A report could not be put into this form. This is a bug of the program.
    #[error("cannot make {what}: {message}")]
    Form {
        /// What was to be made: a page, CSV, JSON.
        what: &'static str,
        /// What is wrong.
        message: String,
    },
    /// Two renders that must be the same bit by bit are not. This is a bug of the program or of the machine.
    #[error("WRONG IMAGE: {0}. Please report it with the scene and the options")]
    WrongImage(String),
    /// A number of threads proves other queries than one thread. This is a bug of the program or of the machine.
    #[error(
        "WRONG PROOFS: {threads} threads prove {found} queries, one thread {expected}. Please report it with the options"
    )]
    WrongProofs {
        /// Number of threads.
        threads: usize,
        /// Queries proved with them.
        found: u64,
        /// Queries proved with one.
        expected: u64,
    },
    /// A replayed query was answered otherwise than it must be. This is a bug of the program, never of a scene.
    #[error("WRONG ANSWER: {0}")]
    WrongAnswer(Box<crate::queries::WrongAnswer>),
    /// A pass that was timed answers otherwise than when it was checked. This is a bug of the program or of the
    /// machine.
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

    /// Checks that the value of an option lies between two limits, both of which are allowed.
    pub(crate) fn check_range(option: &'static str, value: u64, least: u64, most: u64) -> Result<(), Self> {
        if (least..=most).contains(&value) {
            return Ok(());
        }
        Err(Self::option(option, format!("must be from {least} to {most}, not {value}")))
    }
}
