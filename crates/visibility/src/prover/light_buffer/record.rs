//! What decides whether one triangle blocks the way to the light: 64 bytes, a cache line.
//!
//! Nearly always in a few operations, and exactly; else the answer is [`Verdict::Close`].

use glam::{DVec3, Vec3};

use super::cone::Cone;

/// Whether a triangle meets the segment from a point to the light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verdict {
    Blocks,
    Passes,
    /// Too close to an edge or to the plane for the rounding here.
    Close,
}

/// A triangle as a light sees it: the planes of its edges in single precision, its own in double.
///
/// *Rounding.* With u = 2⁻²⁴ and the point relative to the light divided by its largest component, products of an edge's normal (components
/// of at most 1, rounded by u and known as well as u before) and the point (rounded by u) err by 4u each with their own rounding, and their
/// sum by 5u more: by less than [`EDGE_ERROR`] = 24u. Superficial queries start 2⁻³² of their coordinates off their own surface; so the plane is in double
/// precision.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub(super) struct Record {
    plane: DVec3,
    edges: [Vec3; 3],
    /// The largest error of a product of `plane` and a point, over the point's largest component.
    plane_error: f32,
}

/// See [`Record`].
const EDGE_ERROR: f32 = 24.0 / 16_777_216.0;

/// The error of the last difference, from one.
const ONE_ERROR: f64 = 4.0 * f64::EPSILON;

impl Record {
    /// Of a cone in the axes of the world.
    pub(super) fn new(cone: &Cone) -> Self {
        let edge = |i: usize| {
            // Close to it is everywhere where the normal itself is hardly known.
            if cone.edge_errors[i] < 1.0 / 16_777_216.0 { cone.edges[i].as_vec3() } else { Vec3::ZERO }
        };
        #[allow(clippy::cast_possible_truncation, reason = "rounded up")]
        let plane_error = ((4.0 * cone.plane_error) as f32).next_up();
        Self { plane: cone.plane, edges: [edge(0), edge(1), edge(2)], plane_error }
    }

    /// Its first number: who reads it has loaded the record.
    #[inline]
    pub(super) const fn first(&self) -> f64 {
        self.plane.x
    }

    /// Whether the triangle meets the closed segment from the light to the light + `d`; `x` is `d` over its largest component `w`.
    #[inline(always)]
    pub(super) fn test(&self, d: DVec3, x: Vec3, w: f64) -> Verdict {
        let [a, b, c] = self.edges;
        let least = a.dot(x).min(b.dot(x)).min(c.dot(x));
        let behind = self.plane.dot(d) - 1.0;
        let error = f64::from(self.plane_error) * w + ONE_ERROR;
        if least < -EDGE_ERROR || behind < -error {
            Verdict::Passes
        } else if least > EDGE_ERROR && behind > error {
            Verdict::Blocks
        } else {
            Verdict::Close
        }
    }
}

#[cfg(test)]
mod tests {
    use vdf_geometry::{Segment, Triangle, intersect_exact};

    use super::*;

    #[test]
    fn it_is_a_cache_line() {
        assert_eq!((size_of::<Record>(), align_of::<Record>()), (64, 64));
    }

    /// Points on, before and behind triangles, on their edges' planes and ulps beside: a verdict is what the exact test says, and few are close
    /// where nothing is.
    #[test]
    fn verdicts_are_exact() {
        let mut random = fastrand::Rng::with_seed(2);
        let (mut blocks, mut passes, mut close, mut needless) = (0, 0, 0, 0);
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
            let record = Record::new(&cone);
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
            match record.test(d, (d / w).as_vec3(), w) {
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
    }
}
