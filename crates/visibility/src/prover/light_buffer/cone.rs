//! A triangle as a light sees it: the cone of directions in which it is met, and the depth at which.
//!
//! With A, B, C the vertices relative to the light, in the order that makes det(A, B, C) positive, a direction d meets the triangle's cone
//! iff d·(A×B), d·(B×C) and d·(C×A) are none of them negative, for triangles whose plane does not hold the light; the point at d is on or
//! behind the triangle iff n·d ≥ 1, where n = (B−A)×(C−A) / det(A, B, C). No clipping is needed: all this holds for any sign of the depth.
//!
//! *Rounding.* Let u = 2⁻⁵³. Differences of vertices and of a vertex and the light have a relative error of u a component. The normal of
//! the edge from A is computed as A×(B−A), which errs by less than 8u|A||B−A| a component. It is scaled to a largest component of 1. So
//! with m that component before, it errs by 8u|A||B−A|/m + 2u, and its product with (u, v, 1) by less than three times that and 8u. For n,
//! let κ = |B−A||C−A|/det. The numerator errs by 8u|B−A||C−A|, the determinant by 16u|B−A||C−A||A|, so that n, at most κ, errs by less than
//! 16uκ(1 + κ|A|)·2. [`Cone::edge_errors`] and [`Cone::plane_error`] are eight times these bounds or more, in units of a component.
//!
//! On which side of the plane a point is, is known better than the plane's depth. Let m be the numerator as computed, t = m·A as computed, n as computed
//! m/t, and d a point; |·|₁ the sum of components. With N the exact numerator, N·(d−A) has the sign of the side. t errs by less than
//! 4u times the sum of |mA| over components, so by 4uκt|A|₁; m·(d−A) differs from N·(d−A) by at most 8uκt(|d|₁ + |A|₁); the quotients, the point's
//! difference with the light, and the product's own rounding add 6uκt|d|₁. So n·d − 1 has the right sign where it exceeds uκ(14|d|₁ + 12|A|₁), less than
//! 42uκ times the sum of both largest components. [`Cone::side_error`] is 64uκ, which leaves room for its own rounding and that of the sum to single
//! precision.

use glam::{DVec2, DVec3, Vec3};
use vdf_geometry::Triangle;

use super::frame::{DEPTH_SLACK, Face, Rect, SLACK};

/// 2⁻⁴⁸: 32 halves of an ulp of 1.
const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

/// An edge's normal that is less certain than this says nothing.
const VAGUE: f64 = 1.0 / (1_u64 << 24) as f64;

/// A triangle seen from a light, in the world's axes or in those of a face.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cone {
    /// The vertices relative to the light, counter-clockwise as seen from it.
    pub(super) vertices: [DVec3; 3],
    /// The same vertices in the world, for comparisons.
    pub(super) corners: [Vec3; 3],
    /// On a face: u and v of the vertices; no numbers for those that are not in front of it, or in the axes of the world.
    flat: [DVec2; 3],
    /// For each edge, from vertex to vertex, the normal of its plane through the light, inwards, with a largest component of 1; zero if
    /// rounding leaves nothing of it.
    pub(super) edges: [DVec3; 3],
    /// The largest error of a product of an edge's normal and (u, v, 1), which is at most 3.
    pub(super) edge_errors: [f64; 3],
    /// For each edge a number that is the same for the same edge of another triangle, in either direction.
    pub(super) keys: [u64; 3],
    /// The normal n of the plane; zero if rounding leaves nothing of it.
    pub(super) plane: DVec3,
    /// The largest error of a component of `plane`, and of one more rounding; infinite if `plane` is zero.
    pub(super) plane_error: f64,
    /// The largest error of n·d − 1 as a judge of a point's side of the plane, over the sum of the largest component of d and that of a vertex; infinite if
    /// `plane` is zero.
    pub(super) side_error: f64,
}

impl Cone {
    /// The triangle as seen from `light`; `None` if its plane holds the light, exactly: then it blocks no segment towards a light that does
    /// not lie on the triangle itself. So it is with a triangle without area.
    pub(super) fn new(triangle: &Triangle, light: DVec3) -> Option<Self> {
        let mut corners = triangle.vertices;
        let [a, b, c] = triangle.vertices_f64();
        let sizes = (b - a).length() * (c - a).length();
        let normal = (b - a).cross(c - a);
        let det = normal.dot(a - light);
        let (nearest, det_error) = ((a - light).length(), ROUNDING * sizes * (a - light).length());
        // Away from the light or towards it: exactly, where rounding could tell otherwise.
        let towards = if det.abs() > det_error { -det } else { -triangle.side(light) };
        if towards == 0.0 {
            return None;
        }
        if towards > 0.0 {
            corners.swap(1, 2);
        }
        let kappa = sizes / det.abs();
        let (plane, plane_error, side_error) = if kappa * nearest < 1.0 / VAGUE {
            (normal / det, 4.0 * ROUNDING * kappa * (1.0 + kappa * nearest), 2.0 * ROUNDING * kappa)
        } else {
            (DVec3::ZERO, f64::INFINITY, f64::INFINITY)
        };
        let world = corners.map(|v| v.as_dvec3());
        let vertices = world.map(|v| v - light);
        let mut edges = [DVec3::ZERO; 3];
        let mut edge_errors = [1.0; 3];
        for i in 0..3 {
            let edge = world[(i + 1) % 3] - world[i];
            let cross = vertices[i].cross(edge);
            let largest = cross.abs().max_element();
            let error = 4.0 * ROUNDING * (1.0 + vertices[i].length() * edge.length() / largest);
            // False for NaN: an edge that points at the light.
            if error < VAGUE {
                (edges[i], edge_errors[i]) = (cross / largest, error);
            }
        }
        let (flat, keys) = ([DVec2::NAN; 3], [0; 3]);
        Some(Self { vertices, corners, flat, edges, edge_errors, keys, plane, plane_error, side_error })
    }

    /// The same in the axes of a face.
    pub(super) fn on(&self, face: Face) -> Self {
        let vertices = self.vertices.map(|v| face.local(v));
        Self {
            vertices,
            flat: vertices.map(|v| if v.z > 0.0 { v.truncate() * v.z.recip() } else { DVec2::NAN }),
            edges: self.edges.map(|e| face.local(e)),
            plane: face.local(self.plane),
            ..*self
        }
    }

    /// The same with its keys, which only sheets need.
    pub(super) fn with_keys(self) -> Self {
        let hash = |v: Vec3| {
            // Adding zero makes −0 to 0.
            (v + 0.0)
                .to_array()
                .iter()
                .fold(0_u64, |h, x| (h.rotate_left(21) ^ u64::from(x.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15))
        };
        let [a, b, c] = self.corners.map(hash);
        Self { keys: [a.wrapping_add(b), b.wrapping_add(c), c.wrapping_add(a)], ..self }
    }

    /// A lower bound of the distance of light and triangle: that of the plane, or of the box.
    pub(super) fn distance(&self) -> f64 {
        let [a, b, c] = self.vertices;
        let (min, max) = (a.min(b).min(c), a.max(b).max(c));
        let to_box = min.max(-max).max(DVec3::ZERO).length();
        let to_plane = 1.0 / (self.plane.length() + 2.0 * self.plane_error);
        to_box.max(to_plane) * (1.0 - DEPTH_SLACK)
    }

    /// The part of this face that may see the triangle: least and greatest u, least and greatest v; `None` if none does. For a cone in the
    /// axes of the face.
    pub(super) fn bounds(&self) -> Option<[f64; 4]> {
        if self.flat.iter().all(|v| v.is_nan()) {
            return None;
        }
        let whole = Rect { u: 0.0, v: 0.0, half_u: 1.0 + SLACK, half_v: 1.0 + SLACK };
        if self.is_in_front() {
            let [a, b, c] = self.flat;
            let (least, most) = (a.min(b).min(c), a.max(b).max(c));
            let bounds = [least.x, most.x, least.y, most.y];
            let outside = bounds[0] > whole.half_u || bounds[1] < -whole.half_u;
            if outside || bounds[2] > whole.half_v || bounds[3] < -whole.half_v {
                return None;
            }
            // A vertex beside the face may be anywhere, also infinitely far.
            return Some([bounds[0].max(-1.0), bounds[1].min(1.0), bounds[2].max(-1.0), bounds[3].min(1.0)]);
        }
        (self.is_on_the_side(&whole) && self.meets(&whole)).then_some([-1.0, 1.0, -1.0, 1.0])
    }

    /// Whether all vertices are in front of the face.
    #[inline]
    fn is_in_front(&self) -> bool {
        !self.flat.iter().any(|v| v.is_nan())
    }

    /// False only if a side of the rectangle separates it from the triangle, wherever the vertices are.
    fn is_on_the_side(&self, rect: &Rect) -> bool {
        let beyond = |outside: [f64; 3], size: [f64; 3]| {
            outside[0] > size[0] * DEPTH_SLACK
                && outside[1] > size[1] * DEPTH_SLACK
                && outside[2] > size[2] * DEPTH_SLACK
        };
        let v = &self.vertices;
        let size = v.map(|v| v.abs().max_element());
        let (u0, u1) = (rect.u - rect.half_u, rect.u + rect.half_u);
        let (v0, v1) = (rect.v - rect.half_v, rect.v + rect.half_v);
        !(beyond(v.map(|v| v.x - u1 * v.z), size)
            || beyond(v.map(|v| u0 * v.z - v.x), size)
            || beyond(v.map(|v| v.y - v1 * v.z), size)
            || beyond(v.map(|v| v0 * v.z - v.y), size))
    }

    /// False only if an edge separates triangle and rectangle, or a side of the rectangle does so with vertices on both sides of the light.
    #[inline]
    pub(super) fn may_meet(&self, rect: &Rect) -> bool {
        self.meets(rect) && (self.is_in_front() || self.is_on_the_side(rect))
    }

    /// False only if an edge separates triangle and rectangle.
    #[inline]
    fn meets(&self, rect: &Rect) -> bool {
        (0..3).all(|i| {
            let (at, reach) = self.edge(i, rect);
            at + reach >= -self.edge_errors[i]
        })
    }

    /// True only if every direction of the rectangle meets the triangle's cone.
    #[inline]
    pub(super) fn covers(&self, rect: &Rect) -> bool {
        (0..3).all(|i| {
            let (at, reach) = self.edge(i, rect);
            at - reach > self.edge_errors[i]
        })
    }

    /// The product of an edge's normal with the rectangle's middle, and by how much it changes towards its corners.
    #[inline]
    fn edge(&self, i: usize, rect: &Rect) -> (f64, f64) {
        let e = &self.edges[i];
        (e.x * rect.u + e.y * rect.v + e.z, e.x.abs() * rect.half_u + e.y.abs() * rect.half_v)
    }

    /// False only if edge `i` passes the rectangle by.
    pub(super) fn edge_meets(&self, i: usize, rect: &Rect) -> bool {
        let (at, reach) = self.edge(i, rect);
        if at.abs() > reach + self.edge_errors[i] {
            return false;
        }
        let (a, b) = (self.flat[i], self.flat[(i + 1) % 3]);
        // All comparisons are false for what is not in front.
        let beyond = |low: f64, high: f64| (a.x > high && b.x > high) || (a.x < low && b.x < low);
        let above = |low: f64, high: f64| (a.y > high && b.y > high) || (a.y < low && b.y < low);
        !(beyond(rect.u - rect.half_u, rect.u + rect.half_u) || above(rect.v - rect.half_v, rect.v + rect.half_v))
    }

    /// False only if the direction (u, v, 1) is outside the cone.
    #[inline]
    pub(super) fn may_hold(&self, u: f64, v: f64) -> bool {
        self.meets(&Rect { u, v, half_u: 0.0, half_v: 0.0 })
    }

    /// True only if the direction (u, v, 1) is inside the cone.
    #[inline]
    pub(super) fn holds(&self, u: f64, v: f64) -> bool {
        self.covers(&Rect { u, v, half_u: 0.0, half_v: 0.0 })
    }

    /// Bounds of the depths at which directions of the rectangle meet the triangle; `None` if none does.
    #[inline]
    pub(super) fn depths(&self, rect: &Rect) -> Option<[f64; 2]> {
        let [a, b, c] = [self.vertices[0].z, self.vertices[1].z, self.vertices[2].z];
        let (nearest, farthest) = (a.min(b).min(c).max(0.0), a.max(b).max(c));
        let n = &self.plane;
        // The reciprocal of the depth, which is linear on the face.
        let at = n.x * rect.u + n.y * rect.v + n.z;
        let reach = n.x.abs() * rect.half_u + n.y.abs() * rect.half_v + 4.0 * self.plane_error;
        let (least, most) = (at - reach, at + reach);
        if most <= 0.0 {
            return None;
        }
        let far = if least > 0.0 { farthest.min(least.recip()) } else { farthest };
        Some([nearest.max(most.recip()) * (1.0 - DEPTH_SLACK), far * (1.0 + DEPTH_SLACK)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of random and degenerate triangles, seen from near and far, and directions near their edges and vertices: what the bounds exclude is
    /// not met by the exact test, and what they include is.
    #[test]
    fn bounds_agree_with_the_exact_test() {
        let mut random = fastrand::Rng::with_seed(9);
        let (mut met, mut covered, mut missed) = (0, 0, 0);
        for i in 0..60_000_usize {
            let size = 10.0_f64.powi(-((i % 5) as i32));
            let mut point = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * random.f64() - 1.0)));
            let (o, light) = (point(1.0), point(if i % 7 == 0 { 100.0 } else { 1.0 }));
            let (a, mut b) = (o + point(size), o + point(size));
            if i % 11 == 0 {
                // A sliver.
                b = o + (a - o) * 1.5 + point(size * 1e-6);
            }
            let triangle = Triangle { vertices: [o, a, b].map(|p| p.as_vec3()) };
            let Some(cone) = Cone::new(&triangle, light) else { continue };
            let [va, vb, vc] = triangle.vertices_f64();
            let (s, t) = match i % 4 {
                0 => (random.f64(), 0.0),
                1 => (0.5, 0.5),
                2 => (random.f64() * 0.5, random.f64() * 0.5),
                _ => (random.f64() * 2.0 - 1.0, random.f64() * 2.0 - 1.0),
            };
            let on = va + (vb - va) * s + (vc - va) * t;
            let far = light + (on - light) * 8.0;
            let hit = vdf_geometry::intersect_exact(&vdf_geometry::Segment::new(light, far), &triangle);
            let d = far - light;
            let face = Face::of(d);
            let local = face.local(d);
            let (u, v) = (local.x / local.z, local.y / local.z);
            let half = [SLACK, 1e-9, 1e-3, 0.2][i / 5 % 4];
            let rect = Rect {
                u: u + half * (random.f64() * 1.8 - 0.9),
                v: v + half * (random.f64() * 1.8 - 0.9),
                half_u: half + SLACK,
                half_v: half + SLACK,
            };
            let cone = cone.on(face);
            let depths = cone.depths(&rect);
            if hit.is_some() {
                met += 1;
                assert!(cone.may_meet(&rect), "{triangle:?} {light} {rect:?}");
                let bounds = cone.bounds().expect("it is seen");
                assert!(bounds[0] - SLACK <= u && u <= bounds[1] + SLACK, "{bounds:?} {u}");
                assert!(bounds[2] - SLACK <= v && v <= bounds[3] + SLACK, "{bounds:?} {v}");
                let [near, far] = depths.expect("it is met");
                let depth = local.z / 8.0;
                // The point on the triangle is rounded; that is nothing to do with the bounds.
                if i % 11 != 0 {
                    let rounding = 1e-9 * (1.0 + light.length());
                    assert!(near <= depth + rounding && depth <= far + rounding, "{near} {depth} {far}");
                }
                assert!(cone.distance() <= depth * 3.0_f64.sqrt() * (1.0 + 1e-9) + 1e-12);
            } else {
                missed += 1;
                assert!(!cone.covers(&rect), "{triangle:?} {light} {rect:?}");
                assert!(!cone.holds(u, v));
            }
            covered += usize::from(cone.covers(&rect));
        }
        assert!(met > 20_000 && missed > 5_000 && covered > 5_000, "{met} {missed} {covered}");
    }

    #[test]
    fn a_triangle_in_a_plane_with_the_light_has_no_cone() {
        let triangle = Triangle::new(Vec3::X, Vec3::Y, Vec3::new(0.5, 0.5, 1.0));
        let edge_on = DVec3::new(2.0, -1.0, 3.0);
        assert!(Cone::new(&triangle, edge_on).is_none());
        assert!(Cone::new(&triangle, edge_on.with_x(2.0_f64.next_up())).is_some());
        assert!(Cone::new(&Triangle::new(Vec3::X, Vec3::X, Vec3::Y), edge_on).is_none());
    }
}
