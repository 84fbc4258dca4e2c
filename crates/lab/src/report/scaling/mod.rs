//! The scaling report: how costs grow with triangles, voxels, lights and threads.
//!
//! *Idea.* Each sweep multiplies one thing and measures several quantities; a power law is fitted to each of these.
//! Repetitions take turns where several things are compared, so that a machine that grows slower does so for all.
//!
//! *Guarantee.* Answers of proofs are compared with the hierarchy's, images bit by bit between methods and numbers of
//! threads.

mod fit;
mod lights;
mod measure;
mod options;
mod sweep;
mod tables;
mod threads;
mod triangles;
mod voxels;

use vdf_render::Progress;

use self::{measure::Lab, sweep::Sweep};
pub use options::{ScalingOptions, SweepKind, UnknownSweep};

use super::{Report, page::Page};
use crate::LabError;

/// Runs the sweeps that the options name, each once, in the order of [`SweepKind::ALL`].
///
/// # Errors
/// If an option is not usable, an answer or image is wrong, or `progress` asks to stop.
pub fn run(options: &ScalingOptions, progress: &dyn Progress) -> Result<Report, LabError> {
    options.validate()?;
    let lab = Lab { progress, options };
    let chosen = || SweepKind::ALL.into_iter().filter(|kind| options.sweeps.contains(kind));
    progress.work_total(chosen().map(|kind| steps(kind, options) as u64).sum());
    let sweeps = chosen().map(|kind| sweep(kind, &lab)).collect::<Result<Vec<_>, LabError>>()?;
    let measurements = match options.repetitions {
        1 => "one measurement".to_owned(),
        n => format!("{n} measurements"),
    };
    let page = Page {
        title: "How costs grow".to_owned(),
        lead: vec![
            format!(
                "Medians of {measurements}. Exponents are slopes of least-squares lines through the logarithms, with the standard \
                 error of the slope. Where a cost has a part that does not grow, or grows by leaps as a cache gets too small, the \
                 points lie on no line: the error is mostly the bend then, and the slope of the last step, between the two largest \
                 sizes, is nearer to what comes."
            ),
            "Every answer of a replayed proof was compared with the hierarchy's, and every image with the first; all agree."
                .to_owned(),
        ],
        sections: sweeps.iter().map(tables::section).collect(),
    };
    let figures = sweeps.iter().flat_map(tables::figures).collect();
    Ok(Report::new(page, figures, options.seed))
}

fn steps(kind: SweepKind, options: &ScalingOptions) -> usize {
    match kind {
        SweepKind::Triangles => triangles::sizes(options.max_triangles).len(),
        SweepKind::Refined => triangles::splits(options.max_triangles).len(),
        SweepKind::Voxels => voxels::sizes(options.max_voxels_per_side).len(),
        SweepKind::Lights => lights::sizes(options.max_lights).len(),
        SweepKind::Threads => threads::sizes(options.max_threads).len(),
    }
}

fn sweep(kind: SweepKind, lab: &Lab<'_>) -> Result<Sweep, LabError> {
    match kind {
        SweepKind::Triangles => triangles::run(lab),
        SweepKind::Refined => triangles::run_refined(lab),
        SweepKind::Voxels => voxels::run(lab),
        SweepKind::Lights => lights::run(lab),
        SweepKind::Threads => threads::run(lab),
    }
}
