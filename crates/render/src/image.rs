//! An image in memory: linear RGB and its place on the film.

use crate::Rgb;
use crate::scene::PixelRect;

/// A linear RGB image in single precision, possibly a part of a larger one.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// The pixels row by row, top row first; `width · height` of them.
    pub pixels: Vec<Rgb>,
    /// Where the top left pixel lies on the full film. Signed, because a foreign file may say anything.
    pub origin: [i32; 2],
    /// Width and height of the full film.
    pub full_size: [u32; 2],
}

impl Image {
    /// A black image that is the whole film.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        Self::cropped([width, height], PixelRect { x0: 0, y0: 0, x1: width, y1: height })
    }

    /// A black image of the part `crop` of a film of `full_size` pixels.
    #[must_use]
    pub fn cropped(full_size: [u32; 2], crop: PixelRect) -> Self {
        let (width, height) = (crop.x1.saturating_sub(crop.x0), crop.y1.saturating_sub(crop.y0));
        Self {
            width,
            height,
            pixels: vec![Rgb::ZERO; width as usize * height as usize],
            origin: [crop.x0.cast_signed(), crop.y0.cast_signed()],
            full_size,
        }
    }
}
