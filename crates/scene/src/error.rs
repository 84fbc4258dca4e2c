//! The errors of this crate.

use std::path::PathBuf;

use crate::text::shown;

/// Why a scene could not be loaded.
///
/// The fields may hold anything that a file holds. The text of the error, by `Display`, is short, and every control character in it is escaped.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A scene file says something that is wrong or not supported.
    #[error("{}:{line}:{column}: {}{}", shown(&path.display()), shown(message), help_line(help))]
    Element {
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
    #[error("{}: {}", shown(&path.display()), shown(message))]
    File {
        /// The file.
        path: PathBuf,
        /// Why it could not be read.
        message: String,
    },
    /// A parameter that the caller defined is malformed, or the scene never uses it.
    #[error("parameter {}: {}{}", shown(name), shown(message), help_line(help))]
    Define {
        /// The name that was defined.
        name: String,
        /// What is wrong.
        message: String,
        /// How to mend it; may be empty.
        help: String,
    },
}

fn help_line(help: &str) -> String {
    if help.is_empty() { String::new() } else { format!("\n  help: {}", shown(help)) }
}
