//! The fallback: a bounding volume hierarchy (obvhs \[Ylitie2017, Meister2018\]) over exact triangle tests.
//!
//! The hierarchy only culls. Its boxes are single precision and padded by more than all rounding of its box test,
//! so it never culls a triangle that the exact test would hit, and ties are broken by the triangle's number: no
//! answer depends on the shape of the tree.

use std::{ops::ControlFlow, time::Duration};

use glam::{DVec3, Vec3A};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, builder::build_bvh2},
    ray::{Ray, RayHit},
};

use super::intersect::{Segment, SegmentTest};
use crate::Triangle;

/// The first triangle along a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the triangle in the order given to [`Bvh::new`].
    pub triangle: u32,
    /// Parameter along the segment, in [0, 1].
    pub t: f64,
    /// Barycentric weights of the triangle's vertices.
    pub barycentric: [f64; 3],
}

/// A hierarchy over triangles; immutable and shared by all threads.
pub struct Bvh {
    tree: Bvh2,
    /// In the order of the tree's leaves, for locality.
    triangles: Vec<Triangle>,
    /// The number that each of `triangles` had when it was given.
    numbers: Vec<u32>,
    /// Bounds of all triangles; `min > max` if there are none.
    min: DVec3,
    max: DVec3,
    /// By how much the tree's boxes are larger than the triangles.
    pad: f64,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh")
            .field("triangles", &self.triangles.len())
            .field("min", &self.min)
            .field("max", &self.max)
            .finish()
    }
}

/// Padding of boxes in relation to the largest coordinate. With rays that start in the padded bounds, a point on the
/// ray in a box test is off by at most (in units of 2⁻²⁴ times the largest coordinate m, rays being no longer than
/// the bounds' diagonal of 2√3·m): origin 1, direction 2·2√3, obvhs's clamp of small direction components 2·2√3,
/// three roundings of the slab test 3·2√3 + 3. That is below 32; twice as much is taken.
const PAD: f64 = 64.0 / 16_777_216.0;

/// Segments that start farther away than this, in multiples of the largest coordinate, are not traced in single precision.
/// A point computed from the start is off by at most some 16·2⁻⁵³ times the start's distance: up to here by 2⁻²¹ of
/// the largest coordinate, a small part of the half of [`PAD`] that its budget leaves over. (And it is never far beyond the grids'
/// reach: an infinitely far emitter is sampled 10⁶ scenes away.)
const FAR: f64 = 268_435_456.0;

/// How a segment comes to the hierarchy.
enum Approach {
    /// It misses the padded bounds or has no length.
    Miss,
    /// The tree's ray, the distance of its start from the segment's, and the segment's length.
    Ray(Ray, f64, f64),
    /// From so far away that single precision does not do.
    Far,
}

impl Bvh {
    /// Builds the hierarchy. Cost: O(n log n); about 1 µs a triangle.
    #[must_use]
    pub fn new(triangles: &[Triangle]) -> Self {
        let mut min = DVec3::INFINITY;
        let mut max = DVec3::NEG_INFINITY;
        for v in triangles.iter().flat_map(Triangle::vertices_f64) {
            min = min.min(v);
            max = max.max(v);
        }
        let largest = if triangles.is_empty() { 0.0 } else { min.abs().max(max.abs()).max_element() };
        let pad = PAD * largest;
        // The boxes are padded in single precision, where adding the pad may lose half an ulp of the 64.
        #[allow(clippy::cast_possible_truncation, reason = "rounding is part of the padding's budget")]
        let pad_f32 = pad as f32;
        let boxes: Vec<Aabb> = triangles
            .iter()
            .map(|t| {
                let mut b = Aabb::empty();
                for v in t.vertices {
                    b.extend(Vec3A::from(v));
                }
                Aabb::new(b.min - pad_f32, b.max + pad_f32)
            })
            .collect();
        let mut core_time = Duration::ZERO;
        let tree = build_bvh2(&boxes, BvhBuildParams::medium_build(), &mut core_time);
        let numbers = tree.primitive_indices.clone();
        let ordered = numbers.iter().map(|&i| triangles[i as usize]).collect();
        Self { tree, triangles: ordered, numbers, min, max, pad }
    }

    /// Bounds of the triangles, `None` if there are none.
    #[must_use]
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        (!self.triangles.is_empty()).then_some((self.min, self.max))
    }

    /// The first triangle that the closed segment meets. Cost: about 100 ns in a Cornell box.
    #[inline]
    #[must_use]
    pub fn intersect(&self, segment: &Segment) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let (ray, start, length) = match self.approach(segment) {
            Approach::Miss => return None,
            Approach::Ray(ray, start, length) => (ray, start, length),
            Approach::Far => {
                self.visit_hits_from_afar(segment, |hit| {
                    if best.is_none_or(|b| (hit.t, hit.triangle) < (b.t, b.triangle)) {
                        best = Some(hit);
                    }
                    ControlFlow::Continue(())
                });
                return best;
            }
        };
        let test = SegmentTest::new(*segment, self.min, self.max);
        self.tree.ray_traverse(ray, &mut RayHit::none(), |_, slot| {
            if let Some(hit) = test.intersect(&self.triangles[slot]) {
                let triangle = self.numbers[slot];
                if best.is_none_or(|b| (hit.t, triangle) < (b.t, b.triangle)) {
                    best = Some(Hit { triangle, t: hit.t, barycentric: hit.barycentric });
                }
                // Boxes beyond the hit are culled; those within rounding of it are not.
                #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding")]
                return ((hit.t * length - start) * (1.0 + 1e-6) + self.pad) as f32;
            }
            f32::INFINITY
        });
        best
    }

    /// Whether any triangle meets the closed segment: the same as `intersect(segment).is_some()`, but faster.
    #[inline]
    #[must_use]
    pub fn occluded(&self, segment: &Segment) -> bool {
        let ray = match self.approach(segment) {
            Approach::Miss => return false,
            Approach::Ray(ray, _, _) => ray,
            Approach::Far => {
                let mut occluded = false;
                self.visit_hits_from_afar(segment, |_| {
                    occluded = true;
                    ControlFlow::Break(())
                });
                return occluded;
            }
        };
        let test = SegmentTest::new(*segment, self.min, self.max);
        !self.tree.ray_traverse_miss(ray, |_, slot| {
            if test.intersect(&self.triangles[slot]).is_some() { f32::NEG_INFINITY } else { f32::INFINITY }
        })
    }

    /// Calls `visit` with every triangle that the closed segment meets, in no particular order.
    #[inline]
    pub fn visit_hits(&self, segment: &Segment, mut visit: impl FnMut(Hit)) {
        let ray = match self.approach(segment) {
            Approach::Miss => return,
            Approach::Ray(ray, _, _) => ray,
            Approach::Far => {
                return self.visit_hits_from_afar(segment, |hit| {
                    visit(hit);
                    ControlFlow::Continue(())
                });
            }
        };
        let test = SegmentTest::new(*segment, self.min, self.max);
        self.tree.ray_traverse_anyhit(ray, |_, slot| {
            if let Some(hit) = test.intersect(&self.triangles[slot]) {
                visit(Hit { triangle: self.numbers[slot], t: hit.t, barycentric: hit.barycentric });
            }
        });
    }

    #[inline]
    fn approach(&self, segment: &Segment) -> Approach {
        let d = segment.q - segment.p;
        let length = d.length();
        let direction = d / length;
        if !(length > 0.0 && direction.is_finite()) {
            return Approach::Miss;
        }
        let (min, max) = (self.min - self.pad, self.max + self.pad);
        let mut start = 0.0;
        if !(segment.p.cmpge(min).all() && segment.p.cmple(max).all()) {
            // The pad is in proportion to the largest coordinate.
            if segment.p.abs().max_element() * PAD > FAR * self.pad {
                return Approach::Far;
            }
            let inv = direction.recip();
            let (t0, t1) = ((min - segment.p) * inv, (max - segment.p) * inv);
            // A direction parallel to a slab gives NaN on its border: `min` and `max` then keep the other operand.
            let (near, far) = (t0.min(t1).max_element(), t0.max(t1).min_element());
            if near > far || near > length || far < 0.0 {
                return Approach::Miss;
            }
            start = near.max(0.0);
        }
        let origin = segment.p + direction * start;
        #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding")]
        let reach = ((length - start) * (1.0 + 1e-6) + self.pad) as f32;
        let ray = Ray::new(Vec3A::from(origin.as_vec3()), Vec3A::from(direction.as_vec3()), 0.0, reach);
        Approach::Ray(ray, start, length)
    }

    /// [`Bvh::visit_hits`] for segments of any reach, until `visit` breaks: boxes are tested in double precision, and widened by its
    /// rounding errors.
    ///
    /// With u = 2⁻⁵³ and G the largest coordinate of the segment and of the triangles, computed points p + τ·(q − p), τ in [0, 1], are
    /// within 8u·G of the true ones, and the bounds of τ for a slab carry three roundings, less than 8u·G in position. So boxes
    /// widened by 64u·G lose nothing.
    #[cold]
    fn visit_hits_from_afar(&self, segment: &Segment, mut visit: impl FnMut(Hit) -> ControlFlow<()>) {
        let Segment { p, q } = *segment;
        let d = q - p;
        let reach = p.abs().max(q.abs()).max(self.min.abs()).max(self.max.abs()).max_element();
        let margin = 32.0 * f64::EPSILON * reach;
        let meets = |min: DVec3, max: DVec3| {
            let (low, high) = (min - margin - p, max + margin - p);
            let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
            for axis in 0..3 {
                if d[axis] == 0.0 {
                    if low[axis] > 0.0 || high[axis] < 0.0 {
                        return false;
                    }
                    continue;
                }
                let (t0, t1) = (low[axis] / d[axis], high[axis] / d[axis]);
                enter = enter.max(t0.min(t1));
                leave = leave.min(t0.max(t1));
            }
            enter <= leave
        };
        let test = SegmentTest::new(*segment, self.min, self.max);
        let mut stack: Vec<usize> = if self.tree.nodes.is_empty() { vec![] } else { vec![0] };
        while let Some(node) = stack.pop().and_then(|n| self.tree.nodes.get(n)) {
            if !meets(node.aabb.min.as_dvec3(), node.aabb.max.as_dvec3()) {
                continue;
            }
            let first = node.first_index as usize;
            if !node.is_leaf() {
                stack.extend([first, first + 1]);
                continue;
            }
            for slot in first..first + node.prim_count as usize {
                let Some(hit) = test.intersect(&self.triangles[slot]) else { continue };
                let hit = Hit { triangle: self.numbers[slot], t: hit.t, barycentric: hit.barycentric };
                if visit(hit).is_break() {
                    return;
                }
            }
        }
    }
}
