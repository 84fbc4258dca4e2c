//! What measures and checks the renderer: the soundness run, query logs and their replay, a look at the voxels.
//!
//! ```
//! use vdf_lab::verify::{VerifyOptions, verify};
//! use vdf_render::Quiet;
//! use vdf_scene::{LoadOptions, Scene};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let source = vdf_scenes::builtin("cbox_vol6").expect("it is built in");
//! let scene = Scene::from_source(&source, &LoadOptions::default())?;
//! let options = VerifyOptions { segments: 1100, voxel_sizes: vec![40.0], ..VerifyOptions::default() };
//! let report = verify(scene, &options, &Quiet)?;
//! assert!(report.is_sound());
//! # Ok(())
//! # }
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod error;
mod progress;
pub mod queries;
pub mod report;
pub mod verify;
mod voxels;

pub use error::LabError;
pub use voxels::SceneVoxels;
