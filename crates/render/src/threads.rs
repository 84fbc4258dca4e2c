//! Pools of threads.

use crate::RenderError;

/// Tens of thousands of threads do not speed up anything but make the system refuse to start them, or stall.
const MAX_THREADS: usize = 4096;

/// Checks that `threads` is a number of threads that can be started.
///
/// # Errors
/// [`RenderError::Option`] for 0 and for more than 4096.
pub fn check_threads(threads: Option<usize>) -> Result<(), RenderError> {
    match threads {
        Some(0) => Err(RenderError::option("threads", "must be at least 1")),
        Some(n) if n > MAX_THREADS => Err(RenderError::option("threads", format!("must be at most {MAX_THREADS}"))),
        _ => Ok(()),
    }
}

/// Runs `work` on a pool of that many threads, one for each processor by default.
///
/// # Errors
/// Those of `work`; [`RenderError::Option`] or [`RenderError::Threads`] if there cannot be so many threads.
pub fn on_threads<T: Send, E: From<RenderError> + Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> Result<T, E> {
    check_threads(threads)?;
    // Rayon takes 0 for its default.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|e| RenderError::Threads { message: e.to_string() })?.install(work)
}
