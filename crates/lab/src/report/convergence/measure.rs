//! The measurement: every method with every integrator, seed and number of samples.

use vdf_image::{
    Image, ImageError,
    metrics::{PIXELS_PER_DEGREE, hdr_flip, mse, rel_mse},
};
use vdf_render::{Integrator, PreparedScene, on_threads};

use super::{
    super::bench::same_bits, cache::Cache, plan::Plan, reference::Reference, references::references, renders::Renders,
};
use crate::LabError;

/// What was measured. Times in seconds; `[seed][spp]` are indices into those of the plan.
pub(super) struct Measured {
    pub(super) threads: usize,
    pub(super) references: Vec<Reference>,
    /// For each integrator of the plan.
    pub(super) settings: Vec<SettingResult>,
    /// `T_build` of each method with each seed.
    pub(super) t_build: Vec<Vec<f64>>,
}

/// An integrator. Its errors are those of all methods, for their images are the same.
pub(super) struct SettingResult {
    pub(super) integrator: Integrator,
    /// Number of its reference.
    pub(super) reference: usize,
    /// `[seed][spp]`.
    pub(super) errors: Vec<Vec<Errors>>,
    /// `T_render` by `[method][seed][spp]`, without `T_build`.
    pub(super) t_render: Vec<Vec<Vec<f64>>>,
    /// The images of the first seed, the fewest samples and the most.
    pub(super) first: Image,
    pub(super) last: Image,
}

/// How far an image is from its reference: as measured, with the reference's own error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Errors {
    pub(super) mse: f64,
    pub(super) rel_mse: f64,
    /// Mean of HDR-FLIP.
    pub(super) flip: f64,
}

/// Measures all of the plan. The warnings are about references.
pub(super) fn measure(renders: &Renders<'_>, name: &str, cache: &Cache) -> Result<(Measured, Vec<String>), LabError> {
    let (references, warnings) = references(renders, name, cache)?;
    let Plan { methods, integrators, spps, seeds, threads, .. } = renders.plan;
    let mut t_build = vec![Vec::with_capacity(seeds.len()); methods.len()];
    let result = |&integrator: &Integrator| SettingResult {
        integrator,
        reference: references.iter().position(|r| r.integrator.converges_as(integrator)).unwrap_or(0),
        errors: vec![vec![]; seeds.len()],
        t_render: vec![vec![vec![]; seeds.len()]; methods.len()],
        first: Image::new(0, 0),
        last: Image::new(0, 0),
    };
    let mut settings: Vec<SettingResult> = integrators.iter().map(result).collect();
    for (i, &seed) in seeds.iter().enumerate() {
        renders.progress.phase(&format!("seed {seed}: building"));
        let built = methods.iter().map(|m| renders.build(*m)).collect::<Result<Vec<_>, LabError>>()?;
        for (times, built) in t_build.iter_mut().zip(&built) {
            times.push(built.build_report().seconds());
        }
        for (j, &spp) in spps.iter().enumerate() {
            for setting in &mut settings {
                let integrator = setting.integrator;
                renders.progress.phase(&format!("seed {seed}: {integrator}, {spp} spp"));
                let (image, times) = by_all_methods(renders, &built, i + j, integrator, seed, spp)?;
                for (of_method, t) in setting.t_render.iter_mut().zip(times) {
                    of_method[i].push(t);
                }
                setting.errors[i].push(Errors::new(&image, &references[setting.reference].image)?);
                if i == 0 && j == 0 {
                    setting.first = image.clone();
                }
                if i == 0 && j + 1 == spps.len() {
                    setting.last = image;
                }
            }
        }
    }
    let threads = on_threads(*threads, || Ok::<_, LabError>(rayon::current_num_threads()))?;
    Ok((Measured { threads, references, settings, t_build }, warnings))
}

/// The image that all methods make, and `T_render` of each. Method number `first`, counted around, is the first to
/// render: so each is the first in its turn.
fn by_all_methods(
    renders: &Renders<'_>,
    built: &[PreparedScene],
    first: usize,
    integrator: Integrator,
    seed: u64,
    spp: u32,
) -> Result<(Image, Vec<f64>), LabError> {
    let first = first % built.len();
    let mut times = vec![0.0; built.len()];
    let (image, t) = renders.render(&built[first], integrator, seed, spp)?;
    times[first] = t;
    for m in (1..built.len()).map(|k| (first + k) % built.len()) {
        let (other, t) = renders.render(&built[m], integrator, seed, spp)?;
        if !same_bits(&other, &image) {
            return Err(LabError::WrongImage(format!(
                "{integrator} with {}, voxel {}, seed {seed} and {spp} samples per pixel differs from {}",
                built[m].method(),
                renders.plan.voxel_size,
                built[first].method()
            )));
        }
        times[m] = t;
    }
    Ok((image, times))
}

impl Errors {
    fn new(image: &Image, reference: &Image) -> Result<Self, ImageError> {
        Ok(Self {
            mse: mse(image, reference)?,
            rel_mse: rel_mse(image, reference)?,
            flip: hdr_flip(image, reference, PIXELS_PER_DEGREE)?.map.mean(),
        })
    }
}
