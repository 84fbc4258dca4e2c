//! Light transport in participating media: media, lights, integrators, and the render that brings them together.
//!
//! The way of the data: a [`vdf_scene::Scene`] becomes a [`PreparedScene`] (hierarchy, media, emitters, and the provers of a method), which
//! an [`Integrator`] renders tile by tile to an image and its [`Statistics`].
//!
//! ```
//! use vdf_render::{PrepareOptions, PreparedScene, Quiet, RenderOptions};
//! use vdf_scene::{EmbeddedFile, LoadOptions, Scene, SceneSource};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let text = r#"<scene version="3.0.0">
//!     <integrator type="volpath"/>
//!     <sensor type="perspective">
//!         <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film>
//!     </sensor>
//!     <emitter type="constant"/>
//! </scene>"#;
//! let file = EmbeddedFile { path: "sky.xml".into(), bytes: text.as_bytes().into() };
//! let scene = Scene::from_source(&SceneSource::embedded(file, vec![]), &LoadOptions::default())?;
//! let prepared = PreparedScene::new(scene, &PrepareOptions::default(), &Quiet)?;
//! let rendering = prepared.render(&RenderOptions::default(), &Quiet)?;
//! assert!(rendering.image.pixels.iter().all(|&p| p == vdf_scene::Rgb::ONE));
//! # Ok(())
//! # }
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod bsdf;
mod camera;
#[cfg(test)]
mod chi_squared;
mod error;
mod film;
mod filter;
mod frame;
mod integrator;
mod job;
mod light_paths;
mod lights;
mod media;
mod options;
mod others;
mod phase;
mod pilot;
mod prepared;
mod render;
mod sampler;
mod statistics;
mod threads;
mod world;

pub use camera::{Camera, CameraRay};
pub use error::RenderError;
pub use film::{
    Film, FilmError, FilmFileError, FilmOrigin, FilmRun, Layer, Layers, MissingSamples, NoNoiseLimit, NoiseLimit,
    Picture, UnknownLayer,
};
pub use filter::{FilterSample, PixelFilter};
pub use integrator::{Integrator, NoSegmentSamples, SegmentSamples, UnknownIntegrator};
pub use job::{Job, PathTracer};
pub use lights::{LightSample, Lights};
pub use media::{FreeFlight, Homogeneous, Media, MediumInterval, MediumIntervals, RegionSet, ShortFlight};
pub use options::{
    Estimator, GridExtent, LightPaths, PrepareOptions, RenderOptions, Roulette, TransmittanceEstimator,
    check_voxel_size,
};
pub use phase::PhaseFunction;
pub use pilot::{Choice, Declined, Measured, QueryCost, ThreadTime, Work};
pub use prepared::{PreparedScene, default_voxel_size};
pub use render::{FilmPart, LiveFilm, Rendering};
pub use sampler::{Sampler, SamplerKind};
pub use statistics::{NeighbourhoodSize, NoiseFigures, PartSize, Statistics};
pub use threads::{check_threads, on_threads, thread_count};
pub use vdf_visibility::{Progress, Quiet};
pub use world::{SurfacePoint, World, light_shapes};
