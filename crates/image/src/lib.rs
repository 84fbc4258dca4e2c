//! Images as a renderer makes them: linear values in memory, OpenEXR and PNG on disk, and how far two images are apart.
//!
//! Files appear whole or not at all: they are written beside their place and then moved there ([`StagedFile`]).
//!
//! ```
//! use vdf_image::{Image, metrics};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let (black, mut grey) = (Image::new(16, 16), Image::new(16, 16));
//! grey.pixels.fill(vdf_image::Rgb::splat(0.5));
//! assert_eq!(metrics::mse(&grey, &black)?, 0.25);
//!
//! let folder = tempfile::tempdir()?;
//! let path = folder.path().join("grey.exr");
//! vdf_image::write_exr(&path, &grey, &[])?;
//! assert_eq!(vdf_image::read_exr(&path)?, grey);
//! # Ok(())
//! # }
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod error;
mod exr;
mod files;
mod format;
#[cfg(test)]
mod hostile;
mod image;
mod limits;
pub mod metrics;
mod png;
mod srgb;

pub use error::ImageError;
pub use exr::{
    AttributeValue, Channel, ComponentFormat, Compression, ExrOptions, decode_exr, read_exr, stage_exr,
    stage_exr_layers, stage_exr_with, write_exr, write_exr_with,
};
pub use files::{
    Conflict, PersistError, StagedFile, check_distinct, check_writable, remove_temporaries, same_file, shown,
    write_atomically,
};
pub use format::{ImageFormat, read_image};
pub use image::Image;
pub use png::{encode_png, stage_png, write_png};

/// Linear RGB with the primaries of sRGB.
pub type Rgb = glam::Vec3;
