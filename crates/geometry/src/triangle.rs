//! Triangles: the only geometry that the renderer knows.

use glam::{DVec3, Vec3};

use crate::Segment;

/// A triangle in world units. Its single-precision vertices *are* the geometry: every test of the renderer is
/// exact, or bounded, with respect to these numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// The vertices; counter-clockwise order seen from the side that the normal points to.
    pub vertices: [Vec3; 3],
}

impl Triangle {
    /// The triangle `a`, `b`, `c`; its normal is that of the right-hand rule.
    #[must_use]
    pub const fn new(a: Vec3, b: Vec3, c: Vec3) -> Self {
        Self { vertices: [a, b, c] }
    }

    /// The vertices in double precision; the conversion is exact.
    #[inline]
    #[must_use]
    pub fn vertices_f64(&self) -> [DVec3; 3] {
        // Not by `map`, which is a call.
        let [a, b, c] = self.vertices;
        [a.as_dvec3(), b.as_dvec3(), c.as_dvec3()]
    }

    /// The cross product of two edges: twice the area times the normal; zero for a degenerate triangle.
    #[inline]
    #[must_use]
    pub fn area_normal(&self) -> DVec3 {
        let [a, b, c] = self.vertices_f64();
        (b - a).cross(c - a)
    }

    /// For a segment that meets the triangle: whether it comes from the side that the normal points to. Exact, also for grazing segments and
    /// for ones that start or end on the triangle.
    #[must_use]
    #[inline]
    pub fn is_entered_by(&self, segment: &Segment) -> bool {
        let [a, b, c] = self.vertices_f64();
        let (ab, ac, d) = (b - a, c - a, segment.q - segment.p);
        let along = ab.cross(ac).dot(d);
        // A triple product of rounded differences errs by less than 16u of the product of the lengths.
        let error = 32.0 * f64::EPSILON * ab.length() * ac.length() * d.length();
        if along.abs() > error { along < 0.0 } else { self.is_entered_exactly(segment) }
    }

    /// On which side of the triangle's plane `point` lies, exactly: positive below it, where the normal points away from, negative above, zero
    /// on the plane, and zero for a triangle without area. Only the sign means anything.
    #[must_use]
    pub fn side(&self, point: DVec3) -> f64 {
        let coord = |v: DVec3| robust::Coord3D { x: v.x, y: v.y, z: v.z };
        let [a, b, c] = self.vertices_f64().map(coord);
        robust::orient3d(a, b, c, coord(point))
    }

    /// Whether `point` lies on the closed triangle, exactly. Nothing lies on a triangle without area, as no segment meets one.
    #[must_use]
    pub fn holds(&self, point: DVec3) -> bool {
        if self.side(point) != 0.0 {
            return false;
        }
        // In the plane: along an axis along which the triangle has an area, all is seen in two dimensions.
        let [a, b, c] = self.vertices_f64();
        (0..3).any(|axis| {
            let flat = |v: DVec3| robust::Coord { x: v[(axis + 1) % 3], y: v[(axis + 2) % 3] };
            let [a, b, c, p] = [a, b, c, point].map(flat);
            let area = robust::orient2d(a, b, c);
            let within = |side: f64| side == 0.0 || (side > 0.0) == (area > 0.0);
            area != 0.0
                && within(robust::orient2d(a, b, p))
                && within(robust::orient2d(b, c, p))
                && within(robust::orient2d(c, a, p))
        })
    }

    #[cold]
    fn is_entered_exactly(&self, segment: &Segment) -> bool {
        let coord = |v: DVec3| robust::Coord3D { x: v.x, y: v.y, z: v.z };
        let [a, b, c] = self.vertices_f64().map(coord);
        // Positive below the triangle, where the normal points away from.
        let side = |p| robust::orient3d(a, b, c, coord(p));
        let start = side(segment.p);
        if start == 0.0 { side(segment.q) > 0.0 } else { start < 0.0 }
    }

    /// True if every coordinate is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.vertices.iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points on a triangle whose coordinates make them exact, and such an ulp beside it.
    #[test]
    fn what_lies_on_a_triangle_is_exact() {
        let t = Triangle::new(Vec3::new(1.0, 0.0, 0.0), Vec3::new(0.0, 1.0, 0.0), Vec3::new(0.0, 0.0, 1.0));
        for on in [DVec3::X, DVec3::Y, DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.25, 0.25, 0.5)] {
            assert!(t.holds(on), "{on}");
            assert!(!t.holds(on.with_z(on.z + 1e-300_f64.max(on.z * f64::EPSILON))), "{on}");
        }
        assert!(!t.holds(DVec3::new(1.5, -0.5, 0.0)), "in the plane, beside it");
        assert!(!Triangle::new(Vec3::ZERO, Vec3::X, Vec3::X * 2.0).holds(DVec3::X));
        assert!(t.side(DVec3::ZERO) > 0.0 && t.side(DVec3::ONE) < 0.0 && t.side(DVec3::X) == 0.0);
    }

    /// Segments through a triangle from either side, at angles down to grazing, and ones that end or start on it.
    #[test]
    fn the_side_of_a_segment_is_exact() {
        let mut random = fastrand::Rng::with_seed(1);
        let t = Triangle::new(Vec3::new(0.1, 0.2, 0.3), Vec3::new(1.3, 0.1, 0.7), Vec3::new(0.2, 1.9, 0.4));
        let [a, b, c] = t.vertices_f64();
        let normal = t.area_normal().normalize();
        for i in 0..20_000 {
            let on = a + (b - a) * (random.f64() * 0.5) + (c - a) * (random.f64() * 0.5);
            let along = (b - a) * (random.f64() - 0.5) + (c - a) * (random.f64() - 0.5);
            let height = [1.0, 1e-3, 1e-9, 1e-13][i % 4] * (0.1 + random.f64());
            let (above, below) = (on + along + normal * height, on - along - normal * height);
            assert!(t.is_entered_by(&Segment::new(above, below)), "{i}");
            assert!(!t.is_entered_by(&Segment::new(below, above)), "{i}");
        }
        // From a vertex, which is exactly on the plane.
        assert!(t.is_entered_by(&Segment::new(a, a - normal)) && !t.is_entered_by(&Segment::new(a, a + normal)));
        assert!(t.is_entered_by(&Segment::new(a + normal, a)) && !t.is_entered_by(&Segment::new(a - normal, a)));
    }
}
