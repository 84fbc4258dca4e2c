//! The convergence report: speed against error.
//!
//! *Idea.* All methods make the same image, so a method changes the time that an error takes and nothing else; what an
//! error takes is a matter of the integrator, its samples per segment and the samples per pixel.
//!
//! *Guarantee.* The images of all methods are compared bit by bit. No error is claimed that cannot be told from that of
//! its reference.
//!
//! *Cost.* A reference has 16 times the samples of the longest render, but is kept from one run to the next. The
//! structures of all methods exist at the same time, for renders take turns.

mod cache;
mod curve;
mod figures;
mod measure;
mod plan;
mod reference;
mod references;
mod renders;
mod summary;
mod tables;

use vdf_render::{PrepareOptions, PreparedScene, Progress, default_voxel_size};
use vdf_scene::Scene;
use vdf_visibility::Method;

use self::{
    cache::Cache,
    plan::{Plan, resized},
    renders::Renders,
    summary::Summary,
};
pub use plan::ConvergenceOptions;

use super::Report;
use crate::LabError;

/// Measures `scene`, called `name`, in the size that the options say. Writes references to their folder.
///
/// # Errors If an option or the voxel size is not usable, the references cannot be kept, images differ that must be the
/// same, or `progress` asks to stop.
pub fn run(
    name: &str,
    mut scene: Scene,
    options: &ConvergenceOptions,
    progress: &dyn Progress,
) -> Result<Report, LabError> {
    options.validate()?;
    let cache = Cache::open(options.cache.as_deref())?;
    scene.film = resized(scene.film, options.size);
    let none = PrepareOptions { threads: options.threads, ..PrepareOptions::with_method(Method::NONE) };
    let prepared = PreparedScene::new(scene, &none, progress)?;
    let plan = Plan::new(options, default_voxel_size(prepared.world().grid_bounds(options.grid)));
    let renders = Renders { plan: &plan, alone: &prepared, progress };
    let (measured, warnings) = measure::measure(&renders, name, &cache)?;
    let summary = Summary::new(name, &plan, &measured, &prepared.scene().film);
    let report = Report::new(summary.page()?, summary.figures(), options.first_seed);
    Ok(Report { warnings, ..report })
}
