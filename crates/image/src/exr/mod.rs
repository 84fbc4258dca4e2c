//! OpenEXR: images as numbers.

mod attributes;
mod read;
mod write;

pub use attributes::AttributeValue;
pub use read::read_exr;
pub use write::{stage_exr, write_exr};

/// The first four bytes of every EXR.
pub(crate) const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
