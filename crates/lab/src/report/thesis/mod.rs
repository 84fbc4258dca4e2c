//! The thesis report: chapter 6 of \[Houska2013\], measured again.
//!
//! *Idea.* Every figure stands beside that of the thesis, and the gain that inequality 2.7 predicts beside the gain
//! measured.
//!
//! *Limits.* `T_query` is N times the time of a query in a replay, not the sum of a timer in the loop, which distorts
//! both (6.2.2). Flights are not proved (`segment_first` is off), so that proofs only ever save visibility queries, as
//! there.

mod acceleration_tables;
mod bench;
mod data;
mod gain;
mod query_tables;
mod repeated;
mod repeated_tables;
mod scenes;
mod store;
mod timed;

use std::path::PathBuf;

use vdf_render::{Integrator, Progress};
use vdf_scenes::builtin;
use vdf_visibility::Method;

use self::{
    bench::Bench,
    data::ThesisData,
    repeated::{MeasuredResult, OverheadCell, RepeatedResult},
    scenes::SceneResult,
    store::Store,
};
use super::{
    MAX_THREADS, Report,
    bench::processors,
    figures::{About, Figure},
    page::{Page, Section},
    proving,
};
use crate::LabError;

/// Side of the thesis's images in pixels. It is not printed there; its numbers of queries fit this.
const SIDE: u32 = 512;

/// A scene of chapter 6, and the voxel sizes of its tables.
#[derive(Clone, Copy, Debug)]
struct ThesisScene {
    name: &'static str,
    sizes: [f64; 3],
}

/// The scenes of Tables 6.4 to 6.11.
const SCENES: [ThesisScene; 4] = [
    ThesisScene { name: "cbox_vol6", sizes: [4.0, 8.0, 16.0] },
    ThesisScene { name: "cbox_vol4", sizes: [4.0, 8.0, 16.0] },
    ThesisScene { name: "san-miguel", sizes: [0.25, 0.5, 1.0] },
    ThesisScene { name: "scape", sizes: [0.25, 0.5, 1.0] },
];

/// The integrators of these tables.
const INTEGRATORS: [Integrator; 4] =
    [Integrator::raymarch(1), Integrator::raymarch(7), Integrator::raymarch(49), Integrator::Volpath];

/// The integrator of Tables 6.3 and 6.4.
const MANY: Integrator = Integrator::raymarch(49);

/// Samples per pixel in these tables.
const SPP: u32 = 4;

/// What to measure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ThesisOptions {
    /// Scenes of [`ThesisOptions::SCENES`], in any order.
    pub scenes: Vec<String>,
    /// The methods, at least one that proves something; the hierarchy alone is measured in any case.
    pub methods: Vec<Method>,
    /// The middle voxel size only, fewer repetitions and queries.
    pub quick: bool,
    /// Side of the images in pixels, from 1 to 4096.
    pub size: u32,
    /// Seed of the renders.
    pub seed: u64,
    /// Number of all threads, whose renders stand beside those on one thread; by default one for each processor.
    pub threads: Option<usize>,
    /// Folder in which each figure is kept as soon as it is measured, and from which those are taken that are there.
    pub resume: Option<PathBuf>,
}

impl Default for ThesisOptions {
    /// Everything, in images of 512 × 512 pixels: most of a day.
    fn default() -> Self {
        Self {
            scenes: Self::SCENES.map(str::to_owned).to_vec(),
            methods: Method::with_voxels().collect(),
            quick: false,
            size: SIDE,
            seed: 0,
            threads: None,
            resume: None,
        }
    }
}

impl ThesisOptions {
    /// All scenes; the first two are in Tables 6.1 and 6.2 only.
    pub const SCENES: [&str; 6] = ["cbox_vol2", "cbox_vol3", "cbox_vol4", "cbox_vol6", "san-miguel", "scape"];

    /// A minute: images of 32 × 32 pixels, the middle voxel size only.
    #[must_use]
    pub fn quick() -> Self {
        Self { quick: true, size: 32, ..Self::default() }
    }

    fn threads(&self) -> usize {
        self.threads.unwrap_or_else(processors)
    }

    /// Checks all options.
    ///
    /// # Errors
    /// [`vdf_render::RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), LabError> {
        LabError::check_range("size", self.size.into(), 1, 4096)?;
        if proving(&self.methods).is_empty() {
            return Err(LabError::option("methods", "must name a method that proves something, such as amr-sn"));
        }
        if let Some(unknown) = self.scenes.iter().find(|s| !Self::SCENES.contains(&s.as_str())) {
            return Err(LabError::option(
                "scenes",
                format!("must be some of {}, not {unknown}", Self::SCENES.join(", ")),
            ));
        }
        LabError::check_range("threads", self.threads() as u64, 1, MAX_THREADS as u64)
    }
}

/// Measures the tables of the scenes that the options name.
///
/// # Errors
/// If an option is not usable, an answer or image is wrong, the folder of [`ThesisOptions::resume`] cannot be written, or `progress` asks to
/// stop. What was measured until then is in that folder.
pub fn run(options: &ThesisOptions, progress: &dyn Progress) -> Result<Report, LabError> {
    options.validate()?;
    let thesis = ThesisData::load()?;
    let ThesisOptions { quick, size: side, seed, .. } = *options;
    let methods = proving(&options.methods);
    let store = Store::new(options.resume.as_deref(), dependencies(options, &methods))?;
    let bench = Bench { progress, methods: &methods, side, quick, seed, threads: options.threads(), store };
    let named = |name: &str| options.scenes.iter().any(|s| s == name);
    let scenes: Vec<ThesisScene> = SCENES.into_iter().filter(|s| named(s.name)).collect();
    let repeated: Vec<_> = thesis.repeated_settings().into_iter().filter(|s| named(&s.scene)).collect();
    let measured: Vec<_> = thesis.measured.iter().filter(|m| named(&m.scene)).collect();
    let steps = bench.scene_steps(scenes.len()) + bench.repeated_steps(repeated.len(), measured.len(), scenes.len());
    progress.work_total(steps as u64);

    let overheads =
        scenes.iter().map(|s| Ok((s.name, bench.overhead(s.name)?))).collect::<Result<Vec<_>, LabError>>()?;
    let scenes = scenes.iter().map(|s| bench.scene(s)).collect::<Result<Vec<_>, LabError>>()?;
    let repeated = repeated.into_iter().map(|s| bench.repeated(s)).collect::<Result<Vec<_>, LabError>>()?;
    let measured = measured.into_iter().map(|m| bench.measured(m)).collect::<Result<Vec<_>, LabError>>()?;
    let tables = Tables {
        thesis: &thesis,
        threads: bench.threads,
        scenes: &scenes,
        repeated: &repeated,
        measured: &measured,
        overheads: &overheads,
    };
    let (sections, figures) = tables.all();
    let page = Page { title: "Chapter 6 of the thesis, measured again".to_owned(), lead: lead(&bench), sections };
    Ok(Report::new(page, figures, seed))
}

/// What the figures of a run depend on, beside the scenes of Tables 6.4 to 6.11, whose cells name their checksums.
fn dependencies(options: &ThesisOptions, methods: &[Method]) -> String {
    let ThesisOptions { quick, size, seed, .. } = options;
    let methods: Vec<_> = methods.iter().map(|m| m.name()).collect();
    // Generated scenes change with the program only.
    let boxes = ThesisOptions::SCENES.iter().filter(|name| name.starts_with("cbox")).filter_map(|name| builtin(name));
    let texts: Vec<u8> =
        boxes.flat_map(|source| source.files().iter().flat_map(|f| f.bytes.to_vec()).collect::<Vec<_>>()).collect();
    format!(
        "size {size}, seed {seed}, quick {quick}, {} threads, methods {}, boxes {:08x}",
        options.threads(),
        methods.join(","),
        crc32fast::hash(&texts)
    )
}

fn lead(bench: &Bench<'_>) -> Vec<String> {
    let side = bench.side;
    let small = if side == SIDE {
        String::new()
    } else {
        let scale = bench.scale();
        format!(
            " Images are {side} × {side} pixels; N, T_render and T_query are scaled by {scale:.0} to {SIDE} × {SIDE}, T_build is not."
        )
    };
    vec![
        format!(
            "Each figure has that of the thesis [Houska2013] beside or below it, where there is one: one thread of an Intel Core \
             i7-3632QM in Mitsuba 0.x then, one thread of the machine named below now, unless a column says otherwise.{small}"
        ),
        "All images were compared bit by bit with those of the hierarchy alone, and every replayed answer with the hierarchy's; all \
         agree. The geometry of san-miguel and scape is generated, not the thesis's. Where the boxes' light and fog are is not printed there: \
         they were fitted to its tables."
            .to_owned(),
    ]
}

/// What was measured, to be made into tables.
struct Tables<'a> {
    thesis: &'a ThesisData,
    /// All threads, beside one.
    threads: usize,
    scenes: &'a [SceneResult],
    repeated: &'a [RepeatedResult<'a>],
    measured: &'a [MeasuredResult<'a>],
    overheads: &'a [(&'static str, OverheadCell)],
}

impl Tables<'_> {
    fn all(&self) -> (Vec<Section>, Vec<Figure>) {
        let mut figures = Vec::new();
        let mut sections = Vec::new();
        if !self.scenes.is_empty() {
            sections.push(Section {
                heading: "Scenes".to_owned(),
                images: self.scenes.iter().map(|s| s.picture.clone()).collect(),
                ..Section::default()
            });
            sections.push(self.queries(&mut figures));
            sections.push(self.overhead(&mut figures));
            sections.push(self.proof_times(&mut figures));
            sections.extend(self.scenes.iter().map(|s| self.acceleration(s, &mut figures)));
            sections.push(self.inequality(&mut figures));
        }
        if !self.repeated.is_empty() {
            sections.push(self.repeatability(&mut figures));
        }
        if !self.measured.is_empty() {
            sections.push(self.influence(&mut figures));
        }
        (sections, figures)
    }
}

fn about(
    table: &'static str,
    scene: &str,
    integrator: Integrator,
    method: &'static str,
    voxel_size: Option<f64>,
) -> About {
    About { table, scene: scene.to_owned(), integrator: integrator.to_string(), method, voxel_size }
}

/// A percentage of the thesis, as it prints it.
fn printed(percent: f64) -> String {
    format!("{percent:.2} %")
}

/// Samples per path segment as the thesis writes them.
fn sps(integrator: Integrator) -> String {
    integrator.samples_per_segment().map_or_else(|| "VPT".to_owned(), |n| n.to_string())
}
