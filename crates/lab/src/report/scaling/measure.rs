//! What all sweeps measure alike.

use std::time::Instant;

use anyhow::anyhow;
use rayon::ThreadPool;
use vdf_render::{
    Acceleration, BuildReport, Image, IntegratorKind, Method, Prepared, Progress as _, RenderError, RenderOptions,
    Statistics, World,
    geometry::Bvh,
    queries::{Replay, ReplayOptions, record_queries, replay},
    render_prepared,
    scene::{LoadOptions, Scene, SceneSource, builtin},
};

use super::{super::bench::same_bits, Settings};
use crate::{
    failure::Failure,
    progress::{Part, Reporter},
};

/// Samples on each path segment in the recorded renders: most of their queries are spatial.
pub(super) const SAMPLES_PER_SEGMENT: u32 = 7;

/// Where and how often it is measured.
pub(super) struct Lab<'a> {
    pub(super) reporter: &'a Reporter,
    pub(super) settings: &'a Settings,
    pub(super) pool: ThreadPool,
}

/// A scene, ready to be rendered.
pub(super) struct Ready {
    pub(super) scene: Scene,
    pub(super) world: World,
}

/// What was built, and what its proofs are asked by.
pub(super) struct Built {
    pub(super) method: Method,
    pub(super) acceleration: Acceleration,
    pub(super) report: BuildReport,
}

/// The method of that name.
pub(super) fn method(name: &'static str) -> Result<Method, Failure> {
    name.parse().map_err(|e| Failure::Work(anyhow!("{name}: {e}")))
}

pub(super) fn methods(names: &[&'static str]) -> Result<Vec<Method>, Failure> {
    names.iter().map(|n| method(n)).collect()
}

impl Lab<'_> {
    /// A place in a sweep begins.
    pub(super) fn step(&self, sweep: &str, x: impl std::fmt::Display) {
        self.reporter.phase(&format!("{sweep} {x}"));
    }

    /// It is done.
    pub(super) fn done(&self) {
        self.reporter.work_done(1);
    }

    fn look(&self) -> Result<(), Failure> {
        if self.reporter.cancelled() { Err(Failure::Interrupted) } else { Ok(()) }
    }

    pub(super) fn repetitions(&self) -> std::ops::Range<u32> {
        0..self.settings.repetitions
    }

    /// Loads a scene with images of the size asked for.
    pub(super) fn load(&self, source: &SceneSource) -> Result<Scene, Failure> {
        self.look()?;
        let define = |name: &str| (name.to_owned(), self.settings.size.to_string());
        Ok(Scene::from_source(source, &LoadOptions { defines: vec![define("width"), define("height")] })?)
    }

    pub(super) fn builtin(&self, name: &str) -> Result<Scene, Failure> {
        let source = builtin(name).ok_or_else(|| Failure::Work(anyhow!("no built-in scene is called '{name}'")))?;
        self.load(&source)
    }

    pub(super) fn ready(&self, scene: Scene) -> Ready {
        let world = self.pool.install(|| World::new(&scene));
        Ready { scene, world }
    }

    /// Seconds that the hierarchy takes to be built, again and again.
    pub(super) fn hierarchies(&self, world: &World, pool: &ThreadPool) -> Result<Vec<f64>, Failure> {
        let build = |_| {
            self.look()?;
            let start = Instant::now();
            let bvh = pool.install(|| Bvh::new(&world.triangles));
            let seconds = start.elapsed().as_secs_f64();
            drop(bvh);
            Ok(seconds)
        };
        self.repetitions().map(build).collect()
    }

    pub(super) fn build(&self, ready: &Ready, method: Method, size: f64, pool: &ThreadPool) -> Result<Built, Failure> {
        self.look()?;
        let (triangles, lights) = (&ready.world.triangles, ready.scene.light_shapes());
        let max_voxels = RenderOptions::default().max_voxels;
        let build = || Acceleration::build(method, triangles, ready.world.bounds, &lights, size, max_voxels);
        let (acceleration, report) = pool.install(build).map_err(RenderError::from)?;
        Ok(Built { method, acceleration, report })
    }

    /// Builds each method again and again, taking turns; the reports of each.
    pub(super) fn builds(
        &self,
        ready: &Ready,
        methods: &[Method],
        size: f64,
        pool: &ThreadPool,
    ) -> Result<Builds, Failure> {
        let mut reports: Vec<(Method, Vec<BuildReport>)> = methods.iter().map(|&m| (m, vec![])).collect();
        for _ in self.repetitions() {
            for (method, reports) in &mut reports {
                reports.push(self.build(ready, *method, size, pool)?.report);
            }
        }
        Ok(Builds(reports))
    }

    /// Records queries of `raymarch` and replays them; every answer is compared with the hierarchy's.
    pub(super) fn replay(&self, ready: &Ready, methods: &[Method], size: f64) -> Result<Replay, Failure> {
        let options = RenderOptions {
            integrator: IntegratorKind::Raymarch { samples_per_segment: SAMPLES_PER_SEGMENT },
            spp: Some(4),
            seed: Some(self.settings.seed),
            threads: self.settings.threads,
            ..RenderOptions::default()
        };
        let Ready { scene, world } = ready;
        let part = Part(self.reporter);
        let stream = record_queries(scene, world, &options, self.settings.queries, &part)?;
        let options = ReplayOptions {
            methods: methods.to_vec(),
            voxel_sizes: vec![size],
            passes: self.settings.repetitions,
            threads: self.settings.threads,
            ..ReplayOptions::default()
        };
        Ok(replay(scene, world, &stream, &options, &part)?)
    }

    /// Renders with each of `built`, again and again, taking turns: seconds, statistics and image of each. Every image is compared with `expected`, or, if there is
    /// none, with the first.
    pub(super) fn renders(
        &self,
        ready: &Ready,
        built: &[Built],
        threads: Option<usize>,
        expected: &mut Option<Image>,
    ) -> Result<Vec<(Vec<f64>, Statistics)>, Failure> {
        let mut results: Vec<(Vec<f64>, Option<Statistics>)> = built.iter().map(|_| (vec![], None)).collect();
        for _ in self.repetitions() {
            for (built, (seconds, last)) in built.iter().zip(&mut results) {
                let prepared = Prepared {
                    world: &ready.world,
                    t_hierarchy: 0.0,
                    acceleration: &built.acceleration,
                    build: &built.report,
                };
                let options = RenderOptions {
                    method: built.method,
                    spp: Some(self.settings.spp),
                    seed: Some(self.settings.seed),
                    threads,
                    ..RenderOptions::default()
                };
                let rendering = render_prepared(&ready.scene, &prepared, &options, &Part(self.reporter))?;
                let expected = expected.get_or_insert_with(|| rendering.image.clone());
                if !same_bits(expected, &rendering.image) {
                    let (method, threads) = (built.method, rendering.statistics.threads);
                    return Err(Failure::Work(anyhow!(
                        "WRONG IMAGE: with {method} on {threads} threads it differs from the first. Please report it with this command"
                    )));
                }
                seconds.push(rendering.statistics.t_render);
                *last = Some(rendering.statistics);
            }
        }
        Ok(results.into_iter().filter_map(|(seconds, last)| Some((seconds, last?))).collect())
    }
}

/// The reports of repeated builds, by method.
pub(super) struct Builds(Vec<(Method, Vec<BuildReport>)>);

/// A part of a build.
#[derive(Clone, Copy)]
pub(super) enum Phase {
    Voxels = 0,
    Field = 1,
    Neighbourhoods = 2,
}

impl Builds {
    /// Seconds of voxelization, which all methods do alike.
    pub(super) fn voxelization(&self) -> Vec<f64> {
        self.0.iter().flat_map(|(_, reports)| reports.iter().map(|r| r.seconds[Phase::Voxels as usize])).collect()
    }

    /// Seconds of a phase of a method.
    pub(super) fn seconds(&self, method: Method, phase: Phase) -> Vec<f64> {
        self.of(method).map(|r| r.seconds[phase as usize]).collect()
    }

    /// Bytes that a phase of a method leaves: the same in each repetition.
    pub(super) fn bytes(&self, method: Method, phase: Phase) -> Vec<f64> {
        self.of(method).take(1).map(|r| r.bytes[phase as usize] as f64).collect()
    }

    /// Number of voxels, the same for all methods.
    pub(super) fn voxels(&self) -> usize {
        self.0.iter().flat_map(|(_, reports)| reports).map(|r| r.voxels).next().unwrap_or(0)
    }

    /// Occupied voxels / voxels, the same for all methods.
    pub(super) fn occupied_share(&self) -> f64 {
        let report = self.0.iter().flat_map(|(_, reports)| reports).next();
        report.map_or(0.0, |r| r.occupied as f64 / r.voxels as f64)
    }

    fn of(&self, method: Method) -> impl Iterator<Item = &BuildReport> {
        self.0.iter().filter(move |(m, _)| *m == method).flat_map(|(_, reports)| reports)
    }
}
