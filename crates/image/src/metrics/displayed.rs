//! An image as a display shows it.

use rayon::prelude::*;

use crate::{Image, Rgb, srgb};

/// The channels of an image, clamped to [0, 1] and with the sRGB curve.
#[derive(Debug)]
pub(super) struct Displayed {
    /// Red, green and blue, each row by row.
    pub(super) channels: [Vec<f64>; 3],
}

impl Displayed {
    pub(super) fn new(image: &Image) -> Self {
        let channel = |of: fn(&Rgb) -> f32| image.pixels.par_iter().map(|p| f64::from(srgb::encode(of(p)))).collect();
        Self { channels: [channel(|p| p.x), channel(|p| p.y), channel(|p| p.z)] }
    }
}
