//! The renderer of `vdf`: scenes, media, visibility and integrators.
//!
//! The way of the data: [`scene`] (a file, resolved and checked) → [`World`] (hierarchy, media, emitters) → [`Acceleration`] (voxels,
//! distance field, safe neighbourhoods: the proofs) → an integrator, tile by tile → an image and its statistics.

mod acceleration;
mod area_light;
mod atomic_file;
#[cfg(test)]
mod chi_squared;
mod error;
mod frame;
pub mod geometry;
mod image;
mod image_io;
mod integrator;
mod lights;
mod media;
mod mesh;
mod method;
pub mod metrics;
mod options;
mod phase;
pub mod queries;
mod render;
mod sampler;
pub mod scene;
mod sensor;
mod srgb;
mod statistics;
pub mod verify;
mod visibility;
mod voxels;
mod world;

pub use acceleration::{Acceleration, BuildReport, FieldAcceleration, LightShape, ProofsVisitor};
pub use area_light::AreaNeighbourhood;
pub use atomic_file::{PersistError, StagedFile, check_writable, write_atomically};
pub use error::RenderError;
pub use image::Image;
pub use image_io::{
    AttributeValue, ImageError, ImageFormat, encode_png, read_exr, read_image, stage_exr, stage_png, write_exr,
    write_png,
};
pub use lights::{LightSample, Lights};
pub use media::{Flight, Media, Way};
pub use mesh::Triangle;
pub use method::{FieldKind, Method, NeighbourhoodKind, UnknownMethod};
pub use options::{IntegratorKind, Progress, RenderOptions, TransmittanceEstimator, default_voxel_size};
pub use render::{Prepared, Rendering, render, render_prepared};
pub use sampler::Sampler;
pub use statistics::{NeighbourhoodSize, Statistics};
pub use visibility::{
    Answer, Counters, FieldProofs, NeighbourhoodProofs, NoProofs, NoRecorder, Proofs, QueryKind, Recorder, ShadowQuery,
    Visibility,
};
pub use voxels::SceneVoxels;
pub use world::{SurfacePoint, World};

/// Linear RGB with the primaries of sRGB, as radiance, intensity, reflectance or albedo.
pub type Rgb = glam::Vec3;
