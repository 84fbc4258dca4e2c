//! Progress for machines: one JSON object a line, as `docs/long-renders.md` describes it.

use std::time::{Duration, Instant};

use serde::Serialize;

use crate::failure::say_object;

/// Time between two lines of the same phase.
const EVERY: Duration = Duration::from_millis(500);
/// An estimate from less would be a guess.
const LEAST_TIME: Duration = Duration::from_millis(500);

/// What the lines say.
pub(super) struct Json {
    phase: String,
    start: Instant,
    phase_start: Instant,
    last: Instant,
    /// Done before this run.
    pub(super) before: u64,
    /// Samples that all pixels have.
    pub(super) spp: Option<u32>,
    /// Root mean square error over mean, estimated.
    pub(super) error: Option<f64>,
}

#[derive(Serialize)]
#[serde(tag = "event", rename_all = "lowercase")]
enum Line<'a> {
    Phase {
        phase: &'a str,
        elapsed: f64,
    },
    Progress {
        phase: &'a str,
        done: u64,
        total: Option<u64>,
        elapsed: f64,
        remaining: Option<f64>,
        spp: Option<u32>,
        error: Option<f64>,
    },
}

impl Json {
    pub(super) fn new() -> Self {
        let now = Instant::now();
        Self { phase: String::new(), start: now, phase_start: now, last: now, before: 0, spp: None, error: None }
    }

    pub(super) fn begin(&mut self, phase: &str) {
        phase.clone_into(&mut self.phase);
        self.phase_start = Instant::now();
        (self.before, self.spp, self.error) = (0, None, None);
        say_object(&Line::Phase { phase, elapsed: self.start.elapsed().as_secs_f64() });
    }

    pub(super) fn is_due(&self) -> bool {
        self.last.elapsed() >= EVERY
    }

    pub(super) fn tell(&mut self, done: u64, total: u64, left: Option<Duration>) {
        self.last = Instant::now();
        let here = self.phase_start.elapsed();
        // What was done before this run took none of its time.
        let speed = done.saturating_sub(self.before) as f64 / here.as_secs_f64();
        let estimate = || {
            let known = total > 0 && speed > 0.0 && (here >= LEAST_TIME || done >= total);
            known.then(|| total.saturating_sub(done) as f64 / speed)
        };
        say_object(&Line::Progress {
            phase: &self.phase,
            done,
            total: (total > 0).then_some(total),
            elapsed: self.start.elapsed().as_secs_f64(),
            remaining: left.map(|left| left.as_secs_f64()).or_else(estimate),
            spp: self.spp,
            error: self.error,
        });
    }
}
