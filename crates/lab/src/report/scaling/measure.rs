//! What all sweeps measure alike.

use std::time::Instant;

use vdf_geometry::Bvh;
use vdf_image::Image;
use vdf_render::{Integrator, PrepareOptions, PreparedScene, Progress, RenderOptions, Statistics, World, on_threads};
use vdf_scene::{LoadOptions, Scene, SceneSource};
use vdf_scenes::builtin;
use vdf_visibility::{BuildReport, Method};

use super::{super::bench::same_bits, ScalingOptions};
use crate::{
    LabError,
    progress::{Part, look},
    queries::{Replay, ReplayOptions, record_queries, replay},
};

/// The recorded renders: with so many samples on each path segment most of their queries are spatial.
pub(super) const RECORDED: Integrator = Integrator::raymarch(7);

/// Where and how often it is measured.
pub(super) struct Lab<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) options: &'a ScalingOptions,
}

/// The methods of these names, which are in the table.
pub(super) fn methods<const N: usize>(names: [&str; N]) -> [Method; N] {
    names.map(method)
}

/// The method of that name, which is in the table (tested for all that sweeps name).
pub(super) fn method(name: &str) -> Method {
    name.parse().unwrap_or(Method::NONE)
}

impl Lab<'_> {
    /// A place in a sweep begins.
    pub(super) fn step(&self, sweep: &str, x: impl std::fmt::Display) {
        self.progress.phase(&format!("{sweep} {x}"));
    }

    /// It is done.
    pub(super) fn done(&self) {
        self.progress.work_done(1);
    }

    fn repetitions(&self) -> std::ops::Range<u32> {
        0..self.options.repetitions
    }

    /// Loads a scene with images of the size asked for.
    pub(super) fn load(&self, source: &SceneSource) -> Result<Scene, LabError> {
        look(self.progress)?;
        let define = |name: &str| (name.to_owned(), self.options.size.to_string());
        Ok(Scene::from_source(
            source,
            &LoadOptions { defines: vec![define("width"), define("height")], ..LoadOptions::default() },
        )?)
    }

    pub(super) fn builtin(&self, name: &str) -> Result<Scene, LabError> {
        let source = builtin(name).ok_or_else(|| LabError::UnknownScene(name.to_owned()))?;
        self.load(&source)
    }

    /// The scene with its hierarchy and no method.
    pub(super) fn prepare(&self, scene: Scene) -> Result<PreparedScene, LabError> {
        let options = PrepareOptions { threads: self.options.threads, ..PrepareOptions::with_method(Method::NONE) };
        Ok(PreparedScene::new(scene, &options, &Part(self.progress))?)
    }

    /// Seconds that the hierarchy takes to be built, again and again.
    pub(super) fn hierarchies(&self, world: &World, threads: Option<usize>) -> Result<Vec<f64>, LabError> {
        let build = |_| {
            look(self.progress)?;
            on_threads(threads, || {
                let start = Instant::now();
                let bvh = Bvh::new(&world.triangles);
                let seconds = start.elapsed().as_secs_f64();
                drop(bvh);
                Ok(seconds)
            })
        };
        self.repetitions().map(build).collect()
    }

    pub(super) fn build(
        &self,
        alone: &PreparedScene,
        method: Method,
        size: f64,
        threads: Option<usize>,
    ) -> Result<PreparedScene, LabError> {
        let options = PrepareOptions { voxel_size: Some(size), threads, ..PrepareOptions::with_method(method) };
        Ok(alone.with_options(&options, &Part(self.progress))?)
    }

    /// Builds each method again and again, taking turns; the reports of each. One exists at a time.
    pub(super) fn builds(
        &self,
        alone: &PreparedScene,
        methods: &[Method],
        size: f64,
        threads: Option<usize>,
    ) -> Result<Builds, LabError> {
        let mut reports: Vec<(Method, Vec<BuildReport>)> = methods.iter().map(|&m| (m, vec![])).collect();
        for _ in self.repetitions() {
            for (method, reports) in &mut reports {
                reports.push(self.build(alone, *method, size, threads)?.build_report().clone());
            }
        }
        Ok(Builds(reports))
    }

    /// Records queries of `raymarch` and replays them; every answer is compared with the hierarchy's.
    pub(super) fn replay(&self, alone: &PreparedScene, methods: &[Method], size: f64) -> Result<Replay, LabError> {
        let threads = self.options.threads;
        let options = RenderOptions {
            integrator: RECORDED,
            spp: Some(4),
            seed: Some(self.options.seed),
            threads,
            ..RenderOptions::thesis()
        };
        let part = Part(self.progress);
        let stream = record_queries(alone, &options, self.options.queries, &part)?;
        let options = ReplayOptions {
            methods: methods.to_vec(),
            voxel_sizes: vec![size],
            passes: self.options.repetitions,
            threads,
            ..ReplayOptions::default()
        };
        replay(alone, &stream, &options, &part)
    }

    /// Renders with each of `built`, again and again, taking turns: seconds and statistics of each. Every image is
    /// compared with `expected`, or, if there is none, with the first.
    pub(super) fn renders(
        &self,
        built: &[PreparedScene],
        threads: Option<usize>,
        expected: &mut Option<Image>,
    ) -> Result<Vec<(Vec<f64>, Statistics)>, LabError> {
        let options = RenderOptions {
            spp: Some(self.options.spp),
            seed: Some(self.options.seed),
            threads,
            ..RenderOptions::thesis()
        };
        let mut results: Vec<(Vec<f64>, Option<Statistics>)> = built.iter().map(|_| (vec![], None)).collect();
        for _ in self.repetitions() {
            for (built, (seconds, last)) in built.iter().zip(&mut results) {
                let rendering = built.render(&options, &Part(self.progress))?;
                let expected = expected.get_or_insert_with(|| rendering.image.clone());
                if !same_bits(expected, &rendering.image) {
                    let (method, threads) = (built.method(), rendering.statistics.threads);
                    return Err(LabError::WrongImage(format!("{method} on {threads} threads differs from the first")));
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

/// Parts of a build by name.
pub(super) const VOXELS: &str = "voxels";
pub(super) const FIELD: &str = "field";
pub(super) const NEIGHBOURHOODS: &str = "neighbourhoods";

impl Builds {
    /// Seconds of voxelization, which all methods do alike.
    pub(super) fn voxelization(&self) -> Vec<f64> {
        self.0.iter().flat_map(|(method, _)| self.seconds(*method, VOXELS)).collect()
    }

    /// Seconds of a part of a method, for each repetition.
    pub(super) fn seconds(&self, method: Method, part: &str) -> Vec<f64> {
        self.parts(method, part).map(|p| p.seconds).collect()
    }

    /// Bytes of a part of a method: the same in each repetition.
    pub(super) fn bytes(&self, method: Method, part: &str) -> Vec<f64> {
        self.parts(method, part).take(1).map(|p| p.bytes as f64).collect()
    }

    /// Bytes of all parts of a method.
    pub(super) fn all_bytes(&self, method: Method) -> f64 {
        self.of(method).next().map_or(0.0, |r| r.bytes() as f64)
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

    fn parts<'a>(&'a self, method: Method, part: &'a str) -> impl Iterator<Item = &'a vdf_visibility::BuiltPart> {
        self.of(method).flat_map(|r| &r.parts).filter(move |p| p.name == part)
    }
}
