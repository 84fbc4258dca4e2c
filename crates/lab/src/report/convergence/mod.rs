//! `vdf report convergence`: speed against error.
//!
//! All methods make the same image, so a method changes the time that an error takes and nothing else; what an error takes is a matter of
//! the integrator, its samples per segment and the samples per pixel.

mod cache;
mod curve;
mod list;
mod measure;
mod reference;
mod tables;

use std::iter;

use anyhow::anyhow;
use vdf_render::{
    Method, Progress as _, RenderOptions, World, default_voxel_size,
    scene::{FilmSettings, PixelRect},
};

use self::{
    cache::Cache,
    measure::{Bench, Plan, Setting},
    tables::Tables,
};
use super::{methods, provenance::Provenance};
use crate::{
    args::{IntegratorName, ReportConvergenceArgs},
    commands::render::{integrator, load},
    failure::{Failure, say},
    progress::Reporter,
};

/// Widest image in pixels.
const WIDEST: u32 = 4096;

/// The most samples per pixel, of renders and of references.
const MOST_SPP: u32 = 1 << 24;

/// By how many times a reference has more samples than the renders, if nothing else is said.
const REFERENCE: u32 = 16;

pub(crate) fn run(args: &ReportConvergenceArgs) -> Result<(), Failure> {
    let (side, max_spp) = if args.quick { (24, 8) } else { (48, 32) };
    let (side, max_spp) = (args.size.unwrap_or(side), args.max_spp.unwrap_or(max_spp));
    let reference_spp = args.reference_spp.unwrap_or(REFERENCE.saturating_mul(max_spp).min(MOST_SPP));
    within("size", side.into(), 1, WIDEST.into())?;
    within("max-spp", max_spp.into(), 1, MOST_SPP.into())?;
    within("reference-spp", reference_spp.into(), 2, MOST_SPP.into())?;
    within("seeds", args.seeds as u64, curve::FEWEST as u64, curve::MOST as u64)?;
    // The seeds of the references are the two largest.
    within("seed", args.seed, 0, reference::SEEDS[0] - args.seeds as u64)?;
    let settings = settings(args)?;
    let common = RenderOptions { voxel_size: args.voxel, threads: args.threads, ..RenderOptions::default() };

    let (name, mut scene) = load(args.scene.as_deref(), &args.defines)?;
    scene.film = resized(scene.film, side);
    for setting in &settings {
        RenderOptions { integrator: setting.kind(), ..common.clone() }.validate(&scene)?;
    }
    args.files.check()?;
    let cache = Cache::open(args.cache.as_deref())?;
    for warning in &scene.warnings {
        say(format_args!("warning: {warning}"));
    }

    let reporter = Reporter::new(args.files.quiet)?;
    reporter.phase("hierarchy");
    let world = World::new(&scene);
    let plan = Plan {
        methods: iter::once(Method::None).chain(methods(&args.methods)).collect(),
        settings,
        spps: doubling(max_spp),
        seeds: (0..args.seeds as u64).map(|i| args.seed + i).collect(),
        half_spp: reference_spp.div_ceil(2),
        voxel_size: args.voxel.unwrap_or_else(|| default_voxel_size(world.bounds)),
        threads: args.threads,
    };
    let bench = Bench { plan: &plan, name: &name, scene: &scene, world: &world, cache: &cache, reporter: &reporter };
    let measured = bench.measure();
    reporter.finish();
    let measured = measured?;
    if reporter.interrupted() {
        return Err(Failure::Interrupted);
    }
    let tables = Tables::new(&name, &plan, &measured, &scene.film);
    args.files.write(&tables.page()?, &tables.figures(), &Provenance::new(args.seed))
}

fn within(option: &str, value: u64, least: u64, most: u64) -> Result<(), Failure> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Failure::Usage(anyhow!("--{option} must be from {least} to {most}, not {value}")))
}

/// The integrators that two options name together, each once.
fn settings(args: &ReportConvergenceArgs) -> Result<Vec<Setting>, Failure> {
    let all_samples = &args.samples_per_segment;
    if !all_samples.is_empty() && !args.integrator.contains(&IntegratorName::Raymarch) {
        integrator(IntegratorName::Volpath, all_samples.first().copied())?;
    }
    let mut settings = Vec::new();
    for name in &args.integrator {
        let chosen = match name {
            IntegratorName::Volpath => vec![Setting::Volpath],
            IntegratorName::Raymarch if all_samples.is_empty() => vec![Setting::Raymarch(7)],
            IntegratorName::Raymarch => all_samples.iter().map(|n| Setting::Raymarch(*n)).collect(),
        };
        for setting in chosen {
            if !settings.contains(&setting) {
                settings.push(setting);
            }
        }
    }
    Ok(settings)
}

/// 1, 2, 4, ... up to `most`.
fn doubling(most: u32) -> Vec<u32> {
    iter::successors(Some(1_u32), |n| n.checked_mul(2)).take_while(|n| *n <= most).collect()
}

/// The same picture in another width.
fn resized(film: FilmSettings, width: u32) -> FilmSettings {
    let scale = |n: u32| (f64::from(n) * f64::from(width) / f64::from(film.width)).round() as u32;
    let height = scale(film.height).max(1);
    let range = |first: u32, end: u32, side: u32| {
        let first = scale(first).min(side - 1);
        (first, scale(end).clamp(first + 1, side))
    };
    let (x0, x1) = range(film.crop.x0, film.crop.x1, width);
    let (y0, y1) = range(film.crop.y0, film.crop.y1, height);
    FilmSettings { width, height, crop: PixelRect { x0, y0, x1, y1 }, ..film }
}

#[cfg(test)]
mod tests {
    use vdf_render::scene::ReconstructionFilter;

    use super::*;

    #[test]
    fn samples_double() {
        assert_eq!((doubling(1), doubling(5), doubling(8)), (vec![1], vec![1, 2, 4], vec![1, 2, 4, 8]));
        assert_eq!(doubling(MOST_SPP).len(), 25);
    }

    #[test]
    fn films_keep_their_proportions() {
        let rect = |[x0, y0, x1, y1]: [u32; 4]| PixelRect { x0, y0, x1, y1 };
        let film =
            |width, height, crop| FilmSettings { width, height, crop: rect(crop), filter: ReconstructionFilter::Box };
        for (from, width, to) in [
            (film(512, 512, [0, 0, 512, 512]), 48, film(48, 48, [0, 0, 48, 48])),
            (film(640, 480, [0, 0, 640, 480]), 64, film(64, 48, [0, 0, 64, 48])),
            (film(640, 480, [320, 120, 640, 480]), 64, film(64, 48, [32, 12, 64, 48])),
            (film(8, 4, [2, 1, 3, 2]), 16, film(16, 8, [4, 2, 6, 4])),
            // Never without a pixel.
            (film(1000, 1, [999, 0, 1000, 1]), 1, film(1, 1, [0, 0, 1, 1])),
            (film(1000, 1000, [3, 999, 4, 1000]), 10, film(10, 10, [0, 9, 1, 10])),
        ] {
            assert_eq!(resized(from, width), to);
        }
    }
}
