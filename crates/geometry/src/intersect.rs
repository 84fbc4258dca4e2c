//! The reference intersector: does a closed segment meet a triangle?
//!
//! Idea: the watertight test of \[Woop2013\] (translate the segment's start to the origin, shear its direction onto
//! an axis, look at three 2D edge functions), in double precision, with a filter: every sign that rounding could
//! have changed is decided again by exact predicates \[Shewchuk1997\].
//!
//! Guarantee: whether a segment meets a triangle is answered *exactly* for the single-precision vertices of the
//! triangle and the double-precision end points of the segment. So the reach of the intersector's errors, which the
//! voxelization has to cover, is zero; the test is watertight; and it gives the same answer for a reversed segment.
//! Only the position of a hit is rounded, and it stays in the box of the triangle, up to a millionth of the scene.
//!
//! *Deviation:* \[Woop2013\] computes in single precision and repeats an edge function in double precision if it is
//! zero. That leaves an error of some ulps of the largest sheared coordinate in the decision, and an unbounded one
//! in `t` for triangles seen edge-on, which no dilation could cover.
//!
//! Limits: a segment in the plane of a triangle does not meet it, nor does any segment meet a triangle without area.
//! Coordinates must be such that their cubes neither overflow nor underflow in double precision (1e-90 … 1e90).

use glam::DVec3;

use crate::{Bounds, Segment, Triangle};

/// Where a segment meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Parameter along the segment, in [0, 1]; rounded, but its place is within the box of the triangle
    /// ([`SegmentTest::intersect`]).
    pub t: f64,
    /// Barycentric weights of the vertices; each in [0, 1], their sum is 1 up to rounding.
    pub barycentric: [f64; 3],
}

/// A segment prepared for tests against many triangles.
#[derive(Clone, Copy, Debug)]
pub struct SegmentTest {
    segment: Segment,
    /// The segment's direction in units of its largest component; zero for a segment of length zero.
    direction: DVec3,
    /// That component's size, in world units.
    length: f64,
    /// The axis of the largest component is the last. Those before it are in cyclic order, which keeps the orientation,
    /// or exchanged if the segment points backwards along the last, which would mirror.
    axes: [usize; 3],
    /// By how much the first two coordinates change with the last.
    shear: [f64; 2],
    /// The reciprocal of the largest component, with its sign.
    scale: f64,
    /// Largest error of an edge function, for triangles in the bounds given.
    edge_error: f64,
    /// Largest error of `T` and of `T − det`, see [`SegmentTest::intersect`].
    t_error: f64,
    /// How far outside the box of a triangle the place of a hit may be, in world units.
    slack: f64,
}

/// [`SegmentTest`]'s axes by the last, for a segment that points forwards along it and for one that points backwards.
const AXES: [[usize; 3]; 6] = [[1, 2, 0], [2, 0, 1], [0, 1, 2], [2, 1, 0], [0, 2, 1], [1, 0, 2]];

/// Half an ulp of 1 in double precision.
const U: f64 = f64::EPSILON / 2.0;

impl SegmentTest {
    /// Prepares `segment` for triangles within the box from `min` to `max`.
    ///
    /// With `u` = 2⁻⁵³ and `m` the largest coordinate difference of a vertex and `segment.p`, a sheared coordinate is
    /// at most 2m and is computed with an error of at most 8um: one subtraction, a shear factor of 3 roundings, a
    /// product, a subtraction. An edge function is the difference of two products of these. So its error is at most
    /// 2·(2·8um·2m + u·4m²) + u·8m² = 80um². `T` sums three products of an edge function (at most 8m²) and a depth
    /// (at most m/|d_z|, 3 roundings). Its error is at most 3·(80 + 4·8)um³/|d_z| + 3·u·24m³/|d_z| = 408um³/|d_z|. That
    /// of det, three edge functions, is at most 240um² + 2u·24m². The constants below are rounded up to powers of two.
    #[inline]
    #[must_use]
    pub fn new(segment: Segment, min: DVec3, max: DVec3) -> Self {
        let bounds = Bounds::new(min, max);
        Self::within(segment, &bounds, slack(&bounds))
    }

    /// The same; the slack is the bounds' [`slack`], which need not be computed for every segment.
    #[inline(always)]
    pub(crate) fn within(segment: Segment, bounds: &Bounds, slack: f64) -> Self {
        let Bounds { min, max } = *bounds;
        let d = segment.q - segment.p;
        let a = d.abs();
        // Without branches, which would be guessed wrongly as often as not.
        let (first, larger) = if a.x > a.y { (0, a.x) } else { (1, a.y) };
        let z = if larger > a.z { first } else { 2 };
        let vector = d;
        let d = d.to_array();
        let axes = AXES[z + 3 * usize::from(d[z] < 0.0)];
        let [x, y, _] = axes;
        // A segment of length zero meets nothing; scale 0 makes T and det finite, and the exact test decides.
        let scale_z = if d[z] == 0.0 { 0.0 } else { 1.0 / d[z] };
        // So short a segment that its reciprocal overflows: infinite error bounds leave all to the exact test.
        let usable = scale_z.is_finite();
        let length = d[z].abs();
        let direction = if usable { vector * scale_z.abs() } else { vector / length };
        let m = (max - segment.p).abs().max((min - segment.p).abs()).max_element();
        let m2 = m * m;
        Self {
            segment,
            direction,
            length,
            axes,
            shear: [d[x] * scale_z, d[y] * scale_z],
            scale: scale_z,
            edge_error: if usable { 128.0 * U * m2 } else { f64::INFINITY },
            t_error: 1024.0 * U * m2 * (m * scale_z.abs()).max(1.0),
            slack,
        }
    }

    /// The segment that is tested.
    #[inline]
    #[must_use]
    pub const fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The segment's direction in units of its largest component; zero for a segment of length zero.
    #[inline]
    #[must_use]
    pub const fn direction(&self) -> DVec3 {
        self.direction
    }

    /// The size of the largest component of the segment's vector, in world units.
    #[inline]
    #[must_use]
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// The axes in the order of the shear: that of the segment's largest component is the last.
    #[inline]
    pub(crate) const fn axes(&self) -> [usize; 3] {
        self.axes
    }

    /// By how much coordinates along the first two axes change with the last.
    #[inline]
    pub(crate) const fn shear(&self) -> [f64; 2] {
        self.shear
    }

    /// The reciprocal of the largest component, with its sign; 0 for a segment of length zero.
    #[inline]
    pub(crate) const fn scale(&self) -> f64 {
        self.scale
    }

    /// The largest error of an edge function, for triangles in the bounds given.
    #[inline]
    pub(crate) const fn edge_error(&self) -> f64 {
        self.edge_error
    }

    /// The largest error of `T` and of `T − det`.
    #[inline]
    pub(crate) const fn t_error(&self) -> f64 {
        self.t_error
    }

    /// Exactly: do segment and triangle meet? If so, where (rounded)?
    ///
    /// For triangles in the bounds given the place is rounded by at most 2⁻²⁰ of their largest coordinate, or it is in
    /// the triangle's own box, enlarged by as much. (Both are measured along the largest component of the segment. A
    /// start that is 2²⁸ times as far away adds its own rounding.) For `T/det` errs by at most `t_error`/det: `T` −
    /// t·det, which is 0 for the true t, is a mean of `T` and `T − det`. If that is too much, t is clamped to the box,
    /// where the true place is.
    #[inline(always)]
    #[must_use]
    pub fn intersect(&self, triangle: &Triangle) -> Option<TriangleHit> {
        let [a, b, c] = triangle.vertices_f64().map(|v| v.to_array());
        self.intersect_coordinates(self.axes.map(|axis| [a[axis], b[axis], c[axis]]), || *triangle)
    }

    /// The same from the vertices' coordinates along each of [`SegmentTest::axes`]; the triangle is asked for where the
    /// call is close.
    #[inline(always)]
    pub(crate) fn intersect_coordinates(
        &self,
        coordinates: [[f64; 3]; 3],
        triangle: impl FnOnce() -> Triangle,
    ) -> Option<TriangleHit> {
        let [x, y, z] = coordinates;
        let p = self.segment.p.to_array();
        let p = [p[self.axes[0]], p[self.axes[1]], p[self.axes[2]]];
        // The vertex relative to the start, sheared so that the segment runs along z from 0 to 1.
        let sheared = |v: usize| {
            let z = z[v] - p[2];
            [x[v] - p[0] - self.shear[0] * z, y[v] - p[1] - self.shear[1] * z, z * self.scale]
        };
        let (a, b, c) = (sheared(0), sheared(1), sheared(2));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let e = self.edge_error;
        // Comparisons without branches between them; all are false for NaN, which leaves it to the exact test.
        let positive = [u > e, v > e, w > e];
        let negative = [u < -e, v < -e, w < -e];
        let any = |signs: [bool; 3]| signs[0] | signs[1] | signs[2];
        let all = |signs: [bool; 3]| signs[0] & signs[1] & signs[2];
        if any(positive) & any(negative) {
            return None;
        }
        if all(positive) | all(negative) {
            let det = u + v + w;
            let sign = det.signum();
            let t_det = (u * a[2] + v * b[2] + w * c[2]) * sign;
            let det = det * sign;
            let e = self.t_error;
            if t_det < -e || t_det - det > e {
                return None;
            }
            if t_det > e && t_det - det < -e {
                return Some(self.certain_hit([u, v, w], t_det * sign, triangle));
            }
        }
        let triangle = triangle();
        intersect_exact(&self.segment, &triangle).map(|hit| self.put_into_box(hit, &triangle))
    }

    /// Where a triangle is hit that is hit for certain, from its edge functions and `T`.
    #[inline(always)]
    pub(crate) fn certain_hit(&self, edges: [f64; 3], t_det: f64, triangle: impl FnOnce() -> Triangle) -> TriangleHit {
        let [u, v, w] = edges;
        let det = u + v + w;
        let sign = det.signum();
        let (t_det, det) = (t_det * sign, det * sign);
        let inv_det = 1.0 / det;
        let scale = inv_det * sign;
        let hit = TriangleHit { t: t_det * inv_det, barycentric: [u * scale, v * scale, w * scale] };
        if self.t_error * self.length > self.slack * det { self.put_into_box(hit, &triangle()) } else { hit }
    }

    /// The hit with its place put into the box of the triangle, enlarged by the slack.
    #[cold]
    fn put_into_box(&self, hit: TriangleHit, triangle: &Triangle) -> TriangleHit {
        let [a, b, c] = triangle.vertices_f64();
        let (min, max) = (a.min(b).min(c) - self.slack, a.max(b).max(c) + self.slack);
        let (p, d) = (self.segment.p, self.direction);
        // Distances along the largest component.
        let (mut near, mut far) = (0.0_f64, self.length);
        for axis in 0..3 {
            if d[axis] != 0.0 {
                let (lower, upper) = ((min[axis] - p[axis]) / d[axis], (max[axis] - p[axis]) / d[axis]);
                near = near.max(lower.min(upper));
                far = far.min(lower.max(upper));
            }
        }
        let place = hit.t * self.length;
        if near <= place && place <= far {
            return hit;
        }
        // The hierarchy relies on the nearer end, so that is the one that rounding must not undo.
        TriangleHit { t: (place.min(far).max(near) / self.length).clamp(0.0, 1.0), ..hit }
    }
}

/// How far outside the box of a triangle the place of a hit may be, in world units: 2⁻²⁰ of the largest coordinate. The
/// hierarchy's padding covers it.
#[must_use]
pub(crate) fn slack(bounds: &Bounds) -> f64 {
    bounds.largest_coordinate() / 1_048_576.0
}

/// The same answer as [`SegmentTest::intersect`], by exact predicates only; the slow twin that decides close calls. It
/// knows no bounds of a scene, so the place of a grazing hit is not put into the triangle's box.
#[cold]
#[must_use]
pub fn intersect_exact(segment: &Segment, triangle: &Triangle) -> Option<TriangleHit> {
    let coord = |v: DVec3| robust::Coord3D { x: v.x, y: v.y, z: v.z };
    let [a, b, c] = triangle.vertices_f64().map(coord);
    let (p, q) = (coord(segment.p), coord(segment.q));
    // First the sides: most close calls are about a start on the triangle's own surface, and miss.
    let side_p = robust::orient3d(a, b, c, p);
    let side_q = robust::orient3d(a, b, c, q);
    if (side_p > 0.0 && side_q > 0.0) || (side_p < 0.0 && side_q < 0.0) || (side_p == 0.0 && side_q == 0.0) {
        return None;
    }
    // Twice the weights of c, a and b times the segment's length, up to one common sign.
    let weight_c = robust::orient3d(p, q, a, b);
    let weight_a = robust::orient3d(p, q, b, c);
    let weight_b = robust::orient3d(p, q, c, a);
    let lowest = weight_a.min(weight_b).min(weight_c);
    let highest = weight_a.max(weight_b).max(weight_c);
    // All zero: the line lies in the triangle's plane, or the triangle or the segment is degenerate.
    if (lowest < 0.0 && highest > 0.0) || (lowest == 0.0 && highest == 0.0) {
        return None;
    }
    let sum = weight_a + weight_b + weight_c;
    let t = if side_p == 0.0 {
        0.0
    } else if side_q == 0.0 {
        1.0
    } else {
        plane_parameter(segment, triangle).unwrap_or(side_p / (side_p - side_q))
    };
    Some(TriangleHit { t, barycentric: [weight_a / sum, weight_b / sum, weight_c / sum] })
}

/// Where the segment crosses the triangle's plane. The predicates are certain of their sign, but their size may be
/// nothing but rounding where an end is far away; here the segment's vector takes the place of the far end. `None` if
/// the plane of so thin a triangle is not known to a thousandth, at this angle.
fn plane_parameter(segment: &Segment, triangle: &Triangle) -> Option<f64> {
    let [a, b, c] = triangle.vertices_f64();
    let d = segment.q - segment.p;
    let normal = (b - a).cross(c - a);
    let slope = normal.dot(d);
    let rounding = 8.0 * U * (b - a).length() * (c - a).length() * d.length();
    (slope.abs() > 1024.0 * rounding).then(|| (normal.dot(a - segment.p) / slope).clamp(0.0, 1.0))
}
