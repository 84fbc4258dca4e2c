//! Replaying a stream, per method and voxel size.
//!
//! What is timed is one whole pass over the spatial queries (or the superficial ones), on one thread. A pass of the hierarchy, of the proofs and of the proofs
//! with the fallback take turns, as often as asked for, forwards and backwards through the methods, so that a machine that grows slower or
//! faster does so for all; a median is over the passes of one kind. A pass without any query is timed, too: the loop and the reading of the stream are
//! part of all the other figures.

use std::{fmt, hint::black_box, time::Instant};

use rayon::prelude::*;
use serde::Serialize;
use vdf_geometry::Segment;
use vdf_render::{GridExtent, 
    PrepareOptions, PreparedScene, Progress, RenderError, check_voxel_size, default_voxel_size, on_threads,
};
use vdf_visibility::{Answer, Counters, Method, Provers, QueryKind, ShadowQuery, Visibility};

use super::stream::QueryStream;
use crate::LabError;

/// What to replay a stream with.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayOptions {
    /// The methods, at least one; [`Method::NONE`] is measured in any case and may be left out.
    pub methods: Vec<Method>,
    /// Sides of voxels in world units; if empty a 128th of the scene's longest side.
    pub voxel_sizes: Vec<f64>,
    /// What the voxel grids cover.
    pub grid: GridExtent,
    /// Passes over the stream that a median is taken of; at least 1.
    pub passes: u32,
    /// Number of threads that build and check; by default one for each processor. Queries are always timed on one.
    pub threads: Option<usize>,
    /// The largest number of voxels that may be built.
    pub max_voxels: u64,
}

impl Default for ReplayOptions {
    /// All methods, one voxel size, medians of five passes.
    fn default() -> Self {
        Self { methods: Method::all().collect(), voxel_sizes: vec![], grid: GridExtent::default(), passes: 5, threads: None, max_voxels: 1 << 29 }
    }
}

impl ReplayOptions {
    /// Checks what can be checked without a scene.
    ///
    /// # Errors
    /// [`RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), LabError> {
        if self.passes == 0 {
            return Err(LabError::option("passes", "must be at least 1"));
        }
        if self.methods.iter().all(|&m| m == Method::NONE) {
            let message = "must name a method that proves something, such as amr-sn; none is always measured";
            return Err(LabError::option("methods", message));
        }
        Ok(self.voxel_sizes.iter().try_for_each(|&s| check_voxel_size(s))?)
    }
}

/// Nanoseconds a query, over the passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Timing {
    /// The median.
    pub median: f64,
    /// The fastest pass.
    pub min: f64,
    /// The slowest pass.
    pub max: f64,
}

/// What a replay found. Times are nanoseconds a query on one thread, unless a name says otherwise.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Replay {
    /// Queries in the stream.
    pub queries: usize,
    /// Those that are spatial.
    pub spatial: usize,
    /// spatial / queries.
    pub p_spatial: f64,
    /// Share of the spatial queries that are unoccluded: no method that proves nothing else can have a larger p_acc|sp.
    pub unoccluded_of_spatial: f64,
    /// N of the whole render, estimated.
    pub estimated_total: Option<f64>,
    /// Triangles in the hierarchy.
    pub triangles: usize,
    /// Passes of each kind.
    pub passes: u32,
    /// The loop without a query.
    pub t_loop: Timing,
    /// The hierarchy alone.
    pub hierarchy: HierarchyReplay,
    /// What a timer in the loop would have done.
    pub timer: TimerInfluence,
    /// Each method with each voxel size.
    pub methods: Vec<MethodReplay>,
}

/// The hierarchy alone, without a method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct HierarchyReplay {
    /// A spatial query.
    pub t_spatial: Timing,
    /// A superficial query; `None` if there are none.
    pub t_superficial: Option<Timing>,
    /// Any query: `t_query`.
    pub t_query: f64,
}

/// The same spatial queries of the hierarchy with a timer started and stopped around each (6.2.2 in \[Houska2013\]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TimerInfluence {
    /// What a query takes in the pass with timers.
    pub t_spatial: Timing,
    /// What the timers say that it takes.
    pub said: Timing,
}

/// A method with a voxel size.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MethodReplay {
    /// The method.
    pub method: &'static str,
    /// Side of a voxel in world units.
    pub voxel_size: f64,
    /// Voxels along x, y and z.
    pub grid: [u32; 3],
    /// Bytes of all the method's structures.
    pub bytes: usize,
    /// `T_build` in seconds.
    pub t_build: f64,
    /// Spatial queries that were proved.
    pub proved: u64,
    /// proved / spatial.
    pub p_accelerated_given_spatial: f64,
    /// u = 1 − p_acc|sp, the unknown fraction.
    pub unknown_fraction: f64,
    /// `t_acc`, the attempt of a proof for a spatial query.
    pub t_acc: Timing,
    /// A spatial query: the proof, and the fallback where there is none.
    pub t_effective: Timing,
    /// `t_acc` as the thesis computes it (6.3.2), from the whole: t_eff − (1 − p_acc|sp)·t_query. Larger than [`Self::t_acc`] where proofs alone overlap
    /// in the processor but a fallback has to wait for its proof; smaller where proved queries are the expensive ones.
    pub t_acc_derived: f64,
    /// A spatial query of the hierarchy alone, in passes that alternated with those of this method.
    pub t_hierarchy: Timing,
    /// How many times faster a spatial query is than by the hierarchy alone; below 1 it is slower.
    pub speed_up: f64,
    /// The same for the mixture of spatial and superficial queries of the stream.
    pub speed_up_all: f64,
    /// What criterion 2.8 in \[Houska2013\] wants p_acc|sp to exceed: `t_acc / t_query`, both of spatial queries.
    pub threshold: f64,
    /// From how many spatial queries on the build is worth its time, by [`Self::t_effective`]; `None` if never.
    pub pays_from: Option<f64>,
}

/// A query that was answered wrongly.
#[derive(Clone, Debug, PartialEq)]
pub struct WrongAnswer {
    /// The method; `none` if the hierarchy contradicts the answer in the stream.
    pub method: &'static str,
    /// Side of a voxel in world units, if the method has voxels.
    pub voxel_size: Option<f64>,
    /// Place of the query in the stream.
    pub index: usize,
    /// The query.
    pub query: ShadowQuery,
    /// The wrong answer.
    pub unoccluded: bool,
}

impl fmt::Display for WrongAnswer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let said = if self.unoccluded { "unoccluded" } else { "occluded" };
        write!(f, "{}", self.method)?;
        if let Some(size) = self.voxel_size {
            write!(f, " with voxel {size:?}")?;
        }
        let (from, to) = (self.query.from.to_array(), self.query.to.to_array());
        let twin = if self.voxel_size.is_some() { "the hierarchy" } else { "the stream" };
        write!(f, " says {said} of query {}, from {from:?} to {to:?}, emitter {}", self.index, self.query.emitter)?;
        write!(f, "; {twin} says otherwise. Please report it with the scene")
    }
}

/// Replays `stream` in `prepared`, whose own method does not matter.
///
/// # Errors
/// [`LabError::WrongAnswer`] at the first answer that differs from the hierarchy's, or if that differs from the stream's; [`LabError::NoQueries`] if
/// no query is spatial; an option or voxel size that is not usable; or `progress` asks to stop.
pub fn replay(
    prepared: &PreparedScene,
    stream: &QueryStream,
    options: &ReplayOptions,
    progress: &dyn Progress,
) -> Result<Replay, LabError> {
    options.validate()?;
    on_threads(options.threads, || Replaying::new(prepared, stream, progress)?.run(options))
}

/// The queries of a stream by their class, and what the hierarchy answers.
struct Replaying<'a> {
    stream: &'a QueryStream,
    prepared: &'a PreparedScene,
    progress: &'a dyn Progress,
    spatial: Vec<ShadowQuery>,
    superficial: Vec<ShadowQuery>,
    /// For each query of the stream.
    truth: Vec<bool>,
    /// Unoccluded ones among the spatial and among the superficial queries.
    unoccluded: [usize; 2],
}

/// A method that was built and checked, and its passes so far.
struct Candidate {
    method: Method,
    prepared: PreparedScene,
    proved: u64,
    acc: Vec<f64>,
    effective: Vec<f64>,
}

/// Passes that do not depend on a method.
#[derive(Default)]
struct Common {
    empty: Vec<f64>,
    spatial: Vec<f64>,
    superficial: Vec<f64>,
    with_timer: Vec<f64>,
    timer_said: Vec<f64>,
}

impl<'a> Replaying<'a> {
    /// Asks the hierarchy once about all queries.
    fn new(prepared: &'a PreparedScene, stream: &'a QueryStream, progress: &'a dyn Progress) -> Result<Self, LabError> {
        let bvh = &prepared.world().bvh;
        let truth: Vec<bool> = stream.queries.par_iter().map(|q| !bvh.occluded(&Segment::new(q.from, q.to))).collect();
        if let Some(index) = truth.iter().zip(&stream.unoccluded).position(|(a, b)| a != b) {
            return Err(wrong(Method::NONE, None, index, stream.queries[index], truth[index]));
        }
        let (spatial, superficial): (Vec<_>, Vec<_>) =
            stream.queries.iter().partition(|q| q.kind == QueryKind::Spatial);
        if spatial.is_empty() {
            let help = "only queries from a medium towards a point or constant emitter are spatial; record more, or with raymarch";
            return Err(LabError::NoQueries { kind: "spatial", help });
        }
        let count = |spatial| {
            let answers = stream.queries.iter().zip(&truth);
            answers.filter(|(q, t)| (q.kind == QueryKind::Spatial) == spatial && **t).count()
        };
        let unoccluded = [count(true), count(false)];
        Ok(Self { stream, prepared, progress, spatial, superficial, truth, unoccluded })
    }

    fn run(&self, options: &ReplayOptions) -> Result<Replay, LabError> {
        let sizes = match &options.voxel_sizes[..] {
            [] => vec![default_voxel_size(self.prepared.world().grid_bounds(options.grid))],
            sizes => sizes.to_vec(),
        };
        let mut methods: Vec<Method> = Vec::new();
        for &m in &options.methods {
            if m != Method::NONE && !methods.contains(&m) {
                methods.push(m);
            }
        }
        self.progress.work_total(sizes.len() as u64 * (u64::from(options.passes) + 1) * methods.len() as u64);
        let mut common = Common::default();
        let mut rows = Vec::new();
        for &size in &sizes {
            // All methods of one size are held at a time, to take turns.
            self.progress.phase("checking");
            let mut candidates = Vec::new();
            for &method in &methods {
                candidates.push(self.candidate(method, size, options)?);
                self.progress.work_done(1);
            }
            self.progress.phase("replaying");
            let before = common.spatial.len();
            for pass in 0..options.passes {
                self.common_passes(&mut common)?;
                self.method_passes(&mut candidates, pass % 2 == 1)?;
            }
            let here = timing(&common.spatial[before..]);
            rows.extend(candidates.iter().map(|c| (here, c.summary(size, here, self.spatial.len()))));
        }
        Ok(self.report(&common, rows, options.passes))
    }

    /// Builds a method and compares each of its answers with the hierarchy's.
    fn candidate(&self, method: Method, size: f64, options: &ReplayOptions) -> Result<Candidate, LabError> {
        self.look()?;
        let options = PrepareOptions {
            method: Some(method),
            voxel_size: Some(size),
            grid: options.grid,
            max_voxels: options.max_voxels,
            threads: options.threads,
        };
        let prepared = self.prepared.with_options(&options, self.progress)?;
        let checked = check(&prepared.visibility(), &self.stream.queries, &self.truth);
        let proved = checked
            .map_err(|index| wrong(method, Some(size), index, self.stream.queries[index], !self.truth[index]))?;
        Ok(Candidate { method, prepared, proved, acc: vec![], effective: vec![] })
    }

    fn look(&self) -> Result<(), LabError> {
        if self.progress.cancelled() { Err(RenderError::Cancelled.into()) } else { Ok(()) }
    }

    fn common_passes(&self, common: &mut Common) -> Result<(), LabError> {
        self.look()?;
        let bvh = &self.prepared.world().bvh;
        let none = Provers::none();
        let hierarchy = Visibility::new(bvh, &none);
        common.empty.push(empty_pass(&self.spatial));
        common.spatial.push(self.per_spatial(Method::NONE, query_pass(&hierarchy, &self.spatial))?);
        if !self.superficial.is_empty() {
            self.look()?;
            let (seconds, unoccluded) = query_pass(&hierarchy, &self.superficial);
            agrees(Method::NONE, unoccluded, self.unoccluded[1])?;
            common.superficial.push(1e9 * seconds / self.superficial.len() as f64);
        }
        let (pass, said) = timer_pass(&hierarchy, &self.spatial);
        common.with_timer.push(self.per_spatial(Method::NONE, pass)?);
        common.timer_said.push(1e9 * said / self.spatial.len() as f64);
        Ok(())
    }

    fn method_passes(&self, candidates: &mut [Candidate], backwards: bool) -> Result<(), LabError> {
        let turn = |c: &mut Candidate| {
            self.look()?;
            let (seconds, proved) = proof_pass(c.prepared.provers(), &self.spatial);
            agrees(c.method, proved, c.proved as usize)?;
            c.acc.push(1e9 * seconds / self.spatial.len() as f64);
            let pass = query_pass(&c.prepared.visibility(), &self.spatial);
            c.effective.push(self.per_spatial(c.method, pass)?);
            self.progress.work_done(1);
            Ok(())
        };
        if backwards {
            candidates.iter_mut().rev().try_for_each(turn)
        } else {
            candidates.iter_mut().try_for_each(turn)
        }
    }

    /// Nanoseconds a spatial query, if the pass found as many unoccluded as there are.
    fn per_spatial(&self, method: Method, (seconds, unoccluded): (f64, usize)) -> Result<f64, LabError> {
        agrees(method, unoccluded, self.unoccluded[0])?;
        Ok(1e9 * seconds / self.spatial.len() as f64)
    }

    fn report(&self, common: &Common, rows: Vec<(Timing, MethodReplay)>, passes: u32) -> Replay {
        let n = self.stream.queries.len() as f64;
        let p_spatial = self.spatial.len() as f64 / n;
        let t_superficial = (!common.superficial.is_empty()).then(|| timing(&common.superficial));
        let mixed =
            |spatial: f64| p_spatial * spatial + (1.0 - p_spatial) * t_superficial.map_or(0.0, |t: Timing| t.median);
        let t_spatial = timing(&common.spatial);
        let methods = rows
            .into_iter()
            .map(|(here, row)| MethodReplay { speed_up_all: mixed(here.median) / mixed(row.t_effective.median), ..row })
            .collect();
        Replay {
            queries: self.stream.queries.len(),
            spatial: self.spatial.len(),
            p_spatial,
            unoccluded_of_spatial: self.unoccluded[0] as f64 / self.spatial.len() as f64,
            estimated_total: self.stream.estimated_total(),
            triangles: self.prepared.world().triangles.len(),
            passes,
            t_loop: timing(&common.empty),
            hierarchy: HierarchyReplay { t_spatial, t_superficial, t_query: mixed(t_spatial.median) },
            timer: TimerInfluence { t_spatial: timing(&common.with_timer), said: timing(&common.timer_said) },
            methods,
        }
    }
}

impl Candidate {
    fn summary(&self, size: f64, hierarchy: Timing, spatial: usize) -> MethodReplay {
        let (t_acc, t_effective) = (timing(&self.acc), timing(&self.effective));
        let p = self.proved as f64 / spatial as f64;
        let build = self.prepared.build_report();
        let t_build = build.seconds();
        let gain = hierarchy.median - t_effective.median;
        MethodReplay {
            method: self.method.name(),
            voxel_size: size,
            grid: build.resolution.unwrap_or_default(),
            bytes: build.bytes(),
            t_build,
            proved: self.proved,
            p_accelerated_given_spatial: p,
            unknown_fraction: 1.0 - p,
            t_acc,
            t_effective,
            t_acc_derived: t_effective.median - (1.0 - p) * hierarchy.median,
            t_hierarchy: hierarchy,
            speed_up: hierarchy.median / t_effective.median,
            speed_up_all: 1.0,
            threshold: t_acc.median / hierarchy.median,
            pays_from: (gain > 0.0).then(|| 1e9 * t_build / gain),
        }
    }
}

/// The pass that is timed must answer as the one that was checked.
fn agrees(method: Method, found: usize, expected: usize) -> Result<(), LabError> {
    if found == expected {
        return Ok(());
    }
    Err(LabError::UnstableAnswers { method: method.name(), found, expected })
}

fn wrong(method: Method, voxel_size: Option<f64>, index: usize, query: ShadowQuery, unoccluded: bool) -> LabError {
    LabError::WrongAnswer(Box::new(WrongAnswer { method: method.name(), voxel_size, index, query, unoccluded }))
}

/// Compares every answer with the truth: the number of spatial queries proved, or the index of the first query that is answered wrongly.
pub(super) fn check(visibility: &Visibility<'_>, queries: &[ShadowQuery], truth: &[bool]) -> Result<u64, usize> {
    const BLOCK: usize = 4096;
    let answers = queries.par_chunks(BLOCK).zip(truth.par_chunks(BLOCK)).enumerate();
    let proved: Vec<u64> = answers
        .map(|(number, (queries, truth))| {
            let mut counters = Counters::default();
            let differs = queries.iter().zip(truth).position(|(q, &t)| visibility.unoccluded(q, &mut counters) != t);
            differs.map_or(Ok(counters.proved), |i| Err(number * BLOCK + i))
        })
        .collect::<Result<_, usize>>()?;
    Ok(proved.iter().sum())
}

/// One pass over queries that asks only for proofs: its seconds, and how many there are.
fn proof_pass(provers: &Provers, queries: &[ShadowQuery]) -> (f64, usize) {
    let start = Instant::now();
    let mut proved = 0;
    for q in queries {
        proved += usize::from(provers.answer(black_box(q)) != Answer::Unknown);
    }
    (start.elapsed().as_secs_f64(), proved)
}

/// One pass over queries as a render asks them: its seconds, and how many are unoccluded.
fn query_pass(visibility: &Visibility<'_>, queries: &[ShadowQuery]) -> (f64, usize) {
    let start = Instant::now();
    let mut counters = Counters::default();
    let mut unoccluded = 0;
    for q in queries {
        unoccluded += usize::from(visibility.unoccluded(black_box(q), &mut counters));
    }
    black_box(counters);
    (start.elapsed().as_secs_f64(), unoccluded)
}

/// A pass of the hierarchy with a timer around each query: as [`query_pass`], and the sum of what the timers say.
fn timer_pass(visibility: &Visibility<'_>, queries: &[ShadowQuery]) -> ((f64, usize), f64) {
    let start = Instant::now();
    let mut counters = Counters::default();
    let (mut unoccluded, mut said) = (0, 0.0);
    for q in queries {
        let start = Instant::now();
        unoccluded += usize::from(visibility.unoccluded(black_box(q), &mut counters));
        said += start.elapsed().as_secs_f64();
    }
    black_box(counters);
    ((start.elapsed().as_secs_f64(), unoccluded), said)
}

/// Nanoseconds a query to read the stream and nothing else.
fn empty_pass(queries: &[ShadowQuery]) -> f64 {
    let start = Instant::now();
    let mut sum = glam::DVec3::ZERO;
    for q in queries {
        let q = black_box(q);
        sum += q.from + q.to;
    }
    black_box(sum);
    1e9 * start.elapsed().as_secs_f64() / queries.len() as f64
}

/// Median, least and largest of at least one time.
fn timing(times: &[f64]) -> Timing {
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => Timing::default(),
        _ => Timing { median: 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]), min: sorted[0], max: sorted[n - 1] },
    }
}
