//! A render with all options resolved: which pixels, how many samples, and the path of any one sample.
//!
//! Every random number is a function of (seed, pixel, sample, dimension), so a path is the same whoever follows it, and in whatever order.

use vdf_scene::{PixelRect, Rgb};
use vdf_visibility::{Counters, NoRecorder, Recorder, Visibility};

use crate::{
    Camera, FilterSample, Integrator, PixelFilter, PreparedScene, Progress, RenderOptions, Sampler, SamplerKind,
    integrator::Tracer,
};

/// Side of a tile in pixels. Only progress sees tiles.
const TILE: u32 = 16;

/// What to render, with all options resolved.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    prepared: &'a PreparedScene,
    options: &'a RenderOptions,
    camera: Camera,
    crop: PixelRect,
    spp: u32,
    seed: u64,
}

/// Follows the paths of a job; one for each thread or for all of them.
pub struct PathTracer<'a, R> {
    tracer: Tracer<'a, R>,
    camera: Camera,
    filter: PixelFilter,
    integrator: Integrator,
    sampler: SamplerKind,
    seed: u64,
}

impl<'a> Job<'a> {
    pub(crate) fn new(prepared: &'a PreparedScene, options: &'a RenderOptions) -> Self {
        let scene = prepared.scene();
        Self {
            prepared,
            options,
            camera: Camera::new(&scene.sensor, &scene.film),
            crop: options.crop.unwrap_or(scene.film.crop),
            spp: options.spp.unwrap_or(scene.sample_count),
            seed: options.seed.unwrap_or(scene.seed),
        }
    }

    /// What is rendered.
    #[must_use]
    pub const fn prepared(&self) -> &'a PreparedScene {
        self.prepared
    }

    /// The options as they were given.
    #[must_use]
    pub const fn options(&self) -> &'a RenderOptions {
        self.options
    }

    /// The pixels of the full film that are rendered.
    #[must_use]
    pub const fn crop(&self) -> PixelRect {
        self.crop
    }

    /// Width and height of the image in pixels.
    #[must_use]
    pub const fn size(&self) -> [u32; 2] {
        [self.crop.x1 - self.crop.x0, self.crop.y1 - self.crop.y0]
    }

    /// Samples per pixel.
    #[must_use]
    pub const fn spp(&self) -> u32 {
        self.spp
    }

    /// Seed of the random numbers.
    #[must_use]
    pub const fn seed(&self) -> u64 {
        self.seed
    }

    /// The tiles, row by row.
    #[must_use]
    pub fn tiles(&self) -> Vec<PixelRect> {
        let PixelRect { x0, y0, x1, y1 } = self.crop;
        (y0..y1)
            .step_by(TILE as usize)
            .flat_map(|y| (x0..x1).step_by(TILE as usize).map(move |x| (x, y)))
            .map(|(x, y)| PixelRect { x0: x, y0: y, x1: (x + TILE).min(x1), y1: (y + TILE).min(y1) })
            .collect()
    }

    /// Who follows the paths, asking the scene's own provers. A path that goes on and on asks `progress` whether to stop; then its radiance
    /// is not to be used.
    #[must_use]
    pub fn tracer(&self, progress: &'a dyn Progress) -> PathTracer<'a, NoRecorder> {
        self.tracer_with(self.prepared.visibility().segment_first(self.options.segment_first), progress)
    }

    /// Who follows the paths and lets `recorder` hear of every visibility query.
    #[must_use]
    pub fn recording_tracer<R: Recorder>(&self, recorder: R, progress: &'a dyn Progress) -> PathTracer<'a, R> {
        self.tracer_with(self.prepared.visibility().recorded(recorder), progress)
    }

    fn tracer_with<R: Recorder>(&self, visibility: Visibility<'a, R>, progress: &'a dyn Progress) -> PathTracer<'a, R> {
        let scene = self.prepared.scene();
        PathTracer {
            tracer: Tracer {
                world: self.prepared.world(),
                visibility,
                settings: scene.integrator,
                transmittance: self.options.transmittance,
                roulette: self.options.roulette,
                estimator: self.options.estimator,
                progress,
            },
            camera: self.camera,
            filter: PixelFilter::new(&scene.film.filter),
            integrator: self.options.integrator,
            sampler: self.options.sampler,
            seed: self.seed,
        }
    }
}

impl<R> std::fmt::Debug for PathTracer<'_, R> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PathTracer")
            .field("integrator", &self.integrator)
            .field("seed", &self.seed)
            .finish_non_exhaustive()
    }
}

impl<R: Recorder> PathTracer<'_, R> {
    /// The radiance of one path, sample number `sample` of pixel (`x`, `y`) of the full film, and its weight in the pixel.
    #[inline]
    pub fn sample(&self, x: u32, y: u32, sample: u32, counters: &mut Counters) -> (Rgb, f64) {
        let mut sampler = Sampler::of_kind(self.sampler, self.seed, x, y, sample);
        let FilterSample { offset: [dx, dy], weight } = self.filter.sample(&mut sampler);
        let world = self.tracer.world;
        let (x, y, reach) = (f64::from(x) + dx, f64::from(y) + dy, world.lights.reach());
        let centre = self.camera.position();
        let (position, segment, direction) = if self.camera.has_lens() {
            self.camera.ray_through(x, y, reach, sampler.next_2d())
        } else {
            let (segment, direction) = self.camera.ray(x, y, reach);
            (centre, segment, direction)
        };
        let ray = self.tracer.camera_ray(centre, position, segment, direction);
        (self.tracer.radiance(self.integrator, ray, &mut sampler, counters), weight)
    }
}
