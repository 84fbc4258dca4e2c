//! A whole render: prepare, build, then tile by tile over all threads.
//!
//! Every pixel is the mean of its own samples, summed in the order of their numbers, and every random number is a function of (seed, pixel,
//! sample, dimension). So the image does not depend on threads, tiles, crop or method.

use std::time::Instant;

use rayon::prelude::*;

use crate::{
    Acceleration, BuildReport, Image, IntegratorKind, Progress, ProofsVisitor, RenderError, RenderOptions, Rgb,
    Sampler, Statistics, TransmittanceEstimator, World,
    integrator::{Integrator, PathRay},
    options::{default_voxel_size, on_threads},
    scene::{PixelRect, Scene},
    statistics::Record,
    visibility::{Counters, Proofs, Recorder, Visibility},
};

/// Side of a tile in pixels. Only progress sees tiles.
const TILE: u32 = 16;

/// Samples of one pixel between two looks whether to stop: a tile, or even a pixel, may take minutes.
const SAMPLES_PER_LOOK: u32 = 64;

/// A finished render.
#[derive(Clone, Debug)]
pub struct Rendering {
    /// The image.
    pub image: Image,
    /// Its figures.
    pub statistics: Statistics,
}

/// Renders `scene`.
///
/// # Errors
/// If an option or the voxel size is not usable, or `progress` asks to stop.
pub fn render(scene: &Scene, options: &RenderOptions, progress: &dyn Progress) -> Result<Rendering, RenderError> {
    options.validate(scene)?;
    on_threads(options.threads, || render_in_pool(scene, options, progress))
}

fn render_in_pool(scene: &Scene, options: &RenderOptions, progress: &dyn Progress) -> Result<Rendering, RenderError> {
    progress.phase("hierarchy");
    let start = Instant::now();
    let world = World::new(scene);
    let t_hierarchy = start.elapsed().as_secs_f64();

    progress.phase("distance field");
    let voxel_size = options.voxel_size.unwrap_or_else(|| default_voxel_size(world.bounds));
    let (acceleration, build) = Acceleration::build(
        options.method,
        &world.triangles,
        world.bounds,
        &scene.light_shapes(),
        voxel_size,
        options.max_voxels,
    )?;

    let prepared = Prepared { world: &world, t_hierarchy, acceleration: &acceleration, build: &build };
    render_tiles(scene, &prepared, options, progress)
}

/// What a render needs and several renders can share.
#[derive(Clone, Copy, Debug)]
pub struct Prepared<'a> {
    /// The scene, prepared by [`World::new`].
    pub world: &'a World,
    /// How many seconds that took.
    pub t_hierarchy: f64,
    /// The proofs of the method, from [`Acceleration::build`].
    pub acceleration: &'a Acceleration,
    /// What that built.
    pub build: &'a BuildReport,
}

/// As [`render()`], without the preparation: `prepared` must be that of `scene`, its proofs those of `options.method`, which with
/// `options.voxel_size` and `options.max_voxels` only says what the statistics are about.
///
/// # Errors
/// If an option is not usable, or `progress` asks to stop.
pub fn render_prepared(
    scene: &Scene,
    prepared: &Prepared<'_>,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Rendering, RenderError> {
    options.validate(scene)?;
    on_threads(options.threads, || render_tiles(scene, prepared, options, progress))
}

fn render_tiles(
    scene: &Scene,
    prepared: &Prepared<'_>,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Rendering, RenderError> {
    let Prepared { world, t_hierarchy, acceleration, build } = *prepared;
    progress.phase("rendering");
    let start = Instant::now();
    let job = Job::new(scene, world, options);
    let (pixels, counters) = acceleration.accept(Run { job: &job, progress })?;
    let mut image = Image::cropped([scene.film.width, scene.film.height], job.crop);
    image.pixels = pixels;
    let statistics = Statistics::new(&Record {
        scene,
        options,
        build,
        counters: &counters,
        t_hierarchy,
        t_render: start.elapsed().as_secs_f64(),
        size: [image.width, image.height],
        spp: job.spp,
        seed: job.seed,
        triangles: world.triangles.len(),
    });
    Ok(Rendering { image, statistics })
}

/// What to render, with all options resolved.
pub(crate) struct Job<'a> {
    pub(crate) scene: &'a Scene,
    pub(crate) world: &'a World,
    pub(crate) kind: IntegratorKind,
    pub(crate) transmittance: TransmittanceEstimator,
    pub(crate) crop: PixelRect,
    pub(crate) spp: u32,
    pub(crate) seed: u64,
    segment_first: bool,
}

/// Runs a job with the proofs of its method.
struct Run<'a> {
    job: &'a Job<'a>,
    progress: &'a dyn Progress,
}

impl ProofsVisitor for Run<'_> {
    type Output = Result<(Vec<Rgb>, Counters), RenderError>;

    fn visit<P: Proofs>(self, proofs: &P) -> Self::Output {
        self.job.run(proofs, self.progress)
    }
}

impl<'a> Job<'a> {
    pub(crate) fn new(scene: &'a Scene, world: &'a World, options: &RenderOptions) -> Self {
        Self {
            scene,
            world,
            kind: options.integrator,
            transmittance: options.transmittance,
            crop: options.crop.unwrap_or(scene.film.crop),
            spp: options.spp.unwrap_or(scene.sample_count),
            seed: options.seed.unwrap_or(scene.seed),
            segment_first: options.segment_first,
        }
    }

    pub(crate) fn size(&self) -> (u32, u32) {
        (self.crop.x1 - self.crop.x0, self.crop.y1 - self.crop.y0)
    }

    /// The tiles, row by row.
    pub(crate) fn tiles(&self) -> Vec<PixelRect> {
        (self.crop.y0..self.crop.y1)
            .step_by(TILE as usize)
            .flat_map(|y0| (self.crop.x0..self.crop.x1).step_by(TILE as usize).map(move |x0| (x0, y0)))
            .map(|(x0, y0)| PixelRect { x0, y0, x1: (x0 + TILE).min(self.crop.x1), y1: (y0 + TILE).min(self.crop.y1) })
            .collect()
    }

    /// Renders all tiles; generic in the method, so that the dispatch stays out of the loops.
    fn run<P: Proofs>(&self, proofs: &P, progress: &dyn Progress) -> Result<(Vec<Rgb>, Counters), RenderError> {
        let (width, height) = self.size();
        progress.work_total(u64::from(width) * u64::from(height));
        let tiles = self.tiles();
        let rendered: Vec<_> = tiles
            .par_iter()
            .map(|tile| {
                let result = self.tile(proofs, *tile, progress)?;
                progress.work_done(result.0.len() as u64);
                Ok(result)
            })
            .collect::<Result<_, RenderError>>()?;

        let mut pixels = vec![Rgb::ZERO; width as usize * height as usize];
        let mut counters = Counters::default();
        for (tile, (tile_pixels, tile_counters)) in tiles.iter().zip(rendered) {
            counters += tile_counters;
            let row = (tile.x1 - tile.x0) as usize;
            for (y, line) in (tile.y0..).zip(tile_pixels.chunks_exact(row)) {
                let first = (y - self.crop.y0) as usize * width as usize + (tile.x0 - self.crop.x0) as usize;
                pixels[first..first + row].copy_from_slice(line);
            }
        }
        Ok((pixels, counters))
    }

    fn tile<P: Proofs>(
        &self,
        proofs: &P,
        tile: PixelRect,
        progress: &dyn Progress,
    ) -> Result<(Vec<Rgb>, Counters), RenderError> {
        let integrator = Integrator {
            world: self.world,
            visibility: Visibility::new(&self.world.bvh, proofs, self.segment_first),
            settings: self.scene.integrator,
            transmittance: self.transmittance,
        };
        let mut counters = Counters::default();
        let pixels = (tile.y0..tile.y1)
            .flat_map(|y| (tile.x0..tile.x1).map(move |x| (x, y)))
            .map(|(x, y)| {
                let mut sum = glam::DVec3::ZERO;
                for sample in 0..self.spp {
                    if sample % SAMPLES_PER_LOOK == 0 && progress.cancelled() {
                        return Err(RenderError::Cancelled);
                    }
                    let radiance = self.sample(&integrator, x, y, sample, &mut counters);
                    counters.paths += 1;
                    if radiance.is_finite() && radiance.min_element() >= 0.0 {
                        sum += radiance.as_dvec3();
                    } else {
                        counters.refused += 1;
                    }
                }
                Ok((sum / f64::from(self.spp)).as_vec3())
            })
            .collect::<Result<_, RenderError>>()?;
        Ok((pixels, counters))
    }

    /// The radiance of one path.
    #[inline]
    pub(crate) fn sample<P: Proofs, R: Recorder>(
        &self,
        integrator: &Integrator<'_, P, R>,
        x: u32,
        y: u32,
        sample: u32,
        counters: &mut Counters,
    ) -> Rgb {
        let mut sampler = Sampler::new(self.seed, x, y, sample);
        let film = &self.scene.film;
        let [dx, dy] = film.filter.sample(&mut sampler);
        let (segment, direction) = self.scene.sensor.ray(film, f64::from(x) + dx, f64::from(y) + dy);
        let ray = PathRay { segment, direction, medium: self.scene.sensor.medium };
        match self.kind {
            IntegratorKind::Volpath => integrator.volpath(ray, &mut sampler, counters),
            IntegratorKind::Raymarch { samples_per_segment } => {
                integrator.raymarch(ray, samples_per_segment, &mut sampler, counters)
            }
        }
    }
}
