//! Structural similarity.
//!
//! *Idea.* Eyes compare structure: local mean, contrast and correlation, not values.
//!
//! *Definition.* (13) of \[Wang2004\]: in a window, (2μ_x μ_y + C₁)(2σ_xy + C₂) / ((μ_x² + μ_y² + C₁)(σ_x² + σ_y² +
//! C₂)) with C₁ = 0.01², C₂ = 0.03², of displayed values. The window is their circular Gaussian of 11 × 11 pixels and
//! standard deviation 1.5, with weights that sum to 1 (14–16). The figure is the mean over all windows that lie within
//! the image (17), and over the three channels. The paper has grey images; the mean over channels is what scikit-image
//! does with colours.
//!
//! *Guarantee.* Equals `structural_similarity(…, channel_axis=2, data_range=1, gaussian_weights=True, sigma=1.5,
//! use_sample_covariance=False)` of scikit-image on the encoded and clamped images, to rounding. 1 if nothing differs.
//!
//! *Cost.* 5 separable filters of 11 weights a channel, in double precision because variances cancel; rows in parallel.
//!
//! *Limits.* Highlights beyond 1 are all white here. No figure for images smaller than a window.

use rayon::prelude::*;

use super::{
    check_pair,
    convolution::{add_column, add_row},
    displayed::Displayed,
};
use crate::{Image, ImageError};

const RADIUS: usize = 5;
const SIGMA: f64 = 1.5;
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// What is filtered: x, y, x², y², xy.
const MOMENTS: usize = 5;

/// Mean structural similarity of displayed values, at most 1; none if a side is shorter than 11 pixels. See the head of
/// the file.
///
/// # Errors
/// The images differ in size, have no pixels, or have one that is not finite.
pub fn ssim(image: &Image, reference: &Image) -> Result<Option<f64>, ImageError> {
    check_pair(image, reference)?;
    let (width, height) = (image.width as usize, image.height as usize);
    if width.min(height) <= 2 * RADIUS {
        return Ok(None);
    }
    let (a, b) = (Displayed::new(image), Displayed::new(reference));
    let channels = a.channels.iter().zip(&b.channels);
    Ok(Some(channels.map(|(x, y)| ssim_of_channel(x, y, width)).sum::<f64>() / 3.0))
}

fn ssim_of_channel(x: &[f64], y: &[f64], width: usize) -> f64 {
    let window = window();
    let inner = width - 2 * RADIUS;
    let height = x.len() / width;
    // The moments filtered along rows; those of one row follow each other.
    let mut rows = vec![0.0; MOMENTS * inner * height];
    rows.par_chunks_mut(MOMENTS * inner).zip(x.par_chunks(width).zip(y.par_chunks(width))).for_each_init(
        || vec![0.0; width],
        |products, (out, (x, y))| {
            let factors: [(&[f64], Option<&[f64]>); MOMENTS] =
                [(x, None), (y, None), (x, Some(x)), (y, Some(y)), (x, Some(y))];
            for (out, (x, y)) in out.chunks_mut(inner).zip(factors) {
                match y {
                    None => products.copy_from_slice(x),
                    Some(y) => products.iter_mut().zip(x.iter().zip(y)).for_each(|(p, (x, y))| *p = x * y),
                }
                add_row(products, RADIUS, &window, out);
            }
        },
    );
    let row_sums: Vec<f64> = (RADIUS..height - RADIUS)
        .into_par_iter()
        .map_init(
            || vec![0.0; MOMENTS * inner],
            |moments, row| {
                moments.fill(0.0);
                add_column(|y| &rows[y * MOMENTS * inner..(y + 1) * MOMENTS * inner], height, row, &window, moments);
                (0..inner).map(|i| similarity(std::array::from_fn(|m| moments[m * inner + i]))).sum()
            },
        )
        .collect();
    row_sums.iter().sum::<f64>() / (inner * row_sums.len()) as f64
}

/// The similarity in one window, from its mean x, y, x², y² and xy.
fn similarity([x, y, xx, yy, xy]: [f64; MOMENTS]) -> f64 {
    let (var_x, var_y, cov) = (xx - x * x, yy - y * y, xy - x * y);
    (2.0 * x * y + C1) * (2.0 * cov + C2) / ((x * x + y * y + C1) * (var_x + var_y + C2))
}

/// One axis of the Gaussian window.
fn window() -> [f64; 2 * RADIUS + 1] {
    let weights: [f64; 2 * RADIUS + 1] = std::array::from_fn(|i| {
        let d = i as f64 - RADIUS as f64;
        (-d * d / (2.0 * SIGMA * SIGMA)).exp()
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|w| w / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rgb;

    fn image(width: u32, height: u32, value: impl Fn(u32, u32) -> f32) -> Image {
        let mut image = Image::new(width, height);
        let width = width as usize;
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Rgb::splat(value((i % width) as u32, (i / width) as u32));
        }
        image
    }

    #[test]
    fn identical_images_and_small_ones() {
        let a = image(17, 13, |x, y| (x * y) as f32 / 200.0);
        assert_eq!(ssim(&a, &a).unwrap(), Some(1.0));
        assert!(ssim(&image(11, 11, |_, _| 0.5), &image(11, 11, |_, _| 0.25)).unwrap().is_some());
        let narrow = image(10, 40, |_, _| 0.5);
        assert_eq!(ssim(&narrow, &narrow).unwrap(), None);
    }

    #[test]
    fn constant_images_by_hand() {
        // Without variance the second factor is 1. 0.5 and 0.25 are displayed as 0.735357 and 0.537099.
        let (x, y) = (0.735_356_98_f64, 0.537_098_73_f64);
        let expected = (2.0 * x * y + 1e-4) / (x * x + y * y + 1e-4);
        let got = ssim(&image(20, 30, |_, _| 0.5), &image(20, 30, |_, _| 0.25)).unwrap().unwrap();
        assert!((got - expected).abs() < 1e-6, "{got} {expected}");
    }

    #[test]
    fn opposite_structure_is_negative() {
        let stripes = |odd: u32| image(24, 24, move |x, y| if (x + y) % 2 == odd { 0.9 } else { 0.1 });
        assert!(ssim(&stripes(0), &stripes(1)).unwrap().unwrap() < -0.5);
    }
}
