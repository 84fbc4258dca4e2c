//! An image in memory: linear RGB and its place on the film.

use crate::Rgb;

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
        Self::cropped([width, height], [0, 0], [width, height])
    }

    /// A black image of the part of a film of `full_size` pixels that begins at `origin` and has `size` pixels.
    #[must_use]
    pub fn cropped(full_size: [u32; 2], origin: [u32; 2], size: [u32; 2]) -> Self {
        let [width, height] = size;
        Self {
            width,
            height,
            pixels: vec![Rgb::ZERO; width as usize * height as usize],
            origin: origin.map(u32::cast_signed),
            full_size,
        }
    }
}

/// Refuses an image whose pixels are not `width · height`, or none.
pub(crate) fn check_shape(image: &Image) -> Result<(), String> {
    let area = image.width as usize * image.height as usize;
    if area == 0 || image.pixels.len() != area {
        return Err(format!("the image is {} × {} pixels but holds {}", image.width, image.height, image.pixels.len()));
    }
    Ok(())
}
