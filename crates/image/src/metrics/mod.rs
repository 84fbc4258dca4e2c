//! How far an image is from a reference: figures, and a map of the error.
//!
//! Two kinds of value are compared, and each function says which:
//!
//! - *linear*: the values of [`Image`] as they are. So are [`mse`], [`mae`], [`rel_mse`] and [`hdr_flip`].
//! - *displayed*: the values that a display is sent, clamped to [0, 1] and with the sRGB curve; the range of the data
//!   is 1. So are [`psnr`], [`ssim`] and (before the curve) [`ldr_flip`], which are defined for such values only.
//!
//! All refuse pairs that differ in size and pixels that are not finite: no figure of them would mean anything.

mod colour;
mod convolution;
mod displayed;
mod error_map;
mod flip;
mod hdr_flip;
mod mse;
mod ssim;

use serde::Serialize;

pub use error_map::{ErrorMap, magma, write_error_map};
pub use flip::{PIXELS_PER_DEGREE, ldr_flip};
pub use hdr_flip::{Exposures, HdrFlip, hdr_flip};
pub use mse::{mae, mse, psnr, rel_mse};
pub use ssim::ssim;

use crate::{Image, ImageError, Rgb};

/// What the values of two images stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DynamicRange {
    /// Radiance without an upper bound, as an EXR has it.
    High,
    /// Values for a display, within [0, 1], as a PNG has them.
    Low,
}

/// The difference between an image and a reference. Serialized without the map; what is not finite becomes null in
/// JSON.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Mean squared error, see [`mse`].
    pub mse: f64,
    /// Mean absolute error, see [`mae`].
    pub mae: f64,
    /// Relative mean squared error, see [`rel_mse`].
    #[serde(rename = "relmse")]
    pub rel_mse: f64,
    /// Peak signal-to-noise ratio in decibels, see [`psnr`]; infinite for images that look the same.
    pub psnr: f64,
    /// Structural similarity, see [`ssim`]; none for images smaller than its window.
    pub ssim: Option<f64>,
    /// Mean of LDR-FLIP, see [`ldr_flip`].
    pub flip_ldr: f64,
    /// Mean of HDR-FLIP, see [`hdr_flip`]; none for images of low dynamic range.
    pub flip_hdr: Option<f64>,
    /// Whether all pixels are the same, bit for bit.
    pub identical: bool,
    /// The map of HDR-FLIP, or of LDR-FLIP for images of low dynamic range.
    #[serde(skip)]
    pub map: ErrorMap,
}

/// Compares `image` with `reference` in every way there is here, on all threads of the current pool.
///
/// FLIP depends on the size of a pixel in the observer's eye, `pixels_per_degree`, from 1 to 1000;
/// [`PIXELS_PER_DEGREE`] is usual.
///
/// # Errors
/// The images differ in size, have no pixels, or have one that is not finite; `pixels_per_degree` is out of range.
pub fn compare(
    image: &Image,
    reference: &Image,
    range: DynamicRange,
    pixels_per_degree: f64,
) -> Result<Comparison, ImageError> {
    let bits = |p: &Rgb| p.to_array().map(f32::to_bits);
    let ldr = ldr_flip(image, reference, pixels_per_degree)?;
    let flip_ldr = ldr.mean();
    let (flip_hdr, map) = match range {
        DynamicRange::Low => (None, ldr),
        DynamicRange::High => {
            let hdr = hdr_flip(image, reference, pixels_per_degree)?;
            (Some(hdr.map.mean()), hdr.map)
        }
    };
    Ok(Comparison {
        mse: mse(image, reference)?,
        mae: mae(image, reference)?,
        rel_mse: rel_mse(image, reference)?,
        psnr: psnr(image, reference)?,
        ssim: ssim(image, reference)?,
        flip_ldr,
        flip_hdr,
        identical: image.pixels.iter().map(bits).eq(reference.pixels.iter().map(bits)),
        map,
    })
}

/// Refuses two images that no figure can be given for.
fn check_pair(image: &Image, reference: &Image) -> Result<(), ImageError> {
    if (image.width, image.height) != (reference.width, reference.height) {
        return Err(ImageError::SizeMismatch {
            a: [image.width, image.height],
            b: [reference.width, reference.height],
        });
    }
    for (image, name) in [(image, "image"), (reference, "reference")] {
        let area = image.width as usize * image.height as usize;
        if area == 0 || image.pixels.len() != area {
            return Err(ImageError::Uncomparable {
                image: name,
                reason: format!("is {} x {} pixels but holds {}", image.width, image.height, image.pixels.len()),
            });
        }
        if let Some(at) = image.pixels.iter().position(|pixel| !pixel.is_finite()) {
            let (x, y, value) = (at % image.width as usize, at / image.width as usize, image.pixels[at]);
            return Err(ImageError::Uncomparable {
                image: name,
                reason: format!(
                    "is ({}, {}, {}) at pixel ({x}, {y}), counted from the top left",
                    value.x, value.y, value.z
                ),
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: &[[f32; 3]]) -> Image {
        let mut image = Image::new(u32::try_from(pixels.len()).unwrap(), 1);
        image.pixels = pixels.iter().copied().map(Rgb::from).collect();
        image
    }

    fn high(a: &Image, b: &Image) -> Comparison {
        compare(a, b, DynamicRange::High, PIXELS_PER_DEGREE).unwrap()
    }

    #[test]
    fn by_hand() {
        let reference = image(&[[1.0, 1.0, 1.0], [3.0, 3.0, 3.0]]);
        let other = image(&[[1.5, 1.0, 1.0], [3.0, 3.0, 2.0]]);
        let c = high(&other, &reference);
        // m = 2, so the floor is 0.04.
        assert!((c.mse - (0.25 + 1.0) / 6.0).abs() < 1e-15);
        assert!((c.mae - (0.5 + 1.0) / 6.0).abs() < 1e-15);
        assert!((c.rel_mse - (0.25 / 1.04 + 1.0 / 9.04) / 6.0).abs() < 1e-15);
        // On a display all of it is white.
        assert_eq!((c.psnr, c.flip_ldr, c.ssim, c.identical), (f64::INFINITY, 0.0, None, false));
        assert!(c.flip_hdr.unwrap() > 0.0);
    }

    #[test]
    fn identical_means_every_bit() {
        let a = image(&[[0.0, 1.0, 2.0]; 3]);
        let same = high(&a, &a);
        assert_eq!((same.mse, same.mae, same.rel_mse, same.psnr), (0.0, 0.0, 0.0, f64::INFINITY));
        assert_eq!((same.flip_ldr, same.flip_hdr, same.identical), (0.0, Some(0.0), true));
        let mut minus_zero = a.clone();
        minus_zero.pixels[1].x = -0.0;
        let c = high(&minus_zero, &a);
        assert_eq!((c.mse, c.identical), (0.0, false));
    }

    #[test]
    fn black_references_compare() {
        let black = image(&[[0.0; 3]; 4]);
        let same = high(&black, &black);
        assert_eq!((same.rel_mse, same.flip_ldr, same.flip_hdr), (0.0, 0.0, Some(0.0)));
        let other = high(&image(&[[1.0; 3]; 4]), &black);
        assert!(other.rel_mse.is_infinite());
        // Black against white is the largest difference in lightness.
        assert!(other.flip_ldr > 0.9 && other.flip_hdr.unwrap() > 0.9, "{other:?}");
    }

    #[test]
    fn extreme_values_give_finite_figures() {
        let reference = image(&[[f32::MAX; 3], [f32::MIN_POSITIVE; 3], [1e-45; 3], [0.0; 3], [-5.0, 3.0, 1e20]]);
        let other = image(&[[0.0; 3], [1.0; 3], [f32::MAX; 3], [-0.0; 3], [-f32::MAX, 3.0, 1e20]]);
        for (a, b) in [(&reference, &other), (&other, &reference)] {
            let c = high(a, b);
            for figure in [c.mse, c.mae, c.rel_mse, c.psnr, c.flip_ldr, c.flip_hdr.unwrap()] {
                assert!(figure.is_finite() && figure >= 0.0, "{c:?}");
            }
            assert!(c.map.values.iter().all(|v| v.is_finite() && *v >= 0.0), "{c:?}");
        }
    }

    #[test]
    fn the_low_range_has_the_map_of_ldr_flip() {
        let (a, b) = (image(&[[0.2; 3], [0.5; 3]]), image(&[[0.3; 3], [0.5; 3]]));
        let c = compare(&a, &b, DynamicRange::Low, PIXELS_PER_DEGREE).unwrap();
        assert_eq!((c.flip_hdr, c.flip_ldr), (None, c.map.mean()));
        assert_eq!(c.map, ldr_flip(&a, &b, PIXELS_PER_DEGREE).unwrap());
        assert_eq!(high(&a, &b).map, hdr_flip(&a, &b, PIXELS_PER_DEGREE).unwrap().map);
    }

    #[test]
    fn bad_pairs_are_refused() {
        let message =
            |a: &Image, b: &Image| compare(a, b, DynamicRange::High, PIXELS_PER_DEGREE).unwrap_err().to_string();
        assert!(message(&Image::new(2, 1), &Image::new(1, 2)).contains("differ in size: 2 x 1 and 1 x 2"));
        assert!(message(&Image::new(0, 0), &Image::new(0, 0)).contains("the image is 0 x 0 pixels"));
        let good = Image::new(3, 2);
        let mut bad = good.clone();
        bad.pixels[5].y = f32::NAN;
        assert!(message(&good, &bad).contains("the reference is (0, NaN, 0) at pixel (2, 1)"));
        bad.pixels[1].z = f32::INFINITY;
        assert!(message(&bad, &good).contains("the image is (0, 0, inf) at pixel (1, 0)"));
        bad.pixels.pop();
        assert!(message(&good, &bad).contains("the reference is 3 x 2 pixels but holds 5"));
        for ppd in [0.0, 0.99, -3.0, f64::NAN, f64::INFINITY, 1001.0] {
            let error = compare(&good, &good, DynamicRange::Low, ppd).unwrap_err().to_string();
            assert!(error.starts_with("pixels per degree must be from 1 to 1000"), "{error}");
        }
        for ppd in [1.0, 1000.0] {
            let (a, b) = (image(&[[0.2; 3], [0.5; 3]]), image(&[[0.3; 3], [0.5; 3]]));
            let c = compare(&a, &b, DynamicRange::High, ppd).unwrap();
            assert!(c.flip_ldr > 0.0 && c.flip_hdr.unwrap() > 0.0 && c.flip_ldr <= 1.0, "{c:?}");
        }
    }
}
