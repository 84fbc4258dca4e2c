//! Triangles: the only geometry that the renderer knows.

use glam::{DVec3, Vec3};

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

    /// True if every coordinate is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.vertices.iter().all(|v| v.is_finite())
    }
}
