//! The errors of this crate.

use std::{io, path::PathBuf};

use crate::files::shown;

/// Why an image could not be read, written or compared.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The system refused to write.
    #[error("cannot write {}", shown(path))]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The system refused to read.
    #[error("cannot read {}", shown(path))]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file can be read but is not an image that we understand.
    #[error("cannot read {}: {reason}", shown(path))]
    Format {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// The file has more pixels than are read.
    #[error(
        "cannot read {}: its {width} x {height} pixels need {bytes} bytes of memory, and at most {limit} are taken; \
         scale it down or crop it",
        shown(path)
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its width in pixels.
        width: u64,
        /// Its height in pixels.
        height: u64,
        /// What its pixels would need in bytes.
        bytes: u64,
        /// What they may need in bytes.
        limit: u64,
    },
    /// There is not enough memory for an image that was asked for.
    #[error(
        "an image of {width} x {height} pixels needs {bytes} bytes of memory, which are not there; \
         make the image smaller or crop it"
    )]
    Memory {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// What the pixels need in bytes.
        bytes: u64,
    },
    /// The image or its attributes cannot be stored.
    #[error("cannot write {}: {reason}", shown(path))]
    Unencodable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// Two images that should be compared differ in size.
    #[error("the images differ in size: {} x {} and {} x {}", a[0], a[1], b[0], b[1])]
    SizeMismatch {
        /// Width and height of the one in pixels.
        a: [u32; 2],
        /// Width and height of the other in pixels.
        b: [u32; 2],
    },
    /// An image cannot be compared: it has no pixels, or one that is not finite.
    #[error("cannot compare: the {image} {reason}")]
    Uncomparable {
        /// Which one: "image" or "reference".
        image: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// The observer's pixels per degree are out of range.
    #[error("pixels per degree must be from 1 to 1000, not {value}")]
    PixelsPerDegree {
        /// The value that was asked for.
        value: f64,
    },
}
