//! The renderer of `vdf`: scenes, media, visibility and integrators.
//!
//! The way of the data: [`scene`] (a file, resolved and checked) → [`World`] (hierarchy, media, emitters) → [`Acceleration`] (voxels,
//! distance field, safe neighbourhoods: the proofs) → an integrator, tile by tile → an image and its statistics.

mod acceleration;
mod error;
mod frame;
pub mod geometry;
mod integrator;
mod lights;
mod media;
mod mesh;
mod phase;
mod render;
mod sampler;
pub mod scene;
mod sensor;
mod shim;
pub use shim::*;
mod visibility;
mod world;

pub use acceleration::{Acceleration, BuildReport};
pub use lights::{LightSample, Lights};
pub use media::{Flight, Media};
pub use error::RenderError;
pub use mesh::Triangle;
pub use render::render;
pub use sampler::Sampler;
pub use visibility::{Answer, Counters, FieldProofs, NeighbourhoodProofs, NoProofs, Proofs, ShadowQuery, Visibility};
pub use world::{SurfacePoint, World};

/// Linear RGB with the primaries of sRGB, as radiance, intensity, reflectance or albedo.
pub type Rgb = glam::Vec3;
