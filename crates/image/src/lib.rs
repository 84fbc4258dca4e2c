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

mod atomic_file;
mod error;
mod exr;
mod format;
mod image;
pub mod metrics;
mod png;
mod srgb;

pub use atomic_file::{PersistError, StagedFile, check_writable, write_atomically};
pub use error::ImageError;
pub use exr::{AttributeValue, read_exr, stage_exr, write_exr};
pub use format::{ImageFormat, read_image};
pub use image::Image;
pub use png::{encode_png, stage_png, write_png};

/// Linear RGB with the primaries of sRGB.
pub type Rgb = glam::Vec3;
