//! A leaf: which of its triangles a segment meets.
//!
//! *Idea:* all but the few triangles that the line comes near are rejected at once in single precision, four side by
//! side. The rest is asked of the exact test.
//!
//! *Guarantee:* no triangle is rejected that the exact test would hit; the bound is derived at [`Leaf::candidates`].
//!
//! *Limits:* the line is given by a point in the padded bounds of the tree; vertices are in world coordinates.

use glam::{DVec3, Vec4};

use super::layout::{Leaf, WIDTH};
use crate::{SegmentTest, TriangleHit};

/// A segment's line as a leaf needs it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// The axis of the direction's largest component is the last.
    axes: [usize; 3],
    /// A point on it in world coordinates, in the order of `axes`.
    origin: [Vec4; 3],
    /// Tree coordinates per world unit.
    scale: Vec4,
    /// By how much the first two coordinates change with the last, times `scale`.
    shear: [Vec4; 2],
}

/// Largest error of a sheared coordinate in a leaf's test, see [`Leaf::candidates`].
const SHEAR_ERROR: f32 = 32.0 / 16_777_216.0;

/// Scales are powers of two up to 2¹⁵⁰; a leaf's test uses none above 2¹²⁶, so that the spacing of the smallest
/// numbers, 2⁻¹⁴⁹, stays a rounding of 1 there. Its coordinates are then only smaller, and its error bound with them
/// too large.
const LARGEST_SCALE: f64 = 8.507_059_173_023_462e37;

impl Line {
    /// The line of a segment through `origin`, a point on it in the padded bounds, for triangles in a tree of this
    /// scale.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "`SHEAR_ERROR` covers the rounding")]
    pub(super) fn new(origin: DVec3, segment: &SegmentTest, scale: f64) -> Self {
        let axes = segment.axes();
        let o = origin.as_vec3().to_array();
        let scale = scale.min(LARGEST_SCALE) as f32;
        let [x, y] = segment.shear();
        Self {
            axes,
            origin: [Vec4::splat(o[axes[0]]), Vec4::splat(o[axes[1]]), Vec4::splat(o[axes[2]])],
            scale: Vec4::splat(scale),
            shear: [Vec4::splat(x as f32 * scale), Vec4::splat(y as f32 * scale)],
        }
    }
}

impl Leaf {
    /// Which of the first `count` triangles the line may meet, a bit for each.
    ///
    /// Rejects a triangle only if of the three edge functions of \[Woop2013\] one is certainly positive and one
    /// certainly negative. In units of u = 2⁻²⁴ and of tree coordinates, in which vertices and the line's start are at
    /// most 1 (but for the pad): the start is off the line by at most 8 (see `FAR` in `space.rs`) and rounded by 1,
    /// which the shear doubles, 18; a difference of vertex and start, at most 2, is rounded by 2, again doubled, 4; the
    /// shear's factor is rounded by 1, times 2, its product by 2; the last difference, at most 4, by 4. So a sheared
    /// coordinate errs by δ = 30u ([`SHEAR_ERROR`] is 32u). With L the largest of them that was computed, at most 4 +
    /// δ, an edge function cx·by − cy·bx errs by at most 4δL + 2δ² and by the rounding of two products and a
    /// difference, 4uL² < 17uL < δL. So 8δ(L + δ) is more than enough: the rest is for its own rounding, and for 8u of
    /// δ more where the scale is so small that the shear's factor loses bits (8·38u < 8·2·32u).
    ///
    /// Where world coordinates overflow nothing is rejected: a vertex with NaN leaves only one edge function that is a
    /// number, and with infinity alone the bound is infinite.
    #[inline(always)]
    pub(super) fn candidates(&self, count: u32, line: &Line) -> u32 {
        let [x, y, z] = [&self.vertices[line.axes[0]], &self.vertices[line.axes[1]], &self.vertices[line.axes[2]]];
        let sheared = |v: usize| {
            let z = Vec4::from_array(z[v]) - line.origin[2];
            let x = (Vec4::from_array(x[v]) - line.origin[0]) * line.scale - z * line.shear[0];
            let y = (Vec4::from_array(y[v]) - line.origin[1]) * line.scale - z * line.shear[1];
            [x, y]
        };
        let (a, b, c) = (sheared(0), sheared(1), sheared(2));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let size = |p: [Vec4; 2]| p[0].abs().max(p[1].abs());
        let largest = size(a).max(size(b)).max(size(c));
        let error = (largest + SHEAR_ERROR) * (8.0 * SHEAR_ERROR);
        let positive = u.cmpgt(error) | v.cmpgt(error) | w.cmpgt(error);
        let negative = u.cmplt(-error) | v.cmplt(-error) | w.cmplt(-error);
        !(positive & negative).bitmask() & ((1 << count) - 1)
    }

    /// The exact answer for one triangle.
    #[inline(always)]
    pub(super) fn intersect(&self, i: usize, test: &SegmentTest) -> Option<TriangleHit> {
        let i = i & (WIDTH - 1);
        let along = |axis: usize| {
            let vertices = &self.vertices[axis];
            [f64::from(vertices[0][i]), f64::from(vertices[1][i]), f64::from(vertices[2][i])]
        };
        let [x, y, z] = test.axes();
        test.intersect_coordinates([along(x), along(y), along(z)], || self.triangle(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Segment, Triangle};

    /// Lines through vertices and edges of small triangles, from near and far within the bounds: whatever the exact
    /// test hits is a candidate, and of those that the line passes at a tenth of their size nearly none is.
    #[test]
    fn candidates_are_all_that_is_hit_and_little_else() {
        let mut noise = fastrand::Rng::with_seed(11);
        let mut uniform = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * noise.f64() - 1.0)));
        let (mut hits, mut beside, mut false_calls) = (0, 0, 0);
        for i in 0..40_000 {
            let size = [0.5, 0.05, 0.005][i % 3];
            let vertices = [(); 3].map(|()| uniform(1.0 - size));
            let (o, a, b) = (vertices[0], uniform(size), uniform(size));
            let t = Triangle { vertices: [o, o + a, o + b].map(|v| v.as_vec3()) };
            let leaf = Leaf::new(&[t], &[0]);
            let [a, b, c] = t.vertices_f64();
            let target = [a, a + (b - a) * 0.375, (a + b + c) / 3.0, a + (a - b) * 0.1 + (a - c) * 0.1][i / 3 % 4];
            let p = if i % 2 == 0 { vertices[1] } else { target + (vertices[1] - target) * size };
            let segment = Segment::new(p, p + (target - p) * 1.5);
            let test = SegmentTest::new(segment, DVec3::NEG_ONE, DVec3::ONE);
            let candidate = leaf.candidates(1, &Line::new(p, &test, 1.0)) == 1;
            if test.intersect(&t).is_some() {
                hits += 1;
                assert!(candidate, "{segment:?} {t:?}");
            } else if i / 3 % 4 == 3 {
                beside += 1;
                false_calls += usize::from(candidate);
            }
        }
        assert!(hits > 15_000 && beside > 9000 && false_calls < beside / 20, "{hits} {beside} {false_calls}");
    }
}
