//! The film: sums of samples that can be cut and put together again.
//!
//! *Idea.* Floating-point addition is not associative, so a pixel's mean depends on the order of its samples. Here that order is a tree: a
//! block of 2ᵏ samples whose first number is a multiple of 2ᵏ is the sum of its two halves, and a pixel is the sum of the largest such blocks
//! that make up its samples, from the first to the last.
//!
//! *Guarantee.* The image has the same bytes however the samples are divided between threads, passes or machines: every division consists of
//! blocks of the same tree.
//!
//! *Cost.* A render that is not divided keeps a stack of at most 33 sums for the pixel at hand. A [`Film`] keeps 24 bytes a pixel for each
//! of its blocks, of which there are at most two for each power of two in the number of samples.

use std::ops::Range;

use glam::DVec3;
use smallvec::SmallVec;
use vdf_image::Image;
use vdf_scene::PixelRect;

use crate::Integrator;

/// A block of samples: those with the numbers index·2^level to (index + 1)·2^level − 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct BlockId {
    level: u32,
    index: u32,
}

impl BlockId {
    const fn samples(self) -> Range<u64> {
        let size = 1_u64 << self.level;
        self.index as u64 * size..(self.index as u64 + 1) * size
    }

    /// The block that has this one as its left half, and the other as its right half.
    fn parent_with(self, right: Self) -> Option<Self> {
        let buddies = self.level == right.level && self.index.is_multiple_of(2) && right.index == self.index + 1;
        buddies.then_some(Self { level: self.level + 1, index: self.index / 2 })
    }
}

/// The sum of consecutive samples of one pixel, in the order of the tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct PixelSum {
    blocks: SmallVec<[(BlockId, DVec3); 8]>,
}

impl PixelSum {
    /// Adds sample number `sample`, the one after that added before.
    #[inline]
    pub(crate) fn add(&mut self, sample: u32, value: DVec3) {
        let (mut id, mut sum) = (BlockId { level: 0, index: sample }, value);
        while let Some(&(left, left_sum)) = self.blocks.last()
            && let Some(parent) = left.parent_with(id)
        {
            (id, sum) = (parent, left_sum + sum);
            self.blocks.pop();
        }
        self.blocks.push((id, sum));
    }

    /// The sum of all.
    #[inline]
    pub(crate) fn total(&self) -> DVec3 {
        self.blocks.iter().fold(DVec3::ZERO, |total, (_, sum)| total + *sum)
    }
}

/// What the samples of a film are samples of: films that differ in it cannot be merged.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmOrigin {
    /// [`vdf_scene::Scene::checksum`].
    pub scene: u32,
    /// Integrator of the render.
    pub integrator: Integrator,
    /// Name of the estimator of transmittance.
    pub transmittance: &'static str,
    /// Name of the roulette.
    pub roulette: &'static str,
    /// Name of the estimator of light.
    pub estimator: &'static str,
    /// How the samples of a pixel are spread.
    pub sampler: &'static str,
    /// Seed of the render.
    pub seed: u64,
    /// Width and height of the full film in pixels.
    pub full_size: [u32; 2],
    /// The pixels.
    pub crop: PixelRect,
}

/// Sums of some samples of every pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    origin: FilmOrigin,
    /// In the order of their samples.
    blocks: Vec<(BlockId, Vec<DVec3>)>,
}

/// Why two films cannot be merged, or a film is not complete.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FilmError {
    /// They are of different renders.
    #[error("the films are of different renders: {field} differs")]
    Stranger {
        /// What differs.
        field: &'static str,
    },
    /// Both have these samples.
    #[error("both films have the samples {} to {}", samples.start, samples.end - 1)]
    Overlap {
        /// The samples.
        samples: Range<u64>,
    },
    /// There are no samples before these, or none at all.
    #[error("the film lacks the samples from {from}")]
    Missing {
        /// The first that is missing.
        from: u64,
    },
}

impl Film {
    pub(crate) const fn new(origin: FilmOrigin) -> Self {
        Self { origin, blocks: Vec::new() }
    }

    /// Sets the sums of pixel number `pixel`, all of which must have the same blocks.
    pub(crate) fn set(&mut self, pixel: usize, pixels: usize, sum: &PixelSum) {
        if self.blocks.is_empty() {
            self.blocks = sum.blocks.iter().map(|(id, _)| (*id, vec![DVec3::ZERO; pixels])).collect();
        }
        for ((_, sums), (_, sum)) in self.blocks.iter_mut().zip(&sum.blocks) {
            sums[pixel] = *sum;
        }
    }

    /// What the samples are samples of.
    #[must_use]
    pub const fn origin(&self) -> &FilmOrigin {
        &self.origin
    }

    /// The ranges of samples that every pixel has, in order; ranges that follow each other are one.
    #[must_use]
    pub fn samples(&self) -> Vec<Range<u64>> {
        let mut ranges: Vec<Range<u64>> = Vec::new();
        for (id, _) in &self.blocks {
            let samples = id.samples();
            match ranges.last_mut() {
                Some(last) if last.end == samples.start => last.end = samples.end,
                _ => ranges.push(samples),
            }
        }
        ranges
    }

    /// Adds the samples of `other`. The result does not depend on the order in which films are merged.
    ///
    /// # Errors
    /// If the films are of different renders or have a sample in common; then this film is unchanged.
    pub fn merge(&mut self, other: Self) -> Result<(), FilmError> {
        let (a, b) = (&self.origin, &other.origin);
        let differs = [
            ("the scene", a.scene != b.scene),
            ("the integrator", a.integrator != b.integrator),
            ("the estimator of transmittance", a.transmittance != b.transmittance),
            ("the roulette", a.roulette != b.roulette),
            ("the estimator of light", a.estimator != b.estimator),
            ("the sampler", a.sampler != b.sampler),
            ("the seed", a.seed != b.seed),
            ("the size of the film", a.full_size != b.full_size),
            ("the crop", a.crop != b.crop),
        ];
        if let Some((field, _)) = differs.into_iter().find(|(_, differs)| *differs) {
            return Err(FilmError::Stranger { field });
        }
        for (id, _) in &other.blocks {
            let new = id.samples();
            let common = self.blocks.iter().map(|(id, _)| id.samples()).find_map(|old| {
                let common = old.start.max(new.start)..old.end.min(new.end);
                (common.start < common.end).then_some(common)
            });
            if let Some(samples) = common {
                return Err(FilmError::Overlap { samples });
            }
        }
        self.blocks.extend(other.blocks);
        self.blocks.sort_by_key(|(id, _)| id.samples().start);
        self.join_halves();
        Ok(())
    }

    fn join_halves(&mut self) {
        let mut joined: Vec<(BlockId, Vec<DVec3>)> = Vec::with_capacity(self.blocks.len());
        for (mut id, mut sums) in self.blocks.drain(..) {
            while let Some((left, _)) = joined.last()
                && let Some(parent) = left.parent_with(id)
                && let Some((_, left_sums)) = joined.pop()
            {
                sums.iter_mut().zip(left_sums).for_each(|(right, left)| *right = left + *right);
                id = parent;
            }
            joined.push((id, sums));
        }
        self.blocks = joined;
    }

    /// The image: the mean of the samples of each pixel.
    ///
    /// # Errors
    /// If the samples are not all those from 0 to some number.
    pub fn develop(&self) -> Result<Image, FilmError> {
        let ranges = self.samples();
        let n = match ranges.as_slice() {
            [all] if all.start == 0 => all.end,
            [first, ..] if first.start == 0 => return Err(FilmError::Missing { from: first.end }),
            _ => return Err(FilmError::Missing { from: 0 }),
        };
        let FilmOrigin { full_size, crop, .. } = self.origin;
        let mut image = Image::cropped(full_size, [crop.x0, crop.y0], [crop.x1 - crop.x0, crop.y1 - crop.y0]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            let total = self.blocks.iter().fold(DVec3::ZERO, |total, (_, sums)| total + sums[i]);
            *pixel = (total / n as f64).as_vec3();
        }
        Ok(image)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampler;

    const PIXELS: usize = 3;

    fn origin(seed: u64) -> FilmOrigin {
        let crop = PixelRect { x0: 0, y0: 0, x1: 3, y1: 1 };
        let integrator = Integrator::Volpath;
        let (transmittance, roulette, estimator, sampler) = ("analytic", "standard", "thesis", "independent");
        FilmOrigin { scene: 1, integrator, transmittance, roulette, estimator, sampler, seed, full_size: [3, 1], crop }
    }

    /// Values whose sums depend on the order: of very different sizes.
    fn value(pixel: usize, sample: u32) -> DVec3 {
        let mut u = Sampler::new(3, pixel as u32, 0, sample);
        DVec3::from_array([(); 3].map(|()| u.next_1d() * (30.0 * u.next_1d()).exp()))
    }

    fn film(samples: Range<u32>) -> Film {
        let mut film = Film::new(origin(7));
        for pixel in 0..PIXELS {
            let mut sum = PixelSum::default();
            samples.clone().for_each(|s| sum.add(s, value(pixel, s)));
            film.set(pixel, PIXELS, &sum);
        }
        film
    }

    /// The definition: the sum of a block is that of its halves.
    fn block(pixel: usize, first: u32, size: u32) -> DVec3 {
        match size {
            1 => value(pixel, first),
            _ => block(pixel, first, size / 2) + block(pixel, first + size / 2, size / 2),
        }
    }

    #[test]
    fn sums_are_those_of_the_tree() {
        for n in 1..70_u32 {
            let developed = film(0..n).develop().unwrap();
            for pixel in 0..PIXELS {
                let (mut total, mut first) = (DVec3::ZERO, 0);
                while first < n {
                    let size = 1 << (n - first).ilog2();
                    total += block(pixel, first, size);
                    first += size;
                }
                assert_eq!(developed.pixels[pixel], (total / f64::from(n)).as_vec3(), "{n} samples");
            }
        }
    }

    #[test]
    fn a_film_is_the_same_however_it_was_cut() {
        for n in [1_u32, 2, 7, 8, 64, 77] {
            let whole = film(0..n);
            for cut in 0..300 {
                let mut u = Sampler::new(11, cut, n, 0);
                let mut borders = vec![0, n];
                borders.extend((0..cut % 5).map(|_| (u.next_1d() * f64::from(n)) as u32));
                borders.sort_unstable();
                borders.dedup();
                let mut parts: Vec<Film> = borders.windows(2).map(|b| film(b[0]..b[1])).collect();
                while parts.len() > 1 {
                    let part = parts.swap_remove((u.next_1d() * parts.len() as f64) as usize);
                    let into = (u.next_1d() * parts.len() as f64) as usize;
                    parts[into].merge(part).unwrap();
                }
                assert_eq!(parts[0], whole, "{n} samples cut at {borders:?}");
            }
        }
    }

    #[test]
    fn strangers_overlaps_and_gaps_are_refused() {
        let mut a = film(0..5);
        let unchanged = a.clone();
        assert_eq!(a.merge(film(3..9)), Err(FilmError::Overlap { samples: 3..4 }));
        let other = Film { origin: origin(8), ..film(5..9) };
        assert_eq!(a.merge(other), Err(FilmError::Stranger { field: "the seed" }));
        assert_eq!(a, unchanged);
        a.merge(film(6..9)).unwrap();
        assert_eq!(a.samples(), [0..5, 6..9]);
        assert_eq!(a.develop(), Err(FilmError::Missing { from: 5 }));
        assert_eq!(film(2..4).develop(), Err(FilmError::Missing { from: 0 }));
        a.merge(film(5..6)).unwrap();
        assert_eq!(a, film(0..9));
    }
}
