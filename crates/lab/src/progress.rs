//! Progress of the parts of a larger work.

use vdf_render::Progress;

/// A part of a larger work, which counts its parts itself: it can be stopped, and that is all.
pub(crate) struct Part<'a>(pub(crate) &'a dyn Progress);

impl Progress for Part<'_> {
    fn phase(&self, _: &str) {}

    fn work_total(&self, _: u64) {}

    fn work_done(&self, _: u64) {}

    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
}

/// Fails if the work is to stop.
pub(crate) fn look(progress: &dyn Progress) -> Result<(), vdf_render::RenderError> {
    if progress.cancelled() { Err(vdf_render::RenderError::Cancelled) } else { Ok(()) }
}
