//! What reports measure with: threads, and images that have to be the same.

use rayon::ThreadPool;
use vdf_render::{Image, RenderError};

use crate::failure::Failure;

/// The most threads that a report takes.
pub(super) const MOST_THREADS: usize = 1024;

/// How many processors there are, as far as this program may use them.
pub(super) fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// A pool of so many threads, one for each processor by default.
pub(super) fn pool(threads: Option<usize>) -> Result<ThreadPool, Failure> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.unwrap_or(0)).build();
    pool.map_err(|e| RenderError::Threads { message: e.to_string() }.into())
}

/// Whether the images are the same, bit for bit.
pub(super) fn same_bits(a: &Image, b: &Image) -> bool {
    (a.width, a.height, a.origin) == (b.width, b.height, b.origin) && has_pixels(a, b)
}

/// Whether the pixels of a part of the film are the same in the image, bit for bit.
pub(super) fn has_pixels(image: &Image, part: &Image) -> bool {
    let offset = |i: usize| usize::try_from(i64::from(part.origin[i]) - i64::from(image.origin[i])).ok();
    let (Some(dx), Some(dy)) = (offset(0), offset(1)) else { return false };
    let (width, part_width) = (image.width as usize, part.width as usize);
    let bits = |p: &vdf_render::Rgb| p.to_array().map(f32::to_bits);
    part.pixels.chunks(part_width.max(1)).enumerate().all(|(y, row)| {
        let first = (y + dy) * width + dx;
        let there = image.pixels.get(first..first + row.len()).unwrap_or_default();
        dx + part_width <= width && row.iter().map(bits).eq(there.iter().map(bits))
    })
}

#[cfg(test)]
mod tests {
    use vdf_render::Rgb;

    use super::*;

    #[test]
    fn images_are_compared_bit_by_bit() {
        let mut a = Image::new(4, 3);
        for (i, p) in a.pixels.iter_mut().enumerate() {
            *p = Rgb::splat(i as f32);
        }
        assert!(same_bits(&a, &a.clone()));
        for (at, value) in [(0, -0.0), (5, 5.000_001), (11, f32::NAN)] {
            let mut b = a.clone();
            b.pixels[at].z = value;
            assert!(!same_bits(&a, &b) && !same_bits(&b, &a), "{at}");
        }
        assert!(!same_bits(&a, &Image::new(3, 4)));
        let mut shorter = a.clone();
        shorter.height = 2;
        shorter.pixels.truncate(8);
        assert!(!same_bits(&a, &shorter) && !same_bits(&shorter, &a));
    }
}
