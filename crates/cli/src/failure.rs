//! The one place that decides exit codes.

use std::{
    fmt,
    io::{self, Write as _},
    process::ExitCode,
};

use vdf_render::RenderError;

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
            RenderError::Threads { .. }
            | RenderError::Image(_)
            | RenderError::Field(_)
            | RenderError::WrongAnswer(_)
            | RenderError::UnstableAnswers { .. } => Self::Work(e.into()),
            _ => Self::Usage(e.into()),
        }
    }
}

/// For `writeln!` to stdout; any other error of the system deserves a better context.
impl From<io::Error> for Failure {
    fn from(e: io::Error) -> Self {
        Self::Work(anyhow::Error::new(e).context("cannot write to standard output"))
    }
}
