//! The error of every pixel, as numbers and as a picture.

use std::path::Path;

use crate::{ImageError, png::write_png_of};

/// One error for each pixel, 0 where nothing differs.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The errors row by row, top row first; `width · height` of them.
    pub values: Vec<f32>,
}

impl ErrorMap {
    /// The mean error, summed in double precision in the order of the pixels; NaN if there are no pixels.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.values.iter().copied().map(f64::from).sum::<f64>() / self.values.len() as f64
    }
}

/// The colour of an error in the perceptually uniform colour map `magma`: 0 is black, 1 and more is light yellow. Bytes
/// for a display.
///
/// As FLIP's tools colour it, in 256 steps; a byte may be less by 1, for they round and the library cuts off.
#[must_use]
pub fn magma(error: f32) -> [u8; 3] {
    let step = (error.clamp(0.0, 1.0) * 255.0).round() as usize;
    let colour = colorous::MAGMA.eval_rational(step, 256);
    [colour.r, colour.g, colour.b]
}

/// Writes the map as an 8-bit PNG in the colours of [`magma`].
///
/// # Errors
/// The file cannot be written, or the map has no pixels.
pub fn write_error_map(path: &Path, map: &ErrorMap) -> Result<(), ImageError> {
    write_png_of(path, [map.width, map.height], &map.values, |&error| magma(error))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_map_becomes_a_picture() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("map.png");
        let map = ErrorMap { width: 3, height: 1, values: vec![0.0, 2.0, 0.5] };
        assert!((map.mean() - 2.5 / 3.0).abs() < 1e-15);
        write_error_map(&path, &map).unwrap();
        let read = image::open(&path).unwrap().into_rgb8();
        // The ends and the middle of matplotlib's magma, which has (183, 55, 121).
        assert_eq!(read.into_raw(), [0, 0, 4, 252, 253, 191, 182, 54, 121]);
        assert!(write_error_map(&path, &ErrorMap { width: 0, height: 1, values: vec![] }).is_err());
    }
}
