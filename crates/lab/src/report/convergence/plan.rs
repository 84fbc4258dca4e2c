//! What a convergence report measures.

use std::{iter, path::PathBuf};

use vdf_render::{GridExtent, Integrator, SegmentSamples, check_threads, check_voxel_size};
use vdf_scene::{FilmSettings, PixelRect};
use vdf_visibility::Method;

use super::{
    super::proving,
    curve::{MAX_VALUES, MIN_VALUES},
};
use crate::LabError;

/// The widest image in pixels.
const MAX_WIDTH: u32 = 4096;

/// The most samples per pixel, of renders and of references.
const MAX_SPP: u32 = 1 << 24;

/// By how many times a reference has more samples than the renders, if nothing else is said.
const REFERENCE: u32 = 16;

/// The seeds of the halves of a reference: the two largest, which no render has.
pub(super) const REFERENCE_SEEDS: [u64; 2] = [u64::MAX - 1, u64::MAX];

/// What to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvergenceOptions {
    /// The methods; the hierarchy alone is measured in any case and may be left out.
    pub methods: Vec<Method>,
    /// Side of a voxel in world units; by default a 128th of the scene's longest side.
    pub voxel_size: Option<f64>,
    /// What the voxel grid covers.
    pub grid: GridExtent,
    /// The integrators, each with its samples per segment; at least one.
    pub integrators: Vec<Integrator>,
    /// The most samples per pixel; renders have 1, 2, 4, ... up to this.
    pub max_spp: u32,
    /// Samples per pixel of the references; by default 16 times the most of the renders.
    pub reference_spp: Option<u32>,
    /// How many seeds medians are taken over, from 5 to 1000.
    pub seeds: usize,
    /// The first seed; others follow it.
    pub first_seed: u64,
    /// Width of the images in pixels; the height is in proportion.
    pub size: u32,
    /// Folder of the references; by default `vdf-references` where the system keeps caches. Made if it does not exist.
    pub cache: Option<PathBuf>,
    /// Number of threads; by default one for each processor.
    pub threads: Option<usize>,
}

impl Default for ConvergenceOptions {
    /// `ndf`, `amr` and `amr-xsn`, both integrators, images 48 pixels wide with up to 32 samples per pixel and five
    /// seeds.
    fn default() -> Self {
        Self {
            methods: ["ndf", "amr", "amr-xsn"].iter().filter_map(|name| name.parse().ok()).collect(),
            voxel_size: None,
            grid: GridExtent::default(),
            integrators: vec![Integrator::Volpath, Integrator::raymarch(Integrator::SAMPLES_PER_SEGMENT)],
            max_spp: 32,
            reference_spp: None,
            seeds: MIN_VALUES,
            first_seed: 0,
            size: 48,
            cache: None,
            threads: None,
        }
    }
}

impl ConvergenceOptions {
    /// Small images and few samples: a look.
    #[must_use]
    pub fn quick() -> Self {
        Self { max_spp: 8, size: 24, ..Self::default() }
    }

    fn reference_spp(&self) -> u32 {
        self.reference_spp.unwrap_or(REFERENCE.saturating_mul(self.max_spp).min(MAX_SPP))
    }

    /// Checks what can be checked without a scene.
    ///
    /// # Errors
    /// [`vdf_render::RenderError::Option`] names the option and what it has to be.
    pub fn validate(&self) -> Result<(), LabError> {
        let spp = MAX_SPP.into();
        LabError::check_range("size", self.size.into(), 1, MAX_WIDTH.into())?;
        LabError::check_range("max-spp", self.max_spp.into(), 1, spp)?;
        LabError::check_range("reference-spp", self.reference_spp().into(), 2, spp)?;
        LabError::check_range("seeds", self.seeds as u64, MIN_VALUES as u64, MAX_VALUES as u64)?;
        LabError::check_range("seed", self.first_seed, 0, REFERENCE_SEEDS[0] - self.seeds as u64)?;
        if self.integrators.is_empty() {
            return Err(LabError::option("integrator", "must name at least one"));
        }
        if self.integrators.iter().any(|i| i.samples_per_segment() == Some(SegmentSamples::Count(0))) {
            return Err(LabError::option("samples-per-segment", "must be at least 1"));
        }
        check_threads(self.threads)?;
        Ok(self.voxel_size.map_or(Ok(()), check_voxel_size)?)
    }
}

/// The options resolved for a scene.
pub(super) struct Plan {
    /// The hierarchy alone is the first.
    pub(super) methods: Vec<Method>,
    /// Each once.
    pub(super) integrators: Vec<Integrator>,
    /// Samples per pixel, ascending.
    pub(super) spps: Vec<u32>,
    pub(super) seeds: Vec<u64>,
    /// Samples per pixel of each half of a reference.
    pub(super) half_spp: u32,
    pub(super) voxel_size: f64,
    pub(super) grid: GridExtent,
    pub(super) threads: Option<usize>,
}

impl Plan {
    /// The plan for valid options, and the side of a voxel that the scene has by default.
    pub(super) fn new(options: &ConvergenceOptions, default_voxel_size: f64) -> Self {
        let mut integrators = Vec::new();
        for &integrator in &options.integrators {
            if !integrators.contains(&integrator) {
                integrators.push(integrator);
            }
        }
        Self {
            methods: iter::once(Method::NONE).chain(proving(&options.methods)).collect(),
            integrators,
            spps: doubling(options.max_spp),
            seeds: (0..options.seeds as u64).map(|i| options.first_seed + i).collect(),
            half_spp: options.reference_spp().div_ceil(2),
            voxel_size: options.voxel_size.unwrap_or(default_voxel_size),
            grid: options.grid,
            threads: options.threads,
        }
    }
}

/// 1, 2, 4, ... up to `most`.
fn doubling(most: u32) -> Vec<u32> {
    iter::successors(Some(1_u32), |n| n.checked_mul(2)).take_while(|n| *n <= most).collect()
}

/// The same picture in another width.
pub(super) fn resized(film: FilmSettings, width: u32) -> FilmSettings {
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
    use vdf_scene::{ComponentFormat, ReconstructionFilter};

    use super::*;

    #[test]
    fn samples_double() {
        assert_eq!((doubling(1), doubling(5), doubling(8)), (vec![1], vec![1, 2, 4], vec![1, 2, 4, 8]));
        assert_eq!(doubling(MAX_SPP).len(), 25);
    }

    #[test]
    fn plans_have_the_hierarchy_first_and_everything_once() {
        let default = ConvergenceOptions::default();
        assert_eq!(default.methods.len(), 3);
        default.validate().unwrap();
        let methods = vec![Method::default(), Method::NONE, Method::default()];
        let integrators = vec![Integrator::raymarch(3), Integrator::Volpath, Integrator::raymarch(3)];
        let options = ConvergenceOptions { methods, integrators, max_spp: 5, first_seed: 7, ..default };
        let plan = Plan::new(&options, 2.5);
        assert_eq!(plan.methods, [Method::NONE, Method::default()]);
        assert_eq!(plan.integrators, [Integrator::raymarch(3), Integrator::Volpath]);
        assert_eq!((plan.seeds, plan.half_spp, plan.voxel_size), (vec![7, 8, 9, 10, 11], 40, 2.5));
    }

    #[test]
    fn films_keep_their_proportions() {
        let rect = |[x0, y0, x1, y1]: [u32; 4]| PixelRect { x0, y0, x1, y1 };
        let film = |width, height, crop| FilmSettings {
            width,
            height,
            crop: rect(crop),
            filter: ReconstructionFilter::Box,
            component_format: ComponentFormat::Float32,
        };
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
