//! A render with all options resolved: which pixels, how many samples, and the path of any one sample.
//!
//! Every random number is a function of (seed, pixel, sample, dimension), so a path is the same whoever follows it, and in whatever order.

use pulp::Arch;
use vdf_scene::{PixelRect, Rgb};
use vdf_visibility::{Counters, NoRecorder, Recorder, Visibility};

use crate::{
    Camera, Estimator, FilterSample, Integrator, LightPaths, PixelFilter, PreparedScene, Progress, RenderOptions,
    Sampler, SamplerKind,
    film::{Feature, tile_rects},
    integrator::{Connected, PathRay, Tracer},
};

/// What to render, with all options resolved.
#[derive(Clone, Debug)]
pub struct Job<'a> {
    prepared: &'a PreparedScene,
    options: &'a RenderOptions,
    camera: Camera,
    filter: PixelFilter,
    crop: PixelRect,
    spp: u32,
    seed: u64,
}

/// Follows the paths of a job; one for each thread or for all of them.
///
/// Integrators are compiled here, once for those who listen and once for those who don't, and not again by each crate that follows paths.
pub struct PathTracer<'a> {
    tracer: Tracer<'a, NoRecorder>,
    /// Who traces instead if somebody listens.
    recording: Option<Tracer<'a, &'a dyn Recorder>>,
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
            filter: PixelFilter::new(&scene.film.filter),
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
        tile_rects(self.crop).collect()
    }

    /// Who follows the paths, asking the scene's own provers. A path that goes on and on asks `progress` whether to stop; then its radiance
    /// is not to be used.
    #[must_use]
    pub fn tracer(&self, progress: &'a dyn Progress) -> PathTracer<'a> {
        self.path_tracer(None, progress)
    }

    /// Who follows the paths and lets `recorder` hear of every visibility query.
    #[must_use]
    pub fn recording_tracer<'b>(&self, recorder: &'b dyn Recorder, progress: &'b dyn Progress) -> PathTracer<'b>
    where
        'a: 'b,
    {
        self.path_tracer(Some(recorder), progress)
    }

    fn path_tracer<'b>(&self, recorder: Option<&'b dyn Recorder>, progress: &'b dyn Progress) -> PathTracer<'b>
    where
        'a: 'b,
    {
        let visibility = || self.prepared.visibility();
        let light_paths = if self.has_light_paths() { Connected::Always } else { Connected::Never };
        let recording = |recorder| self.tracer_with(visibility().recorded(recorder), light_paths, progress);
        PathTracer {
            tracer: self.tracer_with(visibility().segment_first(self.options.segment_first), light_paths, progress),
            recording: recorder.map(recording),
            camera: self.camera,
            filter: self.filter,
            integrator: self.options.integrator,
            sampler: self.options.sampler,
            seed: self.seed,
        }
    }

    /// Whether paths are connected to paths of the lights: where that can be done, and pays.
    fn has_light_paths(&self) -> bool {
        let world = self.prepared.world();
        let may = self.options.light_paths != LightPaths::Never
            && self.options.integrator == Integrator::Volpath
            && self.options.estimator != Estimator::Thesis
            && !world.lights.beams().is_empty()
            && !world.media.is_chromatic();
        may && (self.options.light_paths == LightPaths::Always || world.light_paths_pay(self.prepared.scene()))
    }

    fn tracer_with<'b, R>(
        &self,
        visibility: Visibility<'b, R>,
        light_paths: Connected,
        progress: &'b dyn Progress,
    ) -> Tracer<'b, R>
    where
        'a: 'b,
    {
        Tracer {
            light_paths,
            world: self.prepared.world(),
            visibility,
            settings: self.prepared.scene().integrator,
            transmittance: self.options.transmittance,
            roulette: self.options.roulette,
            estimator: self.options.estimator,
            arch: Arch::new(),
            progress,
        }
    }
}

impl std::fmt::Debug for PathTracer<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PathTracer")
            .field("integrator", &self.integrator)
            .field("seed", &self.seed)
            .finish_non_exhaustive()
    }
}

impl PathTracer<'_> {
    /// The random numbers of a sample.
    fn numbers(&self, x: u32, y: u32, sample: u32) -> Sampler {
        let even = self.integrator.even_dimensions(self.tracer.world.lights.count());
        Sampler::of_kind(self.sampler, self.seed, x, y, sample).even_up_to(even)
    }

    /// What the camera ray of a sample meets first.
    pub(crate) fn feature(&self, x: u32, y: u32, sample: u32) -> Option<Feature> {
        let mut sampler = self.numbers(x, y, sample);
        let FilterSample { offset: [dx, dy], .. } = self.filter.sample(&mut sampler);
        let ray = self.camera_ray(f64::from(x) + dx, f64::from(y) + dy, &mut sampler);
        let hit = self.tracer.world.bvh.intersect(&ray.segment);
        let surface = self.tracer.surface_met(hit, &ray.segment, ray.direction)?;
        let depth = self.camera.distance(surface.point);
        Some(Feature { albedo: surface.reflectance, normal: surface.normal, position: surface.point, depth })
    }

    /// The ray through a place of the film.
    #[inline]
    fn camera_ray(&self, x: f64, y: f64, sampler: &mut Sampler) -> PathRay {
        let reach = self.tracer.world.lights.reach();
        let ray = match self.camera.lens() {
            Some(lens) => self.camera.ray_through(&lens, x, y, reach, sampler.next_2d()),
            None => self.camera.ray(x, y, reach),
        };
        self.tracer.camera_ray(self.camera.position(), &ray)
    }

    /// The radiance of one path, sample number `sample` of pixel (`x`, `y`) of the full film, and its weight in the pixel.
    pub fn sample(&self, x: u32, y: u32, sample: u32, counters: &mut Counters) -> (Rgb, f64) {
        let mut sampler = self.numbers(x, y, sample);
        let FilterSample { offset: [dx, dy], weight } = self.filter.sample(&mut sampler);
        let ray = self.camera_ray(f64::from(x) + dx, f64::from(y) + dy, &mut sampler);
        let radiance = match &self.recording {
            None => self.tracer.radiance(self.integrator, ray, &mut sampler, counters),
            Some(recording) => recording.radiance(self.integrator, ray, &mut sampler, counters),
        };
        (radiance, weight)
    }
}
