//! How far two images are apart.

use crate::{Image, RenderError, Rgb};

/// The difference between an image and a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Comparison {
    /// Mean squared error over pixels and channels.
    pub mse: f64,
    /// Relative mean squared error: the mean over pixels and channels of (image − reference)² / (reference² + 10⁻²·m²), where m is the
    /// mean of the reference over pixels and channels. The second term keeps dark pixels from dominating.
    pub rel_mse: f64,
    /// Whether all pixels are the same, bit for bit.
    pub identical: bool,
}

/// Compares `image` with `reference`, in double precision.
///
/// # Errors
/// If they differ in size.
pub fn compare(image: &Image, reference: &Image) -> Result<Comparison, RenderError> {
    if (image.width, image.height) != (reference.width, reference.height) {
        return Err(RenderError::SizeMismatch {
            a: [image.width, image.height],
            b: [reference.width, reference.height],
        });
    }
    let channels = |image: &Image| -> Vec<f64> { image.pixels.iter().flat_map(Rgb::to_array).map(f64::from).collect() };
    let (a, b) = (channels(image), channels(reference));
    let n = a.len().max(1) as f64;
    let mean = b.iter().sum::<f64>() / n;
    let floor = 1e-2 * mean * mean;
    let (mut mse, mut rel_mse) = (0.0, 0.0);
    for (a, b) in a.iter().zip(&b) {
        let squared = (a - b) * (a - b);
        mse += squared;
        // Equal values differ by nothing, also where the reference is black.
        if squared != 0.0 {
            rel_mse += squared / (b * b + floor);
        }
    }
    let bits = |p: &Rgb| p.to_array().map(f32::to_bits);
    let identical = image.pixels.iter().map(bits).eq(reference.pixels.iter().map(bits));
    Ok(Comparison { mse: mse / n, rel_mse: rel_mse / n, identical })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(pixels: &[[f32; 3]]) -> Image {
        let mut image = Image::new(u32::try_from(pixels.len()).unwrap(), 1);
        image.pixels = pixels.iter().copied().map(Rgb::from).collect();
        image
    }

    #[test]
    fn by_hand() {
        let reference = image(&[[1.0, 1.0, 1.0], [3.0, 3.0, 3.0]]);
        let other = image(&[[1.5, 1.0, 1.0], [3.0, 3.0, 2.0]]);
        let c = compare(&other, &reference).unwrap();
        // m = 2, so the floor is 0.04.
        assert!((c.mse - (0.25 + 1.0) / 6.0).abs() < 1e-15);
        assert!((c.rel_mse - (0.25 / 1.04 + 1.0 / 9.04) / 6.0).abs() < 1e-15);
        assert!(!c.identical);
    }

    #[test]
    fn identical_means_every_bit() {
        let a = image(&[[0.0, 1.0, 2.0]]);
        let same = compare(&a, &a).unwrap();
        assert_eq!((same.mse, same.rel_mse, same.identical), (0.0, 0.0, true));
        let minus_zero = image(&[[-0.0, 1.0, 2.0]]);
        let c = compare(&minus_zero, &a).unwrap();
        assert_eq!((c.mse, c.identical), (0.0, false));
    }

    #[test]
    fn black_images_compare() {
        let black = image(&[[0.0; 3]]);
        assert_eq!(compare(&black, &black).unwrap().rel_mse, 0.0);
        assert!(compare(&image(&[[1.0; 3]]), &black).unwrap().rel_mse.is_infinite());
    }

    #[test]
    fn sizes_must_match() {
        assert!(compare(&Image::new(2, 1), &Image::new(1, 2)).is_err());
    }
}
