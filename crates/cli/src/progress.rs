//! Telling how a render goes on, and Ctrl-C.

use std::{
    io::{IsTerminal as _, stderr},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use vdf_render::Progress;

use crate::failure::{Failure, say};

/// Progress on stderr: a bar on a terminal, else a line now and then, or nothing.
pub(crate) struct Reporter {
    bar: Option<ProgressBar>,
    lines: Option<Mutex<Instant>>,
    total: AtomicU64,
    done: AtomicU64,
    interrupted: Arc<AtomicBool>,
}

/// Time between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Reporter {
    /// A reporter that also stops the render on Ctrl-C; a second Ctrl-C ends the program at once.
    pub(crate) fn new(quiet: bool) -> Result<Self, Failure> {
        let interrupted = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interrupted);
        ctrlc::set_handler(move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        })
        .context("cannot listen for Ctrl-C")
        .map_err(Failure::Work)?;
        let terminal = stderr().is_terminal();
        let bar = (!quiet && terminal).then(|| {
            let style =
                ProgressStyle::with_template("{msg:16} {bar:40} {percent:>3} %  {elapsed_precise}  left {eta_precise}");
            let bar = ProgressBar::new(0);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        let lines = (!quiet && !terminal).then(|| Mutex::new(Instant::now()));
        Ok(Self { bar, lines, total: AtomicU64::new(0), done: AtomicU64::new(0), interrupted })
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// Whether Ctrl-C was pressed.
    pub(crate) fn interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

impl Progress for Reporter {
    fn phase(&self, name: &str) {
        if let Some(bar) = &self.bar {
            bar.set_message(name.to_owned());
            bar.tick();
        }
    }

    fn pixels_total(&self, n: u64) {
        self.total.store(n, Ordering::Relaxed);
        if let Some(bar) = &self.bar {
            bar.set_length(n);
        }
    }

    fn pixels_done(&self, n: u64) {
        let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
        if let Some(bar) = &self.bar {
            bar.inc(n);
        }
        // Called once a tile, so a lock does not matter; whoever does not get it has nothing new to say.
        if let Some(mut last) = self.lines.as_ref().and_then(|l| l.try_lock().ok())
            && last.elapsed() >= LINE_EVERY
        {
            *last = Instant::now();
            let total = self.total.load(Ordering::Relaxed).max(1);
            say(format_args!("rendering {} %", 100 * done / total));
        }
    }

    fn cancelled(&self) -> bool {
        self.interrupted()
    }
}
