//! Writing EXR.

use std::fs::File;
use std::io::{self, BufWriter};
use std::path::Path;

use ::exr::prelude as openexr;
use ::exr::prelude::WritableImage as _;

use super::attributes::{AttributeValue, LONGEST_ATTRIBUTE_NAME};
use super::sort::sort_header;
use crate::files::StagedFile;
use crate::image::check_shape;
use crate::{Image, ImageError, Rgb};

/// How the components of a pixel are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum ComponentFormat {
    /// 32 bits: every value as it is.
    #[default]
    Float,
    /// 16 bits: the nearest such value, with 11 bits of precision. A finite value stays finite, within ±65504.
    Half,
}

/// How the pixels of an EXR are compressed, without loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Compression {
    /// Deflate, 16 rows at a time.
    #[default]
    Zip,
    /// Wavelets: smaller for noisy pixels.
    Piz,
    /// Lengths of runs: fast.
    Rle,
    /// None.
    Uncompressed,
}

impl From<Compression> for openexr::Compression {
    fn from(compression: Compression) -> Self {
        match compression {
            Compression::Zip => Self::ZIP16,
            Compression::Piz => Self::PIZ,
            Compression::Rle => Self::RLE,
            Compression::Uncompressed => Self::Uncompressed,
        }
    }
}

/// A channel beside those of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Its name with that of its layer, such as `normal.X`.
    pub name: String,
    /// One value a pixel, row by row. Stored in single precision.
    pub values: Vec<f32>,
}

/// How an EXR is written. The default keeps every bit of the pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ExrOptions {
    /// How the components of a pixel are stored.
    pub component_format: ComponentFormat,
    /// How the pixels are compressed.
    pub compression: Compression,
}

impl ExrOptions {
    /// These options with another compression.
    #[must_use]
    pub fn with_compression(mut self, compression: Compression) -> Self {
        self.compression = compression;
        self
    }

    /// These options with another format of the components.
    #[must_use]
    pub fn with_component_format(mut self, component_format: ComponentFormat) -> Self {
        self.component_format = component_format;
        self
    }
}

/// Writes a lossless single-precision EXR: channels R, G, B, ZIP compression. The data window is the image's place on
/// the film, the display window the whole film; `chromaticities` are those of sRGB. The bytes are a function of the
/// arguments alone.
///
/// It encodes 16 rows at a time into the file, so that the image is not held a second time.
///
/// # Errors
/// The file cannot be written, the image has no pixels, or an attribute's name is empty, repeated, longer than 31
/// bytes, not ASCII or one that the format itself uses.
pub fn write_exr(path: &Path, image: &Image, attributes: &[(&str, AttributeValue)]) -> Result<(), ImageError> {
    write_exr_with(path, image, attributes, &ExrOptions::default())
}

/// As [`write_exr`] with options.
///
/// # Errors
/// As [`write_exr`].
pub fn write_exr_with(
    path: &Path,
    image: &Image,
    attributes: &[(&str, AttributeValue)],
    options: &ExrOptions,
) -> Result<(), ImageError> {
    stage_exr_with(path, image, attributes, options)?
        .persist()
        .map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

/// As [`write_exr`], but the file does not appear before [`StagedFile::persist`].
///
/// # Errors
/// As [`write_exr`].
pub fn stage_exr(path: &Path, image: &Image, attributes: &[(&str, AttributeValue)]) -> Result<StagedFile, ImageError> {
    stage_exr_with(path, image, attributes, &ExrOptions::default())
}

/// As [`stage_exr`] with options.
///
/// # Errors
/// As [`write_exr`].
pub fn stage_exr_with(
    path: &Path,
    image: &Image,
    attributes: &[(&str, AttributeValue)],
    options: &ExrOptions,
) -> Result<StagedFile, ImageError> {
    stage_exr_layers(path, image, &[], attributes, options)
}

/// As [`stage_exr_with`] with more channels, in the same part of the file. They are held a second time while it is encoded.
///
/// # Errors
/// As [`write_exr`], or a channel has not one value a pixel, or its name is empty, not ASCII, or given twice.
pub fn stage_exr_layers(
    path: &Path,
    image: &Image,
    channels: &[Channel],
    attributes: &[(&str, AttributeValue)],
    options: &ExrOptions,
) -> Result<StagedFile, ImageError> {
    let encode = |file: &File| {
        check_shape(image).map_err(Failure::Unencodable)?;
        check_channels(image, channels).map_err(Failure::Unencodable)?;
        let attributes = layer_attributes(image, attributes).map_err(Failure::Unencodable)?;
        match options.component_format {
            _ if !channels.is_empty() => encode_layers(file, image, channels, attributes, options)?,
            ComponentFormat::Float => encode(file, image, attributes, options, |value| value)?,
            ComponentFormat::Half => encode(file, image, attributes, options, nearest_half)?,
        }
        Ok(sort_header(file)?)
    };
    StagedFile::write_seekable(path, encode).map_err(|failure| match failure {
        Failure::System(source) => ImageError::Write { path: path.to_owned(), source },
        Failure::Unencodable(reason) => ImageError::Unencodable { path: path.to_owned(), reason },
    })
}

/// Why nothing was written.
enum Failure {
    System(io::Error),
    Unencodable(String),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::System(error)
    }
}

impl From<::exr::error::Error> for Failure {
    fn from(error: ::exr::error::Error) -> Self {
        match error {
            ::exr::error::Error::Io(error) => Self::System(error),
            error => Self::Unencodable(error.to_string()),
        }
    }
}

fn nearest_half(value: f32) -> openexr::f16 {
    let half = openexr::f16::from_f32(value);
    // A value beyond the largest half float would become infinite, and nothing can be compared with that.
    if half.is_infinite() && value.is_finite() { openexr::f16::MAX.copysign(half) } else { half }
}

fn layer_attributes(image: &Image, attributes: &[(&str, AttributeValue)]) -> Result<openexr::LayerAttributes, String> {
    let mut layer_attributes = openexr::LayerAttributes {
        layer_position: openexr::Vec2(image.origin[0], image.origin[1]),
        ..openexr::LayerAttributes::default()
    };
    for (name, value) in attributes {
        let short = (1..=LONGEST_ATTRIBUTE_NAME).contains(&name.len());
        if !short || !name.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(format!("an attribute cannot be named `{name}`"));
        }
        if let ("worldToCamera", AttributeValue::Matrix(matrix)) = (*name, value) {
            layer_attributes.world_to_camera = Some(*matrix);
            continue;
        }
        let key = openexr::Text::from_bytes_unchecked(name.bytes().collect());
        if layer_attributes.other.insert(key, value.clone().into()).is_some() {
            return Err(format!("the attribute `{name}` is given twice"));
        }
    }
    Ok(layer_attributes)
}

/// Refuses channels that are not like the image.
fn check_channels(image: &Image, channels: &[Channel]) -> Result<(), String> {
    for (at, Channel { name, values }) in channels.iter().enumerate() {
        let taken = ["R", "G", "B"].contains(&name.as_str()) || channels[..at].iter().any(|other| other.name == *name);
        if name.is_empty() || !name.bytes().all(|byte| byte.is_ascii_graphic()) || taken {
            return Err(format!("a channel cannot be named `{name}`"));
        }
        if values.len() != image.pixels.len() {
            return Err(format!("the channel {name} has {} values for {} pixels", values.len(), image.pixels.len()));
        }
    }
    Ok(())
}

/// Writes the image with the components that `component` makes of its own.
fn encode<S: openexr::IntoSample>(
    file: &File,
    image: &Image,
    attributes: openexr::LayerAttributes,
    options: &ExrOptions,
    component: impl Fn(f32) -> S + Sync,
) -> Result<(), Failure> {
    let width = image.width as usize;
    let channels = openexr::SpecificChannels::rgb(|position: openexr::Vec2<usize>| {
        let Rgb { x, y, z } = image.pixels[position.y() * width + position.x()];
        (component(x), component(y), component(z))
    });
    let layer = openexr::Layer::new((width, image.height as usize), attributes, encoding(options), channels);
    openexr::Image::new(shared(image), layer).write().non_parallel().to_buffered(BufWriter::new(file))?;
    Ok(())
}

/// Writes the image and more channels.
fn encode_layers(
    file: &File,
    image: &Image,
    channels: &[Channel],
    attributes: openexr::LayerAttributes,
    options: &ExrOptions,
) -> Result<(), Failure> {
    let component = |i: usize| {
        let values = image.pixels.iter().map(move |pixel| pixel[i]);
        match options.component_format {
            ComponentFormat::Float => openexr::FlatSamples::F32(values.collect()),
            ComponentFormat::Half => openexr::FlatSamples::F16(values.map(nearest_half).collect()),
        }
    };
    let mut list: Vec<openexr::AnyChannel<openexr::FlatSamples>> =
        ["R", "G", "B"].into_iter().enumerate().map(|(i, name)| openexr::AnyChannel::new(name, component(i))).collect();
    list.extend(channels.iter().map(|Channel { name, values }| {
        openexr::AnyChannel::new(name.as_str(), openexr::FlatSamples::F32(values.clone()))
    }));
    let channels = openexr::AnyChannels::sort(list.into());
    let size = (image.width as usize, image.height as usize);
    let layer = openexr::Layer::new(size, attributes, encoding(options), channels);
    openexr::Image::new(shared(image), layer).write().non_parallel().to_buffered(BufWriter::new(file))?;
    Ok(())
}

fn encoding(options: &ExrOptions) -> openexr::Encoding {
    openexr::Encoding {
        compression: options.compression.into(),
        line_order: openexr::LineOrder::Increasing,
        ..openexr::Encoding::default()
    }
}

/// What a file says of all of its layers.
fn shared(image: &Image) -> openexr::ImageAttributes {
    let film = openexr::Vec2(image.full_size[0] as usize, image.full_size[1] as usize);
    let mut shared = openexr::ImageAttributes::new(openexr::IntegerBounds::new(openexr::Vec2(0, 0), film));
    // Readers assume these primaries where a file says nothing, but should not have to.
    shared.chromaticities = Some(openexr::attribute::Chromaticities {
        red: openexr::Vec2(0.64, 0.33),
        green: openexr::Vec2(0.3, 0.6),
        blue: openexr::Vec2(0.15, 0.06),
        white: openexr::Vec2(0.3127, 0.329),
    });
    shared
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::{Rgb, read_exr};
    use exr::meta::MetaData;
    use openexr::{ReadChannels as _, ReadLayers as _};

    fn gradient() -> Image {
        let mut image = Image::cropped([40, 30], [5, 7], [7, 20]);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            *pixel = Rgb::new(i as f32 * 0.1, 1.0 / (i as f32 + 1.0), 1e-30);
        }
        image.pixels[3] = Rgb::new(f32::INFINITY, f32::MAX, -0.0);
        image
    }

    fn encode(attributes: &[(&str, AttributeValue)]) -> Result<Vec<u8>, ImageError> {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("a.exr");
        write_exr(&path, &gradient(), attributes).map(|()| std::fs::read(&path).unwrap())
    }

    fn header(bytes: &[u8]) -> ::exr::meta::header::Header {
        MetaData::read_from_buffered(Cursor::new(bytes), true).unwrap().headers.remove(0)
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
        let first = encode(&attributes).unwrap();
        assert_eq!(first, encode(&attributes).unwrap());
        attributes.reverse();
        assert_eq!(first, encode(&attributes).unwrap());
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
            assert!(encode(&[(name, 1.0.into())]).is_err(), "{name}");
        }
        assert!(encode(&[("a", 1.0.into()), ("a", 2.0.into())]).is_err());
    }

    #[test]
    fn an_unwritable_place_is_named() {
        let error = write_exr(Path::new("/nonexistent/a.exr"), &gradient(), &[]).unwrap_err();
        assert!(error.to_string().contains("/nonexistent/a.exr"), "{error}");
    }

    #[test]
    fn the_primaries_are_those_of_srgb() {
        let primaries = header(&encode(&[]).unwrap()).shared_attributes.chromaticities.unwrap();
        assert_eq!((primaries.red.0, primaries.green.1, primaries.white.0), (0.64, 0.6, 0.3127));
        // A caller cannot give another.
        assert!(encode(&[("chromaticities", 1.0.into())]).is_err());
    }

    #[test]
    fn half_floats_are_the_nearest_and_stay_finite() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("half.exr");
        let mut image = gradient();
        image.pixels[0] = Rgb::new(1e9, -70_000.0, f32::NAN);
        let options = ExrOptions::default().with_component_format(ComponentFormat::Half);
        write_exr_with(&path, &image, &[], &options).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert!(header(&bytes).channels.list.iter().all(|channel| channel.sample_type == openexr::SampleType::F16));
        write_exr_with(&path, &image, &[], &options).unwrap();
        assert_eq!(bytes, std::fs::read(&path).unwrap());
        let read = read_exr(&path).unwrap();
        assert_eq!((read.origin, read.full_size), (image.origin, image.full_size));
        assert_eq!((read.pixels[0].x, read.pixels[0].y), (65_504.0, -65_504.0));
        assert!(read.pixels[0].z.is_nan());
        assert_eq!((read.pixels[3].x, read.pixels[3].y), (f32::INFINITY, 65_504.0));
        assert_eq!(read.pixels[3].z.to_bits(), (-0.0_f32).to_bits());
        for (pixel, read) in image.pixels.iter().zip(&read.pixels).skip(4) {
            // Half a unit in the last place of 11 bits; 1e-30 is below the smallest half float.
            assert!((pixel.x - read.x).abs() <= pixel.x / 2048.0 && read.z == 0.0, "{pixel} {read}");
        }
    }

    #[test]
    fn layers_are_channels_of_the_same_part() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("layers.exr");
        let image = gradient();
        let values: Vec<f32> = (0..image.pixels.len()).map(|i| 1.0 / (i as f32 + 3.0)).collect();
        let channel = |name: &str| Channel { name: name.to_owned(), values: values.clone() };
        let channels = [channel("normal.X"), channel("albedo.R"), channel("depth.Z")];
        let write = |channels: &[Channel], options: &ExrOptions| {
            let camera = std::array::from_fn(|i| i as f32);
            let attributes = [("worldToCamera", AttributeValue::Matrix(camera))];
            stage_exr_layers(&path, &image, channels, &attributes, options).map(|file| file.persist().unwrap())
        };
        for compression in [Compression::Zip, Compression::Piz, Compression::Rle, Compression::Uncompressed] {
            for format in [ComponentFormat::Float, ComponentFormat::Half] {
                let options = ExrOptions::default().with_compression(compression).with_component_format(format);
                write(&channels, &options).unwrap();
                let bytes = std::fs::read(&path).unwrap();
                let header = header(&bytes);
                assert_eq!(header.compression, compression.into());
                assert_eq!(header.own_attributes.world_to_camera.unwrap()[7], 7.0);
                let names: Vec<String> = header.channels.list.iter().map(|c| c.name.to_string()).collect();
                assert_eq!(names, ["B", "G", "R", "albedo.R", "depth.Z", "normal.X"]);
                // The picture is what it is without layers; the layers keep every bit.
                let read = read_exr(&path).unwrap();
                write(&[], &options).unwrap();
                assert_eq!(read.pixels[4..], read_exr(&path).unwrap().pixels[4..]);
                let all = openexr::read().no_deep_data().largest_resolution_level().all_channels().first_valid_layer();
                let all = all.all_attributes().from_buffered(Cursor::new(bytes)).unwrap();
                let depth = &all.layer_data.channel_data.list[4].sample_data;
                assert_eq!(*depth, openexr::FlatSamples::F32(values.clone()));
            }
        }
        for wrong in ["", "R", "a b", "albedo.R"] {
            let with = [&channels[..], &[channel(wrong)]].concat();
            assert!(write(&with, &ExrOptions::default()).is_err(), "{wrong}");
        }
        let short = Channel { name: "a".to_owned(), values: vec![1.0] };
        assert!(write(&[short], &ExrOptions::default()).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_gets_the_same_bytes() {
        let directory = tempfile::tempdir().unwrap();
        let pipe = directory.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || std::fs::read(pipe).unwrap()
        });
        write_exr(&pipe, &gradient(), &[]).unwrap();
        assert_eq!(reader.join().unwrap(), encode(&[]).unwrap());
    }
}
