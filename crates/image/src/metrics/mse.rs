//! Errors of single values: mean squared, absolute and relative, and the peak signal-to-noise ratio.
//!
//! *Definition.* With the values x of the image and r of the reference, over all n pixels and channels:
//! MSE = Σ(x − r)²/n, MAE = Σ|x − r|/n, relMSE = Σ (x − r)²/(r² + 10⁻²·m²) / n with m = Σr/n, all of linear values;
//! PSNR = 10·log₁₀(1/MSE) dB, of displayed values.
//!
//! *Guarantee.* All in double precision, summed in the order of the pixels: the same on any machine and number of
//! threads, but for the last digits of PSNR, where the system's power function enters.
//!
//! *Cost.* One pass; for PSNR two powers a value.
//!
//! *Limits.* They know nothing of neighbours: noise and a shifted edge weigh alike.

use super::{check_pair, displayed::Displayed};
use crate::{Image, ImageError, Rgb};

/// Mean squared error of linear values.
///
/// # Errors
/// The images differ in size, have no pixels, or have one that is not finite.
pub fn mse(image: &Image, reference: &Image) -> Result<f64, ImageError> {
    mean(image, reference, |x, r| (x - r) * (x - r))
}

/// Mean absolute error of linear values.
///
/// # Errors
/// As [`mse`].
pub fn mae(image: &Image, reference: &Image) -> Result<f64, ImageError> {
    mean(image, reference, |x, r| (x - r).abs())
}

/// Relative mean squared error of linear values: each squared error is divided by r² + 10⁻²·m², where r is the
/// reference's value and m its mean. The second term keeps dark pixels from dominating. Infinite if the reference is
/// black and the image is not.
///
/// # Errors
/// As [`mse`].
pub fn rel_mse(image: &Image, reference: &Image) -> Result<f64, ImageError> {
    let m = mean(reference, reference, |r, _| r)?;
    let floor = 1e-2 * m * m;
    mean(image, reference, |x, r| {
        let squared = (x - r) * (x - r);
        // Equal values differ by nothing, also where the reference is black.
        if squared == 0.0 { 0.0 } else { squared / (r * r + floor) }
    })
}

/// Peak signal-to-noise ratio in decibels, of displayed values with the peak 1; infinite if none differs.
///
/// This is `peak_signal_noise_ratio(…, data_range=1)` of scikit-image on the encoded and clamped images.
///
/// # Errors
/// As [`mse`].
pub fn psnr(image: &Image, reference: &Image) -> Result<f64, ImageError> {
    check_pair(image, reference)?;
    let (a, b) = (Displayed::new(image), Displayed::new(reference));
    let squared = |(x, r): (&f64, &f64)| (x - r) * (x - r);
    let sum: f64 = a.channels.iter().zip(&b.channels).flat_map(|(a, b)| a.iter().zip(b)).map(squared).sum();
    let mse = sum / (3 * image.pixels.len()) as f64;
    Ok(-10.0 * mse.log10())
}

fn mean(image: &Image, reference: &Image, error: impl Fn(f64, f64) -> f64) -> Result<f64, ImageError> {
    check_pair(image, reference)?;
    fn channels(image: &Image) -> impl Iterator<Item = f64> {
        image.pixels.iter().flat_map(Rgb::to_array).map(f64::from)
    }
    let sum: f64 = channels(image).zip(channels(reference)).map(|(x, r)| error(x, r)).sum();
    Ok(sum / (3 * image.pixels.len()) as f64)
}
