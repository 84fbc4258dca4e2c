//! The measurements behind Tables 6.4 to 6.11.

use vdf_image::Image;
use vdf_render::{Integrator, PreparedScene, RenderOptions};
use vdf_visibility::Method;

use super::{
    super::bench::median,
    INTEGRATORS, SPP, ThesisScene,
    bench::{Bench, total},
};
use crate::{
    LabError,
    queries::{ProofReplay, Replay},
    report::page::Picture,
};

/// A scene of Tables 6.4 to 6.11.
pub(super) struct SceneResult {
    pub(super) name: &'static str,
    pub(super) picture: Picture,
    pub(super) settings: Vec<SettingResult>,
}

/// A scene with an integrator.
pub(super) struct SettingResult {
    pub(super) integrator: Integrator,
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
    pub(super) method: &'static str,
    pub(super) voxel_size: f64,
    pub(super) grid: [u32; 3],
    /// Its spatial queries.
    pub(super) replay: ProofReplay,
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

/// `T_build` and `T_render` (with it) on all threads, where they are more than one. In seconds, scaled as on one
/// thread.
#[derive(Clone, Copy)]
pub(super) struct Threaded {
    pub(super) t_build: f64,
    pub(super) t_render: f64,
}

/// `T_render` of the hierarchy alone, measured between the methods, on one thread and on all.
struct Turns {
    one: Vec<f64>,
    all: Vec<f64>,
}

/// A method that was built on one thread, and how long it takes on all.
struct Built {
    one: PreparedScene,
    t_build_all: f64,
}

impl Bench<'_> {
    fn sizes(&self, scene: &ThesisScene) -> Vec<f64> {
        if self.quick { vec![scene.sizes[1]] } else { scene.sizes.to_vec() }
    }

    /// How many steps so many scenes take.
    pub(super) fn scene_steps(&self, scenes: usize) -> usize {
        let sizes = if self.quick { 1 } else { 3 };
        scenes * INTEGRATORS.len() * (2 + sizes * self.methods.len())
    }

    /// All of Tables 6.4 to 6.11 for a scene. One method exists at a time.
    pub(super) fn scene(&self, scene: &ThesisScene) -> Result<SceneResult, LabError> {
        let alone = self.prepare(scene.name)?;
        let sizes = self.sizes(scene);
        let mut settings = Vec::new();
        let mut images: Vec<Image> = Vec::new();
        for integrator in INTEGRATORS {
            let (setting, image) = self.alone(scene.name, &alone, integrator, &sizes)?;
            settings.push(setting);
            images.push(image);
        }
        // The hierarchy alone takes turns with the methods, which are compared with it.
        let mut turns: Vec<Turns> = settings.iter().map(|s| Turns { one: vec![s.t_render], all: vec![] }).collect();
        for &size in &sizes {
            for (k, &method) in self.methods.iter().enumerate() {
                if k % 4 == 0 {
                    self.step(scene.name, &format!("none {size}"));
                    let again = Built { one: self.build(&alone, Method::NONE, size, 1)?, t_build_all: 0.0 };
                    for ((setting, image), turns) in settings.iter().zip(&images).zip(&mut turns) {
                        let options = self.options(setting.integrator, SPP);
                        let s = self.render_same(&again.one, &options, image)?;
                        turns.one.push(self.scale() * s.t_render);
                        turns.all.extend(self.threaded(&again, &options, image)?.map(|all| all.t_render));
                    }
                }
                self.step(scene.name, &format!("{method} {size}"));
                let t_build_all = if self.threads > 1 {
                    self.build(&alone, method, size, self.threads)?.build_report().seconds()
                } else {
                    0.0
                };
                let built = Built { one: self.build(&alone, method, size, 1)?, t_build_all };
                for (setting, image) in settings.iter_mut().zip(&images) {
                    let result = self.method(&built, size, setting, image)?;
                    setting.methods.extend(result);
                    self.done();
                }
            }
        }
        for (setting, turns) in settings.iter_mut().zip(&turns) {
            setting.t_render = median(&turns.one);
            let all = || Threaded { t_build: 0.0, t_render: median(&turns.all) };
            setting.threaded = (!turns.all.is_empty()).then(all);
        }
        let image = images.pop().unwrap_or_else(|| Image::new(1, 1));
        let [.., last] = INTEGRATORS;
        let picture = Picture::new(&image, format!("{}, {last}, {SPP} samples per pixel", scene.name))?;
        Ok(SceneResult { name: scene.name, picture, settings })
    }

    /// An integrator with the hierarchy alone, and the replay of all methods.
    fn alone(
        &self,
        name: &str,
        alone: &PreparedScene,
        integrator: Integrator,
        sizes: &[f64],
    ) -> Result<(SettingResult, Image), LabError> {
        let options = self.options(integrator, SPP);
        self.step(name, &format!("{integrator} queries"));
        let stream = self.record(alone, &options)?;
        let replay = self.replay(alone, &stream, self.methods, sizes, 5)?;
        self.done();
        self.step(name, "none");
        let (image, s) = self.render(alone, &options)?;
        self.done();
        let (n, p_sp) = (self.scale() * s.queries as f64, s.p_spatial.unwrap_or(0.0));
        let setting = SettingResult {
            integrator,
            n,
            p_sp,
            t_render: self.scale() * s.t_render,
            t_query: total(n, p_sp, &replay, replay.hierarchy.t_spatial()),
            threaded: None,
            replay,
            methods: vec![],
        };
        Ok((setting, image))
    }

    /// `None` for a method that was not replayed.
    fn method(
        &self,
        built: &Built,
        size: f64,
        setting: &SettingResult,
        expected: &Image,
    ) -> Result<Option<MethodResult>, LabError> {
        let options = self.options(setting.integrator, SPP);
        let s = self.render_same(&built.one, &options, expected)?;
        let found = setting.replay.methods.iter().find(|m| m.method == s.method && m.voxel_size == size);
        let Some((found, &replay)) = found.and_then(|m| Some((m, m.spatial()?))) else { return Ok(None) };
        Ok(Some(MethodResult {
            method: found.method,
            voxel_size: size,
            grid: found.grid,
            t_build: s.t_build,
            t_render: self.scale() * s.t_render + s.t_build,
            t_query: total(setting.n, setting.p_sp, &setting.replay, replay.t_effective.median),
            threaded: self.threaded(built, &options, expected)?,
            p_acc_sp: s.p_accelerated_given_spatial.unwrap_or(0.0),
            replay,
        }))
    }

    /// The same on all threads, if they are more than one.
    fn threaded(&self, built: &Built, options: &RenderOptions, expected: &Image) -> Result<Option<Threaded>, LabError> {
        if self.threads <= 1 {
            return Ok(None);
        }
        let options = RenderOptions { threads: Some(self.threads), ..options.clone() };
        let s = self.render_same(&built.one, &options, expected)?;
        let t_build = built.t_build_all;
        Ok(Some(Threaded { t_build, t_render: self.scale() * s.t_render + t_build }))
    }
}
