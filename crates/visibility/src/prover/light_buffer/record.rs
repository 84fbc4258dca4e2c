//! What decides whether one triangle blocks the way to the light: 64 bytes, a cache line.
//!
//! Nearly always in a few operations, and exactly; else the answer is [`Verdict::Close`].

use glam::{DVec3, Vec3, Vec4};

use super::{cone::Cone, place::Direction};

/// Whether a triangle meets the segment from a point to the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Passes,
    Blocks,
    /// Too close to an edge or to the plane for the rounding here.
    Close,
}

/// A triangle as a light sees it: the planes of its edges in single precision, its own in double.
///
/// *Rounding.* With ε = 2⁻²⁴ and a point relative to the light divided by its largest component, in single precision: components of an edge's normal, at
/// most 1, are rounded by ε and known as well as ε before; those of the point have errors of 3ε, by its difference, the reciprocal and the product. (The
/// error of the largest component scales all of them, which changes no sign.) With the product's own rounding that is 6ε for each of three, and their
/// sum errs by 5ε more: by less than [`EDGE_ERROR`] = 32ε. Superficial queries start 2⁻³² of their coordinates off their own surface; so the plane is in
/// double precision, and so is the point that is put into it.
///
/// Numbers: the x of the three edges' normals, their y, their z; then the largest error of a product of the plane and a point, over the sum of the point's
/// largest component and that of any vertex (`Cone::side_error`); then the plane's three numbers, as their bits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record<'a>(pub(super) &'a [u8; size_of::<Numbers>()]);

/// The numbers of a record.
pub(super) type Numbers = [f32; 16];

/// Where the plane starts, in bytes.
const PLANE: usize = 40;

/// See [`Record`].
const EDGE_ERROR: f32 = 32.0 / 16_777_216.0;

impl Record<'_> {
    /// Those of a cone in the axes of the world.
    pub(super) fn numbers(cone: &Cone) -> Numbers {
        let edge = |i: usize| {
            // Close to it is everywhere where the normal itself is hardly known.
            if cone.edge_errors[i] < 1.0 / 16_777_216.0 { cone.edges[i].as_vec3() } else { Vec3::ZERO }
        };
        let [a, b, c] = [edge(0), edge(1), edge(2)];
        #[allow(clippy::cast_possible_truncation, reason = "it leaves room for single precision")]
        let plane_error = cone.side_error as f32;
        let mut all = [a.x, b.x, c.x, a.y, b.y, c.y, a.z, b.z, c.z, plane_error, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        bytemuck::bytes_of_mut(&mut all)[PLANE..].copy_from_slice(bytemuck::bytes_of(&cone.plane.to_array()));
        all
    }

    /// By how much the light + `d` is behind the plane, and the error of that.
    #[inline(always)]
    fn behind(self, d: DVec3, reach: f32) -> (f64, f64) {
        let [px, py, pz]: [f64; 3] = bytemuck::pod_read_unaligned(&self.0[PLANE..]);
        let behind = px * d.x + py * d.y + pz * d.z - 1.0;
        let plane_error: f32 = bytemuck::pod_read_unaligned(&self.0[PLANE - 4..PLANE]);
        (behind, f64::from(plane_error * reach))
    }

    /// Whether the triangle meets the closed segment from the light to the light + `d`, whose direction is known to meet its cone.
    #[inline(always)]
    pub(super) fn side(self, d: DVec3, reach: f32) -> Verdict {
        let (behind, error) = self.behind(d, reach);
        let known = if behind > error { Verdict::Blocks } else { Verdict::Close };
        if behind < -error { Verdict::Passes } else { known }
    }

    /// Whether the triangle meets the closed segment from the light to the light + `d`, whose direction is also given in single precision.
    #[inline(always)]
    pub(super) fn test(self, d: DVec3, &Direction { x: [x, y, z], reach }: &Direction) -> Verdict {
        // All three edges at once; the fourth lane says nothing.
        let edges = |first: usize| Vec4::from_array(bytemuck::pod_read_unaligned(&self.0[4 * first..4 * first + 16]));
        let at = edges(0) * x + edges(3) * y + edges(6) * z;
        let beside = at.cmplt(Vec4::splat(-EDGE_ERROR)).bitmask() & 7 != 0;
        let within = at.cmpgt(Vec4::splat(EDGE_ERROR)).bitmask() & 7 == 7;
        let (behind, error) = self.behind(d, reach);
        let passes = beside | (behind < -error);
        let blocks = within & (behind > error);
        // Not branches, which would be taken at random.
        let known = if blocks { Verdict::Blocks } else { Verdict::Close };
        if passes { Verdict::Passes } else { known }
    }
}

#[cfg(test)]
mod tests {
    use vdf_geometry::{Segment, Triangle, intersect_exact};

    use super::*;

    #[test]
    fn it_is_a_cache_line() {
        assert_eq!(size_of::<Numbers>(), 64);
    }

    /// Points on, before and behind triangles, on their edges' planes and ulps beside: a verdict is what the exact test says, and few are close
    /// where nothing is.
    #[test]
    fn verdicts_are_exact() {
        let mut random = fastrand::Rng::with_seed(2);
        let (mut blocks, mut passes, mut close, mut needless) = (0, 0, 0, 0);
        let (mut sides, mut told) = (0, 0);
        for i in 0..200_000_usize {
            let size = 10.0_f64.powi(-((i % 6) as i32));
            let mut point = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * random.f64() - 1.0)));
            let (o, light) = (point(1.0), point([1.0, 1e-6, 1000.0][i / 6 % 3]));
            let (a, mut b) = (o + point(size), o + point(size));
            if i % 13 == 0 {
                b = o + (a - o) * 1.5 + point(size * 1e-7);
            }
            let triangle = Triangle { vertices: [o, a, b].map(|p| p.as_vec3()) };
            let Some(cone) = Cone::new(&triangle, light) else { continue };
            let record = Record::numbers(&cone);
            let [va, vb, vc] = triangle.vertices_f64();
            let (s, t) = match i % 5 {
                0 => (random.f64(), 0.0),
                1 => (0.5, 0.5),
                2 => (random.f64() * 0.5, random.f64() * 0.5),
                3 => (0.0, 0.0),
                _ => (random.f64() * 2.0 - 1.0, random.f64() * 2.0 - 1.0),
            };
            let on = va + (vb - va) * s + (vc - va) * t;
            let reach = [1.0, 1.0 + 1e-10, 1.0 - 1e-10, 1.0 + f64::EPSILON, 0.5, 2.0][i / 5 % 6];
            let from = light + (on - light) * reach;
            let d = from - light;
            let w = d.abs().max_element();
            if w == 0.0 {
                continue;
            }
            let hit = intersect_exact(&Segment::new(from, light), &triangle).is_some();
            let single = d.as_vec3();
            let largest = single.abs().max_element();
            let vertices = triangle.vertices_f64().map(|v| (v - light).abs().max_element() as f32);
            let reach = largest + vertices.into_iter().fold(0.0, f32::max);
            let direction = Direction { x: (single * largest.recip()).to_array(), reach };
            let record = Record(bytemuck::cast_ref(&record));
            // Where the direction certainly meets the cone, the side is all.
            if (0..3).all(|i| cone.edges[i].dot(d) > cone.edge_errors[i] * w) {
                let side = record.side(d, reach);
                let known = side != Verdict::Close;
                assert!(!known || (side == Verdict::Blocks) == hit, "{triangle:?} {light} {from} {side:?}");
                (sides, told) = (sides + 1, told + usize::from(known));
            }
            match record.test(d, &direction) {
                Verdict::Blocks => {
                    blocks += 1;
                    assert!(hit, "{triangle:?} {light} {from}");
                }
                Verdict::Passes => {
                    passes += 1;
                    assert!(!hit, "{triangle:?} {light} {from}");
                }
                Verdict::Close => {
                    close += 1;
                    needless +=
                        usize::from(i % 5 == 2 && i / 5 % 6 >= 4 && i % 13 != 0 && size > 1e-3 && light.length() < 2.0);
                }
            }
        }
        assert!(
            blocks > 9_000 && passes > 30_000 && close > 10_000 && needless < 100,
            "{blocks} {passes} {close} {needless}"
        );
        assert!(sides > 30_000 && told * 2 > sides, "{sides} {told}");
    }
}
