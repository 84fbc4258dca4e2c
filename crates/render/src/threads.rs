//! Pools of threads.

use crate::RenderError;

/// Tens of thousands of threads do not speed up anything but make the system refuse to start them, or stall.
const MAX_THREADS: usize = 4096;
/// Stack of a thread, Rust's default.
const STACK: usize = 2 << 20;
/// What the work itself needs at least.
const WORK: usize = 128 << 20;

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

/// How many threads [`on_threads`] takes.
///
/// # Errors
/// [`RenderError::Option`] or [`RenderError::Threads`] if there cannot be so many threads.
pub fn thread_count(threads: Option<usize>) -> Result<usize, RenderError> {
    check_threads(threads)?;
    match threads {
        Some(threads) => Ok(threads),
        None => Ok(from_environment()?.unwrap_or_else(processors)),
    }
}

/// Runs `work` on a pool of that many threads; by default as many as the environment variable `RAYON_NUM_THREADS` says, or else one for each
/// processor.
///
/// # Errors
/// Those of `work`; [`RenderError::Option`] or [`RenderError::Threads`] if there cannot be so many threads.
pub fn on_threads<T: Send, E: From<RenderError> + Send>(
    threads: Option<usize>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> Result<T, E> {
    let threads = thread_count(threads)?;
    check_memory(threads)?;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).stack_size(STACK).build();
    pool.map_err(|e| RenderError::Threads { message: e.to_string() })?.install(work)
}

/// Rayon's own variable; it would take any number.
fn from_environment() -> Result<Option<usize>, RenderError> {
    const NAME: &str = "RAYON_NUM_THREADS";
    let threads = std::env::var(NAME).ok().and_then(|text| text.parse().ok()).filter(|&threads| threads > 0);
    if threads.is_some_and(|threads| threads > MAX_THREADS) {
        return Err(RenderError::Threads { message: format!("{NAME} must be at most {MAX_THREADS}") });
    }
    Ok(threads)
}

fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get).min(MAX_THREADS)
}

/// Checks that there is room for the stacks. A thread whose stack took the last of the memory ends the program without a message.
fn check_memory(threads: usize) -> Result<(), RenderError> {
    let needed = threads.saturating_mul(STACK).saturating_add(WORK);
    // Reserved and given back; never touched, so that it costs nothing.
    let mut room: Vec<u8> = Vec::new();
    room.try_reserve_exact(needed).map_err(|_| RenderError::Threads {
        message: format!("{threads} threads need {needed} bytes of memory, which are not there; use fewer"),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threads_without_room_are_refused_with_the_figure() {
        assert!(check_memory(4).is_ok());
        let message = check_memory(usize::MAX / STACK).unwrap_err().to_string();
        assert!(message.contains("threads need") && message.contains("use fewer"), "{message}");
    }
}
