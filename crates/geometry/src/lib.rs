//! Triangles, curved shapes, segments, and whether they meet: exactly.
//!
//! [`SegmentTest`] answers for one triangle, [`Bvh`] for all of a scene; [`CurvedShape`] and [`CurvedSet`] for spheres, disks and cylinders. Both answer for the very single-precision
//! vertices and double-precision end points that they were given, so an answer never depends on rounding or on the
//! shape of a tree.
//!
//! ```
//! use glam::{DVec3, Vec3};
//! use vdf_geometry::{Bvh, Segment, Triangle};
//!
//! let bvh = Bvh::new(&[Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y)]);
//! let through = Segment::new(DVec3::new(0.25, 0.25, -1.0), DVec3::new(0.25, 0.25, 1.0));
//! assert!(bvh.occluded(&through));
//! assert_eq!(bvh.intersect(&through).map(|hit| hit.t), Some(0.5));
//! ```

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

mod bounds;
mod curved;
mod hierarchy;
mod intersect;
mod segment;
mod triangle;

#[cfg(test)]
mod tests;

pub use bounds::Bounds;
pub use curved::{CurvedHit, CurvedKind, CurvedSet, CurvedShape};
pub use hierarchy::{Bvh, Hit};
pub use intersect::{SegmentTest, TriangleHit, intersect_exact};
pub use segment::Segment;
pub use triangle::Triangle;
