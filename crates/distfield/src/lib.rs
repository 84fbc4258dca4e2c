//! Distance fields over voxel sets, and the safe zones that prove a segment unoccluded.
//!
//! A field knows voxels only. It is built from the occupied voxels; then [`SafeZones::proves`] says of two voxels that
//! no segment between a point of one and a point of the other can be occluded. Where one of the voxels is asked again and again,
//! a [`SafeNeighbourhood`] answers with one bit. Definitions are those of \[Houska2013\], chapters 3 and 4.

mod amr;
mod metric;
mod ndf;
mod neighbourhood;
mod rows;
mod safe_zones;

pub use amr::Amr;
pub use metric::chessboard_distance;
pub use ndf::Ndf;
pub use neighbourhood::SafeNeighbourhood;
pub use safe_zones::SafeZones;
