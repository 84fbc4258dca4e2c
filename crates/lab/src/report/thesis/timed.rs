//! Renders with a timer around each visibility query, as the thesis measures them (6.2.2 and 6.3.1), and without. Queries that are asked together have one
//! timer together.
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

/// A stopwatch that runs while queries are answered.
#[derive(Default)]
struct Stopwatch {
    /// Since when, until the first of them is heard of.
    since: Cell<Option<Instant>>,
    spent: Cell<Duration>,
}

impl Recorder for Stopwatch {
    #[inline]
    fn begins(&self) {
        self.since.set(Some(Instant::now()));
    }

    #[inline]
    fn record(&self, _: &ShadowQuery, _: bool) {
        if let Some(since) = self.since.take() {
            self.spent.set(self.spent.get() + since.elapsed());
        }
    }
}

/// Follows all paths of the job on this thread.
pub(super) fn timed_render(job: &Job<'_>, timers: bool, progress: &dyn Progress) -> Result<TimedRender, RenderError> {
    if !timers {
        return follow(job, &job.recording_tracer(&NoRecorder, progress), progress);
    }
    let watch = Stopwatch::default();
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

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use vdf_visibility::QueryKind;

    use super::*;

    /// What several queries took together is counted once, whoever hears of how many.
    #[test]
    fn queries_that_are_asked_together_have_one_timer() {
        let watch = Stopwatch::default();
        let query = ShadowQuery { from: DVec3::ZERO, to: DVec3::ONE, emitter: 0, kind: QueryKind::Spatial };
        watch.record(&query, true);
        assert_eq!(watch.spent.get(), Duration::ZERO);
        let start = Instant::now();
        watch.begins();
        std::thread::sleep(Duration::from_millis(2));
        (0..1000).for_each(|_| watch.record(&query, true));
        assert!(watch.spent.get() >= Duration::from_millis(2) && watch.spent.get() <= start.elapsed());
    }
}
