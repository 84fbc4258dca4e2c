//! A whole render, tile by tile over all threads.
//!
//! Every pixel is the mean of its own samples, summed in the order of their numbers, and every random number is a function of (seed, pixel,
//! sample, dimension). So the image does not depend on threads, tiles, crop or method.

use std::time::Instant;

use rayon::prelude::*;
use vdf_image::Image;
use vdf_scene::{PixelRect, Rgb};
use vdf_visibility::Counters;

use crate::{Progress, RenderError, Statistics, job::Job};

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
    let tiles = job.tiles();
    let rendered: Vec<_> = tiles
        .par_iter()
        .map(|tile| {
            let result = render_tile(job, *tile, progress)?;
            progress.work_done(result.0.len() as u64);
            Ok(result)
        })
        .collect::<Result<_, RenderError>>()?;

    let (film, crop) = (&job.prepared().scene().film, job.crop());
    let mut image = Image::cropped([film.width, film.height], [crop.x0, crop.y0], [width, height]);
    let mut counters = Counters::default();
    for (tile, (tile_pixels, tile_counters)) in tiles.iter().zip(rendered) {
        counters += tile_counters;
        let row = (tile.x1 - tile.x0) as usize;
        for (y, line) in (tile.y0..).zip(tile_pixels.chunks_exact(row)) {
            let first = (y - crop.y0) as usize * width as usize + (tile.x0 - crop.x0) as usize;
            image.pixels[first..first + row].copy_from_slice(line);
        }
    }
    let statistics = Statistics::new(job, &counters, start.elapsed().as_secs_f64());
    Ok(Rendering { image, statistics })
}

fn render_tile<'a>(job: &Job<'a>, tile: PixelRect, progress: &'a dyn Progress) -> Result<(Vec<Rgb>, Counters), RenderError> {
    let tracer = job.tracer(progress);
    let mut counters = Counters::default();
    let pixels = (tile.y0..tile.y1)
        .flat_map(|y| (tile.x0..tile.x1).map(move |x| (x, y)))
        .map(|(x, y)| {
            let mut sum = glam::DVec3::ZERO;
            for sample in 0..job.spp() {
                if sample % SAMPLES_PER_LOOK == 0 && progress.cancelled() {
                    return Err(RenderError::Cancelled);
                }
                let radiance = tracer.sample(x, y, sample, &mut counters);
                counters.paths += 1;
                if radiance.is_finite() && radiance.min_element() >= 0.0 {
                    sum += radiance.as_dvec3();
                } else {
                    counters.refused += 1;
                }
            }
            // The last path may have stopped on its way.
            if progress.cancelled() {
                return Err(RenderError::Cancelled);
            }
            Ok((sum / f64::from(job.spp())).as_vec3())
        })
        .collect::<Result<_, RenderError>>()?;
    Ok((pixels, counters))
}
