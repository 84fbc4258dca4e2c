//! The measurements behind the tables.

use anyhow::anyhow;
use vdf_render::{
    Acceleration, BuildReport, Image, IntegratorKind, Method, Prepared, Progress as _, RenderOptions, Statistics,
    World, encode_png,
    queries::{MethodReplay, QueryStream, Replay, ReplayOptions, TimerInfluence, record_queries, replay},
    render_prepared,
    scene::{LoadOptions, Scene, builtin},
};

use super::{
    SETTINGS, SIDE, SPP, ThesisScene,
    data::{Measured, Repeated},
};
use crate::{
    commands::report::{
        bench::{pool, same_bits},
        page::Picture,
        queries::integrator_name,
    },
    failure::Failure,
    progress::{Part, Reporter},
};

/// How and with what it is measured.
pub(super) struct Bench<'a> {
    pub(super) reporter: &'a Reporter,
    pub(super) methods: &'a [Method],
    pub(super) side: u32,
    pub(super) quick: bool,
    pub(super) seed: u64,
    /// Threads of the renders beside those on one thread; 1 if there are none.
    pub(super) threads: usize,
}

/// A scene of Tables 6.4 to 6.11.
pub(super) struct SceneResult {
    pub(super) name: &'static str,
    pub(super) picture: Picture,
    pub(super) settings: Vec<SettingResult>,
}

/// A scene with an integrator.
pub(super) struct SettingResult {
    pub(super) samples: Option<u32>,
    /// N, scaled.
    pub(super) n: f64,
    pub(super) p_sp: f64,
    /// `T_render` (median of several) and `T_query` of the hierarchy alone in seconds, scaled.
    pub(super) t_render: f64,
    pub(super) t_query: f64,
    /// On all threads.
    pub(super) threaded: Option<Threaded>,
    pub(super) replay: Replay,
    pub(super) methods: Vec<MethodResult>,
}

/// A method with a voxel size in such a setting.
pub(super) struct MethodResult {
    pub(super) replay: MethodReplay,
    /// `T_build` in seconds.
    pub(super) t_build: f64,
    /// With `T_build`, as in the thesis; scaled but for that.
    pub(super) t_render: f64,
    /// Scaled.
    pub(super) t_query: f64,
    /// On all threads.
    pub(super) threaded: Option<Threaded>,
    /// Of the render, all of whose queries count; the replay has some of them.
    pub(super) p_acc_sp: f64,
}

/// `T_build` and `T_render` (with it) on all threads, where they are more than one. In seconds, scaled as on one thread.
#[derive(Clone, Copy)]
pub(super) struct Threaded {
    pub(super) t_build: f64,
    pub(super) t_render: f64,
}

/// A setting of Table 6.1 and its runs: `T_build`, `T_render`, `T_query`.
pub(super) struct RepeatedResult<'a> {
    pub(super) setting: &'a Repeated,
    pub(super) runs: Vec<[f64; 3]>,
}

/// A setting of Table 6.2.
pub(super) struct MeasuredResult<'a> {
    pub(super) setting: &'a Measured,
    /// Median of `T_render` in renders whose queries were not recorded, and in renders whose queries were.
    pub(super) without: f64,
    pub(super) with: f64,
    pub(super) t_query: f64,
    /// Nanoseconds a query of the hierarchy, without timers and with.
    pub(super) t_spatial: f64,
    pub(super) timer: TimerInfluence,
}

/// A scene, ready to be rendered.
struct Ready {
    scene: Scene,
    world: World,
}

/// `T_render` of the hierarchy alone, measured between the methods, on one thread and on all.
struct Turns {
    one: Vec<f64>,
    all: Vec<f64>,
}

/// What was built on one thread and on all, the same but for the time it took.
struct Structures<'a> {
    one: &'a (Acceleration, BuildReport),
    all: &'a (Acceleration, BuildReport),
}

/// Renders that alternate for Table 6.2.
const ALTERNATIONS: usize = 3;

/// A render that takes less is repeated, up to five times, and the median taken.
const SHORT: f64 = 0.2;

impl Bench<'_> {
    /// By how much the thesis's images are larger.
    pub(super) fn scale(&self) -> f64 {
        (f64::from(SIDE) / f64::from(self.side)).powi(2)
    }

    /// Runs of each setting of Table 6.1.
    const fn runs(&self) -> usize {
        if self.quick { 3 } else { 8 }
    }

    fn sizes(&self, scene: &ThesisScene) -> Vec<f64> {
        if self.quick { vec![scene.sizes[1]] } else { scene.sizes.to_vec() }
    }

    /// How many steps it all takes.
    pub(super) fn work(&self, scenes: usize, repeated: usize, measured: usize) -> u64 {
        let sizes = if self.quick { 1 } else { 3 };
        let scene = SETTINGS.len() * (2 + sizes * self.methods.len());
        (scenes * scene + repeated * (1 + self.runs()) + measured * (1 + 2 * ALTERNATIONS)) as u64
    }

    /// A step begins.
    fn step(&self, scene: &str, what: &str) {
        self.reporter.phase(&format!("{scene} {what}"));
    }

    /// It is done.
    fn done(&self) {
        self.reporter.work_done(1);
    }

    fn ready(&self, name: &str) -> Result<Ready, Failure> {
        self.step(name, "loading");
        let source = builtin(name).ok_or_else(|| Failure::Usage(anyhow!("no built-in scene is called '{name}'")))?;
        let define = |name: &str| (name.to_owned(), self.side.to_string());
        let scene = Scene::from_source(&source, &LoadOptions { defines: vec![define("width"), define("height")] })?;
        let world = World::new(&scene);
        Ok(Ready { scene, world })
    }

    fn options(&self, method: Method, voxel_size: f64, samples: Option<u32>, spp: u32) -> RenderOptions {
        RenderOptions {
            method,
            voxel_size: Some(voxel_size),
            integrator: samples
                .map_or(IntegratorKind::Volpath, |n| IntegratorKind::Raymarch { samples_per_segment: n }),
            spp: Some(spp),
            seed: Some(self.seed),
            threads: Some(1),
            segment_first: false,
            ..RenderOptions::default()
        }
    }

    fn build(&self, ready: &Ready, options: &RenderOptions) -> Result<(Acceleration, BuildReport), Failure> {
        let pool = pool(options.threads)?;
        let size = options.voxel_size.unwrap_or(1.0);
        let Ready { scene, world } = ready;
        let build = || {
            Acceleration::build(
                options.method,
                &world.triangles,
                world.bounds,
                &scene.light_shapes(),
                size,
                options.max_voxels,
            )
        };
        Ok(pool.install(build).map_err(vdf_render::RenderError::from)?)
    }

    /// One render, or the one of median time of several short ones.
    fn render(
        &self,
        ready: &Ready,
        built: &(Acceleration, BuildReport),
        options: &RenderOptions,
    ) -> Result<(Image, Statistics), Failure> {
        let prepared = Prepared { world: &ready.world, t_hierarchy: 0.0, acceleration: &built.0, build: &built.1 };
        let mut times = Vec::new();
        loop {
            let rendering = render_prepared(&ready.scene, &prepared, options, &Part(self.reporter))?;
            times.push(rendering.statistics.t_render);
            if times.len() == 5 || times.iter().sum::<f64>() >= SHORT {
                let statistics = Statistics { t_render: median(&times), ..rendering.statistics };
                return Ok((rendering.image, statistics));
            }
        }
    }

    fn record(&self, ready: &Ready, options: &RenderOptions) -> Result<QueryStream, Failure> {
        let most = if self.quick { 20_000 } else { 200_000 };
        let options = RenderOptions { threads: None, ..options.clone() };
        Ok(record_queries(&ready.scene, &ready.world, &options, most, &Part(self.reporter))?)
    }

    fn replay(
        &self,
        ready: &Ready,
        stream: &QueryStream,
        methods: &[Method],
        sizes: &[f64],
        passes: u32,
    ) -> Result<Replay, Failure> {
        let options = ReplayOptions {
            methods: methods.to_vec(),
            voxel_sizes: sizes.to_vec(),
            passes,
            ..ReplayOptions::default()
        };
        Ok(replay(&ready.scene, &ready.world, stream, &options, &Part(self.reporter))?)
    }

    /// All of Tables 6.4 to 6.11 for a scene.
    pub(super) fn scene(&self, scene: &ThesisScene) -> Result<SceneResult, Failure> {
        let ready = self.ready(scene.name)?;
        let sizes = self.sizes(scene);
        let mut settings = Vec::new();
        let mut images: Vec<Image> = Vec::new();
        for samples in SETTINGS {
            let options = self.options(Method::None, 1.0, samples, SPP);
            self.step(scene.name, &format!("{} queries", integrator_name(samples)));
            let stream = self.record(&ready, &options)?;
            let replay = self.replay(&ready, &stream, self.methods, &sizes, 5)?;
            self.done();
            self.step(scene.name, "none");
            let (image, s) = self.render(&ready, &self.build(&ready, &options)?, &options)?;
            self.done();
            let (n, p_sp) = (self.scale() * s.queries as f64, s.p_spatial.unwrap_or(0.0));
            settings.push(SettingResult {
                samples,
                n,
                p_sp,
                t_render: self.scale() * s.t_render,
                t_query: total(n, p_sp, &replay, replay.hierarchy.t_spatial.median),
                threaded: None,
                replay,
                methods: vec![],
            });
            images.push(image);
        }
        // The hierarchy alone takes turns with the methods, which are compared with it.
        let alone = self.build(&ready, &self.options(Method::None, 1.0, None, SPP))?;
        let mut turns: Vec<Turns> = settings.iter().map(|s| Turns { one: vec![s.t_render], all: vec![] }).collect();
        for &size in &sizes {
            for (k, &method) in self.methods.iter().enumerate() {
                if k % 4 == 0 {
                    self.step(scene.name, &format!("none {size}"));
                    for ((setting, image), turns) in settings.iter().zip(&images).zip(&mut turns) {
                        let options = self.options(Method::None, 1.0, setting.samples, SPP);
                        let (again, s) = self.render(&ready, &alone, &options)?;
                        same(&again, image, &options)?;
                        turns.one.push(self.scale() * s.t_render);
                        turns.all.extend(self.threaded(&ready, &alone, &options, image)?.map(|all| all.t_render));
                    }
                }
                self.step(scene.name, &format!("{method} {size}"));
                let options = self.options(method, size, None, SPP);
                let built = self.build(&ready, &options)?;
                let on_all = self.on_all_threads(&options).map(|o| self.build(&ready, &o)).transpose()?;
                let built = Structures { one: &built, all: on_all.as_ref().unwrap_or(&built) };
                for (setting, image) in settings.iter_mut().zip(&images) {
                    let result = self.method(&ready, &built, method, size, setting, image)?;
                    setting.methods.push(result);
                    self.done();
                }
            }
        }
        for (setting, turns) in settings.iter_mut().zip(&turns) {
            setting.t_render = median(&turns.one);
            let all = || Threaded { t_build: 0.0, t_render: median(&turns.all) };
            setting.threaded = (!turns.all.is_empty()).then(all);
        }
        let picture = picture(scene.name, images.last())?;
        Ok(SceneResult { name: scene.name, picture, settings })
    }

    fn method(
        &self,
        ready: &Ready,
        built: &Structures<'_>,
        method: Method,
        size: f64,
        setting: &SettingResult,
        expected: &Image,
    ) -> Result<MethodResult, Failure> {
        let options = self.options(method, size, setting.samples, SPP);
        let (image, s) = self.render(ready, built.one, &options)?;
        same(&image, expected, &options)?;
        let found = setting.replay.methods.iter().find(|m| m.method == method.name() && m.voxel_size == size);
        let replay = found.cloned().ok_or_else(|| Failure::Work(anyhow!("{method} was not replayed")))?;
        Ok(MethodResult {
            t_build: s.t_build,
            t_render: self.scale() * s.t_render + s.t_build,
            t_query: total(setting.n, setting.p_sp, &setting.replay, replay.t_effective.median),
            threaded: self.threaded(ready, built.all, &options, expected)?,
            p_acc_sp: s.p_accelerated_given_spatial.unwrap_or(0.0),
            replay,
        })
    }

    /// The same on all threads, if they are more than one.
    fn on_all_threads(&self, options: &RenderOptions) -> Option<RenderOptions> {
        (self.threads > 1).then(|| RenderOptions { threads: Some(self.threads), ..options.clone() })
    }

    fn threaded(
        &self,
        ready: &Ready,
        built: &(Acceleration, BuildReport),
        options: &RenderOptions,
        expected: &Image,
    ) -> Result<Option<Threaded>, Failure> {
        let Some(options) = self.on_all_threads(options) else { return Ok(None) };
        let (image, s) = self.render(ready, built, &options)?;
        same(&image, expected, &options)?;
        Ok(Some(Threaded { t_build: s.t_build, t_render: self.scale() * s.t_render + s.t_build }))
    }

    /// A setting of Table 6.1, measured again and again.
    pub(super) fn repeated<'a>(&self, setting: &'a Repeated) -> Result<RepeatedResult<'a>, Failure> {
        let ready = self.ready(&setting.scene)?;
        let method = thesis_method()?;
        let options = self.options(method, setting.voxel_size, setting.samples_per_segment, setting.samples_per_pixel);
        self.step(&setting.scene, "repeatability");
        let stream = self.record(&ready, &options)?;
        self.done();
        let run = || {
            let built = self.build(&ready, &options)?;
            let (_, s) = self.render(&ready, &built, &options)?;
            let replay = self.replay(&ready, &stream, &[method], &[setting.voxel_size], 1)?;
            let (n, p_sp) = (self.scale() * s.queries as f64, s.p_spatial.unwrap_or(0.0));
            let effective = replay.methods.first().map_or(0.0, |m| m.t_effective.median);
            self.done();
            Ok([s.t_build, self.scale() * s.t_render + s.t_build, total(n, p_sp, &replay, effective)])
        };
        let runs = (0..self.runs()).map(|_| run()).collect::<Result<_, Failure>>()?;
        Ok(RepeatedResult { setting, runs })
    }

    /// A setting of Table 6.2.
    pub(super) fn measured<'a>(&self, setting: &'a Measured) -> Result<MeasuredResult<'a>, Failure> {
        let ready = self.ready(&setting.scene)?;
        let method = thesis_method()?;
        let options = self.options(method, setting.voxel_size, setting.samples_per_segment, setting.samples_per_pixel);
        self.step(&setting.scene, "influence");
        let built = self.build(&ready, &options)?;
        let stream = self.record(&ready, &options)?;
        let replay = self.replay(&ready, &stream, &[method], &[setting.voxel_size], 5)?;
        self.done();
        let (mut without, mut with) = (Vec::new(), Vec::new());
        let mut t_query = 0.0;
        for i in 0..2 * ALTERNATIONS {
            let (_, s) = self.render(&ready, &built, &options)?;
            let t = self.scale() * s.t_render + s.t_build;
            // As `vdf render --record-queries` does: the pass that records comes after.
            if i % 2 == 1 {
                self.record(&ready, &options)?;
                with.push(t);
            } else {
                without.push(t);
            }
            let effective = replay.methods.first().map_or(0.0, |m| m.t_effective.median);
            t_query = total(self.scale() * s.queries as f64, s.p_spatial.unwrap_or(0.0), &replay, effective);
            self.done();
        }
        Ok(MeasuredResult {
            setting,
            without: median(&without),
            with: median(&with),
            t_query,
            t_spatial: replay.hierarchy.t_spatial.median,
            timer: replay.timer,
        })
    }
}

/// Fails unless the images are the same bit by bit.
fn same(image: &Image, expected: &Image, options: &RenderOptions) -> Result<(), Failure> {
    if same_bits(image, expected) {
        return Ok(());
    }
    let (size, threads) = (options.voxel_size.unwrap_or(1.0), options.threads.unwrap_or(0));
    Err(Failure::Work(anyhow!(
        "WRONG IMAGE: {:?} with {}, voxel {size} and {threads} threads differs from none with one thread",
        options.integrator,
        options.method
    )))
}

/// Tables 6.1 and 6.2 are about the non-directional distance field.
fn thesis_method() -> Result<Method, Failure> {
    "ndf".parse().map_err(|e| Failure::Work(anyhow!("{e}")))
}

/// `T_query` in seconds of `n` queries, of which the spatial ones take `t_spatial` ns.
fn total(n: f64, p_sp: f64, replay: &Replay, t_spatial: f64) -> f64 {
    let superficial = replay.hierarchy.t_superficial.map_or(0.0, |t| t.median);
    1e-9 * n * (p_sp * t_spatial + (1.0 - p_sp) * superficial)
}

pub(super) fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    if n == 0 { 0.0 } else { 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]) }
}

fn picture(name: &str, image: Option<&Image>) -> Result<Picture, Failure> {
    let image = image.ok_or_else(|| Failure::Work(anyhow!("{name} was not rendered")))?;
    let png = encode_png(image).map_err(|e| Failure::Work(anyhow!("{name}: {e}")))?;
    Ok(Picture::png(&png, [image.width, image.height], format!("{name}, volpath, {SPP} samples per pixel")))
}
