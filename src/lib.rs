//! `vdf` in one crate: fog, smoke and haze, rendered with visibility that is proved rather than traced.
//!
//! Each part is a crate of its own and a module here; `docs/ARCHITECTURE.md` shows how they fit together.
//!
//! Voxelize a mesh and prove that a segment is unoccluded:
//!
//! ```
//! use vdf::{
//!     distfield::{Amr, SafeZones},
//!     voxel::{VoxelGrid, voxelize},
//! };
//! use glam::{DVec3, Vec3};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A wall across the unit cube.
//! let wall = [[Vec3::new(0.5, 0.0, 0.0), Vec3::new(0.5, 1.0, 0.0), Vec3::new(0.5, 0.0, 1.0)]];
//! let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::ONE, 1.0 / 64.0, 1 << 20)?;
//! let occupied = voxelize(&grid, rayon::iter::IntoParallelIterator::into_par_iter(wall.to_vec()))?;
//! let field = Amr::build(&occupied);
//! let voxel = |x, y, z| grid.voxel_containing(DVec3::new(x, y, z)).expect("inside the grid");
//! assert!(field.proves(voxel(0.1, 0.1, 0.1), voxel(0.3, 0.4, 0.2)));
//! assert!(!field.proves(voxel(0.1, 0.1, 0.1), voxel(0.9, 0.1, 0.1)));
//! # Ok(())
//! # }
//! ```
//!
//! Load, render and write a scene:
//!
//! ```
//! use vdf::{
//!     image::write_exr,
//!     render::{PrepareOptions, PreparedScene, Quiet, RenderOptions},
//!     scene::{LoadOptions, Scene},
//! };
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let path = folder.path().join("fog.exr");
//! // Or `Scene::load(path, …)` for a file.
//! let source = vdf::scenes::builtin("cbox_vol2").expect("it is built in");
//! let size = ["width", "height"].map(|name| (name.to_owned(), "16".to_owned()));
//! let scene = Scene::from_source(&source, &LoadOptions { defines: size.to_vec(), ..LoadOptions::default() })?;
//! let prepared = PreparedScene::new(scene, &PrepareOptions::default(), &Quiet)?;
//! let rendering = prepared.render(&RenderOptions { spp: Some(1), ..RenderOptions::default() }, &Quiet)?;
//! write_exr(&path, &rendering.image, &[])?;
//! # Ok(())
//! # }
//! ```
//!
//! Compare two images:
//!
//! ```
//! use vdf::image::{
//!     Image, Rgb,
//!     metrics::{DynamicRange, PIXELS_PER_DEGREE, compare},
//! };
//!
//! # fn main() -> Result<(), vdf::image::ImageError> {
//! let mut noisy = Image::new(16, 16);
//! noisy.pixels[100] = Rgb::ONE;
//! let figures = compare(&noisy, &Image::new(16, 16), DynamicRange::High, PIXELS_PER_DEGREE)?;
//! assert_eq!(figures.mse, 1.0 / 256.0);
//! # Ok(())
//! # }
//! ```

pub use vdf_distfield as distfield;
pub use vdf_geometry as geometry;
pub use vdf_image as image;
pub use vdf_lab as lab;
pub use vdf_render as render;
pub use vdf_scene as scene;
pub use vdf_scenes as scenes;
pub use vdf_visibility as visibility;
pub use vdf_voxel as voxel;
