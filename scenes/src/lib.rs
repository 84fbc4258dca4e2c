//! The scenes that come with the renderer: Cornell boxes in fog, kept as files in this folder, and large ones that are generated.
//!
//! ```
//! use vdf_scene::{LoadOptions, Scene};
//!
//! let source = vdf_scenes::builtin(vdf_scenes::DEFAULT_SCENE).expect("it is built in");
//! let scene = Scene::from_source(&source, &LoadOptions::default())?;
//! assert_eq!(scene.media.len(), 1);
//! # Ok::<(), vdf_scene::SceneError>(())
//! ```

mod builtin;
mod error;
mod generate;

pub use builtin::{DEFAULT_SCENE, builtin, builtin_names};
pub use error::ScenesError;
pub use generate::{GeneratedFile, GeneratedScene, Size, generated};
