//! Closed segments between two points of the world.
//!
//! *Idea:* a visibility query is about a segment, not about a ray: both ends belong to it, and nothing beyond them
//! counts. *Limits:* only finite ends can meet anything. Lengths and places along it are rounded; its ends are exact.

use glam::DVec3;

/// A closed segment from `p` to `q`, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Start, at t = 0.
    pub p: DVec3,
    /// End, at t = 1.
    pub q: DVec3,
}

impl Segment {
    /// The segment from `p` to `q`.
    #[must_use]
    pub const fn new(p: DVec3, q: DVec3) -> Self {
        Self { p, q }
    }

    /// The point at parameter `t` in [0, 1].
    #[inline]
    #[must_use]
    pub fn at(&self, t: f64) -> DVec3 {
        self.p + (self.q - self.p) * t
    }

    /// Its length in world units.
    #[inline]
    #[must_use]
    pub fn length(&self) -> f64 {
        (self.q - self.p).length()
    }
}
