//! The fallback: a bounding volume hierarchy (\[Ylitie2017, Meister2018\], built by obvhs) over exact triangle tests.
//!
//! The hierarchy only culls. Its boxes are single precision and padded by more than all rounding of its box test,
//! so it never culls a triangle that the exact test would hit, and ties are broken by the triangle's number. So whether anything is
//! hit, and by what, does not depend on the shape of the tree. Which hit is the first is a matter of rounded parameters: they are off by
//! at most what [`SegmentTest::intersect`] says, which is much for grazing slivers, and a tree may cull one of two that are so close.
//!
//! The tree has a space of its own: world coordinates times a power of two, so that the largest is about 1. Then its single
//! precision neither overflows nor underflows whatever the unit of the scene, and the padding has one
//! known weight.

mod wide;

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;

use self::wide::{Start, Tree};
use crate::{Bounds, Segment, SegmentTest, Triangle};

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
    tree: Tree,
    /// How many triangles there are.
    triangles: usize,
    /// Of all triangles.
    bounds: Bounds,
    /// Tree coordinates per world unit, a power of two.
    scale: f64,
    /// By how much the tree's boxes are larger than the triangles, in world units.
    pad: f64,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh").field("triangles", &self.triangles).field("bounds", &self.bounds).finish()
    }
}

/// Padding of boxes in tree coordinates, where the largest coordinate m is below 1. With rays that start in the padded
/// bounds, and so are no longer than their diagonal of 2√3, a point on the ray in a box test is off by at most (in units of
/// 2⁻²⁴): origin 1, direction 2·2√3, clamp of small direction components 2·2√3, rounding of the boxes 1, the slab test
/// (b − o)·(1/d): 2 each for the difference, at most 2, the reciprocal and the product. That is below 22; about three times as much is taken.
const PAD: f64 = 64.0 / 16_777_216.0;

/// Segments with both ends farther away than this, in multiples of the largest coordinate, are not traced in single precision.
/// A point computed from the start is off by at most some 16·2⁻⁵³ times the start's distance: up to here by 2⁻²¹ of the
/// largest coordinate, a small part of the half of [`PAD`] that its budget leaves over.
const FAR: f64 = 268_435_456.0;

/// How a segment comes to the hierarchy.
enum Approach {
    /// It misses the padded bounds or has no length.
    Miss,
    /// The tree's ray, and where it starts: the distance from the segment's start along its largest component, in world units.
    Ray(Start, f64),
    /// The tree's ray from the segment's end, because its start is too far away.
    Backwards(Start),
    /// Both ends are so far away that single precision does not do. Hardly any such segment comes near; then all triangles are tested.
    Far,
}

impl Bvh {
    /// Builds the hierarchy. Cost: O(n log n); about 1 µs a triangle.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding to single precision")]
    pub fn new(triangles: &[Triangle]) -> Self {
        let bounds = Bounds::of_triangles(triangles);
        let largest = bounds.largest_coordinate();
        // Vertices are single precision, so the exponent is at most 128 and at least −149.
        let scale = if largest > 0.0 { (-largest.log2().floor() - 1.0).exp2() } else { 1.0 };
        let boxes: Vec<Aabb> = triangles
            .iter()
            .zip(0_u32..)
            .map(|(t, number)| {
                let mut b = Aabb::empty();
                for v in t.vertices_f64() {
                    b.extend(Vec3A::from((v * scale).as_vec3()));
                }
                // Among equal boxes obvhs joins one pair at a time, into a chain, in quadratic time. So few are equal: Fibonacci
                // hashing spreads the numbers of neighbours over some hundred pads.
                let unequal = f64::from(number.wrapping_mul(0x9E37_79B9)) / f64::from(u32::MAX);
                let pad = (PAD * (1.0 + unequal)) as f32;
                Aabb::new(b.min - pad, b.max + pad)
            })
            .collect();
        let tree = Tree::new(triangles, &boxes);
        Self { tree, triangles: triangles.len(), bounds, scale, pad: PAD / scale }
    }

    /// Bounds of the triangles; empty if there are none.
    #[must_use]
    #[inline]
    pub fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Bytes of the nodes and of the leaves, which hold the triangles.
    #[must_use]
    pub fn bytes(&self) -> usize {
        self.tree.bytes()
    }

    /// The first triangle that the closed segment meets. Cost: about 60 ns in a Cornell box.
    #[inline]
    #[must_use]
    pub fn intersect(&self, segment: &Segment) -> Option<Hit> {
        if self.bounds.misses(segment) {
            return None;
        }
        let test = SegmentTest::new(*segment, self.bounds.min, self.bounds.max);
        let mut best: Option<Hit> = None;
        let (ray, start) = match self.approach(&test) {
            Approach::Miss => return None,
            Approach::Ray(ray, start) => (ray, start),
            // Last things first: nothing can be culled.
            Approach::Backwards(ray) => (ray, f64::NEG_INFINITY),
            Approach::Far => {
                return self.all_hits(&test).min_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
            }
        };
        self.tree.traverse(ray, &test, self.scale, |hit, triangle| {
            if best.is_none_or(|b| (hit.t, triangle) < (b.t, b.triangle)) {
                best = Some(Hit { triangle, t: hit.t, barycentric: hit.barycentric });
            }
            // Boxes beyond the hit are culled, but not those within 10⁻⁶ of it.
            self.ray_parameter(hit.t * test.length() - start)
        });
        best
    }

    /// Whether any triangle meets the closed segment: the same as `intersect(segment).is_some()`, but faster.
    #[inline]
    #[must_use]
    pub fn occluded(&self, segment: &Segment) -> bool {
        if self.bounds.misses(segment) {
            return false;
        }
        let test = SegmentTest::new(*segment, self.bounds.min, self.bounds.max);
        let ray = match self.approach(&test) {
            Approach::Miss => return false,
            Approach::Ray(ray, _) | Approach::Backwards(ray) => ray,
            Approach::Far => return self.all_hits(&test).next().is_some(),
        };
        let mut occluded = false;
        self.tree.traverse(ray, &test, self.scale, |_, _| {
            occluded = true;
            f32::NEG_INFINITY
        });
        occluded
    }

    /// Calls `visit` with every triangle that the closed segment meets, in no particular order.
    #[inline]
    pub fn visit_hits(&self, segment: &Segment, mut visit: impl FnMut(Hit)) {
        if self.bounds.misses(segment) {
            return;
        }
        let test = SegmentTest::new(*segment, self.bounds.min, self.bounds.max);
        let ray = match self.approach(&test) {
            Approach::Miss => return,
            Approach::Ray(ray, _) | Approach::Backwards(ray) => ray,
            Approach::Far => return self.all_hits(&test).for_each(visit),
        };
        self.tree.traverse(ray, &test, self.scale, |hit, triangle| {
            visit(Hit { triangle, t: hit.t, barycentric: hit.barycentric });
            f32::INFINITY
        });
    }

    /// All hits of a segment, without the tree.
    #[cold]
    fn all_hits<'a>(&'a self, test: &'a SegmentTest) -> impl Iterator<Item = Hit> + 'a {
        self.tree.all().filter_map(|(triangle, number)| {
            test.intersect(&triangle).map(|hit| Hit { triangle: number, t: hit.t, barycentric: hit.barycentric })
        })
    }

    #[inline(always)]
    fn approach(&self, test: &SegmentTest) -> Approach {
        let direction = test.direction();
        if !(test.length() > 0.0 && direction.is_finite()) {
            return Approach::Miss;
        }
        let Segment { p, q } = *test.segment();
        if !self.is_far(p) {
            return self
                .ray(p, direction, test.length())
                .map_or(Approach::Miss, |(ray, start)| Approach::Ray(ray, start));
        }
        if !self.is_far(q) {
            return self.ray(q, -direction, test.length()).map_or(Approach::Miss, |(ray, _)| Approach::Backwards(ray));
        }
        // The rounding of what `passes` computes, as for `FAR`.
        let pad = self.pad + 16.0 * f64::EPSILON * p.abs().max_element();
        self.passes(p, direction, test.length(), pad).map_or(Approach::Miss, |_| Approach::Far)
    }

    /// The pad is in proportion to the largest coordinate.
    #[inline]
    fn is_far(&self, p: DVec3) -> bool {
        p.abs().max_element() * PAD > FAR * self.pad
    }

    /// Where a segment from `origin` comes to the bounds with this pad, if it does.
    #[inline]
    fn passes(&self, origin: DVec3, direction: DVec3, length: f64, pad: f64) -> Option<f64> {
        let (min, max) = (self.bounds.min - pad, self.bounds.max + pad);
        if origin.cmpge(min).all() && origin.cmple(max).all() {
            return Some(0.0);
        }
        let inv = direction.recip();
        let (t0, t1) = ((min - origin) * inv, (max - origin) * inv);
        // A direction parallel to a slab gives NaN on its padded border, where there is nothing to be hit.
        let (near, far) = (t0.min(t1).max_element(), t0.max(t1).min_element());
        (near <= far && near <= length && far >= 0.0).then_some(near.max(0.0))
    }

    /// The tree's ray for a segment that starts here, and at which distance it starts.
    #[inline(always)]
    fn ray(&self, origin: DVec3, direction: DVec3, length: f64) -> Option<(Start, f64)> {
        let start = self.passes(origin, direction, length, self.pad)?;
        let origin = origin + direction * start;
        Some((Start { origin, direction, end: self.ray_parameter(length - start) }, start))
    }

    /// The parameter of a tree's ray at this distance from its start (measured along the largest component), rounded up by more than the
    /// rounding of a box test.
    #[inline]
    #[allow(clippy::cast_possible_truncation, reason = "the pad covers the rounding")]
    fn ray_parameter(&self, distance: f64) -> f32 {
        ((distance * (1.0 + 1e-6) + self.pad) * self.scale) as f32
    }
}
