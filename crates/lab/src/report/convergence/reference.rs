//! Converged images to measure errors against, and how wrong they are themselves.
//!
//! *Idea.* A reference R is the mean of two halves A and B, which differ in nothing but the seed. So (A − B)²/4 has the
//! mean Var R, whatever the variance of a half: the reference tells its own error.
//!
//! *Guarantee.* The seeds of the halves are those of no other render, so the error of an image x against R is on
//! average E(x − μ)² + Var R, with the converged image μ: Var R, the *floor*, can be subtracted. For relMSE this holds
//! but for the noise in its divisor, which is R's. All pixels have random numbers of their own, so the mean of (A −
//! B)²/4 over n pixels has a standard error of at most their standard deviation over √n; the *bound* of the floor lies
//! two of them above it.
//!
//! *Limits.* Light that neither half has found is in neither the floor nor the reference.

use vdf_image::{
    Image, ImageError,
    metrics::{PIXELS_PER_DEGREE, hdr_flip, mse, rel_mse},
};
use vdf_render::Integrator;
use vdf_scene::PixelRect;

/// An error is claimed if it is so many times the bound of the floor: then the floor is at most a third of what
/// remains.
pub(super) const CLAIM: f64 = 4.0;

/// A converged image.
pub(super) struct Reference {
    pub(super) integrator: Integrator,
    /// Samples per pixel, of both halves together.
    pub(super) spp: u32,
    pub(super) image: Image,
    pub(super) floor: Floor,
    /// HDR-FLIP of one half against the other.
    pub(super) flip: f64,
    /// Where it was kept from an earlier run.
    pub(super) cached: bool,
}

/// The error of a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Floor {
    pub(super) mse: f64,
    pub(super) rel_mse: f64,
    /// Two standard errors more.
    pub(super) mse_bound: f64,
    pub(super) rel_mse_bound: f64,
}

impl Reference {
    pub(super) fn new(integrator: Integrator, spp: u32, halves: &[Image; 2], cached: bool) -> Result<Self, ImageError> {
        let image = mean(halves);
        let floor = Floor::new(&image, &halves[0])?;
        let flip = hdr_flip(&halves[0], &halves[1], PIXELS_PER_DEGREE)?.map.mean();
        Ok(Self { integrator, spp, image, floor, flip, cached })
    }

    /// Whether these errors, with the floor, can be told from the reference's own. Both have to: a reference with much
    /// noise is dark in pixels by chance, and its divisors make any relMSE large; MSE has none.
    pub(super) fn claims(&self, rel_mse: f64, mse: f64) -> bool {
        let above = |error: f64, bound: f64| error > 0.0 && error.is_finite() && error >= CLAIM * bound;
        above(rel_mse, self.floor.rel_mse_bound) && above(mse, self.floor.mse_bound)
    }
}

impl Floor {
    /// Of the mean of two halves, one of which is given: the other lies as far on the other side.
    fn new(mean: &Image, half: &Image) -> Result<Self, ImageError> {
        let (mse, rel_mse) = (mse(half, mean)?, rel_mse(half, mean)?);
        let values = || mean.pixels.iter().flat_map(|p| p.to_array()).map(f64::from);
        let m = values().sum::<f64>() / (3 * mean.pixels.len()) as f64;
        let error = |weight: fn(f64, f64) -> f64| {
            let of_pixels: Vec<f64> = half
                .pixels
                .iter()
                .zip(&mean.pixels)
                .map(|(x, r)| {
                    let channels = x.to_array().into_iter().zip(r.to_array());
                    let squared = |(x, r): (f32, f32)| {
                        let d = f64::from(x) - f64::from(r);
                        if d == 0.0 { 0.0 } else { d * d / weight(f64::from(r), m) }
                    };
                    channels.map(squared).sum::<f64>() / 3.0
                })
                .collect();
            standard_error(&of_pixels)
        };
        Ok(Self {
            mse,
            rel_mse,
            mse_bound: mse + 2.0 * error(|_, _| 1.0),
            // The divisor of `rel_mse`.
            rel_mse_bound: rel_mse + 2.0 * error(|r, m| r * r + 1e-2 * m * m),
        })
    }
}

/// Of the mean of these values; 0 of fewer than two.
fn standard_error(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    if values.len() < 2 {
        return 0.0;
    }
    let mean = values.iter().sum::<f64>() / n;
    (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (n - 1.0) / n).sqrt()
}

/// Pixel by pixel.
fn mean(halves: &[Image; 2]) -> Image {
    let [a, b] = halves;
    let pixels = a.pixels.iter().zip(&b.pixels).map(|(a, b)| (0.5 * (a.as_dvec3() + b.as_dvec3())).as_vec3());
    Image { pixels: pixels.collect(), ..a.clone() }
}

/// The pixels of the film, at most 4 × 4, around the one where the halves differ most: nowhere does it show sooner if
/// they were not what they are said to be.
pub(super) fn telling_pixels(halves: &[Image; 2]) -> PixelRect {
    let [a, b] = halves;
    let distance = |i: usize| a.pixels[i].distance_squared(b.pixels[i]);
    let at = (0..a.pixels.len()).max_by(|&i, &j| distance(i).total_cmp(&distance(j))).unwrap_or(0);
    let width = a.width as usize;
    let range = |at: usize, size: u32, origin: i32| {
        let side = size.min(4);
        let first = (at as u32).saturating_sub(2).min(size - side);
        // A render has no origin off the film.
        let origin = origin.cast_unsigned();
        (origin + first, origin + first + side)
    };
    let (x0, x1) = range(at % width, a.width, a.origin[0]);
    let (y0, y1) = range(at / width, a.height, a.origin[1]);
    PixelRect { x0, y0, x1, y1 }
}

#[cfg(test)]
mod tests {
    use vdf_image::Rgb;
    use vdf_render::Sampler;

    use super::*;

    fn image(width: u32, height: u32, pixel: impl FnMut(usize) -> Rgb) -> Image {
        let mut image = Image::new(width, height);
        image.pixels = (0..image.pixels.len()).map(pixel).collect();
        image
    }

    #[test]
    fn floors_by_hand() {
        let a = image(2, 1, |i| Rgb::splat([1.0, 5.0][i]));
        let b = image(2, 1, |i| Rgb::splat([3.0, 5.0][i]));
        let mean = mean(&[a.clone(), b.clone()]);
        assert_eq!(mean, image(2, 1, |i| Rgb::splat([2.0, 5.0][i])));
        let floor = Floor::new(&mean, &a).unwrap();
        // (1 − 3)²/4 in one of two pixels; the standard deviation of (1, 0) is 1/√2, over √2.
        assert_eq!((floor.mse, floor.mse_bound), (0.5, 0.5 + 2.0 * 0.5));
        let first = 1.0 / (4.0 + 1e-2 * 3.5 * 3.5);
        assert!((floor.rel_mse - 0.5 * first).abs() < 1e-15, "{floor:?}");
        assert!((floor.rel_mse_bound - 1.5 * first).abs() < 1e-12, "{floor:?}");
        assert_eq!(floor, Floor::new(&mean, &b).unwrap());
        // Halves that agree claim everything but nothing.
        let exact = Reference::new(Integrator::Volpath, 2, &[a.clone(), a.clone()], false).unwrap();
        assert_eq!((exact.floor.mse, exact.floor.rel_mse_bound, exact.flip), (0.0, 0.0, 0.0));
        assert!(
            exact.claims(1e-30, 1e-30)
                && !exact.claims(0.0, 1.0)
                && !exact.claims(f64::NAN, 1.0)
                && !exact.claims(f64::INFINITY, 1.0)
        );
        let noisy = Reference::new(Integrator::Volpath, 2, &[a, b], false).unwrap();
        let (least, of_mse) = (CLAIM * noisy.floor.rel_mse_bound, CLAIM * noisy.floor.mse_bound);
        assert!(
            noisy.claims(least, of_mse) && !noisy.claims(0.999 * least, of_mse) && !noisy.claims(least, 0.999 * of_mse)
        );
        // Black is no division by zero.
        let black = Image::new(3, 2);
        assert_eq!(Reference::new(Integrator::Volpath, 2, &[black.clone(), black], false).unwrap().floor.rel_mse, 0.0);
    }

    /// Noise of a known variance, uniform with standard deviation s in a half: the floor is s²/2, and an image of
    /// variance v against the reference has v + s²/2, so that v remains. 30 000 values; relative standard errors are
    /// below √(2/30 000) = 0.8 %, the tolerance of 4 % is five of them (false alarm below 10⁻⁶, and the seeds are
    /// fixed).
    #[test]
    fn the_floor_is_the_variance_of_the_reference() {
        let s = 0.2_f64;
        let noisy = |seed: u64, deviation: f64| {
            image(100, 100, |i| {
                let mut sampler = Sampler::new(seed, i as u32, 0, 0);
                let mut draw = || (1.0 + deviation * 12_f64.sqrt() * (sampler.next_1d() - 0.5)) as f32;
                Rgb::new(draw(), draw(), draw())
            })
        };
        let reference = Reference::new(Integrator::Volpath, 2, &[noisy(1, s), noisy(2, s)], false).unwrap();
        let floor = reference.floor;
        assert!((floor.mse / (s * s / 2.0) - 1.0).abs() < 0.04, "{floor:?}");
        assert!(floor.mse_bound > floor.mse && floor.mse_bound < 1.05 * floor.mse, "{floor:?}");
        for deviation in [0.4, 0.2] {
            let rest = mse(&noisy(3, deviation), &reference.image).unwrap() - floor.mse;
            assert!((rest / (deviation * deviation) - 1.0).abs() < 0.04, "{rest}");
        }
        // With 1 % of m² in the divisor, which is all about 1.
        assert!((floor.rel_mse * 1.01 / floor.mse - 1.0).abs() < 0.1, "{floor:?}");
    }

    #[test]
    fn telling_pixels_are_on_the_film() {
        for (at, expected) in
            [(0, [10, 20, 14, 24]), (6, [13, 20, 17, 24]), (7 * 3 + 3, [11, 21, 15, 25]), (7 * 4 + 6, [13, 21, 17, 25])]
        {
            let mut a = image(7, 5, |_| Rgb::ONE);
            a.origin = [10, 20];
            let mut b = a.clone();
            b.pixels[at].y = 2.0;
            let PixelRect { x0, y0, x1, y1 } = telling_pixels(&[a, b]);
            assert_eq!([x0, y0, x1, y1], expected, "{at}");
        }
        let tiny = image(1, 1, |_| Rgb::ONE);
        assert_eq!(telling_pixels(&[tiny.clone(), tiny]), PixelRect { x0: 0, y0: 0, x1: 1, y1: 1 });
    }
}
