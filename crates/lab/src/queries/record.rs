//! Recording the queries of a render.
//!
//! Whole paths are kept, each with the same probability, and in the order in which a render of one thread would follow
//! them: so a replay meets the coherence that a render meets, where one path asks for many points of one ray. Which
//! paths these are depends on a random number of each path's own; the stream has those with the smallest numbers.

use std::cell::RefCell;

use rayon::prelude::*;
use vdf_render::{Job, PreparedScene, Progress, RenderError, RenderOptions, Sampler, on_threads};
use vdf_scene::PixelRect;
use vdf_visibility::{Counters, Recorder, ShadowQuery};

use super::stream::{QueryStream, StreamOrigin, triangles_crc32};
use crate::LabError;

/// How many paths tell how many to follow.
const PILOT_PATHS: f64 = 256.0;

/// By how much more is followed than seems needed, so that one round more is seldom needed.
const MARGIN: f64 = 1.25;

/// The most by which a round follows more paths than the one before: what few paths tell of the queries of all may be
/// far off.
const MAX_GROWTH: f64 = 64.0;

/// More paths than this are not looked through: of each pixel the first samples stand for all.
const MAX_PATHS: u64 = 1 << 24;

/// Mixed into the seed for the numbers that choose paths, so that these are independent of those that the paths
/// consume.
const SELECTION: u64 = 0x7175_6572_6965_7321;

/// The visibility queries of a render of `prepared` with `options`: those of as many whole paths as ask at most
/// `max_queries`. They do not depend on the method. Cost: that of rendering the paths kept.
///
/// # Errors
/// If an option is not usable, `max_queries` is 0, or `progress` asks to stop.
pub fn record_queries(
    prepared: &PreparedScene,
    options: &RenderOptions,
    max_queries: u64,
    progress: &dyn Progress,
) -> Result<QueryStream, LabError> {
    let job = prepared.job(options)?;
    if max_queries == 0 {
        return Err(LabError::option("max-queries", "must be at least 1"));
    }
    progress.phase("recording");
    let recording = Recording { job, progress };
    let kept = on_threads(options.threads, || recording.run(max_queries))?;
    let job = &recording.job;
    let world = prepared.world();
    let mut stream = QueryStream {
        origin: StreamOrigin {
            paths: recording.pixels() * u64::from(job.spp()),
            paths_recorded: 0,
            seed: job.seed(),
            spp: job.spp(),
            integrator: options.integrator,
            triangles: world.triangles.len() as u64,
            triangles_crc32: triangles_crc32(&world.triangles),
            scene_crc32: prepared.scene().checksum(),
            emitters: prepared.scene().emitters.len() as u32,
        },
        queries: Vec::new(),
        unoccluded: Vec::new(),
    };
    kept.append_smallest(max_queries, &mut stream);
    Ok(stream)
}

/// What a tile's paths ask. A tile is the work of one thread.
#[derive(Default)]
struct TileLog(RefCell<QueryLog>);

/// Paths and their queries, in the order of the render.
#[derive(Default)]
struct QueryLog {
    paths: Vec<LoggedPath>,
    queries: Vec<ShadowQuery>,
    unoccluded: Vec<bool>,
}

#[derive(Clone, Copy)]
struct LoggedPath {
    /// Uniform in [0, 1); the smallest are kept.
    number: f64,
    queries: usize,
}

impl Recorder for TileLog {
    #[inline]
    fn record(&self, query: &ShadowQuery, unoccluded: bool) {
        let mut log = self.0.borrow_mut();
        log.queries.push(*query);
        log.unoccluded.push(unoccluded);
    }
}

struct Recording<'a> {
    job: Job<'a>,
    progress: &'a dyn Progress,
}

impl Recording<'_> {
    fn pixels(&self) -> u64 {
        let [width, height] = self.job.size();
        u64::from(width) * u64::from(height)
    }

    /// How many samples of each pixel are looked through.
    fn samples(&self) -> u32 {
        let most = (MAX_PATHS / self.pixels()).max(1);
        u32::try_from(most).map_or(self.job.spp(), |most| most.min(self.job.spp()))
    }

    /// Follows more and more paths, until they ask enough or are all.
    fn run(&self, max_queries: u64) -> Result<QueryLog, RenderError> {
        let paths = self.pixels() as f64 * f64::from(self.samples());
        let mut fraction = (PILOT_PATHS / paths).min(1.0);
        loop {
            let log = self.round(fraction)?;
            let found = log.queries.len() as f64;
            if fraction >= 1.0 || found >= max_queries as f64 {
                return Ok(log);
            }
            let growth = (MARGIN * max_queries as f64 / found.max(1.0)).clamp(MARGIN, MAX_GROWTH);
            fraction = (fraction * growth).min(1.0);
        }
    }

    /// Follows the paths whose numbers are below `fraction`.
    fn round(&self, fraction: f64) -> Result<QueryLog, RenderError> {
        self.progress.work_total(self.pixels());
        let tiles: Vec<QueryLog> = self
            .job
            .tiles()
            .into_par_iter()
            .map(|tile| {
                let log = self.tile(tile, fraction)?;
                self.progress.work_done(u64::from(tile.x1 - tile.x0) * u64::from(tile.y1 - tile.y0));
                Ok(log)
            })
            .collect::<Result<_, RenderError>>()?;
        let mut all = QueryLog::default();
        for mut tile in tiles {
            all.paths.append(&mut tile.paths);
            all.queries.append(&mut tile.queries);
            all.unoccluded.append(&mut tile.unoccluded);
        }
        Ok(all)
    }

    fn tile(&self, tile: PixelRect, fraction: f64) -> Result<QueryLog, RenderError> {
        let job = &self.job;
        let log = TileLog::default();
        let tracer = job.recording_tracer(&log, self.progress);
        let mut counters = Counters::default();
        for y in tile.y0..tile.y1 {
            for x in tile.x0..tile.x1 {
                if self.progress.cancelled() {
                    return Err(RenderError::Cancelled);
                }
                for sample in 0..self.samples() {
                    let number = Sampler::new(job.seed() ^ SELECTION, x, y, sample).next_1d();
                    if number < fraction {
                        let before = counters.queries;
                        let _ = tracer.sample(x, y, sample, &mut counters);
                        let queries = (counters.queries - before) as usize;
                        log.0.borrow_mut().paths.push(LoggedPath { number, queries });
                    }
                }
            }
        }
        Ok(log.0.into_inner())
    }
}

impl QueryLog {
    /// Moves to `stream` the paths with the smallest numbers that together ask at most `max_queries`.
    fn append_smallest(self, max_queries: u64, stream: &mut QueryStream) {
        let mut order: Vec<usize> = (0..self.paths.len()).collect();
        order.sort_by(|&a, &b| self.paths[a].number.total_cmp(&self.paths[b].number).then(a.cmp(&b)));
        let mut kept = vec![false; self.paths.len()];
        let mut asked = 0;
        for &i in &order {
            asked += self.paths[i].queries as u64;
            if asked > max_queries {
                break;
            }
            kept[i] = true;
            stream.origin.paths_recorded += 1;
        }
        let mut first = 0;
        for (path, kept) in self.paths.iter().zip(kept) {
            let range = first..first + path.queries;
            first = range.end;
            if kept {
                stream.queries.extend_from_slice(&self.queries[range.clone()]);
                stream.unoccluded.extend_from_slice(&self.unoccluded[range]);
            }
        }
    }
}
