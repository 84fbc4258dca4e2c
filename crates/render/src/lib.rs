//! The renderer of `vdf`: scenes, media, visibility and integrators.

mod error;
mod mesh;
pub mod scene;

pub use error::RenderError;
pub use mesh::Triangle;

/// Linear RGB with the primaries of sRGB, as radiance, intensity, reflectance or albedo.
pub type Rgb = glam::Vec3;
