//! The triangles of a shape at their place in the world.

use glam::{DMat4, DVec3};
use vdf_geometry::Triangle;

/// A shape may be displaced by its rounding to single precision by this share of its longest side.
const MOST_LOST: f64 = 1.0 / 256.0;

/// Triangles rounded to single precision, and what that did to them.
#[derive(Debug)]
pub(super) struct Placement {
    to_world: DMat4,
    pub(super) triangles: Vec<Triangle>,
    /// Bounds before the rounding.
    low: DVec3,
    high: DVec3,
    /// The largest change of a coordinate by rounding.
    lost: f64,
}

impl Placement {
    /// Nothing yet.
    pub(super) const fn new(to_world: DMat4) -> Self {
        Self { to_world, triangles: Vec::new(), low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, lost: 0.0 }
    }

    /// Adds a triangle, given before the transform.
    pub(super) fn push(&mut self, corners: [DVec3; 3]) {
        let vertices = corners.map(|p| {
            let p = self.to_world.transform_point3(p);
            (self.low, self.high) = (self.low.min(p), self.high.max(p));
            let rounded = p.as_vec3();
            self.lost = self.lost.max((rounded.as_dvec3() - p).abs().max_element());
            rounded
        });
        self.triangles.push(Triangle { vertices });
    }

    /// What is wrong if the shape is not the one that was meant any more: far from the origin the steps of single precision are coarse.
    pub(super) fn lost_shape(&self) -> Option<String> {
        let longest = (self.high - self.low).max_element();
        // A point has no shape to lose.
        (longest > 0.0 && self.lost > longest * MOST_LOST).then(|| {
            format!(
                "precision exhausted: single precision moves its vertices by up to {:.1e}, and its longest side is {longest:.1e}",
                self.lost
            )
        })
    }
}
