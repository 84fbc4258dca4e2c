//! An image in memory: linear RGB and its place on the film.

use crate::{ImageError, Rgb};

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
    /// A black image that is the whole film, of 12 bytes a pixel. The process is aborted if there is no memory for it:
    /// use [`Self::try_new`] for sizes that a user may choose.
    #[must_use]
    pub fn new(width: u32, height: u32) -> Self {
        Self::cropped([width, height], [0, 0], [width, height])
    }

    /// A black image of the part of a film of `full_size` pixels that begins at `origin` and has `size` pixels. Its
    /// memory is as that of [`Self::new`].
    #[must_use]
    pub fn cropped(full_size: [u32; 2], origin: [u32; 2], size: [u32; 2]) -> Self {
        let [width, height] = size;
        let pixels = vec![Rgb::ZERO; width as usize * height as usize];
        Self { width, height, pixels, origin: origin.map(u32::cast_signed), full_size }
    }

    /// As [`Self::new`], but with an error if there is no memory for it.
    ///
    /// # Errors
    /// [`ImageError::Memory`] with the bytes that are needed. A system that gives more memory than it has may still end
    /// the process when the pixels are written.
    pub fn try_new(width: u32, height: u32) -> Result<Self, ImageError> {
        Self::try_cropped([width, height], [0, 0], [width, height])
    }

    /// As [`Self::cropped`], but with an error if there is no memory for it.
    ///
    /// # Errors
    /// As [`Self::try_new`].
    pub fn try_cropped(full_size: [u32; 2], origin: [u32; 2], size: [u32; 2]) -> Result<Self, ImageError> {
        let [width, height] = size;
        let area = u64::from(width) * u64::from(height);
        let none = ImageError::Memory { width, height, bytes: area.saturating_mul(size_of::<Rgb>() as u64) };
        let mut pixels = Vec::new();
        let area = match usize::try_from(area) {
            Ok(area) if pixels.try_reserve_exact(area).is_ok() => area,
            _ => return Err(none),
        };
        pixels.resize(area, Rgb::ZERO);
        Ok(Self { width, height, pixels, origin: origin.map(u32::cast_signed), full_size })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_that_does_not_fit_is_an_error_with_the_figure() {
        assert_eq!(Image::try_new(3, 2).unwrap(), Image::new(3, 2));
        let part = ([9, 9], [1, 2], [3, 4]);
        assert_eq!(Image::try_cropped(part.0, part.1, part.2).unwrap(), Image::cropped(part.0, part.1, part.2));
        // The first is more than any address; the second overflows 64 bits.
        for (edge, needed) in [(1_u32 << 30, 12_u64 << 60), (u32::MAX, u64::MAX)] {
            let error = Image::try_new(edge, edge).unwrap_err();
            assert!(matches!(error, ImageError::Memory { bytes, .. } if bytes == needed), "{error}");
        }
        let error = Image::try_new(1 << 22, 1 << 22).unwrap_err().to_string();
        assert!(error.contains("4194304 x 4194304") && error.contains("211106232532992 bytes"), "{error}");
    }
}
