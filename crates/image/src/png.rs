//! PNG: images for eyes.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use crate::atomic_file::{StagedFile, persist, stage_bytes};
use crate::format::MOST_PIXELS;
use crate::image::check_shape;
use crate::{Image, ImageError, Rgb, srgb};

/// The first four bytes of every PNG; there are four more.
pub(crate) const PNG_MAGIC: [u8; 4] = *b"\x89PNG";

/// Writes an 8-bit PNG with the sRGB transfer curve. Values outside [0, 1] are clamped, NaN becomes black.
///
/// # Errors
/// The file cannot be written, or the image has no pixels.
pub fn write_png(path: &Path, image: &Image) -> Result<(), ImageError> {
    persist(path, stage_png(path, image)?)
}

/// As [`write_png`], but the file does not appear before [`StagedFile::persist`].
///
/// # Errors
/// As [`write_png`].
pub fn stage_png(path: &Path, image: &Image) -> Result<StagedFile, ImageError> {
    let bytes = encode_png(image).map_err(|reason| ImageError::Unencodable { path: path.to_owned(), reason })?;
    stage_bytes(path, &bytes)
}

/// The bytes that [`write_png`] writes.
///
/// # Errors
/// Says what is wrong if the image has no pixels.
pub fn encode_png(image: &Image) -> Result<Vec<u8>, String> {
    check_shape(image)?;
    let samples: Vec<u8> = image.pixels.iter().flat_map(|pixel| pixel.to_array().map(srgb_byte)).collect();
    encode_png_bytes(image.width, image.height, &samples)
}

/// Writes an 8-bit PNG of red, green and blue, as a display takes them.
pub(crate) fn write_png_bytes(path: &Path, width: u32, height: u32, samples: &[u8]) -> Result<(), ImageError> {
    let unencodable = |reason: String| ImageError::Unencodable { path: path.to_owned(), reason };
    persist(path, stage_bytes(path, &encode_png_bytes(width, height, samples).map_err(unencodable)?)?)
}

fn encode_png_bytes(width: u32, height: u32, samples: &[u8]) -> Result<Vec<u8>, String> {
    if samples.is_empty() || samples.len() != 3 * width as usize * height as usize {
        return Err(format!("the image is {width} × {height} pixels but holds {} bytes", samples.len()));
    }
    let mut bytes = Vec::new();
    let encoder = image::codecs::png::PngEncoder::new(&mut bytes);
    image::ImageEncoder::write_image(encoder, samples, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}

pub(crate) fn decode_png(file: BufReader<File>) -> Result<Image, String> {
    let mut reader = image::ImageReader::with_format(file, image::ImageFormat::Png);
    let mut limits = image::Limits::default();
    // A decoder may take as much memory as the largest EXR does.
    limits.max_alloc = Some((MOST_PIXELS * size_of::<Rgb>()) as u64);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| error.to_string())?.into_rgb32f();
    let mut image = Image::new(decoded.width(), decoded.height());
    for (pixel, encoded) in image.pixels.iter_mut().zip(decoded.pixels()) {
        *pixel = Rgb::from(encoded.0.map(srgb::decode));
    }
    Ok(image)
}

/// The sRGB transfer curve, quantized to the nearest of 256 levels.
fn srgb_byte(linear: f32) -> u8 {
    (srgb::encode(linear) * 255.0).round() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_transfer_curve_meets_its_known_points() {
        let known = [(0.0, 0), (1.0, 255), (2.0, 255), (-1.0, 0), (f32::NAN, 0), (f32::INFINITY, 255), (0.5, 188)];
        for (linear, byte) in known {
            assert_eq!(srgb_byte(linear), byte, "{linear}");
        }
        assert_eq!(srgb_byte(0.214_041_14), 128);
    }

    #[test]
    fn a_png_holds_the_encoded_pixels() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.png");
        let mut image = Image::new(2, 1);
        image.pixels[1] = Rgb::new(1.0, 0.5, f32::NAN);
        write_png(&path, &image).unwrap();
        let read = image::open(&path).unwrap().into_rgb8();
        assert_eq!(read.into_raw(), [0, 0, 0, 255, 188, 0]);
        assert!(write_png(&path, &Image::new(0, 3)).is_err());
    }
}
