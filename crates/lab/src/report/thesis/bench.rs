//! How it is measured: scenes, builds, renders and replays as the thesis's tables want them.

use vdf_image::Image;
use vdf_render::{
    GridExtent, Integrator, PrepareOptions, PreparedScene, Progress, RenderOptions, Roulette, Statistics,
};
use vdf_scene::{LoadOptions, Scene};
use vdf_scenes::builtin;
use vdf_visibility::Method;

use super::{
    super::bench::{median, same_bits},
    SIDE,
    store::Store,
};
use crate::{
    LabError,
    progress::{Part, look},
    queries::{QueryStream, Replay, ReplayOptions, record_queries, replay},
};

/// Renders that together take less are repeated, up to five times, and the median taken; two there are always, for the spread. In seconds.
const SHORT: f64 = 0.2;

/// The thesis's grids cover the whole scene (5.2).
const GRID: GridExtent = GridExtent::Scene;

/// How and with what it is measured.
pub(super) struct Bench<'a> {
    pub(super) progress: &'a dyn Progress,
    pub(super) methods: &'a [Method],
    /// Side of the images in pixels.
    pub(super) side: u32,
    pub(super) quick: bool,
    pub(super) seed: u64,
    /// Threads of the renders beside those on one thread; 1 if there are none.
    pub(super) threads: usize,
    /// What was measured by an earlier run.
    pub(super) store: Store,
}

/// Statistics of the render of median time, and how far the times are apart: (greatest − least) / median.
pub(super) type Spread<T> = (T, f64);

impl Bench<'_> {
    /// By how much the thesis's images are larger.
    pub(super) fn scale(&self) -> f64 {
        (f64::from(SIDE) / f64::from(self.side)).powi(2)
    }

    /// A step begins.
    pub(super) fn step(&self, scene: &str, what: &str) {
        self.progress.phase(&format!("{scene} {what}"));
    }

    /// It is done.
    pub(super) fn done(&self) {
        self.progress.work_done(1);
    }

    /// A built-in scene with the hierarchy alone.
    pub(super) fn prepare(&self, name: &str) -> Result<PreparedScene, LabError> {
        self.step(name, "loading");
        let source = builtin(name).ok_or_else(|| LabError::UnknownScene(name.to_owned()))?;
        let define = |name: &str| (name.to_owned(), self.side.to_string());
        let scene = Scene::from_source(
            &source,
            &LoadOptions { defines: vec![define("width"), define("height")], ..LoadOptions::default() },
        )?;
        Ok(PreparedScene::new(scene, &PrepareOptions::with_method(Method::NONE), &Part(self.progress))?)
    }

    /// A render on one thread.
    pub(super) fn options(&self, integrator: Integrator, spp: u32) -> RenderOptions {
        RenderOptions {
            integrator,
            spp: Some(spp),
            seed: Some(self.seed),
            threads: Some(1),
            roulette: Roulette::Thesis,
            segment_first: false,
            ..RenderOptions::thesis()
        }
    }

    pub(super) fn build(
        &self,
        alone: &PreparedScene,
        method: Method,
        size: f64,
        threads: usize,
    ) -> Result<PreparedScene, LabError> {
        look(self.progress)?;
        let threads = Some(threads);
        let options =
            PrepareOptions { voxel_size: Some(size), grid: GRID, threads, ..PrepareOptions::with_method(method) };
        Ok(alone.with_options(&options, &Part(self.progress))?)
    }

    /// Two renders or more: the image, and the statistics with the median of the times.
    pub(super) fn render(
        &self,
        prepared: &PreparedScene,
        options: &RenderOptions,
    ) -> Result<(Image, Spread<Statistics>), LabError> {
        let mut times = Vec::new();
        loop {
            let rendering = prepared.render(options, &Part(self.progress))?;
            times.push(rendering.statistics.t_render);
            if times.len() == 5 || (times.len() >= 2 && times.iter().sum::<f64>() >= SHORT) {
                let statistics = Statistics { t_render: median(&times), ..rendering.statistics };
                return Ok((rendering.image, (statistics, spread(&times))));
            }
        }
    }

    /// The same, and fails unless the image is the one expected, bit by bit.
    pub(super) fn render_same(
        &self,
        prepared: &PreparedScene,
        options: &RenderOptions,
        expected: &Image,
    ) -> Result<Spread<Statistics>, LabError> {
        let (image, (statistics, spread)) = self.render(prepared, options)?;
        if same_bits(&image, expected) {
            return Ok((statistics, spread));
        }
        let Statistics { method, threads, .. } = statistics;
        let size = statistics.voxel_size.unwrap_or_default();
        Err(LabError::WrongImage(format!(
            "{} with {method}, voxel {size} and {threads} threads differs from none with one thread",
            options.integrator
        )))
    }

    /// Queries of this render, on all threads; some of them are spatial.
    pub(super) fn record(&self, alone: &PreparedScene, options: &RenderOptions) -> Result<QueryStream, LabError> {
        let most = if self.quick { 20_000 } else { 200_000 };
        let options = RenderOptions { threads: None, ..options.clone() };
        let stream = record_queries(alone, &options, most, &Part(self.progress))?;
        if stream.spatial() == 0 {
            let help = "the tables of the thesis are about spatial queries; render larger images";
            return Err(LabError::NoQueries { kind: "spatial", help });
        }
        Ok(stream)
    }

    pub(super) fn replay(
        &self,
        alone: &PreparedScene,
        stream: &QueryStream,
        methods: &[Method],
        sizes: &[f64],
        passes: u32,
    ) -> Result<Replay, LabError> {
        let options = ReplayOptions {
            methods: methods.to_vec(),
            voxel_sizes: sizes.to_vec(),
            grid: GRID,
            passes,
            ..ReplayOptions::default()
        };
        replay(alone, stream, &options, &Part(self.progress))
    }
}

/// `T_query` in seconds of `n` queries, of which the spatial ones take `t_spatial` ns and the others `t_other`, as in the replay.
pub(super) fn total(n: f64, p_sp: f64, t_spatial: f64, t_other: f64) -> f64 {
    1e-9 * n * (p_sp * t_spatial + (1.0 - p_sp) * t_other)
}

/// (greatest − least) / median; 0 of one value.
pub(super) fn spread(values: &[f64]) -> f64 {
    let (least, greatest) = values.iter().fold((f64::INFINITY, 0.0_f64), |(l, g), &v| (l.min(v), g.max(v)));
    if values.len() < 2 { 0.0 } else { (greatest - least) / median(values) }
}
