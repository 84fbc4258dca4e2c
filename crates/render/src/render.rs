//! A whole render, tile by tile over all threads, or some samples of it.
//!
//! Every random number is a function of (seed, pixel, sample, dimension), and the samples of a pixel are summed in a fixed tree (`film.rs`).
//! So the image does not depend on threads, tiles, crop or method, nor on how its samples are divided.

use std::{ops::Range, sync::Mutex, time::Instant};

use rayon::prelude::*;
use vdf_image::Image;
use vdf_scene::{PixelRect, Rgb};
use vdf_visibility::{Counters, NoRecorder};

use crate::{
    Film, FilmOrigin, Progress, RenderError, Statistics,
    film::PixelSum,
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

/// Renders on the current pool of threads.
pub(crate) fn render<'a>(job: &Job<'a>, progress: &'a dyn Progress) -> Result<Rendering, RenderError> {
    progress.phase("rendering");
    let start = Instant::now();
    let [width, height] = job.size();
    progress.work_total(u64::from(width) * u64::from(height));
    // Before the first sample is taken: a film that does not fit is told at once.
    let (film, crop) = (&job.prepared().scene().film, job.crop());
    let image = Image::try_cropped([film.width, film.height], [crop.x0, crop.y0], [width, height])?;
    // Locked once a tile.
    let image = Mutex::new(image);
    let counters = job
        .tiles()
        .into_par_iter()
        .map(|tile| {
            let (pixels, counters) = render_tile(job, tile, progress)?;
            if let Ok(mut image) = image.lock() {
                put(&mut image, crop, tile, &pixels);
            }
            progress.work_done(pixels.len() as u64);
            Ok(counters)
        })
        .try_reduce(Counters::default, |mut a, b| {
            a += b;
            Ok::<_, RenderError>(a)
        })?;
    let image = image.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    let statistics = Statistics::new(job, &counters, start.elapsed().as_secs_f64());
    Ok(Rendering { image, statistics })
}

fn render_tile<'a>(
    job: &Job<'a>,
    tile: PixelRect,
    progress: &'a dyn Progress,
) -> Result<(Vec<Rgb>, Counters), RenderError> {
    let tracer = job.tracer(progress);
    let mut counters = Counters::default();
    let n = f64::from(job.spp());
    let pixels = pixels(tile)
        .map(|pixel| {
            let sum = sum_pixel(&tracer, pixel, 0..job.spp(), progress, &mut counters)?;
            Ok((sum.total() / n).as_vec3())
        })
        .collect::<Result<_, RenderError>>()?;
    Ok((pixels, counters))
}

/// Puts the pixels of a tile at their place in the image of `crop`.
fn put(image: &mut Image, crop: PixelRect, tile: PixelRect, pixels: &[Rgb]) {
    let (width, row) = (image.width as usize, (tile.x1 - tile.x0) as usize);
    for (y, line) in (tile.y0..).zip(pixels.chunks_exact(row)) {
        let first = (y - crop.y0) as usize * width + (tile.x0 - crop.x0) as usize;
        image.pixels[first..first + row].copy_from_slice(line);
    }
}

/// Some samples of every pixel, on the current pool of threads.
pub(crate) fn render_film<'a>(
    job: &Job<'a>,
    samples: Range<u32>,
    progress: &'a dyn Progress,
) -> Result<(Film, Counters), RenderError> {
    progress.phase("rendering");
    let scene = job.prepared().scene();
    let (crop, [width, height]) = (job.crop(), job.size());
    progress.work_total(u64::from(width) * u64::from(height));
    let rows: Vec<(Vec<PixelSum>, Counters)> = (crop.y0..crop.y1)
        .into_par_iter()
        .map(|y| {
            let tracer = job.tracer(progress);
            let mut counters = Counters::default();
            let row = PixelRect { y0: y, y1: y + 1, ..crop };
            let sums = pixels(row)
                .map(|pixel| sum_pixel(&tracer, pixel, samples.clone(), progress, &mut counters))
                .collect::<Result<_, RenderError>>()?;
            progress.work_done(u64::from(width));
            Ok((sums, counters))
        })
        .collect::<Result<_, RenderError>>()?;
    let mut film = Film::new(FilmOrigin {
        scene: scene.checksum(),
        integrator: job.options().integrator,
        transmittance: job.options().transmittance.name(),
        roulette: job.options().roulette.name(),
        estimator: job.options().estimator.name(),
        sampler: job.options().sampler.name(),
        seed: job.seed(),
        full_size: [scene.film.width, scene.film.height],
        crop,
    });
    let mut counters = Counters::default();
    let count = width as usize * height as usize;
    for (row, (sums, of_row)) in rows.into_iter().enumerate() {
        counters += of_row;
        for (x, sum) in sums.iter().enumerate() {
            film.set(row * width as usize + x, count, sum);
        }
    }
    Ok((film, counters))
}

/// The pixels of a rectangle, row by row.
fn pixels(r: PixelRect) -> impl Iterator<Item = (u32, u32)> {
    (r.y0..r.y1).flat_map(move |y| (r.x0..r.x1).map(move |x| (x, y)))
}

fn sum_pixel(
    tracer: &PathTracer<'_, NoRecorder>,
    (x, y): (u32, u32),
    samples: Range<u32>,
    progress: &dyn Progress,
    counters: &mut Counters,
) -> Result<PixelSum, RenderError> {
    let mut sum = PixelSum::default();
    for sample in samples {
        if sample % SAMPLES_PER_LOOK == 0 && progress.cancelled() {
            return Err(RenderError::Cancelled);
        }
        let (radiance, weight) = tracer.sample(x, y, sample, counters);
        counters.paths += 1;
        if radiance.is_finite() && radiance.min_element() >= 0.0 {
            sum.add(sample, radiance.as_dvec3() * weight);
        } else {
            counters.refused += 1;
            sum.add(sample, glam::DVec3::ZERO);
        }
    }
    // The last path may have stopped on its way.
    if progress.cancelled() { Err(RenderError::Cancelled) } else { Ok(sum) }
}
