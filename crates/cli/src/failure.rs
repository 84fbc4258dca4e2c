//! The one place that decides exit codes.

use std::{
    fmt,
    io::{self, Write as _},
    process::ExitCode,
    sync::{
        Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
};

use anyhow::anyhow;
use serde::Serialize;
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
    /// The user interrupted, and what was done is kept, as this message says: exit code 130.
    Stopped(String),
    /// What was asked for is done, but the render is not complete: exit code 3.
    Incomplete(String),
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
            // Whoever reads our output stopped reading: nothing is left to say, and nobody to say it to.
            Self::Work(e) if e.downcast_ref::<io::Error>().is_some_and(|e| e.kind() == io::ErrorKind::BrokenPipe) => {}
            Self::Work(_) | Self::Usage(_) | Self::Incomplete(_) => say(format_args!("error: {}", self.message())),
            Self::Stopped(_) | Self::Interrupted | Self::InterruptedAfter { .. } => {
                say(format_args!("{}", self.message()));
            }
        }
        say_end(self.code());
        ExitCode::from(self.code())
    }

    /// The same failure, told of this part of the work.
    pub(crate) fn of(self, part: &str) -> Self {
        match self {
            Self::Usage(e) => Self::Usage(e.context(part.to_owned())),
            Self::Work(e) => Self::Work(e.context(part.to_owned())),
            other => other,
        }
    }

    const fn code(&self) -> u8 {
        match self {
            Self::Usage(_) => 2,
            Self::Work(_) => 1,
            Self::Incomplete(_) => 3,
            Self::Stopped(_) | Self::Interrupted | Self::InterruptedAfter { .. } => 130,
        }
    }

    /// What there is to say.
    pub(crate) fn message(&self) -> String {
        match self {
            Self::Usage(e) | Self::Work(e) => format!("{e:#}"),
            Self::Stopped(message) | Self::Incomplete(message) => message.clone(),
            Self::InterruptedAfter { written } if *written > 0 => {
                format!("interrupted; {written} files were written, each of them whole")
            }
            Self::Interrupted | Self::InterruptedAfter { .. } => "interrupted; nothing was written".to_owned(),
        }
    }
}

/// Whether stderr is read by a program.
static JSON: AtomicBool = AtomicBool::new(false);

/// From now on what is said on stderr is one JSON object a line.
pub(crate) fn speak_json() {
    JSON.store(true, Ordering::Relaxed);
}

/// The last line for a program that reads stderr.
pub(crate) fn say_end(code: u8) {
    if JSON.load(Ordering::Relaxed) {
        say_object(&serde_json::json!({ "event": "end", "code": code }));
    }
}

/// Why stdout could not take all that was told.
static UNTOLD: Mutex<Option<io::Error>> = Mutex::new(None);

/// A line of results on stdout. Whoever reads it may be gone: files are still to be written, so the program goes on and fails in the end ([`said`]).
pub(crate) fn tell(line: fmt::Arguments<'_>) {
    let mut untold = UNTOLD.lock().unwrap_or_else(PoisonError::into_inner);
    if untold.is_none()
        && let Err(error) = writeln!(io::stdout(), "{line}")
    {
        *untold = Some(error);
    }
}

/// Fails if some of what was told could not be written.
pub(crate) fn said() -> Result<(), Failure> {
    UNTOLD.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), |error| Err(error.into()))
}

/// A line on stderr. Unlike `eprintln!` it does not panic if nobody can read it.
pub(crate) fn say(line: fmt::Arguments<'_>) {
    if JSON.load(Ordering::Relaxed) {
        let line = line.to_string();
        let kinds = ["error", "warning", "note"];
        let of_kind = kinds.iter().find_map(|kind| Some((*kind, line.strip_prefix(kind)?.strip_prefix(": ")?)));
        let (event, message) = of_kind.unwrap_or(("note", &line));
        say_object(&serde_json::json!({ "event": event, "message": message }));
    } else {
        let _ = writeln!(io::stderr(), "{line}");
    }
}

/// An object in one line on stderr.
pub(crate) fn say_object(object: &impl Serialize) {
    if let Ok(line) = serde_json::to_string(object) {
        // In one piece, so that no other thread's line gets between.
        let _ = io::stderr().write_all(format!("{line}\n").as_bytes());
    }
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
