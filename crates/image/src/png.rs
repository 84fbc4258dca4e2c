//! PNG: images for eyes.

use std::io::{self, BufRead, Seek, Write};
use std::path::Path;

use crate::files::StagedFile;
use crate::image::check_shape;
use crate::limits::{DEFLATE_RATIO, check_area, check_ratio, reserve};
use crate::{Image, ImageError, Rgb, srgb};

/// The first four bytes of every PNG; there are four more.
pub(crate) const PNG_MAGIC: [u8; 4] = *b"\x89PNG";

/// Most pixels that are encoded at once, which makes a smaller file and takes 9 bytes a pixel; more go row by row.
const MOST_AT_ONCE: usize = 1 << 24;

/// Compressed bytes in one piece of the file; the last one may have fewer.
const PIECE: usize = 1 << 20;

/// Most bytes that the decoder takes for what is not pixels.
const DECODER_BYTES: usize = 64 << 20;

/// Writes an 8-bit PNG with the sRGB transfer curve. Values outside [0, 1] are clamped, NaN becomes black. The bytes
/// are a function of the pixels alone. The encoder takes at most 150 MiB beside the image.
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
    check_shape(image).map_err(|reason| ImageError::Unencodable { path: path.to_owned(), reason })?;
    stage_rows(path, [image.width, image.height], &image.pixels, |pixel| pixel.to_array().map(srgb_byte))
}

/// The bytes that [`write_png`] writes.
///
/// # Errors
/// Says what is wrong if the image has no pixels.
pub fn encode_png(image: &Image) -> Result<Vec<u8>, String> {
    check_shape(image)?;
    let mut bytes = Vec::new();
    encode(&mut bytes, [image.width, image.height], &image.pixels, |pixel| pixel.to_array().map(srgb_byte))
        .map_err(|error| error.to_string())?;
    Ok(bytes)
}

/// Writes an 8-bit PNG of `size` pixels that `colour` makes of `values`, as a display takes them.
pub(crate) fn write_png_of<T>(
    path: &Path,
    size: [u32; 2],
    values: &[T],
    colour: impl Fn(&T) -> [u8; 3],
) -> Result<(), ImageError> {
    if values.is_empty() || values.len() as u64 != u64::from(size[0]) * u64::from(size[1]) {
        let reason = format!("the image is {} × {} pixels but holds {}", size[0], size[1], values.len());
        return Err(ImageError::Unencodable { path: path.to_owned(), reason });
    }
    persist(path, stage_rows(path, size, values, colour)?)
}

fn persist(path: &Path, file: StagedFile) -> Result<(), ImageError> {
    file.persist().map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn stage_rows<T>(
    path: &Path,
    size: [u32; 2],
    values: &[T],
    colour: impl Fn(&T) -> [u8; 3],
) -> Result<StagedFile, ImageError> {
    StagedFile::write(path, |out| encode(out, size, values, colour))
        .map_err(|source| ImageError::Write { path: path.to_owned(), source })
}

fn encode<T>(out: impl Write, size: [u32; 2], values: &[T], colour: impl Fn(&T) -> [u8; 3]) -> io::Result<()> {
    let [width, height] = size;
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header().map_err(system)?;
    if values.len() <= MOST_AT_ONCE {
        let samples: Vec<u8> = values.iter().flat_map(colour).collect();
        writer.write_image_data(&samples).map_err(system)?;
    } else {
        write_rows(&mut writer, width, values, colour)?;
    }
    writer.finish().map_err(system)
}

/// Encodes row by row, so that the image is not held a second time.
fn write_rows<T>(
    writer: &mut png::Writer<impl Write>,
    width: u32,
    values: &[T],
    colour: impl Fn(&T) -> [u8; 3],
) -> io::Result<()> {
    let mut stream = writer.stream_writer_with_size(PIECE).map_err(system)?;
    let mut row = Vec::new();
    for values in values.chunks(width as usize) {
        row.clear();
        row.extend(values.iter().flat_map(&colour));
        stream.write_all(&row)?;
    }
    stream.finish().map_err(system)
}

/// The system's own error, so that the caller can tell a full disk from a limit to the size of files.
fn system(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(error) => error,
        error => io::Error::other(error),
    }
}

/// Decodes a PNG of `length` bytes row by row. `path` is for messages.
pub(crate) fn decode_png(path: &Path, file: impl BufRead + Seek, length: u64) -> Result<Image, ImageError> {
    let failed = |error: png::DecodingError| match error {
        png::DecodingError::IoError(source) if source.kind() != io::ErrorKind::UnexpectedEof => {
            ImageError::Read { path: path.to_owned(), source }
        }
        error => ImageError::Format { path: path.to_owned(), reason: error.to_string() },
    };
    let mut decoder = png::Decoder::new_with_limits(file, png::Limits { bytes: DECODER_BYTES });
    decoder.set_transformations(png::Transformations::EXPAND);
    // Nothing of these is used, so they should not take time and memory.
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let header = decoder.read_header_info().map_err(failed)?;
    let [width, height] = [header.width, header.height];
    let is_interlaced = header.interlaced;
    let bits = header.bits_per_pixel() as u64;
    let area = check_area(path, width.into(), height.into())?;
    check_ratio(path, length, area as u64 * bits / 8, DEFLATE_RATIO)?;
    let mut reader = decoder.read_info().map_err(failed)?;
    let (colour, depth) = reader.output_color_type();
    let grey = matches!(colour, png::ColorType::Grayscale | png::ColorType::GrayscaleAlpha);
    let is_wide = depth == png::BitDepth::Sixteen;
    let mut pixels = reserve(path, area)?;
    let mut rows = Rows::new(width, height, is_interlaced);
    while let Some(row) = reader.next_interlaced_row().map_err(failed)? {
        let Some([y, first, step]) = rows.next() else { break };
        let start = y * width as usize;
        // Interlaced rows come several times; the first time makes place for them.
        let end = start + width as usize;
        if pixels.len() < end {
            pixels.resize(end, Rgb::ZERO);
        }
        let samples = row.data().chunks_exact(colour.samples() * if is_wide { 2 } else { 1 });
        for (pixel, samples) in pixels[start..end].iter_mut().skip(first).step_by(step).zip(samples) {
            let sample = |at: usize| {
                if is_wide {
                    f32::from(u16::from_be_bytes([samples[2 * at], samples[2 * at + 1]])) / f32::from(u16::MAX)
                } else {
                    f32::from(samples[at]) / f32::from(u8::MAX)
                }
            };
            let encoded = if grey { [sample(0); 3] } else { [sample(0), sample(1), sample(2)] };
            *pixel = Rgb::from(encoded.map(srgb::decode));
        }
    }
    if pixels.len() != area {
        return Err(ImageError::Format { path: path.to_owned(), reason: "it has too few rows".to_owned() });
    }
    Ok(Image { width, height, pixels, origin: [0, 0], full_size: [width, height] })
}

/// The rows in the order of the file. Each is the row's place, its first column, and the columns from pixel to pixel.
///
/// An interlaced PNG comes in seven passes, each of which brings some pixels of some rows (Adam7).
struct Rows {
    size: [usize; 2],
    /// First row, rows from row to row, first column, columns from pixel to pixel; the last pass first.
    passes: Vec<[usize; 4]>,
    /// Rows of this pass that are done.
    line: usize,
}

impl Rows {
    fn new(width: u32, height: u32, is_interlaced: bool) -> Self {
        const ADAM7: [[usize; 4]; 7] =
            [[1, 2, 0, 1], [0, 2, 1, 2], [2, 4, 0, 2], [0, 4, 2, 4], [4, 8, 0, 4], [0, 8, 4, 8], [0, 8, 0, 8]];
        let passes = if is_interlaced { ADAM7.to_vec() } else { vec![[0, 1, 0, 1]] };
        Self { size: [width as usize, height as usize], passes, line: 0 }
    }
}

impl Iterator for Rows {
    type Item = [usize; 3];

    fn next(&mut self) -> Option<[usize; 3]> {
        while let Some(&[first_row, rows, first, step]) = self.passes.last() {
            let y = first_row + rows * self.line;
            if y < self.size[1] && first < self.size[0] {
                self.line += 1;
                return Some([y, first, step]);
            }
            self.passes.pop();
            self.line = 0;
        }
        None
    }
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

    /// Pixels that no filter and no run length makes small.
    fn noise(width: u32, height: u32) -> Image {
        let mut image = Image::new(width, height);
        let mut random = 1_u32;
        for pixel in image.pixels.iter_mut().flat_map(AsMut::<[f32; 3]>::as_mut) {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *pixel = (random >> 8) as f32 / (1 << 24) as f32;
        }
        image
    }

    #[test]
    fn rows_one_by_one_are_the_same_picture() {
        let image = noise(700, 900);
        let colour = |pixel: &Rgb| pixel.to_array().map(srgb_byte);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 700, 900);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().unwrap();
        write_rows(&mut writer, 700, &image.pixels, colour).unwrap();
        writer.finish().unwrap();
        // It takes more than one piece.
        assert!(bytes.len() > PIECE + PIECE / 2, "{}", bytes.len());
        let decode = |bytes: &[u8]| image::load_from_memory(bytes).unwrap().into_rgb8();
        assert_eq!(decode(&bytes), decode(&encode_png(&image).unwrap()));
    }

    /// A PNG of any kind with the samples `0, 1, 2, …`, and what another decoder makes of it.
    fn decoded_twice(size: [u32; 2], colour: png::ColorType, depth: png::BitDepth) -> (Image, image::Rgb32FImage) {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, size[0], size[1]);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        if colour == png::ColorType::Indexed {
            encoder.set_palette((0..=255).flat_map(|i| [i, 255 - i, i / 2]).collect::<Vec<u8>>());
            encoder.set_trns(vec![7; 3]);
        }
        let mut writer = encoder.write_header().unwrap();
        let row = (size[0] as usize * colour.samples() * depth as usize).div_ceil(8);
        let data: Vec<u8> = (0..row * size[1] as usize).map(|i| (i * 37) as u8).collect();
        writer.write_image_data(&data).unwrap();
        writer.finish().unwrap();
        let other = image::load_from_memory(&bytes).unwrap().into_rgb32f();
        let length = bytes.len() as u64;
        (decode_png(Path::new("a.png"), io::Cursor::new(bytes), length).unwrap(), other)
    }

    #[test]
    fn every_kind_of_png_is_read_as_another_decoder_does() {
        use png::{BitDepth as Depth, ColorType as Colour};
        let kinds = [
            (Colour::Grayscale, [Depth::One, Depth::Two, Depth::Four, Depth::Eight, Depth::Sixteen].as_slice()),
            (Colour::Indexed, &[Depth::One, Depth::Two, Depth::Four, Depth::Eight]),
            (Colour::GrayscaleAlpha, &[Depth::Eight, Depth::Sixteen]),
            (Colour::Rgb, &[Depth::Eight, Depth::Sixteen]),
            (Colour::Rgba, &[Depth::Eight, Depth::Sixteen]),
        ];
        for (colour, depths) in kinds {
            for &depth in depths {
                for size in [[1, 1], [7, 3], [20, 9]] {
                    let (image, other) = decoded_twice(size, colour, depth);
                    assert_eq!([image.width, image.height], size);
                    for (pixel, other) in image.pixels.iter().zip(other.pixels()) {
                        let expected = Rgb::from(other.0.map(srgb::decode));
                        // The other one rounds grey twice.
                        let difference = (pixel - expected).abs().max_element();
                        assert!(difference < 1e-6, "{colour:?} {depth:?} {size:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn interlaced_rows_find_their_places() {
        for [width, height] in [[1, 1], [1, 9], [5, 1], [2, 2], [8, 8], [17, 13], [4, 5], [3, 20]] {
            let mut times = vec![0; width * height];
            for [y, first, step] in Rows::new(width as u32, height as u32, true) {
                (first..width).step_by(step).for_each(|x| times[y * width + x] += 1);
            }
            assert!(times.iter().all(|&times| times == 1), "{width} {height} {times:?}");
        }
    }

    #[test]
    fn a_png_that_claims_too_much_is_refused_with_the_figure() {
        // One bit a pixel, all black: 130 kB that would become 12.9 GB.
        let claim = |width: u32, height: u32| {
            let mut bytes = Vec::new();
            let mut encoder = png::Encoder::new(&mut bytes, width, height);
            encoder.set_depth(png::BitDepth::One);
            encoder.set_compression(png::Compression::High);
            let mut writer = encoder.write_header().unwrap();
            let mut stream = writer.stream_writer().unwrap();
            // A part of the rows is enough, since none is read.
            stream.write_all(&vec![0; 1 << 16]).unwrap();
            drop(stream);
            drop(writer);
            let length = bytes.len() as u64;
            decode_png(Path::new("a.png"), io::Cursor::new(bytes), length).unwrap_err()
        };
        let error = claim(32_768, 32_768);
        assert!(matches!(error, ImageError::TooLarge { bytes: 12_884_901_888, .. }), "{error}");
        assert!(error.to_string().contains("32768 x 32768 pixels need 12884901888 bytes"), "{error}");
        let error = claim(16_384, 16_384);
        assert!(matches!(error, ImageError::Format { .. }), "{error}");
        assert!(error.to_string().contains("claims pixels of 33554432 bytes"), "{error}");
    }
}
