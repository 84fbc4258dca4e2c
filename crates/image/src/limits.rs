//! What a file may ask for before its pixels are decoded.

use std::fs::File;
use std::io::{self, BufReader};
use std::path::Path;

use crate::{ImageError, Rgb};

/// Most pixels that are read, 16384², which take 3 GiB: whoever wrote a file with more cannot make this process take
/// all memory.
pub(crate) const MOST_PIXELS: u64 = 1 << 28;

/// Most bytes that deflate makes of one byte: a match of 258 bytes takes at least two bits.
pub(crate) const DEFLATE_RATIO: u64 = 1032;

/// Opens a regular file and tells its length in bytes.
///
/// The kind is checked before the file is opened, because to open a pipe is to wait for its writer.
pub(crate) fn open(path: &Path) -> Result<(BufReader<File>, u64), ImageError> {
    let unreadable = |source| ImageError::Read { path: path.to_owned(), source };
    let check = |metadata: &std::fs::Metadata| {
        let reason = match metadata.file_type() {
            kind if kind.is_file() => return Ok(()),
            kind if kind.is_dir() => "it is not a file but a directory",
            _ => "it is not a file but a pipe or a device; copy its content to a file first",
        };
        Err(ImageError::Format { path: path.to_owned(), reason: reason.to_owned() })
    };
    check(&path.metadata().map_err(unreadable)?)?;
    let file = File::open(path).map_err(unreadable)?;
    // Another file may have come to this place in between.
    let metadata = file.metadata().map_err(unreadable)?;
    check(&metadata)?;
    Ok((BufReader::new(file), metadata.len()))
}

/// Refuses an image of more than [`MOST_PIXELS`], and tells how many pixels there are.
pub(crate) fn check_area(path: &Path, width: u64, height: u64) -> Result<usize, ImageError> {
    const PIXEL: u64 = size_of::<Rgb>() as u64;
    let area = width.saturating_mul(height);
    match usize::try_from(area) {
        Ok(small) if area <= MOST_PIXELS => Ok(small),
        _ => Err(ImageError::TooLarge {
            path: path.to_owned(),
            width,
            height,
            bytes: area.saturating_mul(PIXEL),
            limit: MOST_PIXELS * PIXEL,
        }),
    }
}

/// Refuses a file of `length` bytes that claims to hold `decoded` bytes of pixels, of which one byte can hold `ratio`
/// at most.
pub(crate) fn check_ratio(path: &Path, length: u64, decoded: u64, ratio: u64) -> Result<(), ImageError> {
    if decoded <= length.saturating_mul(ratio) {
        return Ok(());
    }
    Err(ImageError::Format {
        path: path.to_owned(),
        reason: format!(
            "it claims pixels of {decoded} bytes, which do not fit into a file of {length} bytes; \
             it is damaged or not complete"
        ),
    })
}

/// Memory for `area` pixels, none of which is there yet: a file that breaks off has touched no more than it filled.
pub(crate) fn reserve(path: &Path, area: usize) -> Result<Vec<Rgb>, ImageError> {
    let mut pixels = Vec::new();
    pixels.try_reserve_exact(area).map_err(|_| ImageError::Read {
        path: path.to_owned(),
        source: io::Error::new(
            io::ErrorKind::OutOfMemory,
            format!("its pixels need {} bytes of memory, which are not there", area * size_of::<Rgb>()),
        ),
    })?;
    Ok(pixels)
}
