//! Telling how a long work goes on, and Ctrl-C.

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
use vdf_image::remove_temporaries;
use vdf_render::Progress;

use crate::failure::{Failure, say};

/// Progress on stderr: a bar on a terminal, else a line now and then, or nothing.
pub(crate) struct Reporter {
    bar: Option<ProgressBar>,
    lines: Option<Mutex<Lines>>,
    total: AtomicU64,
    done: AtomicU64,
    interrupted: Arc<AtomicBool>,
    /// Whether something may be half written, so that the program must not end at once.
    writes: Arc<AtomicBool>,
}

/// What the lines are about.
struct Lines {
    phase: String,
    last: Instant,
}

/// Time between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Reporter {
    /// A reporter that also stops the work on Ctrl-C: at once while nothing is written ([`Reporter::writes`]), else where the work looks;
    /// a second Ctrl-C ends the program in any case. No temporary file stays behind.
    pub(crate) fn new(quiet: bool) -> Result<Self, Failure> {
        let (interrupted, writes) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let (flag, busy) = (Arc::clone(&interrupted), Arc::clone(&writes));
        ctrlc::set_handler(move || {
            let again = flag.swap(true, Ordering::Relaxed);
            if again || !busy.load(Ordering::Relaxed) {
                remove_temporaries();
                if !again {
                    let _ = Failure::Interrupted.report();
                }
                std::process::exit(130);
            }
        })
        .context("cannot listen for Ctrl-C")
        .map_err(Failure::Work)?;
        let terminal = stderr().is_terminal();
        let bar = (!quiet && terminal).then(|| {
            let style =
                ProgressStyle::with_template("{msg:24} {bar:32} {percent:>3} %  {elapsed_precise}  left {eta_precise}");
            let bar = ProgressBar::new(0);
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        let lines = (!quiet && !terminal).then(|| Mutex::new(Lines { phase: String::new(), last: Instant::now() }));
        Ok(Self { bar, lines, total: AtomicU64::new(0), done: AtomicU64::new(0), interrupted, writes })
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }

    /// From now on something is written: Ctrl-C lets the file at hand be finished.
    pub(crate) fn writes(&self) {
        self.writes.store(true, Ordering::Relaxed);
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
        if let Some(mut lines) = self.lines.as_ref().and_then(|l| l.lock().ok()) {
            name.clone_into(&mut lines.phase);
        }
    }

    fn work_total(&self, n: u64) {
        self.total.store(n, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
        if let Some(bar) = &self.bar {
            bar.set_position(0);
            bar.set_length(n);
        }
    }

    fn work_done(&self, n: u64) {
        let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
        if let Some(bar) = &self.bar {
            bar.inc(n);
        }
        // Called once a tile or block, so a lock does not matter; whoever does not get it has nothing new to say.
        if let Some(mut lines) = self.lines.as_ref().and_then(|l| l.try_lock().ok())
            && lines.last.elapsed() >= LINE_EVERY
        {
            lines.last = Instant::now();
            let total = self.total.load(Ordering::Relaxed).max(1);
            say(format_args!("{} {} %", lines.phase, 100 * done / total));
        }
    }

    fn cancelled(&self) -> bool {
        self.interrupted()
    }
}
