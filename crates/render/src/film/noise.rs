//! Noise: how far the pixels of a tile may be from what they would be after infinitely many samples, and whether a tile has samples enough.
//!
//! *Idea.* The variance of a pixel's mean is estimated from its samples. One pixel's estimate is worth little when few of its samples
//! carry most of the light, so a tile of 256 pixels is judged as one \[Dammertz2010\].
//!
//! *Guarantee.* A tile is judged by its own samples alone, and only when their number is a power of two, from [`FEWEST`] on. So which samples a
//! tile gets is a function of the seed, as the samples are: not of threads, methods, passes, checkpoints or shards. It does depend on the crop, for
//! tiles begin at its corner.
//!
//! *Bias.* Samples that decide when to stop are not independent of their mean: light that has not been found yet makes a tile look both
//! darker and quieter than it is. `docs/accuracy.md` has figures.

use std::{ops::Range, str::FromStr};

use serde::{Deserialize, Serialize};

use super::{Film, FilmTile, Layer, Layers, area};
use crate::statistics::NoiseFigures;

/// No tile stops with fewer samples a pixel.
const FEWEST: u64 = 16;

/// The largest noise at which a tile gets no more samples: the standard error of its pixels, as root mean square over pixels and colours, over
/// the mean of both. Positive and finite; 0.01 is a clean picture.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f64", into = "f64")]
pub struct NoiseLimit(f64);

impl NoiseLimit {
    /// The most samples per pixel where only noise limits a render: beside a point light there may be pixels whose noise never ends.
    pub const MOST_SAMPLES: u32 = 1 << 14;
}

// Never a NaN.
impl Eq for NoiseLimit {}

/// A number that cannot be a [`NoiseLimit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("must be a positive number, such as 0.02: the standard error of pixels over their mean")]
pub struct NoNoiseLimit;

impl TryFrom<f64> for NoiseLimit {
    type Error = NoNoiseLimit;

    fn try_from(limit: f64) -> Result<Self, NoNoiseLimit> {
        if limit > 0.0 && limit.is_finite() { Ok(Self(limit)) } else { Err(NoNoiseLimit) }
    }
}

impl From<NoiseLimit> for f64 {
    fn from(NoiseLimit(limit): NoiseLimit) -> Self {
        limit
    }
}

impl FromStr for NoiseLimit {
    type Err = NoNoiseLimit;

    fn from_str(text: &str) -> Result<Self, NoNoiseLimit> {
        text.parse::<f64>().map_err(|_| NoNoiseLimit)?.try_into()
    }
}

/// The layers that a film with a limit of noise keeps: the sums that tell it are theirs.
pub(crate) fn layers_of_noise() -> Layers {
    [Layer::Variance, Layer::Samples].into_iter().collect()
}

/// Sums over pixels and colours.
#[derive(Clone, Copy, Debug, Default)]
struct Noise {
    /// Of the variances of means.
    variance: f64,
    /// Of means.
    mean: f64,
    numbers: f64,
}

impl Noise {
    /// The standard error over the mean; 0 of what is black and has no variance.
    fn value(self) -> f64 {
        if self.variance == 0.0 { 0.0 } else { (self.variance * self.numbers).sqrt() / self.mean }
    }

    fn and(self, other: Self) -> Self {
        Self {
            variance: self.variance + other.variance,
            mean: self.mean + other.mean,
            numbers: self.numbers + other.numbers,
        }
    }
}

impl Film {
    /// The noise of the picture so far, as that of one large tile; `None` without the sums that tell it ([`Layer::Variance`]), or if there is a
    /// tile with fewer than two samples.
    #[must_use]
    pub fn noise(&self) -> Option<f64> {
        let layout = Layout::of(self)?;
        let tiles = self.tiles.iter().map(|tile| (tile.count() > 1).then(|| layout.noise(tile)));
        tiles.reduce(|a, b| Some(a?.and(b?))).flatten().map(Noise::value)
    }

    /// How far the limit of noise was reached, if there is one.
    pub(crate) fn noise_figures(&self) -> Option<NoiseFigures> {
        Some(NoiseFigures {
            limit: self.origin.noise?.into(),
            noise: self.noise(),
            tiles: self.tiles.len(),
            quiet_tiles: self.tiles.iter().filter(|tile| self.is_quiet(tile)).count(),
            mean_spp: self.total_samples() as f64 / area(self.origin.crop) as f64,
        })
    }

    /// Those of the samples `wanted` that a tile may have before it is judged again: none if it has enough.
    pub(super) fn before_next_look(&self, tile: &FilmTile, wanted: Range<u64>) -> Range<u64> {
        if self.origin.noise.is_none() {
            return wanted;
        }
        if self.is_quiet(tile) {
            return wanted.start..wanted.start;
        }
        let look = (tile.count() + 1).next_power_of_two().max(FEWEST);
        wanted.start..wanted.end.min(look)
    }

    fn is_quiet(&self, tile: &FilmTile) -> bool {
        let (Some(NoiseLimit(limit)), Some(layout)) = (self.origin.noise, Layout::of(self)) else { return false };
        // The blocks of so many samples, from the first on, are one exactly if the number is a power of two.
        let [(id, _)] = &*tile.blocks else { return false };
        id.index == 0 && tile.count() >= FEWEST && layout.noise(tile).value() <= limit
    }
}

/// Where the sums of a film are that tell its noise.
struct Layout {
    stride: usize,
    /// The place of the first sum of squares among the sums of a pixel.
    squares: usize,
}

impl Layout {
    fn of(film: &Film) -> Option<Self> {
        let layers = film.origin.layers;
        let squares = layers.place_of(Layer::Variance)?;
        Some(Self { stride: film.origin.sums_per_pixel(), squares })
    }

    /// Of a tile with at least two samples.
    fn noise(&self, tile: &FilmTile) -> Noise {
        let n = tile.count() as f64;
        let pixels = tile.blocks.first().map_or(0, |(_, sums)| sums.len() / self.stride);
        let mut noise = Noise { numbers: 3.0 * pixels as f64, ..Noise::default() };
        for pixel in 0..pixels {
            for colour in 0..3 {
                let sum_at =
                    |place: usize| tile.blocks.iter().map(|(_, sums)| sums[pixel * self.stride + place]).sum::<f64>();
                let (sum, squares) = (sum_at(colour), sum_at(self.squares + colour));
                // The difference may round below zero where all samples are alike.
                noise.variance += (squares - sum * sum / n).max(0.0) / (n * (n - 1.0));
                noise.mean += sum / n;
            }
        }
        noise
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::{
        FilmOrigin, Picture, Sampler,
        film::{LayerSums, PixelSum, TileSums, pixels, tile_rects},
    };

    /// Two tiles, one pixel wide the second.
    fn film(limit: f64) -> Film {
        let origin = FilmOrigin {
            layers: layers_of_noise().with([Layer::Albedo].into_iter().collect()),
            noise: Some(limit.try_into().unwrap()),
            ..FilmOrigin::example([17, 16], 1000)
        };
        Film::new(origin, Picture::default()).unwrap()
    }

    /// Of mean 1 and standard deviation 0.5; noisier in the second tile.
    fn value(x: u32, y: u32, sample: u32) -> DVec3 {
        let mut u = Sampler::new(5, x, y, sample);
        DVec3::from_array(
            [(); 3].map(|()| 1.0 + if x < 16 { 0.5 } else { 0.9 } * (2.0 * u.next_1d() - 1.0) * 3_f64.sqrt()),
        )
    }

    fn add(film: &mut Film, tile: usize, samples: Range<u32>) {
        let layers = LayerSums::new(film.origin.layers);
        let rect = tile_rects(film.origin.crop).nth(tile).unwrap();
        let mut sums = TileSums::new();
        for (x, y) in pixels(rect) {
            let mut sum = PixelSum::new();
            for s in samples.clone() {
                sum.add(s, layers.sample(value(x, y, s), None, &Default::default(), &Default::default()));
            }
            sums.push(256, &sum, |value, numbers| layers.keep(value, numbers));
        }
        film.add_tile(tile, sums, &Default::default());
    }

    #[test]
    fn noise_is_the_standard_error_over_the_mean() {
        let mut film = film(0.1);
        assert_eq!(film.noise(), None);
        add(&mut film, 0, 0..7);
        add(&mut film, 1, 0..4);
        // By the definition, pixel by pixel.
        let (mut variance, mut mean, mut numbers) = (0.0, 0.0, 0.0);
        for (x, y) in pixels(film.origin.crop) {
            let n = if x < 16 { 7 } else { 4 };
            for colour in 0..3 {
                let values: Vec<f64> = (0..n).map(|s| value(x, y, s)[colour]).collect();
                let of_pixel = values.iter().sum::<f64>() / f64::from(n);
                let deviations = values.iter().map(|v| (v - of_pixel).powi(2)).sum::<f64>();
                variance += deviations / f64::from(n - 1) / f64::from(n);
                mean += of_pixel;
                numbers += 1.0;
            }
        }
        let expected = (variance / numbers).sqrt() / (mean / numbers);
        let noise = film.noise().unwrap();
        assert!((noise - expected).abs() < 1e-12 * expected, "{noise} {expected}");
        assert!((0.15..0.25).contains(&noise), "{noise}");
    }

    #[test]
    fn a_tile_is_judged_at_powers_of_two_and_stops_when_it_is_quiet() {
        // Standard errors of 0.5 and 0.9 over √n: below 0.1 from 32 and 128 samples on.
        for (tile, stops) in [(0, 32), (1, 128)] {
            let mut film = film(0.1);
            let mut looks = vec![];
            while let Some(missing) = film.missing_of_tile(tile, 0..1000).first().cloned() {
                looks.push(missing.end);
                add(&mut film, tile, missing.start as u32..missing.end as u32);
            }
            let expected: Vec<u64> = [16, 32, 64, 128, 256].into_iter().filter(|&n| n <= stops).collect();
            assert_eq!(looks, expected);
            // No sooner because a pass ended between two looks.
            let mut film = self::film(0.1);
            for end in [5, 16, 17, 31, 40, 70, 100, 500] {
                for missing in film.missing_of_tile(tile, 0..end) {
                    add(&mut film, tile, missing.start as u32..missing.end as u32);
                }
            }
            let rest = film.missing_of_tile(tile, 0..1000);
            assert!(film.tiles[tile].count() <= stops && rest.is_empty() == (film.tiles[tile].count() == stops));
        }
    }

    #[test]
    fn black_tiles_are_quiet_and_limits_are_positive() {
        let noise = Noise { variance: 0.0, mean: 0.0, numbers: 768.0 };
        assert_eq!(noise.value(), 0.0);
        for bad in ["0", "-1", "nan", "inf", "", "1%"] {
            assert_eq!(bad.parse::<NoiseLimit>(), Err(NoNoiseLimit), "{bad}");
        }
        assert_eq!("0.02".parse::<NoiseLimit>().map(f64::from), Ok(0.02));
    }
}
