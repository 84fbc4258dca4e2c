//! Distance fields over voxel sets, and the safe zones that prove a segment unoccluded.
//!
//! A field knows voxels only. It is built from the occupied voxels; then [`SafeZones::proves`] says of two voxels that
//! no segment between a point of one and a point of the other can be occluded. Where one of the voxels is asked again
//! and again, a [`Neighbourhood`] answers with one load: [`SafeNeighbourhood`] with what a field proves,
//! [`ExtendedNeighbourhood`] with all that a free cuboid can prove, [`HopNeighbourhood`] with what several in a row can. Definitions are those of \[Houska2013\], chapters 3
//! and 4.

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod amr;
mod bytes;
mod dsz;
mod dual;
mod error;
mod extended;
mod hop;
mod lines;
mod manhattan;
mod metric;
mod ndf;
mod neighbourhood;
mod rows;
mod safe_zones;
mod validate;
mod voxel_box;

pub use amr::Amr;
pub use bytes::Bytes;
pub use dsz::Dsz;
pub use dual::Dual;
pub use error::FieldError;
pub use extended::ExtendedNeighbourhood;
pub use hop::HopNeighbourhood;
pub use metric::{chessboard_distance, manhattan_distance};
pub use ndf::{Ndf, NdfBuilder};
pub use neighbourhood::{Neighbourhood, SafeNeighbourhood};
pub use safe_zones::SafeZones;
pub use voxel_box::VoxelBox;
