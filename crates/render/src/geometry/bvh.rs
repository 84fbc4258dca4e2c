//! The fallback: a bounding volume hierarchy (obvhs \[Ylitie2017, Meister2018\]) over exact triangle tests.
//!
//! The hierarchy only culls. Its boxes are single precision and padded by more than all rounding of its box test,
//! so it never culls a triangle that the exact test would hit, and ties are broken by the triangle's number: no
//! answer depends on the shape of the tree.

use std::time::Duration;

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
        let (ray, start, length) = self.ray(segment)?;
        let test = SegmentTest::new(*segment, self.min, self.max);
        let mut best: Option<Hit> = None;
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
        let Some((ray, _, _)) = self.ray(segment) else { return false };
        let test = SegmentTest::new(*segment, self.min, self.max);
        !self.tree.ray_traverse_miss(ray, |_, slot| {
            if test.intersect(&self.triangles[slot]).is_some() { f32::NEG_INFINITY } else { f32::INFINITY }
        })
    }

    /// Calls `visit` with every triangle that the closed segment meets, in no particular order.
    #[inline]
    pub fn visit_hits(&self, segment: &Segment, mut visit: impl FnMut(Hit)) {
        let Some((ray, _, _)) = self.ray(segment) else { return };
        let test = SegmentTest::new(*segment, self.min, self.max);
        self.tree.ray_traverse_anyhit(ray, |_, slot| {
            if let Some(hit) = test.intersect(&self.triangles[slot]) {
                visit(Hit { triangle: self.numbers[slot], t: hit.t, barycentric: hit.barycentric });
            }
        });
    }

    /// The tree's ray for a segment, the distance of its start from the segment's, and the segment's length;
    /// `None` if the segment misses the padded bounds or has no length.
    #[inline]
    fn ray(&self, segment: &Segment) -> Option<(Ray, f64, f64)> {
        let d = segment.q - segment.p;
        let length = d.length();
        let direction = d / length;
        if !(length > 0.0 && direction.is_finite()) {
            return None;
        }
        let (min, max) = (self.min - self.pad, self.max + self.pad);
        let mut start = 0.0;
        if !(segment.p.cmpge(min).all() && segment.p.cmple(max).all()) {
            let inv = direction.recip();
            let (t0, t1) = ((min - segment.p) * inv, (max - segment.p) * inv);
            // A direction parallel to a slab gives NaN on its border: `min` and `max` then keep the other operand.
            let (near, far) = (t0.min(t1).max_element(), t0.max(t1).min_element());
            if near > far || near > length || far < 0.0 {
                return None;
            }
            start = near.max(0.0);
        }
        let origin = segment.p + direction * start;
        #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding")]
        let reach = ((length - start) * (1.0 + 1e-6) + self.pad) as f32;
        let ray = Ray::new(Vec3A::from(origin.as_vec3()), Vec3A::from(direction.as_vec3()), 0.0, reach);
        Some((ray, start, length))
    }
}
