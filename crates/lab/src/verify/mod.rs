//! The soundness run: many segments, hard ones above all, and every proof about them checked.
//!
//! *Idea.* A proof is a claim about exact geometry, so it can be held against a test that knows no voxels. Segments are
//! made in blocks; each method is asked about a whole block; where any method proved something, the hierarchy is asked
//! as well, and a loop over all triangles as often as that is affordable.
//!
//! First the structures themselves are validated: the occupied voxels against the triangles, the fields and
//! neighbourhoods against the occupied voxels.
//!
//! *Guarantee.* None, only a bound: see [`Tally::bound`]. What is asked depends on the seed and the scene alone.
//!
//! *Cost.* About a microsecond a segment and thread.

mod oracle;
mod report;
mod segments;

#[cfg(test)]
mod tests;

use std::{array, sync::Arc, time::Instant};

use rayon::prelude::*;
use vdf_geometry::Bounds;
use vdf_render::{
    GridExtent, PrepareOptions, PreparedScene, Progress, RenderError, check_voxel_size, default_voxel_size, on_threads,
};
use vdf_scene::Scene;
use vdf_visibility::{Answer, Method, Provers, QueryKind, ShadowQuery};
use vdf_voxel::{VoxelGrid, voxelize};

use self::{
    oracle::{Oracle, Truth},
    segments::{Generator, Query},
};
pub use self::{
    report::{Checks, ClassTally, Failure, GridSummary, MethodTally, Tally, VerifyReport},
    segments::SegmentClass,
};
use crate::{LabError, progress::Part};

/// Segments that are made, asked about and checked in one go.
const BLOCK: u64 = 4096;

/// Failures that are told in full.
const TOLD: usize = 20;

/// A claim of each has one bit.
const MAX_METHODS: usize = 32;

const CLASSES: usize = SegmentClass::ALL.len();

/// What to verify.
#[derive(Clone, Debug, PartialEq)]
pub struct VerifyOptions {
    /// The methods, all asked about the same segments; at least one, and not [`Method::NONE`], which proves nothing.
    pub methods: Vec<Method>,
    /// Sides of voxels in world units, between which the segments are divided; if empty a 128th of the scene's longest
    /// side.
    pub voxel_sizes: Vec<f64>,
    /// What the voxel grids cover.
    pub grid: GridExtent,
    /// Number of segments in all, at least 1; divided evenly between the classes.
    pub segments: u64,
    /// Seed of the segments.
    pub seed: u64,
    /// Number of threads; by default one for each processor.
    pub threads: Option<usize>,
    /// The largest number of voxels that may be built. The structures of all methods exist at the same time.
    pub max_voxels: u64,
}

impl Default for VerifyOptions {
    /// A million segments, all methods, at most 2²⁷ voxels.
    fn default() -> Self {
        Self {
            methods: Method::proving().collect(),
            voxel_sizes: vec![],
            grid: GridExtent::default(),
            segments: 1_000_000,
            seed: 0,
            threads: None,
            max_voxels: 1 << 27,
        }
    }
}

impl VerifyOptions {
    /// Checks what can be checked before anything is built.
    ///
    /// # Errors
    /// [`vdf_render::RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), LabError> {
        if self.segments == 0 {
            return Err(LabError::option("segments", "must be at least 1"));
        }
        if self.methods.is_empty() || self.methods.contains(&Method::NONE) {
            return Err(LabError::option("method", "must name methods that prove something; none does not"));
        }
        if self.methods.len() > MAX_METHODS {
            return Err(LabError::option("method", format!("must name at most {MAX_METHODS} methods")));
        }
        Ok(self.voxel_sizes.iter().try_for_each(|&size| check_voxel_size(size))?)
    }
}

/// Asks the methods about segments of all classes and checks every proof.
///
/// Wrong proofs are no error but part of the report.
///
/// # Errors
/// If an option or a voxel size is not usable, or `progress` asks to stop.
pub fn verify(
    scene: impl Into<Arc<Scene>>,
    options: &VerifyOptions,
    progress: &dyn Progress,
) -> Result<VerifyReport, LabError> {
    options.validate()?;
    let none = PrepareOptions { threads: options.threads, ..PrepareOptions::with_method(Method::NONE) };
    let prepared = PreparedScene::new(scene, &none, progress)?;
    on_threads(options.threads, || verify_in_pool(&prepared, options, progress))
}

fn verify_in_pool(
    prepared: &PreparedScene,
    options: &VerifyOptions,
    progress: &dyn Progress,
) -> Result<VerifyReport, LabError> {
    let world = prepared.world();
    let oracle = Oracle::new(world);
    let sizes = match options.voxel_sizes.as_slice() {
        [] => vec![default_voxel_size(world.grid_bounds(options.grid))],
        sizes => sizes.to_vec(),
    };
    let names: Vec<_> = options.methods.iter().map(|m| m.name()).collect();
    progress.work_total(options.segments);

    let classes = SegmentClass::of(world);
    let mut sum = Sum::new(names.len());
    let mut grids = Vec::new();
    let mut seconds = 0.0;
    for (number, &voxel_size) in (0u32..).zip(&sizes) {
        progress.phase("distance fields");
        let grid = grid_over(world.grid_bounds(options.grid), voxel_size, options.max_voxels)?;
        let vertices = world.triangles.par_iter().map(|t| t.vertices);
        let occupied = voxelize(&grid, vertices.clone())?;
        let excess = occupied.validate(&grid, vertices)?;
        let mut methods = Vec::new();
        for &method in &options.methods {
            if progress.cancelled() {
                return Err(RenderError::Cancelled.into());
            }
            let options = PrepareOptions {
                method: Some(method),
                voxel_size: Some(voxel_size),
                grid: options.grid,
                max_voxels: options.max_voxels,
                threads: options.threads,
                ..PrepareOptions::default()
            };
            let with_method = prepared.with_options(&options, &Part(progress))?;
            with_method.provers().validate(&occupied)?;
            methods.push(with_method);
        }
        let r = grid.resolution();
        let free_share = 1.0 - occupied.count() as f64 / r.voxel_count() as f64;
        grids.push(GridSummary { voxel_size, grid: r.sides(), free_share, excess });

        progress.phase("verifying");
        let start = Instant::now();
        let [from, to] = [number, number + 1].map(|n| part(options.segments, n.into(), sizes.len() as u64));
        let run = Run {
            claimants: methods.iter().map(|m| m.provers() as &dyn Claimant).collect(),
            names: &names,
            generator: Generator::new(prepared.scene(), world, grid, options.seed, number),
            oracle: &oracle,
            classes: &classes,
            voxel_size,
        };
        sum = sum.plus(run.all(to - from, progress)?);
        seconds += start.elapsed().as_secs_f64();
    }
    let classes = classes.into_iter().map(|class| (class, sum.classes[class as usize]));
    let mut total = Tally::default();
    sum.classes.iter().for_each(|&t| total += t);
    Ok(VerifyReport {
        version: env!("CARGO_PKG_VERSION"),
        seed: options.seed,
        threads: rayon::current_num_threads(),
        triangles: world.triangles.len(),
        grids,
        seconds,
        classes: classes.map(|(class, tally)| ClassTally { class, tally, bound: tally.bound() }).collect(),
        total,
        methods: names.iter().zip(&sum.methods).map(|(m, &[n, wrong])| MethodTally::new(m, n, wrong)).collect(),
        checks: sum.checks,
        failures: sum.failures,
    })
}

fn grid_over(bounds: &Bounds, voxel_size: f64, max_voxels: u64) -> Result<VoxelGrid, LabError> {
    Ok(VoxelGrid::covering(bounds.min, bounds.max, voxel_size, max_voxels)?)
}

/// The first of `whole` things that belong to part `n` of `parts`.
fn part(whole: u64, n: u64, parts: u64) -> u64 {
    // Exact even if the product has more than 64 bits.
    (u128::from(whole) * u128::from(n) / u128::from(parts.max(1))) as u64
}

/// What the methods claim of a segment: bit i is method i's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Claims {
    unoccluded: u32,
    occluded: u32,
}

impl Claims {
    fn add(&mut self, answer: Answer, bit: u32) {
        match answer {
            Answer::Unoccluded => self.unoccluded |= 1 << bit,
            Answer::Occluded => self.occluded |= 1 << bit,
            Answer::Unknown => {}
        }
    }
}

/// Whoever is asked about blocks of segments: one virtual call a block.
trait Claimant: Sync {
    /// Sets bit `bit` of what is claimed of each of `queries`.
    fn claim(&self, queries: &[Query], claims: &mut [Claims], bit: u32);
}

impl Claimant for Provers {
    fn claim(&self, queries: &[Query], claims: &mut [Claims], bit: u32) {
        for (query, claims) in queries.iter().zip(claims) {
            let (from, to) = (query.segment.p, query.segment.q);
            // A query towards an emitter may have an answer of its own; the one for any two points has to be right as
            // well.
            let of_emitter = query.emitter.map(|emitter| {
                [QueryKind::Spatial, QueryKind::OnLight, QueryKind::Superficial]
                    .map(|kind| self.answer(&ShadowQuery { from, to, emitter, kind }))
            });
            for answer in of_emitter.into_iter().flatten().chain([self.answer_between(from, to)]) {
                claims.add(answer, bit);
            }
        }
    }
}

/// The methods on one grid.
struct Run<'a> {
    claimants: Vec<&'a dyn Claimant>,
    names: &'a [&'static str],
    generator: Generator<'a>,
    oracle: &'a Oracle<'a>,
    classes: &'a [SegmentClass],
    voxel_size: f64,
}

/// What a thread needs for a block.
#[derive(Default)]
struct Scratch {
    queries: Vec<Query>,
    claims: Vec<Claims>,
}

impl Run<'_> {
    fn all(&self, segments: u64, progress: &dyn Progress) -> Result<Sum, RenderError> {
        let classes = self.classes.len() as u64;
        // The largest share of a class, in blocks; classes take turns.
        let blocks = segments.div_ceil(classes).div_ceil(BLOCK);
        (0..blocks * classes)
            .into_par_iter()
            .map_init(Scratch::default, |scratch, block| {
                if progress.cancelled() {
                    return Err(RenderError::Cancelled);
                }
                let [class, block] = [block % classes, block / classes];
                let share = part(segments, class + 1, classes) - part(segments, class, classes);
                let indices = share.min(block * BLOCK)..share.min((block + 1) * BLOCK);
                let n = indices.end - indices.start;
                let sum = self.block(self.classes[class as usize], indices, scratch);
                progress.work_done(n);
                Ok(sum)
            })
            .try_reduce(|| Sum::new(self.names.len()), |a, b| Ok(a.plus(b)))
    }

    fn block(&self, class: SegmentClass, indices: std::ops::Range<u64>, scratch: &mut Scratch) -> Sum {
        let Scratch { queries, claims } = scratch;
        queries.clear();
        queries.extend(indices.clone().map(|i| self.generator.query(class, i)));
        claims.clear();
        claims.resize(queries.len(), Claims::default());
        for (claimant, bit) in self.claimants.iter().zip(0..) {
            claimant.claim(queries, claims, bit);
        }
        let mut sum = Sum::new(self.names.len());
        for ((index, query), claims) in indices.zip(queries).zip(claims) {
            self.check(&mut sum, class, index, query, *claims);
        }
        sum
    }

    fn check(&self, sum: &mut Sum, class: SegmentClass, index: u64, query: &Query, claims: Claims) {
        let proved = claims != Claims::default();
        let truth = self.oracle.ask(&query.segment, index, proved, class == SegmentClass::Curved);
        sum.checks += Checks {
            proved_by_hierarchy: u64::from(proved && truth.by_hierarchy.is_some()),
            proved_by_loop: u64::from(proved && truth.by_loop.is_some()),
            compared: u64::from(truth.by_hierarchy.is_some() && truth.by_loop.is_some()),
            disagreements: u64::from(truth.disagrees()),
            curved: u64::from(truth.curved.is_some()),
            curved_disagreements: u64::from(truth.disagrees_about_curved()),
        };
        // One and the same method may claim both.
        let wrong_unoccluded = if truth.says(true) { claims.unoccluded } else { 0 };
        let wrong_occluded = if truth.says(false) { claims.occluded } else { 0 };
        let wrong = wrong_unoccluded | wrong_occluded;
        let made = claims.unoccluded | claims.occluded;
        sum.classes[class as usize] += Tally {
            segments: 1,
            proved: u64::from(proved),
            proofs: made.count_ones().into(),
            wrong: wrong.count_ones().into(),
        };
        for (bit, [proofs, wrongs]) in sum.methods.iter_mut().enumerate() {
            *proofs += u64::from(made >> bit & 1);
            *wrongs += u64::from(wrong >> bit & 1);
        }
        if wrong != 0 || truth.disagrees() || truth.disagrees_about_curved() {
            sum.failures.push(self.failure(class, index, query, truth, wrong));
            sum.failures.truncate(TOLD);
        }
    }

    #[cold]
    fn failure(&self, class: SegmentClass, index: u64, query: &Query, truth: Truth, wrong: u32) -> Failure {
        let methods = self.names.iter().enumerate().filter(|(bit, _)| wrong >> bit & 1 != 0);
        Failure {
            methods: methods.map(|(_, &name)| name).collect(),
            voxel_size: self.voxel_size,
            class,
            index,
            emitter: query.emitter,
            from: query.segment.p.to_array(),
            to: query.segment.q.to_array(),
            occluded_by_hierarchy: truth.by_hierarchy,
            occluded_by_loop: truth.by_loop,
            meets_curved: truth.curved,
        }
    }
}

/// What blocks add up to.
struct Sum {
    classes: [Tally; CLASSES],
    /// For each method its proofs and the wrong ones among them.
    methods: Vec<[u64; 2]>,
    checks: Checks,
    failures: Vec<Failure>,
}

impl Sum {
    fn new(methods: usize) -> Self {
        Self {
            classes: [Tally::default(); CLASSES],
            methods: vec![[0; 2]; methods],
            checks: Checks::default(),
            failures: vec![],
        }
    }

    fn plus(mut self, other: Self) -> Self {
        self.classes.iter_mut().zip(other.classes).for_each(|(a, b)| *a += b);
        for (a, b) in self.methods.iter_mut().zip(other.methods) {
            *a = array::from_fn(|i| a[i] + b[i]);
        }
        self.checks += other.checks;
        self.failures.extend(other.failures);
        self.failures.truncate(TOLD);
        self
    }
}
