//! Renders with a timer around each visibility query, as the thesis measures them (6.2.2 and 6.3.1), and without.
//!
//! *Limits.* For tables about the timer only: it costs as much as a query. Both sorts of render follow the same paths in the same order on
//! this thread, without a film.

use std::{
    cell::Cell,
    hint::black_box,
    time::{Duration, Instant},
};

use vdf_render::{Job, PathTracer, Progress, RenderError};
use vdf_visibility::{Counters, NoRecorder, Recorder, ShadowQuery};

/// What such a render took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TimedRender {
    /// Seconds of the render.
    pub(super) t_render: f64,
    /// Seconds of all queries, as the timers say; 0 without timers.
    pub(super) t_query: f64,
    /// Visibility queries.
    pub(super) queries: u64,
}

/// A stopwatch that runs while a query is answered.
struct Stopwatch {
    since: Cell<Instant>,
    spent: Cell<Duration>,
}

impl Recorder for Stopwatch {
    #[inline]
    fn begins(&self) {
        self.since.set(Instant::now());
    }

    #[inline]
    fn record(&self, _: &ShadowQuery, _: bool) {
        self.spent.set(self.spent.get() + self.since.get().elapsed());
    }
}

/// Follows all paths of the job on this thread.
pub(super) fn timed_render(job: &Job<'_>, timers: bool, progress: &dyn Progress) -> Result<TimedRender, RenderError> {
    if !timers {
        return follow(job, &job.recording_tracer(&NoRecorder, progress), progress);
    }
    let watch = Stopwatch { since: Cell::new(Instant::now()), spent: Cell::default() };
    let rendered = follow(job, &job.recording_tracer(&watch, progress), progress)?;
    Ok(TimedRender { t_query: watch.spent.get().as_secs_f64(), ..rendered })
}

fn follow(job: &Job<'_>, tracer: &PathTracer<'_>, progress: &dyn Progress) -> Result<TimedRender, RenderError> {
    let start = Instant::now();
    let mut counters = Counters::default();
    let crop = job.crop();
    for y in crop.y0..crop.y1 {
        if progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        for x in crop.x0..crop.x1 {
            for sample in 0..job.spp() {
                black_box(tracer.sample(x, y, sample, &mut counters));
            }
        }
    }
    Ok(TimedRender { t_render: start.elapsed().as_secs_f64(), t_query: 0.0, queries: counters.queries })
}
