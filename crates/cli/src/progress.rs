//! Telling how a long work goes on, and Ctrl-C.

mod json;

use std::{
    io::{IsTerminal as _, stderr},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, AtomicU64, Ordering},
    },
    time::{Duration, Instant},
};

use indicatif::{ProgressBar, ProgressStyle};
use vdf_image::remove_temporaries;
use vdf_render::Progress;

use self::json::Json;
use crate::{
    args::ProgressName,
    failure::{Failure, say},
    signals::on_end,
};

/// Progress on stderr: a bar on a terminal, else a line now and then, or JSON, or nothing.
pub(crate) struct Reporter {
    voice: Voice,
    total: AtomicU64,
    done: AtomicU64,
    interrupted: Arc<AtomicBool>,
    /// Whether something may be half written, so that the program must not end at once.
    writes: Arc<AtomicBool>,
    /// When the work began, and after how long it ends whatever is done by then.
    limit: Mutex<Option<(Instant, Duration)>>,
}

/// To whom progress is told.
enum Voice {
    Nobody,
    Bar(ProgressBar),
    Lines(Mutex<Lines>),
    Json(Mutex<Json>),
}

/// What the lines are about.
struct Lines {
    phase: String,
    last: Instant,
}

/// Time between two lines where there is no terminal.
const LINE_EVERY: Duration = Duration::from_secs(10);

impl Reporter {
    /// A reporter for people.
    pub(crate) fn new(quiet: bool) -> Result<Self, Failure> {
        Self::of_kind(quiet, ProgressName::Auto)
    }

    /// A reporter that also stops the work on Ctrl-C: at once while nothing is written ([`Reporter::writes`]), else where the work looks;
    /// a second Ctrl-C ends the program in any case. No temporary file stays behind.
    pub(crate) fn of_kind(quiet: bool, progress: ProgressName) -> Result<Self, Failure> {
        let (interrupted, writes) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicBool::new(false)));
        let (flag, busy) = (Arc::clone(&interrupted), Arc::clone(&writes));
        on_end(move || {
            let again = flag.swap(true, Ordering::Relaxed);
            if again || !busy.load(Ordering::Relaxed) {
                remove_temporaries();
                if !again {
                    let _ = Failure::Interrupted.report();
                }
                std::process::exit(130);
            }
        })?;
        let voice = match progress {
            ProgressName::Json => Voice::Json(Mutex::new(Json::new())),
            ProgressName::Auto if quiet => Voice::Nobody,
            ProgressName::Auto if stderr().is_terminal() => {
                let style = ProgressStyle::with_template(
                    "{msg:24} {bar:32} {percent:>3} %  {elapsed_precise}  left {eta_precise}",
                );
                let bar = ProgressBar::new(0);
                bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
                Voice::Bar(bar)
            }
            ProgressName::Auto => Voice::Lines(Mutex::new(Lines { phase: String::new(), last: Instant::now() })),
        };
        let (total, done, limit) = (AtomicU64::new(0), AtomicU64::new(0), Mutex::new(None));
        Ok(Self { voice, total, done, interrupted, writes, limit })
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Voice::Bar(bar) = &self.voice {
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

    /// The work has no total but ends after so long.
    pub(crate) fn limit(&self, limit: Duration) {
        if let Ok(mut until) = self.limit.lock() {
            *until = Some((Instant::now(), limit));
        }
        self.work_total(0);
    }

    /// So much of the total was done before this run.
    pub(crate) fn work_before(&self, n: u64) {
        self.done.store(n, Ordering::Relaxed);
        match &self.voice {
            Voice::Bar(bar) => bar.set_position(n),
            Voice::Json(json) => {
                if let Ok(mut json) = json.lock() {
                    json.before = n;
                }
            }
            Voice::Lines(_) | Voice::Nobody => {}
        }
    }

    /// The picture has so many samples per pixel everywhere, and about this error: root mean square over mean.
    pub(crate) fn pass(&self, spp: u32, error: Option<f64>) {
        if let Voice::Json(json) = &self.voice
            && let Ok(mut json) = json.lock()
        {
            (json.spp, json.error) = (Some(spp), error);
            json.tell(self.done.load(Ordering::Relaxed), self.total.load(Ordering::Relaxed), self.left());
        }
    }

    /// How much time there is until the limit.
    fn left(&self) -> Option<Duration> {
        let limit = *self.limit.lock().ok()?;
        limit.map(|(start, limit)| limit.saturating_sub(start.elapsed()))
    }

    /// How much is done, in percent.
    fn percent(&self, done: u64) -> u64 {
        match self.limit.lock().ok().and_then(|limit| *limit) {
            Some((start, limit)) => ((100.0 * start.elapsed().as_secs_f64() / limit.as_secs_f64()) as u64).min(100),
            None => 100 * done / self.total.load(Ordering::Relaxed).max(1),
        }
    }
}

impl Progress for Reporter {
    fn phase(&self, name: &str) {
        match &self.voice {
            Voice::Nobody => {}
            Voice::Bar(bar) => {
                bar.set_message(name.to_owned());
                bar.tick();
            }
            Voice::Lines(lines) => {
                if let Ok(mut lines) = lines.lock() {
                    name.clone_into(&mut lines.phase);
                }
            }
            Voice::Json(json) => {
                if let Ok(mut json) = json.lock() {
                    json.begin(name);
                }
            }
        }
    }

    fn work_total(&self, n: u64) {
        self.total.store(n, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
        if let Voice::Bar(bar) = &self.voice {
            bar.set_position(0);
            // Where time is all that limits the work it is counted in hundredths.
            bar.set_length(if n == 0 { 100 } else { n });
        }
    }

    fn work_done(&self, n: u64) {
        let done = self.done.fetch_add(n, Ordering::Relaxed) + n;
        let total = self.total.load(Ordering::Relaxed);
        // Called once a tile or block, so a lock does not matter; whoever does not get it has nothing new to say.
        match &self.voice {
            Voice::Nobody => {}
            Voice::Bar(bar) => bar.set_position(if total == 0 { self.percent(done) } else { done }),
            Voice::Lines(lines) => {
                if let Ok(mut lines) = lines.try_lock()
                    && lines.last.elapsed() >= LINE_EVERY
                {
                    lines.last = Instant::now();
                    say(format_args!("{} {} %", lines.phase, self.percent(done)));
                }
            }
            Voice::Json(json) => {
                if let Ok(mut json) = json.try_lock()
                    && (json.is_due() || (done == total && total > 0))
                {
                    json.tell(done, total, self.left());
                }
            }
        }
    }

    fn cancelled(&self) -> bool {
        self.interrupted()
    }
}
