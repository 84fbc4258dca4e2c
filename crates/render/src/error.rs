//! The errors of this crate.

/// Why a scene could not be prepared or rendered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// An option is out of range.
    #[error("{option} {message}")]
    Option {
        /// Name of the option, in the words of the command line: `spp`, `samples-per-segment`.
        option: &'static str,
        /// What it has to be.
        message: String,
    },
    /// The provers of the method could not be built.
    #[error(transparent)]
    Visibility(#[from] vdf_visibility::VisibilityError),
    /// There is no memory for the film.
    #[error(transparent)]
    Film(#[from] vdf_image::ImageError),
    /// The film lacks samples that it should have.
    #[error(transparent)]
    Incomplete(#[from] crate::FilmError),
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

impl RenderError {
    /// The error that option `option` is out of range.
    #[must_use]
    pub fn option(option: &'static str, message: impl Into<String>) -> Self {
        Self::Option { option, message: message.into() }
    }
}
