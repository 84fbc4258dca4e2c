//! Recording the queries of a render.
//!
//! Whole paths are kept, each with the same probability, and in the order in which a render of one thread would follow them: so a replay
//! meets the coherence that a render meets, where one path asks for many points of one ray. Which paths these are depends on a random number of each
//! path's own; the stream has those with the smallest numbers.

use std::cell::RefCell;

use rayon::prelude::*;

use super::stream::{QueryStream, StreamOrigin, triangles_crc32};
use crate::{
    IntegratorKind, Progress, RenderError, RenderOptions, Sampler, World,
    integrator::Integrator,
    options::{fail, on_threads},
    render::Job,
    scene::{PixelRect, Scene},
    visibility::{Counters, NoProofs, Recorder, ShadowQuery, Visibility},
};

/// How many paths tell how many to follow.
const PILOT_PATHS: f64 = 256.0;

/// By how much more is followed than seems needed, so that one round more is seldom needed.
const MARGIN: f64 = 1.25;

/// The most by which a round follows more paths than the one before: what few paths tell of the queries of all may be far off.
const MOST_GROWTH: f64 = 64.0;

/// More paths than this are not looked through: of each pixel the first samples stand for all.
const MOST_PATHS: u64 = 1 << 24;

/// Mixed into the seed for the numbers that choose paths, so that these are independent of those that the paths consume.
const SELECTION: u64 = 0x7175_6572_6965_7321;

/// The visibility queries of a render of `scene` with `options`, of which `world` is the preparation: those of as many whole paths as ask
/// at most `max_queries`. They do not depend on the method, which is not used. Cost: that of rendering the paths kept.
///
/// # Errors
/// If an option is not usable, `max_queries` is 0, or `progress` asks to stop.
pub fn record_queries(
    scene: &Scene,
    world: &World,
    options: &RenderOptions,
    max_queries: u64,
    progress: &dyn Progress,
) -> Result<QueryStream, RenderError> {
    options.validate(scene)?;
    if max_queries == 0 {
        return fail("max-queries", "must be at least 1".into());
    }
    progress.phase("recording");
    let recording = Recording { job: Job::new(scene, world, options), progress };
    let kept = on_threads(options.threads, || recording.run(max_queries))?;
    let job = &recording.job;
    let mut stream = QueryStream {
        origin: StreamOrigin {
            paths: recording.pixels() * u64::from(job.spp),
            paths_recorded: 0,
            seed: job.seed,
            spp: job.spp,
            samples_per_segment: match job.kind {
                IntegratorKind::Volpath => None,
                IntegratorKind::Raymarch { samples_per_segment } => Some(samples_per_segment),
            },
            triangles: world.triangles.len() as u64,
            triangles_crc32: triangles_crc32(&world.triangles),
            emitters: scene.emitters.len() as u32,
        },
        queries: Vec::new(),
        unoccluded: Vec::new(),
    };
    kept.append_smallest(max_queries, &mut stream);
    Ok(stream)
}

/// What a tile's paths ask. A tile is the work of one thread.
#[derive(Default)]
struct Tape(RefCell<Track>);

/// Paths and their queries, in the order of the render.
#[derive(Default)]
struct Track {
    paths: Vec<PathOnTrack>,
    queries: Vec<ShadowQuery>,
    unoccluded: Vec<bool>,
}

#[derive(Clone, Copy)]
struct PathOnTrack {
    /// Uniform in [0, 1); the smallest are kept.
    number: f64,
    queries: usize,
}

impl Recorder for &Tape {
    #[inline]
    fn record(&self, query: &ShadowQuery, unoccluded: bool) {
        let mut track = self.0.borrow_mut();
        track.queries.push(*query);
        track.unoccluded.push(unoccluded);
    }
}

struct Recording<'a> {
    job: Job<'a>,
    progress: &'a dyn Progress,
}

impl Recording<'_> {
    fn pixels(&self) -> u64 {
        let (width, height) = self.job.size();
        u64::from(width) * u64::from(height)
    }

    /// How many samples of each pixel are looked through.
    fn samples(&self) -> u32 {
        let most = (MOST_PATHS / self.pixels()).max(1);
        u32::try_from(most).map_or(self.job.spp, |most| most.min(self.job.spp))
    }

    /// Follows more and more paths, until they ask enough or are all.
    fn run(&self, max_queries: u64) -> Result<Track, RenderError> {
        let paths = self.pixels() as f64 * f64::from(self.samples());
        let mut fraction = (PILOT_PATHS / paths).min(1.0);
        loop {
            let track = self.round(fraction)?;
            let found = track.queries.len() as f64;
            if fraction >= 1.0 || found >= max_queries as f64 {
                return Ok(track);
            }
            let growth = (MARGIN * max_queries as f64 / found.max(1.0)).clamp(MARGIN, MOST_GROWTH);
            fraction = (fraction * growth).min(1.0);
        }
    }

    /// Follows the paths whose numbers are below `fraction`.
    fn round(&self, fraction: f64) -> Result<Track, RenderError> {
        self.progress.work_total(self.pixels());
        let tiles: Vec<Track> = self
            .job
            .tiles()
            .into_par_iter()
            .map(|tile| {
                let track = self.tile(tile, fraction)?;
                self.progress.work_done(u64::from(tile.x1 - tile.x0) * u64::from(tile.y1 - tile.y0));
                Ok(track)
            })
            .collect::<Result<_, RenderError>>()?;
        let mut all = Track::default();
        for mut tile in tiles {
            all.paths.append(&mut tile.paths);
            all.queries.append(&mut tile.queries);
            all.unoccluded.append(&mut tile.unoccluded);
        }
        Ok(all)
    }

    fn tile(&self, tile: PixelRect, fraction: f64) -> Result<Track, RenderError> {
        let job = &self.job;
        let tape = Tape::default();
        let integrator = Integrator {
            world: job.world,
            visibility: Visibility::recorded(&job.world.bvh, &NoProofs, false, &tape),
            settings: job.scene.integrator,
            transmittance: job.transmittance,
        };
        let mut counters = Counters::default();
        for y in tile.y0..tile.y1 {
            for x in tile.x0..tile.x1 {
                if self.progress.cancelled() {
                    return Err(RenderError::Cancelled);
                }
                for sample in 0..self.samples() {
                    let number = Sampler::new(job.seed ^ SELECTION, x, y, sample).next_1d();
                    if number < fraction {
                        let before = counters.queries;
                        let _ = job.sample(&integrator, x, y, sample, &mut counters);
                        let queries = (counters.queries - before) as usize;
                        tape.0.borrow_mut().paths.push(PathOnTrack { number, queries });
                    }
                }
            }
        }
        Ok(tape.0.into_inner())
    }
}

impl Track {
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
