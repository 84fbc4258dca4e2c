//! The errors of this crate.

use std::path::PathBuf;

/// Why a scene could not be loaded or rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// A scene file says something that is wrong or not supported.
    #[error("{}:{line}:{column}: {message}{}", path.display(), help_line(help))]
    Scene {
        /// The file, as it was named by the user or by the file that includes it.
        path: PathBuf,
        /// Line, from 1.
        line: u32,
        /// Column in characters, from 1.
        column: u32,
        /// What is wrong.
        message: String,
        /// How to mend it; may be empty.
        help: String,
    },
    /// A file of the scene could not be read.
    #[error("{}: {message}", path.display())]
    SceneFile {
        /// The file.
        path: PathBuf,
        /// Why it could not be read.
        message: String,
    },
    /// A definition given with `-D` is malformed, or the scene never uses it.
    #[error("-D {name}: {message}{}", help_line(help))]
    Define {
        /// The name that was defined.
        name: String,
        /// What is wrong.
        message: String,
        /// How to mend it; may be empty.
        help: String,
    },
    /// An option of the render is out of range.
    #[error("--{option} {message}")]
    Option {
        /// Name of the option on the command line.
        option: &'static str,
        /// What it has to be.
        message: String,
    },
    /// Two images that should be compared differ in size.
    #[error("the images differ in size: {} x {} and {} x {}", a[0], a[1], b[0], b[1])]
    SizeMismatch {
        /// Width and height of the one.
        a: [u32; 2],
        /// Width and height of the other.
        b: [u32; 2],
    },
    /// An image cannot be compared: it has no pixels, or one that is not finite.
    #[error("cannot compare: the {image} {reason}")]
    Uncomparable {
        /// Which one: "image" or "reference".
        image: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// An image could not be read or written.
    #[error(transparent)]
    Image(#[from] crate::ImageError),
    /// The voxel size does not fit the scene.
    #[error(transparent)]
    Voxel(#[from] vdf_voxel::VoxelError),
    /// A distance field or a neighbourhood is not what its occluders make it.
    #[error(transparent)]
    Field(#[from] vdf_distfield::FieldError),
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
    /// The threads could not be started.
    #[error("cannot start the rendering threads: {message}")]
    Threads {
        /// Why not.
        message: String,
    },
    /// The render was asked to stop.
    #[error("interrupted")]
    Cancelled,
}

fn help_line(help: &str) -> String {
    if help.is_empty() { String::new() } else { format!("\n  help: {help}") }
}
