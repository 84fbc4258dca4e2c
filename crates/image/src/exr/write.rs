//! Writing EXR.

use std::io::Cursor;
use std::path::Path;

use ::exr::prelude as openexr;
use ::exr::prelude::WritableImage as _;

use super::attributes::{AttributeValue, LONGEST_ATTRIBUTE_NAME};
use crate::atomic_file::{StagedFile, persist, stage_bytes};
use crate::image::check_shape;
use crate::{Image, ImageError};

/// Writes a lossless single-precision EXR: channels R, G, B, ZIP compression. The data window is the image's place on
/// the film, the display window the whole film. The bytes are a function of the arguments alone.
///
/// # Errors
/// The file cannot be written, or an attribute's name is empty, repeated, longer than 31 bytes or not ASCII.
pub fn write_exr(path: &Path, image: &Image, attributes: &[(&str, AttributeValue)]) -> Result<(), ImageError> {
    persist(path, stage_exr(path, image, attributes)?)
}

/// As [`write_exr`], but the file does not appear before [`StagedFile::persist`].
///
/// # Errors
/// As [`write_exr`].
pub fn stage_exr(path: &Path, image: &Image, attributes: &[(&str, AttributeValue)]) -> Result<StagedFile, ImageError> {
    let bytes =
        encode_exr(image, attributes).map_err(|reason| ImageError::Unencodable { path: path.to_owned(), reason })?;
    stage_bytes(path, &bytes)
}

fn encode_exr(image: &Image, attributes: &[(&str, AttributeValue)]) -> Result<Vec<u8>, String> {
    check_shape(image)?;
    let width = image.width as usize;
    let channels = openexr::SpecificChannels::rgb(|position: openexr::Vec2<usize>| {
        let pixel = image.pixels[position.y() * width + position.x()];
        (pixel.x, pixel.y, pixel.z)
    });
    let mut layer_attributes = openexr::LayerAttributes {
        layer_position: openexr::Vec2(image.origin[0], image.origin[1]),
        ..openexr::LayerAttributes::default()
    };
    for (name, value) in attributes {
        let short = (1..=LONGEST_ATTRIBUTE_NAME).contains(&name.len());
        if !short || !name.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(format!("an attribute cannot be named `{name}`"));
        }
        let key = openexr::Text::from_bytes_unchecked(name.bytes().collect());
        if layer_attributes.other.insert(key, value.clone().into()).is_some() {
            return Err(format!("the attribute `{name}` is given twice"));
        }
    }
    let encoding = openexr::Encoding {
        compression: openexr::Compression::ZIP16,
        line_order: openexr::LineOrder::Increasing,
        ..openexr::Encoding::default()
    };
    let layer = openexr::Layer::new((width, image.height as usize), layer_attributes, encoding, channels);
    let film = openexr::Vec2(image.full_size[0] as usize, image.full_size[1] as usize);
    let display = openexr::IntegerBounds::new(openexr::Vec2(0, 0), film);
    let mut bytes = Cursor::new(Vec::new());
    openexr::Image::new(openexr::ImageAttributes::new(display), layer)
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(|error| error.to_string())?;
    let mut bytes = bytes.into_inner();
    sort_header(&mut bytes).ok_or("the encoder wrote a header that cannot be parsed")?;
    Ok(bytes)
}

/// Sorts the attributes in the header by name, in place.
///
/// The encoder keeps custom attributes in a hash map, so that their order differs from run to run. The header keeps
/// its length, so all offsets stay right. `None` if the bytes are no single-part EXR.
fn sort_header(bytes: &mut [u8]) -> Option<()> {
    /// Magic number and version.
    const START: usize = 8;
    /// The text from `at` and its terminator's place.
    fn end_of_text(bytes: &[u8], at: usize) -> Option<usize> {
        bytes.get(at..)?.iter().position(|&byte| byte == 0).map(|length| at + length)
    }

    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut at = START;
    // An empty name ends the header.
    while *bytes.get(at)? != 0 {
        let name_end = end_of_text(bytes, at)?;
        let type_end = end_of_text(bytes, name_end + 1)?;
        let size = bytes.get(type_end + 1..type_end + 5)?;
        let size = usize::try_from(i32::from_le_bytes(size.try_into().ok()?)).ok()?;
        let end = type_end + 5 + size;
        attributes.push(bytes.get(at..end)?.to_vec());
        at = end;
    }
    // Names are unique and NUL-terminated, so comparing whole attributes compares names.
    attributes.sort_unstable();
    bytes[START..at].copy_from_slice(&attributes.concat());
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Rgb, read_exr};
    use exr::meta::MetaData;

    fn gradient() -> Image {
        let mut image = Image::cropped([40, 30], [5, 7], [7, 20]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Rgb::new(i as f32 * 0.1, 1.0 / (i as f32 + 1.0), 1e-30);
        }
        image.pixels[3] = Rgb::new(f32::INFINITY, f32::MAX, -0.0);
        image
    }

    #[test]
    fn an_exr_keeps_every_bit_and_its_place_on_the_film() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        let image = gradient();
        write_exr(&path, &image, &[]).unwrap();
        let read = read_exr(&path).unwrap();
        assert_eq!(read, image);
        assert_eq!(read.pixels[3].z.to_bits(), (-0.0_f32).to_bits());
    }

    #[test]
    fn exr_bytes_depend_on_the_arguments_alone() {
        let names: Vec<String> = (0..20).map(|i| format!("vdf:{i}")).collect();
        let mut attributes: Vec<(&str, AttributeValue)> =
            names.iter().map(|name| (name.as_str(), 1.5.into())).collect();
        attributes.push(("vdf:seed", AttributeValue::Integer(i64::MAX)));
        attributes.push(("vdf:scene", "größe.xml".into()));
        let first = encode_exr(&gradient(), &attributes).unwrap();
        assert_eq!(first, encode_exr(&gradient(), &attributes).unwrap());
        attributes.reverse();
        assert_eq!(first, encode_exr(&gradient(), &attributes).unwrap());
        let meta = MetaData::read_from_buffered(Cursor::new(first), true).unwrap();
        let layer = &meta.headers[0].own_attributes.other;
        assert_eq!(layer.len(), attributes.len());
        let key = openexr::Text::from("vdf:seed");
        assert_eq!(layer[&key], openexr::AttributeValue::Text(i64::MAX.to_string().as_str().into()));
    }

    #[test]
    fn attribute_names_are_checked() {
        let too_long = "a".repeat(LONGEST_ATTRIBUTE_NAME + 1);
        for name in ["", "with space", too_long.as_str()] {
            assert!(encode_exr(&gradient(), &[(name, 1.0.into())]).is_err(), "{name}");
        }
        assert!(encode_exr(&gradient(), &[("a", 1.0.into()), ("a", 2.0.into())]).is_err());
    }

    #[test]
    fn an_unwritable_place_is_named() {
        let error = write_exr(Path::new("/nonexistent/a.exr"), &gradient(), &[]).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/a.exr"), "{error}");
    }
}
