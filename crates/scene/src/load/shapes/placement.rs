//! The triangles of a shape at their place in the world.

use glam::{DMat4, DVec3, Vec2};
use vdf_geometry::Triangle;

use crate::MeshAttributes;
use crate::mesh::Attributes;

/// A shape may be displaced by its rounding to single precision by this share of its longest side.
const MOST_LOST: f64 = 1.0 / 256.0;

/// Triangles rounded to single precision, and what that did to them.
#[derive(Debug)]
pub(super) struct Placement {
    to_world: DMat4,
    pub(super) triangles: Vec<Triangle>,
    pub(super) attributes: MeshAttributes,
    /// What textures may ask for.
    pub(super) named: Attributes,
    /// Bounds before the rounding.
    low: DVec3,
    high: DVec3,
    /// The largest change of a coordinate by rounding.
    lost: f64,
}

impl Placement {
    /// Nothing yet.
    pub(super) fn new(to_world: DMat4) -> Self {
        Self {
            to_world,
            triangles: Vec::new(),
            attributes: MeshAttributes::default(),
            named: Attributes::default(),
            low: DVec3::INFINITY,
            high: DVec3::NEG_INFINITY,
            lost: 0.0,
        }
    }

    /// The transform.
    pub(super) const fn to_world(&self) -> DMat4 {
        self.to_world
    }

    /// Adds a rectangle with its texture coordinates, corner by corner around it.
    pub(super) fn push_quad(&mut self, [a, b, c, d]: [DVec3; 4], uv: impl Fn(DVec3) -> Vec2) {
        for corners in [[a, b, c], [a, c, d]] {
            self.push(corners);
            self.attributes.uvs.push(corners.map(&uv));
        }
    }

    /// Turns all triangles round, with what their corners carry.
    pub(super) fn turn(&mut self) {
        self.triangles.iter_mut().for_each(|t| t.vertices.swap(1, 2));
        self.attributes.uvs.iter_mut().for_each(|uvs| uvs.swap(1, 2));
        self.attributes.normals.iter_mut().for_each(|normals| normals.swap(1, 2));
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
