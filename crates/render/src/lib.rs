//! The renderer of `vdf`: scenes, media, visibility and integrators.
//!
//! The way of the data: [`scene`] (a file, resolved and checked) → [`World`] (hierarchy, media, emitters) → [`Acceleration`] (voxels,
//! distance field, safe neighbourhoods: the proofs) → an integrator, tile by tile → an image and its statistics.

mod frame;
pub mod geometry;
mod lights;
mod media;
mod mesh;
mod phase;
mod sampler;
pub mod scene;
mod sensor;
mod world;

pub use lights::{LightSample, Lights};
pub use media::{Flight, Media};
pub use mesh::Triangle;
pub use sampler::Sampler;
pub use world::{SurfacePoint, World};

/// Linear RGB with the primaries of sRGB, as radiance, intensity, reflectance or albedo.
pub type Rgb = glam::Vec3;
