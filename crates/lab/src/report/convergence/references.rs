//! Where references come from: the folder that keeps them, or renders.

use vdf_image::Image;
use vdf_render::Integrator;

use super::{
    super::bench::has_pixels,
    cache::{Cache, Key, Lookup},
    plan::{Plan, REFERENCE_SEEDS},
    reference::{Reference, telling_pixels},
    renders::Renders,
};
use crate::LabError;

/// The references of all integrators of the plan, and warnings about those in the folder that cannot be used.
///
/// Begins the progress of the whole report, of which it knows how much is to be rendered.
pub(super) fn references(
    renders: &Renders<'_>,
    name: &str,
    cache: &Cache,
) -> Result<(Vec<Reference>, Vec<String>), LabError> {
    let Plan { integrators, half_spp, .. } = renders.plan;
    let wanted = one_for_each(integrators);
    renders.progress.phase("looking for references");
    let scene = renders.alone.scene();
    let key = |integrator: Integrator| Key::new(name, scene, integrator, *half_spp, REFERENCE_SEEDS);
    let mut warnings = Vec::new();
    let mut kept = Vec::new();
    for &integrator in &wanted {
        kept.push(find(renders, cache, integrator, &key(integrator), &mut warnings)?);
    }
    let missing = kept.iter().filter(|k| k.is_none()).count() as u64;
    renders.progress.work_total(paths(renders, missing));
    let mut references = Vec::new();
    for (integrator, kept) in wanted.into_iter().zip(kept) {
        let cached = kept.is_some();
        let halves = match kept {
            Some(halves) => halves,
            None => {
                renders.progress.phase(&format!("{integrator}: reference"));
                let halves = renders.halves(integrator, None)?;
                cache.store(&key(integrator), &halves)?;
                halves
            }
        };
        references.push(Reference::new(integrator, 2 * half_spp, &halves, cached)?);
    }
    Ok((references, warnings))
}

/// One integrator for all that converge to the same image: that with the most samples per segment, whose variance is
/// the least.
fn one_for_each(integrators: &[Integrator]) -> Vec<Integrator> {
    let mut wanted: Vec<Integrator> = Vec::new();
    for &integrator in integrators {
        match wanted.iter_mut().find(|w| w.converges_as(integrator)) {
            Some(w) if w.samples_per_segment() < integrator.samples_per_segment() => *w = integrator,
            Some(_) => {}
            None => wanted.push(integrator),
        }
    }
    wanted
}

/// How many paths the whole report follows if so many references are missing.
fn paths(renders: &Renders<'_>, missing: u64) -> u64 {
    let Plan { methods, integrators, spps, seeds, half_spp, .. } = renders.plan;
    let crop = renders.alone.scene().film.crop;
    let pixels = u64::from(crop.x1 - crop.x0) * u64::from(crop.y1 - crop.y0);
    let samples: u64 = spps.iter().map(|s| u64::from(*s)).sum();
    let all = samples * (integrators.len() * methods.len() * seeds.len()) as u64;
    pixels * (all + 2 * missing * u64::from(*half_spp))
}

/// What the folder has, if it is what this program would render.
fn find(
    renders: &Renders<'_>,
    cache: &Cache,
    integrator: Integrator,
    key: &Key,
    warnings: &mut Vec<String>,
) -> Result<Option<[Image; 2]>, LabError> {
    let mut again = |file: String, why: &str| warnings.push(format!("{file}: {why}; it is rendered again"));
    match cache.look_up(key) {
        Lookup::Missing => Ok(None),
        Lookup::Unusable { file, why } => {
            again(file.display().to_string(), &why);
            Ok(None)
        }
        Lookup::Found(halves) => {
            let rendered = renders.halves(integrator, Some(telling_pixels(&halves)))?;
            if halves.iter().zip(&rendered).all(|(kept, rendered)| has_pixels(kept, rendered)) {
                return Ok(Some(halves));
            }
            let what = format!("the reference of {integrator} in {}", cache.folder().display());
            again(what, "this program renders other pixels");
            Ok(None)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_reference_for_all_that_converge_to_it() {
        let [few, many] = [1, 49].map(Integrator::raymarch);
        for order in [[few, Integrator::Volpath, many], [many, few, Integrator::Volpath]] {
            let wanted = one_for_each(&order);
            assert!(wanted.len() == 2 && wanted.contains(&many) && wanted.contains(&Integrator::Volpath), "{wanted:?}");
        }
    }
}
