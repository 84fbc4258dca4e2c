//! What a proof has to know of a light: where it is.

use glam::DVec3;
use vdf_geometry::Triangle;

/// Where an emitter is, as far as proofs are concerned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightShape<'a> {
    /// A point, in world units.
    Point(DVec3),
    /// Some of the occluders.
    Area(&'a [Triangle]),
    /// Infinitely far away.
    Infinite,
}
