//! Exact segment–triangle intersection and the bounding volume hierarchy over it.

mod bvh;
mod intersect;
mod wide;

#[cfg(test)]
mod tests;

pub use bvh::{Bvh, Hit};
pub use intersect::{Segment, SegmentTest, TriangleHit, intersect_exact};
