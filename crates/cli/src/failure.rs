//! The one place that decides exit codes.

use std::{
    fmt,
    io::{self, Write as _},
    process::ExitCode,
};

use anyhow::anyhow;
use vdf_image::ImageError;
use vdf_lab::LabError;
use vdf_render::RenderError;
use vdf_scene::SceneError;
use vdf_scenes::ScenesError;
use vdf_visibility::VisibilityError;

/// Why the program ends without success.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The user asked for something that cannot be: exit code 2.
    Usage(anyhow::Error),
    /// Rendering, reading or writing failed: exit code 1.
    Work(anyhow::Error),
    /// The user interrupted: exit code 130.
    Interrupted,
    /// The user interrupted after some of the files had been written: exit code 130.
    InterruptedAfter {
        /// Files that were written, each of them whole.
        written: usize,
    },
}

impl Failure {
    /// Prints the message and returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        match self {
            Self::Usage(e) => {
                say(format_args!("error: {e:#}"));
                ExitCode::from(2)
            }
            // Whoever reads our output stopped reading: nothing is left to say, and nobody to say it to.
            Self::Work(e) if e.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe) => {
                ExitCode::from(1)
            }
            Self::Work(e) => {
                say(format_args!("error: {e:#}"));
                ExitCode::from(1)
            }
            Self::InterruptedAfter { written } if *written > 0 => {
                say(format_args!("interrupted; {written} files were written, each of them whole"));
                ExitCode::from(130)
            }
            Self::Interrupted | Self::InterruptedAfter { .. } => {
                say(format_args!("interrupted; nothing was written"));
                ExitCode::from(130)
            }
        }
    }
}

/// A line on stderr. Unlike `eprintln!` it does not panic if nobody can read it.
pub(crate) fn say(line: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr(), "{line}");
}

impl From<RenderError> for Failure {
    fn from(e: RenderError) -> Self {
        match e {
            RenderError::Cancelled => Self::Interrupted,
            // The library knows no flags.
            RenderError::Option { .. } => Self::Usage(anyhow!("--{e}")),
            RenderError::Visibility(e) => e.into(),
            _ => Self::Work(e.into()),
        }
    }
}

impl From<VisibilityError> for Failure {
    fn from(e: VisibilityError) -> Self {
        match e {
            VisibilityError::Voxel(_) => Self::Usage(e.into()),
            _ => Self::Work(e.into()),
        }
    }
}

impl From<SceneError> for Failure {
    fn from(e: SceneError) -> Self {
        match &e {
            SceneError::Define { name, .. } => {
                let message = e.to_string().replacen(&format!("parameter {name}"), &format!("-D {name}"), 1);
                Self::Usage(anyhow!(message))
            }
            _ => Self::Usage(e.into()),
        }
    }
}

impl From<ScenesError> for Failure {
    fn from(e: ScenesError) -> Self {
        Self::Usage(anyhow!("--{e}"))
    }
}

impl From<ImageError> for Failure {
    fn from(e: ImageError) -> Self {
        match e {
            ImageError::SizeMismatch { .. } | ImageError::Uncomparable { .. } | ImageError::PixelsPerDegree { .. } => {
                Self::Usage(e.into())
            }
            _ => Self::Work(e.into()),
        }
    }
}

impl From<LabError> for Failure {
    fn from(e: LabError) -> Self {
        match e {
            LabError::Render(e) => e.into(),
            LabError::Scene(e) => e.into(),
            LabError::Visibility(e) => e.into(),
            LabError::Image(e) => e.into(),
            LabError::Queries { .. } | LabError::NoQueries { .. } => Self::Usage(e.into()),
            _ => Self::Work(e.into()),
        }
    }
}

/// For `writeln!` to stdout; any other error of the system deserves a better context.
impl From<io::Error> for Failure {
    fn from(e: io::Error) -> Self {
        Self::Work(anyhow::Error::new(e).context("cannot write to standard output"))
    }
}
