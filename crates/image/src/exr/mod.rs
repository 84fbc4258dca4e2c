//! OpenEXR: images as numbers.

mod attributes;
mod bounds;
mod read;
mod sort;
mod write;

pub use attributes::AttributeValue;
pub use read::{decode_exr, read_exr};
pub use write::{
    Channel, ComponentFormat, Compression, ExrOptions, stage_exr, stage_exr_layers, stage_exr_with, write_exr,
    write_exr_with,
};

/// The first four bytes of every EXR.
pub(crate) const EXR_MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];
