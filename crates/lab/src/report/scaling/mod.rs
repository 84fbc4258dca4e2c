//! `vdf report scaling`: how costs grow with triangles, voxels, lights and threads.
//!
//! Each sweep doubles one thing and measures several quantities; a power law is fitted to each of these. Repetitions take turns where several things are
//! compared, so that a machine that grows slower does so for all.

mod fit;
mod lights;
mod measure;
mod sweep;
mod tables;
mod threads;
mod triangles;
mod voxels;

use anyhow::anyhow;
use vdf_render::Progress as _;

use self::{measure::Lab, sweep::Sweep};
use super::{
    bench::{MOST_THREADS, pool, processors},
    grid,
    page::Page,
    provenance::Provenance,
    queries::integrator_name,
};
use crate::{args::ReportScalingArgs, failure::Failure, progress::Reporter};

/// How far and how often it is measured.
#[derive(Clone, Debug)]
struct Settings {
    max_triangles: u64,
    max_voxels_per_side: u32,
    max_lights: u32,
    max_threads: usize,
    repetitions: u32,
    /// Side of the images in pixels, and samples per pixel.
    size: u32,
    spp: u32,
    seed: u64,
    /// Threads outside the sweep of threads.
    threads: Option<usize>,
    /// Queries to replay.
    queries: u64,
    /// Along the longest side of the scene in the sweep of threads: enough work for several.
    voxels_for_threads: u32,
}

impl Settings {
    fn new(args: &ReportScalingArgs) -> Result<Self, Failure> {
        let quick = args.quick;
        let either = |full, small| if quick { small } else { full };
        let processors = processors();
        let settings = Self {
            max_triangles: args.max_triangles.unwrap_or(if quick { 400_000 } else { 1_000_000 }),
            max_voxels_per_side: args.max_voxels_per_side.unwrap_or(either(256, 128)),
            max_lights: args.max_lights.unwrap_or(either(64, 16)),
            max_threads: args.max_threads.unwrap_or(processors.min(MOST_THREADS)),
            repetitions: args.repetitions.unwrap_or(either(5, 3)),
            size: args.size.unwrap_or(either(128, 48)),
            spp: either(16, 4),
            seed: args.seed,
            threads: args.threads,
            queries: if quick { 20_000 } else { 200_000 },
            voxels_for_threads: either(512, 128),
        };
        let limits = [
            ("max-triangles", settings.max_triangles, triangles::LEAST, triangles::MOST),
            ("max-voxels-per-side", settings.max_voxels_per_side.into(), voxels::LEAST.into(), voxels::MOST.into()),
            ("max-lights", settings.max_lights.into(), 1, lights::MOST.into()),
            ("max-threads", settings.max_threads as u64, 1, MOST_THREADS as u64),
            ("repetitions", settings.repetitions.into(), 1, 1000),
            ("size", settings.size.into(), 1, 4096),
        ];
        for (option, value, least, most) in limits {
            if !(least..=most).contains(&value) {
                return Err(Failure::Usage(anyhow!("--{option} must be from {least} to {most}, not {value}")));
            }
        }
        if settings.threads.is_some_and(|n| !(1..=MOST_THREADS).contains(&n)) {
            return Err(Failure::Usage(anyhow!(
                "--threads must be from 1 to {}, not {}",
                MOST_THREADS,
                settings.threads.unwrap_or(0)
            )));
        }
        Ok(settings)
    }
}

pub(crate) fn run(args: &ReportScalingArgs) -> Result<(), Failure> {
    let settings = Settings::new(args)?;
    args.files.check()?;
    let reporter = Reporter::new(args.files.quiet)?;
    let lab = Lab { reporter: &reporter, settings: &settings, pool: pool(settings.threads)? };
    let result = sweeps(&lab, &args.only);
    reporter.finish();
    let sweeps = result?;
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }
    let page = Page {
        title: "How costs grow".to_owned(),
        lead: vec![
            format!(
                "Medians of {}. Exponents are slopes of least-squares lines through the logarithms, with the standard error of the slope. \
                 Where a cost has a part that does not grow, or grows by leaps as a cache gets too small, the points lie on no line: the error is mostly the bend then, and the \
                 slope of the last step, between the two largest sizes, is nearer to what comes.",
                if settings.repetitions == 1 { "one measurement".to_owned() } else { format!("{} measurements", settings.repetitions) }
            ),
            "Every answer of a replayed proof was compared with the hierarchy's, and every image with the first; all agree.".to_owned(),
        ],
        sections: sweeps.iter().map(tables::section).collect(),
    };
    let figures: Vec<_> = sweeps.iter().flat_map(tables::figures).collect();
    args.files.write(&page, &figures, &Provenance::new(settings.seed))
}

/// The sweeps named, each once.
fn sweeps(lab: &Lab<'_>, only: &[String]) -> Result<Vec<Sweep>, Failure> {
    type Run = fn(&Lab<'_>) -> Result<Sweep, Failure>;
    let s = lab.settings;
    let all: [(&str, usize, Run); 5] = [
        ("triangles", triangles::sizes(s.max_triangles).len(), triangles::run),
        ("refined", triangles::splits(s.max_triangles).len(), triangles::run_refined),
        ("voxels", voxels::sizes(s.max_voxels_per_side).len(), voxels::run),
        ("lights", lights::sizes(s.max_lights).len(), lights::run),
        ("threads", threads::sizes(s.max_threads).len(), threads::run),
    ];
    let chosen = || all.iter().filter(|(name, ..)| only.iter().any(|o| o == name));
    lab.reporter.work_total(chosen().map(|(_, steps, _)| *steps as u64).sum());
    chosen().map(|(_, _, run)| run(lab)).collect()
}
