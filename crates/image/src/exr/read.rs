//! Reading EXR.

use std::io::{Read as _, Seek as _};
use std::path::Path;

use ::exr::meta::MetaData;
use ::exr::prelude as openexr;
use ::exr::prelude::{ReadChannels as _, ReadLayers as _, ReadSpecificChannel as _};

use super::EXR_MAGIC;
use crate::format::{MOST_PIXELS, open};
use crate::{Image, ImageError, Rgb};

/// Reads the channels R, G and B (half, float or integer) of the first layer that has them; others are ignored.
///
/// # Errors
/// The file cannot be read, is no EXR, or has no such layer.
pub fn read_exr(path: &Path) -> Result<Image, ImageError> {
    let unreadable = |source| ImageError::Read { path: path.to_owned(), source };
    let malformed = |reason: String| ImageError::Format { path: path.to_owned(), reason };
    let mut file = open(path)?;
    let mut magic = [0; 4];
    if file.read_exact(&mut magic).is_err() || magic != EXR_MAGIC {
        return Err(malformed("it is not an OpenEXR file".to_owned()));
    }
    file.rewind().map_err(unreadable)?;
    let meta = MetaData::read_from_buffered(&mut file, false).map_err(|error| malformed(error.to_string()))?;
    check_header(&meta).map_err(malformed)?;
    file.rewind().map_err(unreadable)?;

    let read = openexr::read()
        .no_deep_data()
        .largest_resolution_level()
        .specific_channels()
        .required("R")
        .required("G")
        .required("B")
        .collect_pixels(
            |size, _| (size.width(), vec![Rgb::ZERO; size.area()]),
            |(width, pixels), position, (r, g, b): (f32, f32, f32)| {
                pixels[position.y() * *width + position.x()] = Rgb::new(r, g, b);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)
        .map_err(|error| malformed(error.to_string()))?;
    let edge = |length: usize| u32::try_from(length).map_err(|_| malformed("it is too large".to_owned()));
    let layer = read.layer_data;
    let film = read.attributes.display_window.size;
    Ok(Image {
        width: edge(layer.size.width())?,
        height: edge(layer.size.height())?,
        pixels: layer.channel_data.pixels.1,
        origin: [layer.attributes.layer_position.x(), layer.attributes.layer_position.y()],
        full_size: [edge(film.width())?, edge(film.height())?],
    })
}

/// Refuses what the decoder would choke on, before it takes memory for it.
fn check_header(meta: &MetaData) -> Result<(), String> {
    let header = meta
        .headers
        .iter()
        .find(|header| ["R", "G", "B"].iter().all(|name| header.channels.list.iter().any(|c| c.name.eq(name))))
        .ok_or("it has no layer with the channels R, G and B")?;
    if header.deep {
        return Err("deep images are not supported".to_owned());
    }
    if header.channels.list.iter().any(|channel| channel.sampling != openexr::Vec2(1, 1)) {
        return Err("subsampled channels are not supported".to_owned());
    }
    let size = header.layer_size;
    match size.width().checked_mul(size.height()) {
        Some(area) if area <= MOST_PIXELS => Ok(()),
        _ => Err(format!("it claims {} × {} pixels, more than is supported", size.width(), size.height())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gradient() -> Image {
        let mut image = Image::cropped([40, 30], [5, 7], [7, 20]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Rgb::new(i as f32 * 0.1, 1.0 / (i as f32 + 1.0), 1e-30);
        }
        image.pixels[3] = Rgb::new(f32::INFINITY, f32::MAX, -0.0);
        image
    }

    #[test]
    fn half_precision_and_further_channels_are_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("half.exr");
        let half = ::exr::prelude::f16::from_f32;
        ::exr::prelude::write_rgba_file(&path, 3, 2, |x, y| (half(x as f32), half(y as f32), half(0.5), half(1.0)))
            .unwrap();
        let image = read_exr(&path).unwrap();
        assert_eq!((image.width, image.height), (3, 2));
        assert_eq!(image.pixels[5], Rgb::new(2.0, 1.0, 0.5));
    }

    #[test]
    fn damaged_files_are_errors() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        assert!(matches!(read_exr(&path), Err(ImageError::Read { .. })));
        let whole = {
            crate::write_exr(&path, &gradient(), &[]).unwrap();
            std::fs::read(&path).unwrap()
        };
        for length in [0, 3, 4, 8, 50, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            let error = read_exr(&path).unwrap_err();
            assert!(matches!(error, ImageError::Format { .. }), "{length}: {error}");
        }
        for at in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[at] ^= 0x55;
            std::fs::write(&path, &damaged).unwrap();
            // Some bytes are pixels, and harmless; no byte may cause a panic.
            let _ = read_exr(&path);
        }
    }
}
