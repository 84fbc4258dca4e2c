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
    #[must_use]
    pub fn vertices_f64(&self) -> [DVec3; 3] {
        self.vertices.map(|v| v.as_dvec3())
    }

    /// The cross product of two edges: twice the area times the normal; zero for a degenerate triangle.
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
