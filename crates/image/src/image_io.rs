//! Images on disk: OpenEXR for numbers, PNG for eyes.

use std::fs::File;
use std::io::{BufReader, Cursor, Read as _, Seek as _};
use std::path::Path;

use exr::meta::MetaData;
use exr::prelude as openexr;
use exr::prelude::{ReadChannels as _, ReadLayers as _, ReadSpecificChannel as _, WritableImage as _};

use crate::atomic_file::StagedFile;
use crate::{Image, ImageError, Rgb, srgb};

/// Longer names of attributes break other programs (Nuke).
const LONGEST_ATTRIBUTE_NAME: usize = 31;

/// Most pixels that are read, 16384²: a file that claims more is damaged, and memory is taken before it is found out.
const MOST_PIXELS: usize = 1 << 28;

/// The value of an attribute in the header of an EXR.
#[derive(Clone, Debug, PartialEq)]
pub enum AttributeValue {
    /// Text.
    Text(String),
    /// A number in double precision.
    Float(f64),
    /// A whole number. EXR has 32 bits only: a larger one is written as decimal text.
    Integer(i64),
}

impl From<&str> for AttributeValue {
    fn from(value: &str) -> Self {
        Self::Text(value.to_owned())
    }
}

impl From<String> for AttributeValue {
    fn from(value: String) -> Self {
        Self::Text(value)
    }
}

impl From<f64> for AttributeValue {
    fn from(value: f64) -> Self {
        Self::Float(value)
    }
}

impl From<i64> for AttributeValue {
    fn from(value: i64) -> Self {
        Self::Integer(value)
    }
}

impl From<AttributeValue> for openexr::AttributeValue {
    fn from(value: AttributeValue) -> Self {
        // EXR strings are UTF-8 by convention; the crate's checked constructors know ASCII only.
        let text = |text: &str| Self::Text(openexr::Text::from_bytes_unchecked(text.bytes().collect()));
        match value {
            AttributeValue::Text(value) => text(&value),
            AttributeValue::Float(value) => Self::F64(value),
            AttributeValue::Integer(value) => i32::try_from(value).map_or_else(|_| text(&value.to_string()), Self::I32),
        }
    }
}

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

/// The first four bytes of every EXR.
const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The first four bytes of every PNG; there are four more.
const PNG_MAGIC: [u8; 4] = *b"\x89PNG";

fn open(path: &Path) -> Result<BufReader<File>, ImageError> {
    let unreadable = |source| ImageError::Read { path: path.to_owned(), source };
    let file = File::open(path).map_err(unreadable)?;
    if !file.metadata().map_err(unreadable)?.is_file() {
        return Err(ImageError::Format { path: path.to_owned(), reason: "it is not a file".to_owned() });
    }
    Ok(BufReader::new(file))
}

fn decode_png(file: BufReader<File>) -> Result<Image, String> {
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

fn stage_bytes(path: &Path, bytes: &[u8]) -> Result<StagedFile, ImageError> {
    StagedFile::write(path, |out| out.write_all(bytes))
        .map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn persist(path: &Path, file: StagedFile) -> Result<(), ImageError> {
    file.persist().map_err(|source| ImageError::Write { path: path.to_owned(), source })
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

fn check_shape(image: &Image) -> Result<(), String> {
    let area = image.width as usize * image.height as usize;
    if area == 0 || image.pixels.len() != area {
        return Err(format!("the image is {} × {} pixels but holds {}", image.width, image.height, image.pixels.len()));
    }
    Ok(())
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

/// The sRGB transfer curve, quantized to the nearest of 256 levels.
fn srgb_byte(linear: f32) -> u8 {
    (srgb::encode(linear) * 255.0).round() as u8
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
    fn half_precision_and_further_channels_are_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("half.exr");
        let half = exr::prelude::f16::from_f32;
        exr::prelude::write_rgba_file(&path, 3, 2, |x, y| (half(x as f32), half(y as f32), half(0.5), half(1.0)))
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
        let whole = encode_exr(&gradient(), &[]).unwrap();
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

    #[test]
    fn an_unwritable_place_is_named() {
        let error = write_exr(Path::new("/nonexistent/a.exr"), &gradient(), &[]).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/a.exr"), "{error}");
    }
}
