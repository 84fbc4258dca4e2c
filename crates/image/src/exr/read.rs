//! Reading EXR.

use std::collections::HashSet;
use std::io::{BufRead, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use ::exr::block::UncompressedBlock;
use ::exr::block::chunk::Chunk;
use ::exr::block::reader::ChunksReader as _;
use ::exr::error::Error;
use ::exr::meta::MetaData;
use ::exr::meta::attribute::SampleType;
use ::exr::meta::header::Header;
use ::exr::prelude as openexr;

use super::EXR_MAGIC;
use super::bounds::{check_chunk, check_header};
use crate::limits::{open, reserve};
use crate::{Image, ImageError, Rgb};

/// Reads the channels R, G and B (half, float or integer) of the first layer that has them; others are ignored.
///
/// It takes the image's 12 bytes a pixel and at most five times its largest block (a tile, or the rows that are
/// compressed together), and a block of more than 256 MiB is refused. What a file only claims takes no memory.
///
/// # Errors
/// The file cannot be read, is no regular file, is no EXR or damaged, has no such layer or more than 2²⁸ pixels.
pub fn read_exr(path: &Path) -> Result<Image, ImageError> {
    let (file, length) = open(path)?;
    decode_exr(path, file, length)
}

/// Decodes an EXR of `length` bytes from anywhere, with the promises and the errors of [`read_exr`]. `path` is for messages.
///
/// # Errors
/// Those of [`read_exr`].
pub fn decode_exr(path: &Path, mut file: impl BufRead + Seek, length: u64) -> Result<Image, ImageError> {
    let malformed = |reason: &str| ImageError::Format { path: path.to_owned(), reason: reason.to_owned() };
    let failed = |error: Error| match error {
        Error::Io(source) => ImageError::Read { path: path.to_owned(), source },
        error => malformed(&error.to_string()),
    };
    let mut magic = [0; 4];
    let is_exr = file.read_exact(&mut magic).is_ok() && magic == EXR_MAGIC;
    if !is_exr {
        return Err(malformed("it is not an OpenEXR file"));
    }
    file.rewind().map_err(|source| ImageError::Read { path: path.to_owned(), source })?;
    let reader = ::exr::block::read(file, false).map_err(failed)?;
    let (layer, channels) =
        find_layer(reader.headers()).ok_or_else(|| malformed("it has no layer with the channels R, G and B"))?;
    let area = check_header(path, reader.headers(), layer, length)?;
    let header = reader.headers()[layer].clone();
    let is_largest = |level: openexr::Vec2<usize>| level == openexr::Vec2(0, 0);
    let mut chunks =
        reader.filter_chunks(false, |_, _, block| block.layer == layer && is_largest(block.level)).map_err(failed)?;
    let mut canvas = Canvas { width: header.layer_size.width(), pixels: reserve(path, area)?, done: HashSet::new() };
    while let Some(chunk) = chunks.read_next_chunk() {
        let chunk = chunk.map_err(failed)?;
        if chunk.layer_index != layer {
            return Err(malformed("a block is not of the layer that it should be of"));
        }
        check_chunk(&header, &chunk.compressed_block).map_err(malformed)?;
        let block = decompress(chunk, chunks.meta_data()).map_err(failed)?;
        if !is_largest(block.index.level) {
            return Err(malformed("a block is not of the level that it should be of"));
        }
        canvas.draw(&block, &header, &channels).ok_or_else(|| malformed("a block is not where it should be"))?;
    }
    if canvas.done.len() != chunks.expected_chunk_count() || canvas.pixels.len() != area {
        return Err(malformed("blocks are missing"));
    }
    let edge = |length: usize| u32::try_from(length).map_err(|_| malformed("its film is too large"));
    let (film, position) = (header.shared_attributes.display_window.size, header.own_attributes.layer_position);
    Ok(Image {
        width: edge(header.layer_size.width())?,
        height: edge(header.layer_size.height())?,
        pixels: canvas.pixels,
        origin: [position.x(), position.y()],
        full_size: [edge(film.width())?, edge(film.height())?],
    })
}

/// Decompresses a block whose claims have been checked.
///
/// A panic of the decoder becomes an error. Its arithmetic on the values of damaged B44 blocks overflows, which is a
/// panic in builds that check it, and these values cannot be checked without decoding them. Nothing that the decoder
/// has touched is used again.
fn decompress(chunk: Chunk, meta: &MetaData) -> Result<UncompressedBlock, Error> {
    let decode = AssertUnwindSafe(|| UncompressedBlock::decompress_chunk(chunk, meta, false));
    catch_unwind(decode).unwrap_or_else(|_| Err(Error::Invalid("compressed data".into())))
}

/// One channel in the rows of a block.
struct Channel {
    /// Bytes of a pixel in the channels before it.
    before: usize,
    samples: SampleType,
}

/// The first layer with the channels R, G and B, and these.
fn find_layer(headers: &[Header]) -> Option<(usize, [Channel; 3])> {
    headers.iter().enumerate().find_map(|(layer, header)| {
        let find = |name: &str| {
            let list = &header.channels.list;
            let at = list.iter().position(|channel| channel.name.eq(name))?;
            let before = list[..at].iter().map(|channel| channel.sample_type.bytes_per_sample()).sum();
            Some(Channel { before, samples: list[at].sample_type })
        };
        Some((layer, [find("R")?, find("G")?, find("B")?]))
    })
}

/// The pixels that have come so far.
struct Canvas {
    width: usize,
    /// As many rows as the lowest block reaches down; memory for all is reserved.
    pixels: Vec<Rgb>,
    /// The top left corners of the blocks.
    done: HashSet<[usize; 2]>,
}

impl Canvas {
    /// Draws a block; `None` if it does not fit or has come before.
    fn draw(&mut self, block: &UncompressedBlock, header: &Header, channels: &[Channel; 3]) -> Option<()> {
        let (position, size) = (block.index.pixel_position, block.index.pixel_size);
        let bottom = position.y().checked_add(size.height())?;
        let fits = position.x().checked_add(size.width())? <= self.width && bottom <= header.layer_size.height();
        if !fits || !self.done.insert([position.x(), position.y()]) {
            return None;
        }
        if self.pixels.len() < bottom * self.width {
            self.pixels.resize(bottom * self.width, Rgb::ZERO);
        }
        let row_bytes = size.width() * header.channels.bytes_per_pixel;
        for (row, bytes) in block.data.chunks_exact(row_bytes).enumerate() {
            let start = (position.y() + row) * self.width + position.x();
            let pixels = self.pixels.get_mut(start..start + size.width())?;
            for (at, Channel { before, samples }) in channels.iter().enumerate() {
                let samples_bytes = bytes.get(before * size.width()..)?;
                let pixels = pixels.iter_mut().map(|pixel| &mut pixel[at]);
                match samples {
                    SampleType::F16 => {
                        fill(pixels, samples_bytes, |bits| openexr::f16::from_ne_bytes(bits).to_f32());
                    }
                    SampleType::F32 => fill(pixels, samples_bytes, f32::from_ne_bytes),
                    SampleType::U32 => fill(pixels, samples_bytes, |bits| u32::from_ne_bytes(bits) as f32),
                }
            }
        }
        Some(())
    }
}

fn fill<'a, const N: usize>(values: impl Iterator<Item = &'a mut f32>, bytes: &[u8], decode: impl Fn([u8; N]) -> f32) {
    for (value, &bytes) in values.zip(bytes.as_chunks::<N>().0) {
        *value = decode(bytes);
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
