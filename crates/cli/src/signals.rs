//! Ctrl-C and the other signals that ask a program to end.

use anyhow::Context as _;

use crate::failure::Failure;

/// Calls `end` each time the program is asked to end: by Ctrl-C, and on Unix also by SIGTERM and SIGHUP. A signal that is ignored when the program starts stays
/// ignored: that is how `nohup`, and a shell that puts work into the background, keep it alive.
pub(crate) fn on_end(end: impl Fn() + Send + 'static) -> Result<(), Failure> {
    listen(end).context("cannot listen for Ctrl-C").map_err(Failure::Work)
}

#[cfg(unix)]
fn listen(end: impl Fn() + Send + 'static) -> anyhow::Result<()> {
    use signal_hook::{
        consts::{SIGHUP, SIGINT, SIGTERM},
        iterator::Signals,
    };

    let ignored = ignored();
    let heard = [SIGHUP, SIGINT, SIGTERM].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    let mut signals = Signals::new(heard)?;
    std::thread::Builder::new().name("signals".to_owned()).spawn(move || signals.forever().for_each(|_| end()))?;
    Ok(())
}

/// The signals that are ignored, a bit for each from the first; none where the system does not tell.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    line.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}

#[cfg(not(unix))]
fn listen(end: impl Fn() + Send + 'static) -> anyhow::Result<()> {
    Ok(ctrlc::set_handler(end)?)
}
