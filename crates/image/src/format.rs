//! Which format the file of an image has.

use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _};
use std::path::Path;

use crate::exr::EXR_MAGIC;
use crate::png::{PNG_MAGIC, decode_png};
use crate::{Image, ImageError, read_exr};

/// Most pixels that are read, 16384²: a file that claims more is damaged, and memory is taken before it is found out.
pub(crate) const MOST_PIXELS: usize = 1 << 28;

/// The kinds of files that images are read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFormat {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
}

/// Reads an image of either format, told apart by their first bytes, not by their names. An EXR is read as by [`read_exr`].
///
/// A PNG of any depth is taken as sRGB, whatever profile it carries, and decoded to linear values; grey is spread to all channels, alpha
/// is ignored.
///
/// # Errors
/// The file cannot be read, is of neither format or damaged, or an EXR without the channels R, G and B.
pub fn read_image(path: &Path) -> Result<(Image, ImageFormat), ImageError> {
    let malformed = |reason: String| ImageError::Format { path: path.to_owned(), reason };
    let mut file = open(path)?;
    let mut magic = [0; 4];
    match file.read_exact(&mut magic).map(|()| magic) {
        Ok(EXR_MAGIC) => Ok((read_exr(path)?, ImageFormat::Exr)),
        Ok(PNG_MAGIC) => {
            file.rewind().map_err(|source| ImageError::Read { path: path.to_owned(), source })?;
            Ok((decode_png(file).map_err(malformed)?, ImageFormat::Png))
        }
        _ => Err(malformed("it is neither an OpenEXR nor a PNG file".to_owned())),
    }
}

pub(crate) fn open(path: &Path) -> Result<BufReader<File>, ImageError> {
    let unreadable = |source| ImageError::Read { path: path.to_owned(), source };
    let file = File::open(path).map_err(unreadable)?;
    if !file.metadata().map_err(unreadable)?.is_file() {
        return Err(ImageError::Format { path: path.to_owned(), reason: "it is not a file".to_owned() });
    }
    Ok(BufReader::new(file))
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
