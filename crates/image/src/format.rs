//! Which format the file of an image has.

use std::io::{Read as _, Seek as _};
use std::path::Path;

use crate::exr::{EXR_MAGIC, decode_exr};
use crate::limits::open;
use crate::png::{PNG_MAGIC, decode_png};
use crate::{Image, ImageError};

/// The kinds of files that images are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
}

/// Reads an image of either format, told apart by their first bytes, not by their names. An EXR is read as by
/// [`read_exr`](crate::read_exr).
///
/// A PNG of any depth is taken as sRGB, whatever profile it carries, and decoded to linear values; grey is spread to
/// all channels, alpha is ignored. Beside the 12 bytes a pixel of the image, some rows and at most 64 MiB are taken.
///
/// # Errors
/// The file cannot be read, is no regular file, is of neither format or damaged, has more than 2²⁸ pixels, or is an EXR
/// that [`read_exr`](crate::read_exr) refuses.
pub fn read_image(path: &Path) -> Result<(Image, ImageFormat), ImageError> {
    let (mut file, length) = open(path)?;
    let mut magic = [0; 4];
    // A file that is too short has no magic number, either.
    let known = file.read_exact(&mut magic).is_ok();
    file.rewind().map_err(|source| ImageError::Read { path: path.to_owned(), source })?;
    match magic {
        EXR_MAGIC if known => Ok((decode_exr(path, file, length)?, ImageFormat::Exr)),
        PNG_MAGIC if known => Ok((decode_png(path, file, length)?, ImageFormat::Png)),
        _ => Err(ImageError::Format {
            path: path.to_owned(),
            reason: "it is neither an OpenEXR nor a PNG file".to_owned(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rgb, write_exr};

    fn gradient() -> Image {
        let mut image = Image::cropped([40, 30], [5, 7], [7, 20]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Rgb::new(i as f32 * 0.1, 1.0 / (i as f32 + 1.0), 1e-30);
        }
        image.pixels[3] = Rgb::new(f32::INFINITY, f32::MAX, -0.0);
        image
    }

    #[test]
    fn formats_are_told_apart_by_their_bytes() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("image");
        let image = gradient();
        write_exr(&path, &image, &[]).unwrap();
        assert_eq!(read_image(&path).unwrap(), (image, ImageFormat::Exr));
        image::RgbImage::from_raw(2, 1, vec![0, 255, 188, 128, 0, 0])
            .unwrap()
            .save_with_format(&path, image::ImageFormat::Png)
            .unwrap();
        let (image, format) = read_image(&path).unwrap();
        assert_eq!((image.width, image.height, format), (2, 1, ImageFormat::Png));
        let expected = [[0.0, 1.0, 0.502_886], [0.215_861, 0.0, 0.0]].map(Rgb::from);
        for (pixel, expected) in image.pixels.iter().zip(expected) {
            assert!((pixel - expected).abs().max_element() < 1e-6, "{pixel}");
        }
        // Sixteen bits, grey and alpha.
        let deep = image::ImageBuffer::<image::LumaA<u16>, _>::from_raw(1, 1, vec![32_768, 7]).unwrap();
        deep.save_with_format(&path, image::ImageFormat::Png).unwrap();
        let (image, _) = read_image(&path).unwrap();
        assert!((image.pixels[0] - Rgb::splat(0.214_050)).abs().max_element() < 1e-5, "{}", image.pixels[0]);
        let whole = std::fs::read(&path).unwrap();
        for length in [0, 3, 4, 20, whole.len() / 2] {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(matches!(read_image(&path), Err(ImageError::Format { .. })), "{length}");
        }
        assert!(matches!(read_image(directory.path()), Err(ImageError::Format { .. })));
        assert!(matches!(read_image(&directory.path().join("no")), Err(ImageError::Read { .. })));
    }
}
