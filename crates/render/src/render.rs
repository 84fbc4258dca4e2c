//! Renders, whole or in parts, tile by tile over all threads.
//!
//! Every random number is a function of (seed, pixel, sample, dimension), and the samples of a pixel are summed in a fixed tree (`film/`).
//! So the image does not depend on threads, tiles, crop or method, nor on how its samples are divided.

use std::{
    ops::{Add, Range},
    sync::{Mutex, MutexGuard, PoisonError},
    time::Instant,
};

use glam::DVec3;
use rayon::prelude::*;
use vdf_image::Image;
use vdf_scene::PixelRect;
use vdf_visibility::Counters;

use crate::{
    Film, FilmError, FilmOrigin, Picture, Progress, RenderError, Statistics,
    film::{LayerSums, PixelSum, TileSums, pixels},
    job::{Job, PathTracer},
};

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

/// Which samples of which pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FilmPart {
    /// The numbers of the samples of each pixel.
    pub samples: Range<u32>,
    /// Only the tiles whose number leaves the rest `tiles.0` when divided by `tiles.1`.
    pub tiles: (usize, usize),
}

impl FilmPart {
    /// These samples of all pixels.
    #[must_use]
    pub const fn samples(samples: Range<u32>) -> Self {
        Self { samples, tiles: (0, 1) }
    }

    /// Part `index` of `count`, from 0, of a render of `spp` samples per pixel: a share of the samples of all pixels, one after the other. If there
    /// are more parts than samples, some are empty.
    ///
    /// ```
    /// # use vdf_render::FilmPart;
    /// assert_eq!(FilmPart::by_samples(10, 1, 4).samples, 2..5);
    /// ```
    #[must_use]
    pub fn by_samples(spp: u32, index: u32, count: u32) -> Self {
        let border = |i: u32| (u64::from(spp) * u64::from(i) / u64::from(count.max(1))) as u32;
        Self::samples(border(index)..border(index + 1))
    }

    /// Part `index` of `count`, from 0: every `count`-th tile with all its samples.
    #[must_use]
    pub const fn by_tiles(spp: u32, index: u32, count: u32) -> Self {
        Self { samples: 0..spp, tiles: (index as usize, count as usize) }
    }

    /// Whether the tile of this number belongs to the part.
    #[must_use]
    pub const fn has_tile(&self, tile: usize) -> bool {
        tile % self.tiles.1 == self.tiles.0
    }
}

/// A film that is being rendered to: threads add to it while others look.
#[derive(Debug)]
pub struct LiveFilm(Mutex<Film>);

impl LiveFilm {
    /// Goes on with a film.
    #[must_use]
    pub const fn new(film: Film) -> Self {
        Self(Mutex::new(film))
    }

    /// The film as it is now: with whole tiles only. Shares the sums with it, so it costs next to nothing.
    #[must_use]
    pub fn snapshot(&self) -> Film {
        self.lock().clone()
    }

    /// Changes what is said of the film.
    pub fn update(&self, change: impl FnOnce(&mut Film)) {
        change(&mut self.lock());
    }

    /// The film.
    #[must_use]
    pub fn into_film(self) -> Film {
        self.0.into_inner().unwrap_or_else(PoisonError::into_inner)
    }

    /// A panic elsewhere leaves no tile half added.
    fn lock(&self) -> MutexGuard<'_, Film> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// An empty film for a job.
pub(crate) fn empty_film(job: &Job<'_>, name: &str) -> Result<Film, RenderError> {
    let (scene, options) = (job.prepared().scene(), job.options());
    let origin = FilmOrigin {
        version: env!("CARGO_PKG_VERSION").to_owned(),
        scene: scene.checksum(),
        integrator: options.integrator.to_string(),
        transmittance: options.transmittance.name().to_owned(),
        roulette: options.roulette.name().to_owned(),
        estimator: options.estimator.name().to_owned(),
        light_paths: options.light_paths.name().to_owned(),
        sampler: options.sampler.name().to_owned(),
        seed: job.seed(),
        full_size: [scene.film.width, scene.film.height],
        crop: job.crop(),
        layers: options.kept_layers(),
        method: options.layers.depend_on_method().then(|| job.prepared().method().name().to_owned()),
        spp: job.spp(),
        noise: options.noise,
    };
    let picture = Picture {
        name: name.to_owned(),
        half: scene.film.component_format == vdf_scene::ComponentFormat::Float16,
        world_to_camera: scene.sensor.world_from_camera.inverse().to_cols_array(),
    };
    Film::new(origin, picture)
}

/// Renders on the current pool of threads.
pub(crate) fn render<'a>(job: &Job<'a>, progress: &'a dyn Progress) -> Result<Rendering, RenderError> {
    progress.phase("rendering");
    let start = Instant::now();
    let film = LiveFilm::new(empty_film(job, "")?);
    let part = FilmPart::samples(0..job.spp());
    progress.work_total(film.snapshot().missing_samples(&part));
    add_part(job, &film, &part, progress)?;
    let film = film.into_film();
    let image = film.develop().map_err(|error| match error {
        FilmError::Memory { size: [width, height] } => {
            let bytes = u64::from(width) * u64::from(height) * 12;
            RenderError::Film(vdf_image::ImageError::Memory { width, height, bytes })
        }
        error => RenderError::Incomplete(error),
    })?;
    let statistics = Statistics::new(job, film.counters(), job.spp(), start.elapsed().as_secs_f64());
    Ok(Rendering { image, statistics })
}

/// Adds what the film lacks of a part, on the current pool of threads. Tiles are added whole, so that a film can be looked at, or the work stopped,
/// at any time.
pub(crate) fn add_part<'a>(
    job: &Job<'a>,
    film: &LiveFilm,
    part: &FilmPart,
    progress: &'a dyn Progress,
) -> Result<(), RenderError> {
    let tiles: Vec<(usize, PixelRect)> =
        job.tiles().into_iter().enumerate().filter(|(i, _)| part.has_tile(*i)).collect();
    tiles.into_par_iter().try_for_each(|(number, tile)| {
        // Asked again and again, for with a limit of noise it is only known up to where the tile is judged.
        loop {
            let Some(samples) = film.lock().missing_of_tile(number, part.samples.clone()).into_iter().next() else {
                return Ok(());
            };
            let samples = samples.start as u32..samples.end as u32;
            let (sums, counters) = render_tile(job, tile, samples.clone(), progress)?;
            // Once a tile.
            film.lock().add_tile(number, sums, &counters);
            let area = u64::from(tile.x1 - tile.x0) * u64::from(tile.y1 - tile.y0);
            progress.work_done(area * u64::from(samples.end - samples.start));
        }
    })
}

fn render_tile<'a>(
    job: &Job<'a>,
    tile: PixelRect,
    samples: Range<u32>,
    progress: &'a dyn Progress,
) -> Result<(TileSums, Counters), RenderError> {
    let tracer = job.tracer(progress);
    let mut counters = Counters::default();
    let area = (tile.x1 - tile.x0) as usize * (tile.y1 - tile.y0) as usize;
    let mut sums = TileSums::new();
    let layers = job.options().kept_layers();
    if layers.is_empty() {
        for pixel in pixels(tile) {
            let sum = sum_pixel(&tracer, pixel, samples.clone(), progress, &mut counters, |value, _, _, _| value)?;
            sums.push(area, &sum, |value, numbers| numbers.extend(value.to_array()));
        }
        return Ok((sums, counters));
    }
    let layers = LayerSums::new(layers);
    for (x, y) in pixels(tile) {
        let make = |value, sample, before: &Counters, after: &Counters| {
            let feature = if layers.need_surface() { tracer.feature(x, y, sample) } else { None };
            layers.sample(value, feature, before, after)
        };
        let sum = sum_pixel(&tracer, (x, y), samples.clone(), progress, &mut counters, make)?;
        sums.push(area, &sum, |value, numbers| layers.keep(value, numbers));
    }
    Ok((sums, counters))
}

/// The sum of what `make` makes of each sample: of its value, its number, and the counters before and after it.
#[inline]
fn sum_pixel<V: Copy + Add<Output = V>>(
    tracer: &PathTracer<'_>,
    (x, y): (u32, u32),
    samples: Range<u32>,
    progress: &dyn Progress,
    counters: &mut Counters,
    make: impl Fn(DVec3, u32, &Counters, &Counters) -> V,
) -> Result<PixelSum<V>, RenderError> {
    let mut sum = PixelSum::new();
    for sample in samples {
        if sample % SAMPLES_PER_LOOK == 0 && progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let before = *counters;
        let (radiance, weight) = tracer.sample(x, y, sample, counters);
        counters.paths += 1;
        let value = if radiance.is_finite() && radiance.min_element() >= 0.0 {
            radiance.as_dvec3() * weight
        } else {
            counters.refused += 1;
            DVec3::ZERO
        };
        sum.add(sample, make(value, sample, &before, counters));
    }
    // The last path may have stopped on its way.
    if progress.cancelled() { Err(RenderError::Cancelled) } else { Ok(sum) }
}
