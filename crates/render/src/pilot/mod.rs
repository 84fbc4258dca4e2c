//! The choice of a method by a pilot: some of the render's own paths, followed with and without it.
//!
//! *Idea.* Whether a method pays is inequality 2.7 in \[Houska2013\]: what its proofs save must be more than what asking for them and building it costs. It took a
//! proved query to cost as much as any other, and then promises gains that do not come, for what is proved are often the cheap queries. So here nothing is
//! derived from means: paths of the render are timed as they are, without a method and with it. What has to be guessed is only whether a build is worth a trial.
//!
//! *Definition.* 1. A few paths say how long the whole will take without a method. 2. The queries of some more are recorded and asked again, which says how much of a path
//! they take. 3. A method is built if its build, estimated from triangles, texels and voxels (`cost`), is nearly free or less than what it may be
//! expected to save of all that is to be rendered. 4. What was built and the hierarchy alone take turns with fresh paths. 5. The best is taken (`choice`).
//!
//! *Guarantee.* The image is the same whatever is chosen; what is chosen may differ from run to run.
//!
//! *Cost.* Less than a hundredth of the predicted time of the render, at least some milliseconds and at most some hundredths of a second; and the builds that are not kept, which
//! take at most half of what they might have saved.
//!
//! *Limits.* Paths apart from each other share less of the caches than neighbours do, which makes them some hundredths slower, and one thread has them for itself. What is resumed counts as if it began anew.

mod choice;
mod clock;
mod cost;
#[cfg(test)]
mod tests;

use std::{cell::RefCell, hint::black_box};

use glam::DVec3;
use vdf_scene::PixelRect;
use vdf_visibility::{
    Answer, Counters, LightShape, Method, ProverOptions, Provers, QueryKind, Recorder, ShadowQuery, Visibility,
};

pub use self::{
    choice::{Choice, Declined, Measured, QueryCost},
    clock::ThreadTime,
};
use self::{
    choice::{Plain, best, reason},
    cost::Expected,
};
use crate::{
    Job, PrepareOptions, PreparedScene, Progress, RenderError, RenderOptions, default_voxel_size, integrator::evenly,
    light_shapes, threads::on_threads,
};

/// The part of the predicted time that a pilot may take beside builds, and its least and most seconds.
const SHARE: f64 = 0.007;
const LEAST: f64 = 0.002;
const MOST: f64 = 0.06;

/// A render that takes less processor time is over before anything pays.
const SHORT: f64 = 0.03;

/// Paths that warm the caches, and those that say how many can be followed.
const WARMING: usize = 16;
const SOUNDING: usize = 64;

/// The paths of a pilot are followed in so many rounds, in each without a method and with each.
const ROUNDS: usize = 16;

/// About so often each path is followed and its queries are asked.
const PASSES: f64 = 7.0;

/// The fewest and the most paths of a pilot.
const PATHS: (f64, f64) = (64.0, 8192.0);

/// How much is to be rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Work {
    /// Paths: pixels times samples.
    pub paths: u64,
    /// The longest that rendering may take, in seconds, if there is a limit.
    pub seconds: Option<f64>,
}

impl PreparedScene {
    /// The same scene with the method that renders so much of it soonest, builds included, as far as a pilot can tell; then [`PreparedScene::choice`] says why. `prepare` counts but
    /// for its method.
    ///
    /// # Errors
    /// As [`PreparedScene::with_options`] and [`PreparedScene::render`].
    pub fn with_best_method(
        &self,
        prepare: &PrepareOptions,
        render: &RenderOptions,
        work: Work,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        prepare.validate()?;
        render.validate(self.scene())?;
        on_threads(prepare.threads, || {
            let prepare = PrepareOptions { method: Some(Method::NONE), ..*prepare };
            let plain = self.with_provers(&prepare, progress)?;
            let (best, choice) = Pilot { plain: &plain, prepare, render, work, progress }.run()?;
            Ok(best.unwrap_or(plain).chosen(choice))
        })
    }
}

/// A path: its pixel and the number of its sample.
type Place = (u32, u32, u32);

struct Pilot<'a> {
    plain: &'a PreparedScene,
    prepare: PrepareOptions,
    render: &'a RenderOptions,
    work: Work,
    progress: &'a dyn Progress,
}

/// A method that was built, and its times.
struct Trial {
    prepared: PreparedScene,
    /// Seconds that this thread took to build it.
    building: f64,
    /// Of each round, its time over that of the hierarchy alone.
    ratios: Vec<f64>,
}

impl Pilot<'_> {
    fn run(&self) -> Result<(Option<PreparedScene>, Choice), RenderError> {
        let job = self.plain.job(self.render)?;
        // The look whether light paths pay is taken with the first tracer, and any render takes it.
        drop(job.tracer(self.progress));
        self.progress.phase("pilot");
        let start = ThreadTime::now();
        let threads = rayon::current_num_threads();
        let mut places = Places::new(&job);
        self.follow(self.plain, &places.next(WARMING))?;
        let sounding = self.follow(self.plain, &places.next(SOUNDING))? / SOUNDING as f64;
        let limit = self.work.seconds.map_or(f64::INFINITY, |seconds| seconds * threads as f64);
        let mut plain = Plain { paths: self.work.paths as f64, per_path: sounding.max(1e-9), limit };
        let mut queries = [QueryCost::default(); 3];
        let (mut trials, mut declined) = (Vec::new(), Vec::new());
        let mut recorded = Vec::new();
        let mut followed = WARMING + SOUNDING;
        if plain.seconds() > SHORT {
            let budget = (SHARE * plain.seconds() / threads as f64).clamp(LEAST, MOST);
            let count = (budget / (PASSES * plain.per_path)).clamp(PATHS.0, PATHS.1) as usize;
            // Not by the same paths: to listen takes time, and what was followed just now is in the caches.
            recorded = self.record(&job, &places.next(count))?;
            plain.per_path = self.follow(self.plain, &places.next(count))? / count as f64;
            followed += 2 * count;
            queries = self.query_costs(&recorded, count);
            let offers = self.offers(&recorded, count, &queries);
            // What is nearly free to build, and expected to save the most, needs no rival.
            let most = offers.iter().map(|(_, expected)| expected.saves).fold(0.0, f64::max);
            let clear = offers.iter().position(|(_, e)| e.saves == most && plain.is_cheap(e.build));
            for (i, (method, expected)) in offers.into_iter().enumerate() {
                if clear.is_some_and(|clear| clear != i) {
                    continue;
                }
                if !plain.is_worth_trying(expected.build, expected.saves) {
                    let saves = expected.saves * plain.paths;
                    declined.push(Declined { method: method.name(), t_build: expected.build, saves });
                    continue;
                }
                let options = PrepareOptions { method: Some(method), ..self.prepare };
                let before = ThreadTime::now();
                let prepared = self.plain.with_provers(&options, self.progress)?;
                let building = before.seconds();
                // Where the method could not be built another was taken, with a note.
                if prepared.method() != Method::NONE {
                    trials.push(Trial { prepared, building, ratios: Vec::new() });
                }
            }
            if !trials.is_empty() {
                self.progress.phase("pilot");
                plain.per_path = self.compare(&mut places, count, &plain, &mut trials)?;
                followed += count;
            }
        }
        let measured: Vec<Measured> = trials.iter_mut().map(|t| self.measured(t, &plain, &recorded)).collect();
        let chosen = best(&plain, &measured);
        // Builds that were in vain are a part of its cost.
        let t_pilot = start.seconds() - chosen.map_or(0.0, |i| trials[i].building);
        let per_path = chosen.map_or(plain.per_path, |i| measured[i].t_path);
        let predicted = |per_path: f64| (plain.paths * per_path).min(plain.limit) / threads as f64;
        let choice = Choice {
            method: chosen.map_or(Method::NONE.name(), |i| measured[i].method),
            reason: reason(&plain, &queries, &measured, chosen, &declined, threads),
            pilot_paths: followed,
            t_pilot,
            predicted_none: predicted(plain.per_path),
            predicted: predicted(per_path),
            t_path_none: plain.per_path,
            queries,
            measured,
            declined,
        };
        Ok((chosen.map(|i| trials.swap_remove(i).prepared), choice))
    }

    /// Follows paths: seconds that this takes.
    fn follow(&self, prepared: &PreparedScene, places: &[Place]) -> Result<f64, RenderError> {
        let job = prepared.job(self.render)?;
        let tracer = job.tracer(self.progress);
        let mut counters = Counters::default();
        let start = ThreadTime::now();
        for &(x, y, sample) in places {
            black_box(tracer.sample(x, y, sample, &mut counters));
        }
        let seconds = start.seconds();
        black_box(counters);
        if self.progress.cancelled() { Err(RenderError::Cancelled) } else { Ok(seconds) }
    }

    /// Follows paths without a method: their queries.
    fn record(&self, job: &Job<'_>, places: &[Place]) -> Result<Vec<ShadowQuery>, RenderError> {
        let log = Log::default();
        let tracer = job.recording_tracer(&log, self.progress);
        let mut counters = Counters::default();
        for &(x, y, sample) in places {
            black_box(tracer.sample(x, y, sample, &mut counters));
        }
        if self.progress.cancelled() { Err(RenderError::Cancelled) } else { Ok(log.0.into_inner()) }
    }

    /// What the queries of `paths` paths cost the hierarchy.
    fn query_costs(&self, recorded: &[ShadowQuery], paths: usize) -> [QueryCost; 3] {
        [QueryKind::Spatial, QueryKind::OnLight, QueryKind::Superficial].map(|kind| {
            let queries: Vec<_> = recorded.iter().filter(|q| q.kind == kind).copied().collect();
            QueryCost { per_path: queries.len() as f64 / paths as f64, seconds: self.seconds_of_hierarchy(&queries) }
        })
    }

    /// Seconds of a query of these.
    fn seconds_of_hierarchy(&self, queries: &[ShadowQuery]) -> f64 {
        let none = Provers::none();
        let visibility = Visibility::new(&self.plain.world().bvh, &none);
        let mut counters = Counters::default();
        seconds_each(queries, |q| visibility.unoccluded(q, &mut counters))
    }

    /// The methods that may pay, and what is expected of each: neighbourhoods alone, and light buffers.
    fn offers(&self, recorded: &[ShadowQuery], paths: usize, queries: &[QueryCost; 3]) -> Vec<(Method, Expected)> {
        let lights = light_shapes(self.plain.scene());
        let triangles = self.plain.world().triangles.len();
        let points = lights.iter().filter(|l| matches!(l, LightShape::Point(_))).count();
        let areas = lights.iter().filter(|l| matches!(l, LightShape::Area(_))).count();
        // Of the queries of a class those that a method knows something of.
        let some = |kind: QueryKind, point: bool| {
            let is = |q: &&ShadowQuery| {
                q.kind == kind && point == matches!(lights.get(q.emitter), Some(LightShape::Point(_)))
            };
            let per_path = recorded.iter().filter(is).count() as f64 / paths as f64;
            QueryCost { per_path, ..queries[class(kind)] }
        };
        let (spatial, superficial) = (some(QueryKind::Spatial, true), some(QueryKind::Superficial, true));
        let on_light = some(QueryKind::OnLight, false);
        let bounds = self.plain.world().grid_bounds(self.prepare.grid);
        let size = self.prepare.voxel_size.unwrap_or_else(|| default_voxel_size(bounds));
        let voxels = (bounds.extent() / size).ceil().max(DVec3::ONE).element_product();
        let mut offers = Vec::new();
        if points + areas > 0 {
            let expected = cost::neighbourhoods(triangles, voxels, &[spatial, on_light]);
            offers.push((Method::NEIGHBOURHOODS, expected));
        }
        if points > 0 {
            let options = ProverOptions { texels: self.prepare.texels, ..ProverOptions::default() };
            let side = options.texels_for(triangles, points);
            let mut expected = cost::buffers(triangles, side, points, &[spatial, superficial]);
            if areas > 0 {
                let others = cost::neighbourhoods(triangles, voxels, &[on_light]);
                expected = Expected { build: expected.build + others.build, saves: expected.saves + others.saves };
            }
            offers.push((Method::default(), expected));
        }
        offers
    }

    /// Lets the methods and the hierarchy alone take turns, each with the same `count` fresh paths, a part of them in each round: seconds that a path takes without a
    /// method, together with those before.
    fn compare(
        &self,
        places: &mut Places,
        count: usize,
        plain: &Plain,
        trials: &mut [Trial],
    ) -> Result<f64, RenderError> {
        let of_round = count.div_ceil(ROUNDS);
        let mut alone = 0.0;
        for round in 0..ROUNDS {
            let paths = places.next(of_round);
            // Who comes first finds the caches cold: each in its turn.
            let mut seconds = vec![0.0; trials.len() + 1];
            let turns = seconds.len();
            for turn in 0..turns {
                let who = (round + if round % 2 == 0 { turn } else { turns - turn }) % turns;
                let prepared = who.checked_sub(1).map_or(self.plain, |i| &trials[i].prepared);
                seconds[who] = self.follow(prepared, &paths)?;
            }
            alone += seconds[0];
            for (trial, with) in trials.iter_mut().zip(&seconds[1..]) {
                trial.ratios.push(with / seconds[0].max(1e-9));
            }
        }
        Ok(0.5 * (plain.per_path + alone / (ROUNDS * of_round) as f64))
    }

    /// The figures of a method.
    fn measured(&self, trial: &mut Trial, plain: &Plain, recorded: &[ShadowQuery]) -> Measured {
        let provers = trial.prepared.provers();
        let proved: Vec<_> = recorded.iter().filter(|q| provers.answer(q) != Answer::Unknown).copied().collect();
        Measured {
            method: trial.prepared.method().name(),
            t_build: trial.prepared.build_report().seconds(),
            t_path: plain.per_path * median(&mut trial.ratios),
            answered: proved.len() as f64 / recorded.len().max(1) as f64,
            t_query: self.seconds_of_hierarchy(&proved),
            t_acc: seconds_each(&proved, |q| provers.answer(q) != Answer::Unknown),
        }
    }
}

/// The place of a class in [`Choice::queries`].
const fn class(kind: QueryKind) -> usize {
    match kind {
        QueryKind::Spatial => 0,
        QueryKind::OnLight => 1,
        QueryKind::Superficial => 2,
    }
}

/// Seconds of a query of these: the faster of two passes; 0 of none.
fn seconds_each(queries: &[ShadowQuery], mut ask: impl FnMut(&ShadowQuery) -> bool) -> f64 {
    let mut pass = || {
        let start = ThreadTime::now();
        let answers = queries.iter().filter(|q| ask(black_box(q))).count();
        black_box(answers);
        start.seconds() / queries.len().max(1) as f64
    };
    pass().min(pass())
}

/// The median; 1 of nothing.
fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => 1.0,
        n => 0.5 * (values[(n - 1) / 2] + values[n / 2]),
    }
}

/// The queries of the paths that are recorded.
#[derive(Default)]
struct Log(RefCell<Vec<ShadowQuery>>);

impl Recorder for Log {
    fn record(&self, query: &ShadowQuery, _: bool) {
        self.0.borrow_mut().push(*query);
    }
}

/// Paths all over the picture, which stay even however many there are. Several at one place would share the caches as those of a render do, but then there are fewer places,
/// and what a path costs differs more from place to place.
struct Places {
    crop: PixelRect,
    samples: u32,
    number: u32,
}

impl Places {
    fn new(job: &Job<'_>) -> Self {
        Self { crop: job.crop(), samples: job.spp(), number: 0 }
    }

    /// The next paths.
    fn next(&mut self, count: usize) -> Vec<Place> {
        let PixelRect { x0, y0, x1, y1 } = self.crop;
        (0..count)
            .map(|_| {
                let [u, v] = evenly([0.5, 0.5], self.number);
                let sample = self.number % self.samples.max(1);
                self.number += 1;
                #[allow(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "below the number of places"
                )]
                let at = |first: u32, end: u32, u: f64| first + (f64::from(end - first) * u) as u32;
                (at(x0, x1, u), at(y0, y1, v), sample)
            })
            .collect()
    }
}
