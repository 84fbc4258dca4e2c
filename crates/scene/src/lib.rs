//! Scenes: what a file describes, resolved, checked and ready to render.
//!
//! A scene file is a strict subset of Mitsuba 3 XML, with meshes as OBJ, PLY or `serialized` and pictures in the usual formats. [`Scene::load`] reads one; everything that is not in the subset is a
//! [`SceneError`] with file, line and column. This crate knows nothing of voxels, of methods of acceleration or of a command line.
//!
//! ```
//! use vdf_scene::{EmbeddedFile, LoadOptions, Scene, SceneSource};
//!
//! # fn main() -> Result<(), vdf_scene::SceneError> {
//! let text = r#"<scene version="3.0.0">
//!     <integrator type="volpath"/>
//!     <sensor type="perspective"><film type="hdrfilm"/></sensor>
//!     <shape type="cube"><bsdf type="diffuse"/></shape>
//!     <emitter type="constant"/>
//! </scene>"#;
//! let file = EmbeddedFile { path: "cube.xml".into(), bytes: text.as_bytes().into() };
//! let scene = Scene::from_source(&SceneSource::embedded(file, vec![]), &LoadOptions::default())?;
//! assert_eq!(scene.surfaces[0].triangles.len(), 12);
//! # Ok(())
//! # }
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod bsdf;
mod checksum;
mod error;
mod load;
mod mesh;
mod model;
mod obj;
mod pfm;
mod ply;
mod serialized;
mod source;
mod text;
mod texture;
mod vol;
mod volume;

pub use bsdf::{Bsdf, Microfacets, Perturbation, Principled, PrincipledThin, Roughness};
pub use error::SceneError;
pub use load::LoadOptions;
pub use model::{
    Albedo, Boundary, ComponentFormat, Emitter, Extinction, FilmSettings, IntegratorSettings, Lens, Medium, MediumId,
    MeshAttributes, Phase, PixelRect, Projection, ReconstructionFilter, Scene, Sensor, Slide, Surface,
};
pub use source::{EmbeddedFile, SceneSource};
pub use texture::{Attribute, Pixels, Texture, TextureFilter, TexturePoint, UvTransform, Wrap, luminance};
pub use volume::{GridVolume, VolumeFilter, VoxelGrid};

/// Linear RGB with the primaries of sRGB, as radiance, intensity, reflectance or albedo.
pub type Rgb = glam::Vec3;
