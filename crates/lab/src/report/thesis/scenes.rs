//! The measurements behind Tables 6.4 to 6.11.

use serde::{Deserialize, Serialize, de::DeserializeOwned};
use vdf_image::Image;
use vdf_render::{Integrator, PreparedScene, RenderOptions};
use vdf_visibility::{Method, QueryKind};

use super::{
    super::bench::median,
    INTEGRATORS, SPP, ThesisScene,
    bench::{Bench, spread, total},
    store::by_name,
};
use crate::{LabError, queries::MethodReplay, report::page::Picture};

/// A scene of Tables 6.4 to 6.11.
pub(super) struct SceneResult {
    pub(super) name: &'static str,
    pub(super) picture: Picture,
    pub(super) settings: Vec<SettingResult>,
}

/// A scene with an integrator, and all that was measured of it.
pub(super) struct SettingResult {
    pub(super) integrator: Integrator,
    pub(super) alone: Alone,
    /// `T_render` of the hierarchy alone in seconds, scaled: median of its turns between the methods; and their spread.
    pub(super) t_render: f64,
    pub(super) spread: f64,
    /// On all threads.
    pub(super) threaded: Option<Threaded>,
    pub(super) methods: Vec<MethodResult>,
}

/// A scene with an integrator and the hierarchy alone, and the replay of all methods: a cell.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Alone {
    /// N, scaled.
    pub(super) n: f64,
    pub(super) p_sp: f64,
    /// Share of the recorded queries that are superficial and unoccluded.
    pub(super) superficial_unoccluded: f64,
    /// `T_render` in seconds, scaled.
    t_render: f64,
    /// Nanoseconds of a query, of a spatial one, and of another, by the hierarchy.
    pub(super) t_query_each: f64,
    t_spatial: f64,
    t_other: f64,
    replayed: Vec<Replayed>,
}

impl Alone {
    /// `T_query` of the hierarchy in seconds, scaled.
    pub(super) fn t_query(&self) -> f64 {
        total(self.n, self.p_sp, self.t_spatial, self.t_other)
    }
}

/// What the replay says of a method's spatial queries, in nanoseconds.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Replayed {
    #[serde(with = "by_name")]
    method: Method,
    voxel_size: f64,
    grid: [u32; 3],
    pub(super) t_acc: f64,
    pub(super) t_acc_derived: f64,
    t_effective: f64,
}

/// A method with a voxel size in such a setting: a cell.
#[derive(Clone, Serialize, Deserialize)]
struct MethodCell {
    /// `T_build` in seconds.
    t_build: f64,
    /// `T_render` without it in seconds, not scaled, and the spread of the renders.
    t_render: f64,
    spread: f64,
    p_acc_sp: f64,
    /// On all threads.
    threaded: Option<Threaded>,
}

/// The same with what the replay says.
pub(super) struct MethodResult {
    pub(super) method: &'static str,
    pub(super) voxel_size: f64,
    pub(super) grid: [u32; 3],
    pub(super) replay: Replayed,
    /// `T_build` in seconds.
    pub(super) t_build: f64,
    /// With `T_build`, as in the thesis; scaled but for that.
    pub(super) t_render: f64,
    /// Spread of the renders.
    pub(super) spread: f64,
    /// Scaled.
    pub(super) t_query: f64,
    /// On all threads.
    pub(super) threaded: Option<Threaded>,
    /// Of the render, all of whose queries count; the replay has some of them.
    pub(super) p_acc_sp: f64,
}

/// `T_build` and `T_render` (with it) on all threads, where they are more than one. In seconds, scaled as on one
/// thread.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(super) struct Threaded {
    pub(super) t_build: f64,
    pub(super) t_render: f64,
}

/// `T_render` of the hierarchy alone in its turn between the methods, scaled, on one thread and on all: a cell.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct Turn {
    one: f64,
    all: Option<f64>,
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
        let kept = Kept { name: scene.name, checksum: alone.scene().checksum() };
        let sizes = self.sizes(scene);
        let mut settings = Vec::new();
        for integrator in INTEGRATORS {
            settings.push(self.alone(&kept, &alone, integrator, &sizes)?);
        }
        let images: Vec<&Image> = settings.iter().map(|(_, image)| image).collect();
        // The hierarchy alone takes turns with the methods, which are compared with it.
        let mut turns: Vec<Vec<Turn>> =
            settings.iter().map(|(alone, _)| vec![Turn { one: alone.t_render, all: None }]).collect();
        let mut methods: Vec<Vec<MethodResult>> = INTEGRATORS.iter().map(|_| vec![]).collect();
        for &size in &sizes {
            for (k, &method) in self.methods.iter().enumerate() {
                if k % 4 == 0 {
                    self.step(scene.name, &format!("none {size}"));
                    let measured = self.for_each_setting(
                        &kept,
                        &format!("turn {k} of none {size}"),
                        || Ok(Built { one: self.build(&alone, Method::NONE, size, 1)?, t_build_all: 0.0 }),
                        |built, i| self.turn(built, INTEGRATORS[i], images[i]),
                    )?;
                    turns.iter_mut().zip(measured).for_each(|(turns, turn)| turns.push(turn));
                }
                self.step(scene.name, &format!("{method} {size}"));
                let measured = self.for_each_setting(
                    &kept,
                    &format!("{method} {size}"),
                    || self.built(&alone, method, size),
                    |built, i| self.method(built, INTEGRATORS[i], images[i]),
                )?;
                for (i, cell) in measured.into_iter().enumerate() {
                    methods[i].extend(self.result(&settings[i].0, method, size, &cell));
                    self.done();
                }
            }
        }
        let [.., last] = INTEGRATORS;
        let last_image = settings.last().map_or_else(|| Image::new(1, 1), |(_, image)| image.clone());
        let picture = Picture::new(&last_image, format!("{}, {last}, {SPP} samples per pixel", scene.name))?;
        let all = settings.into_iter().zip(INTEGRATORS).zip(turns.into_iter().zip(methods));
        let settings = all.map(|(((alone, _), integrator), (turns, methods))| {
            let one: Vec<f64> = turns.iter().map(|t| t.one).collect();
            let all: Vec<f64> = turns.iter().filter_map(|t| t.all).collect();
            let threaded = (!all.is_empty()).then(|| Threaded { t_build: 0.0, t_render: median(&all) });
            SettingResult { integrator, alone, t_render: median(&one), spread: spread(&one), threaded, methods }
        });
        Ok(SceneResult { name: scene.name, picture, settings: settings.collect() })
    }

    /// A cell for each integrator; what they share is built only if one of them is missing.
    fn for_each_setting<T: Serialize + DeserializeOwned>(
        &self,
        kept: &Kept,
        what: &str,
        build: impl Fn() -> Result<Built, LabError>,
        measure: impl Fn(&Built, usize) -> Result<T, LabError>,
    ) -> Result<Vec<T>, LabError> {
        let mut built = None;
        let mut cells = Vec::new();
        for (i, integrator) in INTEGRATORS.into_iter().enumerate() {
            cells.push(self.store.cell(&kept.cell(&format!("{integrator} {what}")), || {
                let built = match &mut built {
                    Some(built) => built,
                    none => none.insert(build()?),
                };
                measure(built, i)
            })?);
        }
        Ok(cells)
    }

    /// An integrator with the hierarchy alone, and the replay of all methods; and its image.
    fn alone(
        &self,
        kept: &Kept,
        alone: &PreparedScene,
        integrator: Integrator,
        sizes: &[f64],
    ) -> Result<(Alone, Image), LabError> {
        let options = self.options(integrator, SPP);
        self.step(kept.name, &format!("{integrator} none"));
        let name = kept.cell(&integrator.to_string());
        let mut rendered = None;
        // What an image stands for is in its cell; an image alone is as good as none.
        let image = self.store.find::<Alone>(&name).and_then(|_| self.store.image(&name));
        let image = match image {
            Some(image) => image,
            None => {
                let (image, (s, _)) = self.render(alone, &options)?;
                self.store.keep_image(&name, &image)?;
                rendered = Some(s);
                image
            }
        };
        self.done();
        let cell = self.store.cell(&name, || {
            let s = match rendered.take() {
                Some(s) => s,
                None => self.render(alone, &options)?.1.0,
            };
            self.step(kept.name, &format!("{integrator} queries"));
            let stream = self.record(alone, &options)?;
            let replay = self.replay(alone, &stream, self.methods, sizes, 5)?;
            let superficial = stream.queries.iter().zip(&stream.unoccluded);
            let superficial = superficial.filter(|(q, unoccluded)| **unoccluded && q.kind == QueryKind::Superficial);
            let hierarchy = &replay.hierarchy;
            Ok(Alone {
                n: self.scale() * s.queries as f64,
                p_sp: s.p_spatial.unwrap_or(0.0),
                superficial_unoccluded: superficial.count() as f64 / stream.queries.len() as f64,
                t_render: self.scale() * s.t_render,
                t_query_each: hierarchy.t_query,
                t_spatial: hierarchy.t_spatial(),
                t_other: hierarchy.t_other(),
                replayed: replay.methods.iter().filter_map(Replayed::of).collect(),
            })
        })?;
        self.done();
        Ok((cell, image))
    }

    /// A turn of the hierarchy alone.
    fn turn(&self, none: &Built, integrator: Integrator, expected: &Image) -> Result<Turn, LabError> {
        let options = self.options(integrator, SPP);
        let (s, _) = self.render_same(&none.one, &options, expected)?;
        let all = self.threaded(none, &options, expected)?.map(|all| all.t_render);
        Ok(Turn { one: self.scale() * s.t_render, all })
    }

    /// A method on one thread, and how long it takes on all.
    fn built(&self, alone: &PreparedScene, method: Method, size: f64) -> Result<Built, LabError> {
        let t_build_all = if self.threads > 1 {
            self.build(alone, method, size, self.threads)?.build_report().seconds()
        } else {
            0.0
        };
        Ok(Built { one: self.build(alone, method, size, 1)?, t_build_all })
    }

    fn method(&self, built: &Built, integrator: Integrator, expected: &Image) -> Result<MethodCell, LabError> {
        let options = self.options(integrator, SPP);
        let (s, spread) = self.render_same(&built.one, &options, expected)?;
        Ok(MethodCell {
            t_build: s.t_build,
            t_render: s.t_render,
            spread,
            p_acc_sp: s.p_accelerated_given_spatial.unwrap_or(0.0),
            threaded: self.threaded(built, &options, expected)?,
        })
    }

    /// `None` for a method that was not replayed.
    fn result(&self, alone: &Alone, method: Method, size: f64, cell: &MethodCell) -> Option<MethodResult> {
        let replay = alone.replayed.iter().find(|m| m.method == method && m.voxel_size == size).copied()?;
        Some(MethodResult {
            method: method.name(),
            voxel_size: size,
            grid: replay.grid,
            t_build: cell.t_build,
            t_render: self.scale() * cell.t_render + cell.t_build,
            spread: cell.spread,
            t_query: total(alone.n, alone.p_sp, replay.t_effective, alone.t_other),
            threaded: cell.threaded,
            p_acc_sp: cell.p_acc_sp,
            replay,
        })
    }

    /// The same on all threads, if they are more than one.
    fn threaded(&self, built: &Built, options: &RenderOptions, expected: &Image) -> Result<Option<Threaded>, LabError> {
        if self.threads <= 1 {
            return Ok(None);
        }
        let options = RenderOptions { threads: Some(self.threads), ..options.clone() };
        let (s, _) = self.render_same(&built.one, &options, expected)?;
        let t_build = built.t_build_all;
        Ok(Some(Threaded { t_build, t_render: self.scale() * s.t_render + t_build }))
    }
}

/// What the cells of a scene are named after.
pub(super) struct Kept {
    pub(super) name: &'static str,
    pub(super) checksum: u32,
}

impl Kept {
    pub(super) fn cell(&self, what: &str) -> String {
        format!("{} {:08x} {what}", self.name, self.checksum)
    }
}

impl Replayed {
    fn of(m: &MethodReplay) -> Option<Self> {
        let spatial = m.spatial()?;
        Some(Self {
            method: m.method.parse().ok()?,
            voxel_size: m.voxel_size,
            grid: m.grid,
            t_acc: spatial.t_acc.median,
            t_acc_derived: spatial.t_acc_derived,
            t_effective: spatial.t_effective.median,
        })
    }
}
