//! What an EXR may ask for, checked before the decoder takes memory for it.

use std::path::Path;

use ::exr::block::chunk::CompressedBlock;
use ::exr::compression::Compression;
use ::exr::meta::header::Header;
use ::exr::prelude::Vec2;

use crate::ImageError;
use crate::limits::{DEFLATE_RATIO, check_area, check_ratio};

/// Most bytes of the pixels of one block. Usual ones have less than 64 MiB: 256 rows of 16,384 pixels of four channels.
const MOST_BLOCK_BYTES: u64 = 256 << 20;

/// Most bytes of run-length codes in a DWA block. They become up to 64 times as many.
const MOST_DWA_CODES: u64 = 16 << 20;

/// Bytes of a run-length code of two bytes, per byte.
const RUN_RATIO: u64 = 64;

/// Refuses a header whose layer would take more time or memory than its file of `length` bytes can account for. Returns
/// the layer's area in pixels.
pub(super) fn check_header(path: &Path, headers: &[Header], layer: usize, length: u64) -> Result<usize, ImageError> {
    let malformed = |reason: String| ImageError::Format { path: path.to_owned(), reason };
    let header = &headers[layer];
    if headers.iter().any(|header| header.deep) {
        return Err(malformed("deep images are not supported; flatten it".to_owned()));
    }
    if header.channels.list.iter().any(|channel| channel.sampling != Vec2(1, 1)) {
        return Err(malformed("subsampled channels are not supported; store all at full resolution".to_owned()));
    }
    let size = header.layer_size;
    let area = check_area(path, size.width() as u64, size.height() as u64)?;
    let pixel = header.channels.bytes_per_pixel as u64;
    if let Some(ratio) = most_ratio(header.compression) {
        check_ratio(path, length, (area as u64).saturating_mul(pixel), ratio)?;
    }
    // Every block has an offset of eight bytes in front of the pixels.
    let blocks = headers.iter().fold(0_u64, |sum, header| sum.saturating_add(header.chunk_count as u64));
    check_ratio(path, length, blocks.saturating_mul(8), 1)?;
    let block = header.max_block_pixel_size();
    let block = (block.width() as u64).saturating_mul(block.height() as u64).saturating_mul(pixel);
    if block > MOST_BLOCK_BYTES {
        return Err(malformed(format!(
            "its tiles or rows are compressed in blocks of {block} bytes, and at most {MOST_BLOCK_BYTES} are taken; \
             store it in smaller tiles"
        )));
    }
    Ok(area)
}

/// How many bytes of pixels there can be to a byte of a file. `None` where there is no such bound worth a check.
fn most_ratio(compression: Compression) -> Option<u64> {
    match compression {
        Compression::Uncompressed => Some(1),
        Compression::RLE => Some(RUN_RATIO),
        Compression::ZIP1 | Compression::ZIP16 => Some(DEFLATE_RATIO),
        // It drops a quarter of each float first.
        Compression::PXR24 => Some(DEFLATE_RATIO * 4 / 3),
        _ => None,
    }
}

/// Refuses a block that the decoder would make more of than the block's pixels.
///
/// The decoders of ZIP, PIZ, PXR24 and B44 stop there by themselves. That of run lengths does not, and that of DWA
/// believes the lengths that a block claims for its parts.
pub(super) fn check_chunk(header: &Header, block: &CompressedBlock) -> Result<(), &'static str> {
    let bytes = match block {
        CompressedBlock::ScanLine(block) => &block.compressed_pixels_le,
        CompressedBlock::Tile(block) => &block.compressed_pixels_le,
        _ => return Err("deep images are not supported; flatten it"),
    };
    let place = header.get_block_data_indices(block).and_then(|at| header.get_absolute_block_pixel_coordinates(at));
    let size = place.map_err(|_| "a block is not where it should be")?.size;
    let most = size.area() * header.channels.bytes_per_pixel;
    // A block that compression would have made longer is stored as it is.
    if bytes.len() == most {
        return Ok(());
    }
    let is_bounded = match header.compression {
        Compression::RLE => run_lengths(bytes) <= most,
        Compression::DWAA(_) | Compression::DWAB(_) => dwa_is_bounded(bytes, size, header),
        _ => true,
    };
    if is_bounded { Ok(()) } else { Err("a block claims to hold more than its pixels") }
}

/// How many bytes run-length codes stand for.
fn run_lengths(codes: &[u8]) -> usize {
    let (mut at, mut length) = (0, 0);
    while let Some(&count) = codes.get(at) {
        // A negative count is followed by as many bytes, any other by one that is repeated once more often.
        let count = i32::from(count.cast_signed());
        let (bytes, step) = if count < 0 { (-count, 1 - count) } else { (count + 1, 2) };
        length += bytes.unsigned_abs() as usize;
        at += step.unsigned_abs() as usize;
    }
    length
}

/// Whether the lengths at the start of a DWA block fit its pixels.
fn dwa_is_bounded(bytes: &[u8], size: Vec2<usize>, header: &Header) -> bool {
    let channels = header.channels.list.len() as u64;
    let most = size.area() as u64 * header.channels.bytes_per_pixel as u64;
    // Cosine transforms come in squares of 8 pixels, also at the edge.
    let squares = size.width().div_ceil(8) as u64 * size.height().div_ceil(8) as u64 * channels;
    let counters = bytes.as_chunks::<8>().0;
    let counter = |at: usize| counters.get(at).copied().map_or(0, u64::from_le_bytes);
    let [unknown, run_codes, run_bytes, ac, dc] = [1, 6, 7, 8, 9].map(counter);
    unknown <= most
        && run_bytes <= most
        && run_codes <= (2 * most).min(MOST_DWA_CODES)
        && ac <= 64 * squares
        && dc <= squares
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn run_lengths_are_counted() {
        // Four of a kind, two as they are, and one that breaks off.
        assert_eq!(run_lengths(&[3, 7, 254, 1, 2, 127]), 4 + 2 + 128);
        assert_eq!(run_lengths(&[]), 0);
        assert_eq!(run_lengths(&[128]), 128);
    }
}
