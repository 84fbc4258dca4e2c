//! Axis-aligned boxes in world coordinates.

use glam::DVec3;

use crate::{Segment, Triangle};

/// A closed box in world units. Empty if `min` exceeds `max` on any axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The least corner.
    pub min: DVec3,
    /// The greatest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box of nothing.
    pub const EMPTY: Self = Self { min: DVec3::INFINITY, max: DVec3::NEG_INFINITY };

    /// The box with these corners.
    #[must_use]
    pub const fn new(min: DVec3, max: DVec3) -> Self {
        Self { min, max }
    }

    /// The smallest box around these points.
    #[must_use]
    pub fn of_points(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::with)
    }

    /// The smallest box around these triangles.
    #[must_use]
    pub fn of_triangles<'a>(triangles: impl IntoIterator<Item = &'a Triangle>) -> Self {
        Self::of_points(triangles.into_iter().flat_map(Triangle::vertices_f64))
    }

    /// The smallest box around this one and `point`.
    #[must_use]
    pub fn with(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// True if it holds no point.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// True if `point` lies in the closed box.
    #[must_use]
    #[inline]
    pub fn contains(&self, point: DVec3) -> bool {
        point.cmpge(self.min).all() && point.cmple(self.max).all()
    }

    /// True if the closed boxes have a point in common.
    #[must_use]
    #[inline]
    pub fn touches(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && self.max.cmpge(other.min).all()
    }

    /// True only if the segment's own bounds and the box are disjoint, which is a comparison of exact numbers. False
    /// says nothing.
    #[must_use]
    #[inline]
    pub fn misses(&self, segment: &Segment) -> bool {
        segment.p.max(segment.q).cmplt(self.min).any() || segment.p.min(segment.q).cmpgt(self.max).any()
    }

    /// Lengths of the sides in world units; not positive on every axis for an empty box.
    #[must_use]
    pub fn extent(&self) -> DVec3 {
        self.max - self.min
    }

    /// The largest absolute coordinate, 0 for an empty box.
    #[must_use]
    pub fn largest_coordinate(&self) -> f64 {
        if self.is_empty() { 0.0 } else { self.min.abs().max(self.max.abs()).max_element() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_nothing_of_a_point_and_of_more() {
        let nothing = Bounds::of_points([]);
        assert!(nothing.is_empty() && nothing.largest_coordinate() == 0.0);
        let p = DVec3::new(1.0, -7.0, 2.0);
        let point = Bounds::of_points([p]);
        assert!(!point.is_empty() && point.contains(p) && point.extent() == DVec3::ZERO);
        assert_eq!(point.largest_coordinate(), 7.0);
        let both = point.with(DVec3::ZERO);
        assert_eq!(both, point.union(Bounds::of_points([DVec3::ZERO])).union(nothing));
        assert!(both.touches(&point) && !both.touches(&nothing));
    }

    #[test]
    fn a_segment_that_touches_a_face_is_not_missed() {
        let unit = Bounds::new(DVec3::ZERO, DVec3::ONE);
        let along = |y: f64| Segment::new(DVec3::new(-1.0, y, 0.5), DVec3::new(2.0, y, 0.5));
        assert!(!unit.misses(&along(1.0)) && unit.misses(&along(1.0_f64.next_up())));
    }
}
