//! Voxel grids over a scene: coordinates, sets of voxels and conservative voxelization.
//!
//! The way of the data: [`VoxelGrid::covering`] lays a grid over the scene, [`voxelize`] finds the voxels that touch
//! an occluder as a [`VoxelSet`], and [`VoxelGrid::voxel_span`] turns the two ends of a visibility query into voxels.
//! Together they keep one promise, on which every proof of visibility rests:
//!
//! > If every voxel of the cuboid spanned by the two voxels of [`Span::Inside`] is missing from the set of [`voxelize`],
//! > then the segment touches no triangle; not in the limit of good arithmetic, but for the very `f32` vertices and
//! > `f64` end points that were passed.
//!
//! [`VoxelSet::validate`] checks a set against its triangles. The error budget behind the promise,
//! [`VoxelGrid::dilation`], is derived in `docs/numerics.md`. Definitions are those of \[Houska2013\], chapter 3.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod clip;
mod error;
mod export;
mod grid;
mod leaving;
mod set;
mod validate;
mod voxelize;

pub use clip::Span;
pub use error::VoxelError;
pub use export::{write_indices, write_obj};
pub use grid::{Resolution, Voxel, VoxelGrid};
pub use set::VoxelSet;
pub use voxelize::{Voxelizer, voxel_bounds, voxelize, voxelize_with};
