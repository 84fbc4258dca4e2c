//! HDR-FLIP: FLIP for images whose values a display cannot show at once.
//!
//! *Idea.* Show the images at every exposure that somebody might look at them with, and keep the worst error of each
//! pixel.
//!
//! *Definition.* \[Andersson2021\]: the exposures go from c_start to c_stop in N − 1 equal steps, N = max(2, ⌈c_stop −
//! c_start⌉). Let x_max be what the tone mapper maps to 0.85. Then c_start = log₂(x_max/Y_max) and c_stop =
//! log₂(x_max/Y_median), with the largest and the median luminance of the reference. At each exposure c both images
//! times 2^c are tone mapped, clamped to [0, 1] and compared by LDR-FLIP; the map is the largest error of each pixel.
//! The tone mapper is their default, the fit to ACES of \[Narkowicz2016\].
//!
//! *Guarantee.* Agrees with NVIDIA's flip-evaluator 1.7 to the rounding of single precision, in which both compute. As
//! there, the median is of an even number of pixels the upper one, and at least 2⁻²³. The same for any number of
//! threads.
//!
//! *Cost.* LDR-FLIP for each of N exposures; N is about the reference's range in stops, from the median up, at most
//! 151.
//!
//! *Limits.* Values below 0 are taken as 0, for which FLIP is not defined. Where the reference is dark all over (its
//! largest luminance below 2⁻²³) flip-evaluator gives up; here the largest luminance then bounds the median, and a
//! black reference has 2⁻²³ for both.

use super::{ErrorMap, check_pair, colour::luminance, flip::Flip};
use crate::{Image, ImageError, Rgb};

/// The range of exposures that images are compared at, in stops: values are multiplied by 2 to that power.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposures {
    /// Where the brightest pixel of the reference is not yet white.
    pub start: f64,
    /// Where its median pixel is so.
    pub stop: f64,
    /// How many exposures there are, at least 2, evenly from start to stop.
    pub count: u32,
}

/// HDR-FLIP and the exposures it was found with.
#[derive(Clone, Debug, PartialEq)]
pub struct HdrFlip {
    /// The largest error of each pixel over all exposures, from 0 to 1.
    pub map: ErrorMap,
    /// The exposures.
    pub exposures: Exposures,
}

/// HDR-FLIP of linear images; the reference alone determines the exposures. See the head of the file.
///
/// `pixels_per_degree` is as for [`ldr_flip`](super::ldr_flip).
///
/// # Errors
/// The images differ in size, have no pixels, or have one that is not finite; `pixels_per_degree` is out of range.
pub fn hdr_flip(image: &Image, reference: &Image, pixels_per_degree: f64) -> Result<HdrFlip, ImageError> {
    check_pair(image, reference)?;
    let mut flip = Flip::new(image.width, image.height, pixels_per_degree)?;
    let exposures = exposures(reference);
    let mut map = flip.empty_map();
    let mut errors = map.values.clone();
    let step = (exposures.stop - exposures.start) / f64::from(exposures.count - 1);
    for i in 0..exposures.count {
        let factor = (exposures.start + f64::from(i) * step).exp2();
        flip.evaluate(image, reference, |rgb| tone_map(rgb, factor), &mut errors);
        for (worst, error) in map.values.iter_mut().zip(&errors) {
            *worst = worst.max(*error);
        }
    }
    Ok(HdrFlip { map, exposures })
}

/// The fit to the tone curve of ACES: v ↦ (αv² + βv)/(γv² + δv + ε) with v = 0.6·x.
mod aces {
    pub(super) const SCALE: f64 = 0.6;
    pub(super) const ALPHA: f64 = 2.51;
    pub(super) const BETA: f64 = 0.03;
    pub(super) const GAMMA: f64 = 2.43;
    pub(super) const DELTA: f64 = 0.59;
    pub(super) const EPSILON: f64 = 0.14;
}

/// What a display is given at an exposure.
fn tone_map(rgb: Rgb, factor: f64) -> Rgb {
    use aces::{ALPHA, BETA, DELTA, EPSILON, GAMMA, SCALE};
    // The curve passes 1 at v = 7.2; the bound keeps its squares finite.
    const ENOUGH: f64 = 1e4;
    let factor = SCALE * factor;
    let curve = |x: f32| {
        // The factor alone may be beyond single precision.
        let v = (f64::from(x) * factor).clamp(0.0, ENOUGH) as f32;
        v * (ALPHA as f32 * v + BETA as f32) / (v * (GAMMA as f32 * v + DELTA as f32) + EPSILON as f32)
    };
    Rgb::new(curve(rgb.x), curve(rgb.y), curve(rgb.z)).min(Rgb::ONE)
}

/// The x that the tone mapper maps to `value`, in (0, 1).
fn tone_map_inverse(value: f64) -> f64 {
    use aces::{ALPHA, BETA, DELTA, EPSILON, GAMMA, SCALE};
    let (a, b, c) = (ALPHA - value * GAMMA, BETA - value * DELTA, -value * EPSILON);
    // a is positive and c negative, so one root is positive.
    (-b + (b * b - 4.0 * a * c).sqrt()) / (2.0 * a) / SCALE
}

fn exposures(reference: &Image) -> Exposures {
    const BRIGHT: f64 = 0.85;
    const LEAST: f64 = f32::EPSILON as f64;
    let mut luminances: Vec<f64> = reference.pixels.iter().map(|&rgb| luminance(rgb.max(Rgb::ZERO))).collect();
    let middle = luminances.len() / 2;
    let (_, &mut median, above) = luminances.select_nth_unstable_by(middle, f64::total_cmp);
    let max = above.iter().copied().fold(median, f64::max);
    let max = if max > 0.0 { max } else { LEAST };
    let median = median.max(LEAST.min(max));
    let x_max = tone_map_inverse(BRIGHT);
    let (start, stop) = ((x_max / max).log2(), (x_max / median).log2());
    Exposures { start, stop, count: ((stop - start).ceil() as u32).max(2) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metrics::PIXELS_PER_DEGREE;

    fn image(values: &[f32]) -> Image {
        let mut image = Image::new(u32::try_from(values.len()).unwrap(), 1);
        image.pixels = values.iter().map(|&v| Rgb::splat(v)).collect();
        image
    }

    #[test]
    fn the_tone_mapper_and_its_inverse() {
        for value in [0.01, 0.5, 0.85, 0.99] {
            let x = tone_map_inverse(value);
            assert!((f64::from(tone_map(Rgb::splat(x as f32), 1.0).y) - value).abs() < 1e-6, "{value}");
            assert!((f64::from(tone_map(Rgb::splat(1.0), x).y) - value).abs() < 1e-6, "{value}");
        }
        assert_eq!(tone_map(Rgb::new(0.0, -3.0, f32::MAX), 1e30), Rgb::new(0.0, 0.0, 1.0));
        assert_eq!(tone_map(Rgb::splat(13.0), 1.0), Rgb::ONE);
    }

    #[test]
    fn exposures_from_the_brightest_and_the_median() {
        let of = |values: &[f32]| exposures(&image(values));
        let x = tone_map_inverse(0.85);
        // Even number of pixels: the upper one of the middle.
        let e = of(&[16.0, 0.25, 1.0, 0.5]);
        assert!((e.start - (x / 16.0).log2()).abs() < 1e-6 && (e.stop - x.log2()).abs() < 1e-6, "{e:?}");
        assert_eq!(of(&[17.0, 0.25, 1.0, 0.5]).count, 5);
        let e = of(&[3.0, 3.0]);
        assert_eq!((e.start, e.count), (e.stop, 2));
        // Darker than the least median, or black.
        let dark = of(&[1e-9, 0.0, 0.0]);
        assert!((dark.start - (x / 1e-9).log2()).abs() < 1e-6 && dark.start == dark.stop, "{dark:?}");
        let black = of(&[0.0, -1.0, 0.0]);
        assert!((black.start - (x.log2() + 23.0)).abs() < 1e-6 && black.start == black.stop, "{black:?}");
        // As many as there can be.
        let widest = of(&[f32::MAX, 0.0, 0.0]);
        assert_eq!(widest.count, 151);
    }

    #[test]
    fn differences_in_highlights_are_seen() {
        // Both are white on a display.
        let (a, b) = (image(&[0.1, 0.1, 100.0]), image(&[0.1, 0.1, 20.0]));
        assert_eq!(crate::metrics::ldr_flip(&a, &b, PIXELS_PER_DEGREE).unwrap().mean(), 0.0);
        let hdr = hdr_flip(&a, &b, PIXELS_PER_DEGREE).unwrap();
        assert!(hdr.map.values[2] > 0.1, "{hdr:?}");
        // The scale of both images does not matter.
        let scaled = |image: &Image| {
            let mut image = image.clone();
            image.pixels.iter_mut().for_each(|p| *p *= 256.0);
            image
        };
        let other = hdr_flip(&scaled(&a), &scaled(&b), PIXELS_PER_DEGREE).unwrap();
        assert!((other.map.mean() - hdr.map.mean()).abs() < 1e-6, "{other:?} {hdr:?}");
    }
}
