//! The space of the tree: world coordinates times a power of two, so that the largest is between ½ and 1.
//!
//! *Idea:* the tree's boxes are single precision. In a space of its own they neither overflow nor underflow whatever
//! the unit of the scene, and one padding has the same weight for all scenes. A point of the world is a [`DVec3`]; what
//! lies in the tree's space has a type of its own, and only a [`TreeSpace`] makes one of the other.
//!
//! *Guarantee:* [`PAD`] covers all rounding of a box test, see there. The scale is a power of two, so that scaling is
//! exact in double precision.
//!
//! *Limits:* rays start in the padded bounds. Segments that start farther away than [`FAR`] are not traced in this
//! space.

use glam::{DVec3, Vec3A};

use crate::{Bounds, Triangle};

/// Padding of boxes in the tree's space, where the largest coordinate m is below 1. With rays that start in the padded
/// bounds, and so are no longer than their diagonal of 2√3, a point on the ray in a box test is off by at most (in
/// units of 2⁻²⁴): origin 1, direction 2·2√3, clamp of small direction components 2·2√3, rounding of the boxes 1, the
/// slab test (b − o)·(1/d): 2 each for the difference, at most 2, the reciprocal and the product. That is below 22;
/// about three times as much is taken.
const PAD: f64 = 64.0 / 16_777_216.0;

/// Segments with both ends farther away than this, in multiples of the largest coordinate, are not traced in single
/// precision. A point computed from the start is off by at most some 16·2⁻⁵³ times the start's distance: up to here by
/// 2⁻²¹ of the largest coordinate, a small part of the half of [`PAD`] that its budget leaves over.
const FAR: f64 = 268_435_456.0;

/// From world coordinates to the tree's.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreeSpace {
    /// Tree coordinates per world unit, a power of two.
    scale: f64,
    /// [`PAD`] in world units.
    pad: f64,
}

/// A point in the tree's space.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreePoint(pub(super) Vec3A);

/// A distance along a ray in the tree's space, measured along the largest component of its direction.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
pub(super) struct TreeDistance(pub(super) f32);

impl TreeDistance {
    /// Behind everything.
    pub(super) const INFINITY: Self = Self(f32::INFINITY);
    /// In front of everything.
    pub(super) const NEG_INFINITY: Self = Self(f32::NEG_INFINITY);

    /// The lesser of both.
    #[inline(always)]
    pub(super) fn nearer(self, other: Self) -> Self {
        if other < self { other } else { self }
    }
}

/// A box in the tree's space. Empty if `min` exceeds `max`.
#[derive(Clone, Copy, Debug)]
pub(super) struct TreeBox {
    pub(super) min: Vec3A,
    pub(super) max: Vec3A,
}

impl TreeSpace {
    /// The space for a scene with these bounds.
    pub(super) fn new(bounds: &Bounds) -> Self {
        let largest = bounds.largest_coordinate();
        // Vertices are single precision, so the exponent is at most 128 and at least −149.
        let scale = if largest > 0.0 { (-largest.log2().floor() - 1.0).exp2() } else { 1.0 };
        Self { scale, pad: PAD / scale }
    }

    /// Tree coordinates per world unit, a power of two.
    #[inline]
    pub(super) const fn scale(self) -> f64 {
        self.scale
    }

    /// By how much the tree's boxes are larger than the triangles, in world units.
    #[inline]
    pub(super) const fn pad(self) -> f64 {
        self.pad
    }

    /// True if rays that start here are not traced. The pad is in proportion to the largest coordinate.
    #[inline]
    pub(super) fn is_far(self, p: DVec3) -> bool {
        p.abs().max_element() * PAD > FAR * self.pad
    }

    /// A point of the world, rounded.
    #[inline]
    pub(super) fn point(self, p: DVec3) -> TreePoint {
        TreePoint((p * self.scale).as_vec3a())
    }

    /// The end of a ray at this distance from its start (in world units, measured along the largest component), rounded
    /// up by more than the rounding of a box test.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding")]
    pub(super) fn end(self, distance: f64) -> TreeDistance {
        TreeDistance(((distance * (1.0 + 1e-6) + self.pad) * self.scale) as f32)
    }

    /// The box of a triangle, with the [`PAD`].
    #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding to single precision")]
    pub(super) fn padded_box(self, triangle: &Triangle) -> TreeBox {
        let [a, b, c] = triangle.vertices_f64().map(|v| self.point(v).0);
        let pad = PAD as f32;
        TreeBox { min: a.min(b).min(c) - pad, max: a.max(b).max(c) + pad }
    }
}
