//! The fallback: a bounding volume hierarchy (\[Wald2007, Meister2018, Ylitie2017\]) over exact triangle tests.
//!
//! The hierarchy only culls. Its boxes are single precision and padded by more than all rounding of its box test, so it
//! never culls a triangle that the exact test would hit. So whether anything is hit, and by what, does not depend on
//! the tree.
//!
//! *Which hit is the first* does not depend on it either. The first is that with the least (t, number) of all hits,
//! where t is what [`SegmentTest::intersect`] computes: a function of the segment, the triangle and the bounds of the
//! scene. The rounding of t is large for grazing slivers, so no triangle whose t is the least may be culled. Here is
//! why it is not. (The place of t is its distance along the segment's largest component; lengths are in units of 2⁻²⁴
//! of the tree's space.) Let a ray end at a hit with parameter t₀, and let a triangle be hit at t ≤ t₀ as computed.
//!
//! 1. Boxes are culled only if the ray comes in beyond `end(t₀)`, which is at least `end(t)`. That is at least 48
//!    beyond the place of t: 64 by the pad, less the rounding to single precision and of the start.
//! 2. If the place of t is off by at most the slack of 16, `end(t)` is beyond the true place of the hit. That is a point
//!    of the triangle, so the ray comes into all boxes around the triangle before it, also as computed.
//! 3. Otherwise the place of t is in the triangle's box, enlarged by the slack of 16 and by 4 for the rounding of the
//!    clamp. A point of the ray is off by at most 22 in a box test and by 8 for the ray's start (`space`). So a point
//!    within 34 of the triangle's box is inside the padded boxes around it, and 20 is less: again the ray comes in before
//!    the place of t. If that is in front of the ray's start, it is so by no more than 28; then `end(t)` is positive, and
//!    a ray that starts in a box comes in at 0.
//!
//! Segments that start far away are traced from their end or tested against all triangles, and nothing is culled by t.
//!
//! What a ray is before it comes to the tree is decided here; `space` is the tree's own space and its padding, `layout`
//! what the tree is made of, `build` how it comes about (`divide` its upper part, by a `grid`; `reinsert` what is rearranged there; `slices` how a set is divided in two), `lanes` what it is computed with, `traverse` the way of a ray, `leaf` the triangles at its end, `wedge` the way of
//! all rays from a segment to a point at once.

mod build;
mod divide;
mod grid;
mod lanes;
mod layout;
mod leaf;
mod reinsert;
mod slices;
mod space;
mod table;
mod traverse;
mod wedge;

use std::ops::ControlFlow;

use glam::DVec3;
use pulp::Arch;
use rayon::prelude::*;

use self::{
    lanes::{InLanes, Lanes, dispatch},
    layout::Tree,
    space::{TreeDistance, TreeSpace},
    traverse::Start,
};
use crate::{Bounds, Segment, SegmentTest, Triangle, intersect::slack};

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
    space: TreeSpace,
    /// The [`slack`] of the bounds.
    slack: f64,
    /// The registers of the machine.
    arch: Arch,
}

impl std::fmt::Debug for Bvh {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Bvh").field("triangles", &self.triangles).field("bounds", &self.bounds).finish()
    }
}

/// How a segment comes to the hierarchy.
enum Approach {
    /// It misses the padded bounds or has no length.
    Miss,
    /// The tree's ray, and where it starts: the distance from the segment's start along its largest component, in world
    /// units.
    Ray(Start, f64),
    /// The tree's ray from the segment's end, because its start is too far away.
    Backwards(Start),
    /// Both ends are so far away that single precision does not do. Hardly any such segment comes near; then all
    /// triangles are tested.
    Far,
}

impl Bvh {
    /// Builds the hierarchy, on the threads of the current rayon pool; it is the same for any number of them. Cost: O(n
    /// log n) for any input, about 0.4 µs a triangle and thread; 64 bytes a triangle while it builds, and a third of the
    /// result.
    #[must_use]
    pub fn new(triangles: &[Triangle]) -> Self {
        let parts = triangles.par_chunks(1 << 14).map(Bounds::of_triangles);
        let bounds = parts.reduce(|| Bounds::of_triangles([]), Bounds::union);
        let space = TreeSpace::new(&bounds);
        let tree = Tree::build(triangles, space);
        Self { tree, triangles: triangles.len(), bounds, space, slack: slack(&bounds), arch: Arch::new() }
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
        if self.bounds.misses(segment) { None } else { dispatch(self.arch, Intersect { bvh: self, segment }) }
    }

    /// Whether any triangle meets the closed segment: the same as `intersect(segment).is_some()`, but faster.
    #[inline]
    #[must_use]
    pub fn occluded(&self, segment: &Segment) -> bool {
        !self.bounds.misses(segment) && dispatch(self.arch, Occluded { bvh: self, segment })
    }

    /// Calls `visit` with every triangle that the closed segment meets, in no particular order.
    #[inline]
    pub fn visit_hits(&self, segment: &Segment, visit: impl FnMut(Hit)) {
        if !self.bounds.misses(segment) {
            dispatch(self.arch, VisitHits { bvh: self, segment, visit });
        }
    }

    /// Calls `visit` with every triangle that comes between `apex` and a point of `segment` ([`Segment::at`] for some t in [0, 1]), with some
    /// others, in no particular order, until it breaks. A triangle comes between if the closed segment from the one to the other meets it.
    #[inline]
    pub fn visit_wedge(&self, apex: DVec3, segment: &Segment, visit: impl FnMut(&Triangle) -> ControlFlow<()>) {
        self.tree.visit_wedge(apex, segment, self.space, visit);
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
        if !self.space.is_far(p) {
            return self
                .ray(p, direction, test.length())
                .map_or(Approach::Miss, |(ray, start)| Approach::Ray(ray, start));
        }
        if !self.space.is_far(q) {
            return self.ray(q, -direction, test.length()).map_or(Approach::Miss, |(ray, _)| Approach::Backwards(ray));
        }
        // The rounding of what `passes` computes, as for `FAR`.
        let pad = self.space.pad() + 16.0 * f64::EPSILON * p.abs().max_element();
        self.passes(p, direction, test.length(), pad).map_or(Approach::Miss, |_| Approach::Far)
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
        let start = self.passes(origin, direction, length, self.space.pad())?;
        let origin = origin + direction * start;
        Some((Start { origin, direction, end: self.space.end(length - start) }, start))
    }
}

struct Intersect<'a> {
    bvh: &'a Bvh,
    segment: &'a Segment,
}

impl InLanes for Intersect<'_> {
    type Output = Option<Hit>;

    #[inline(always)]
    fn run(self, lanes: impl Lanes) -> Option<Hit> {
        let bvh = self.bvh;
        let test = SegmentTest::within(*self.segment, &bvh.bounds, bvh.slack);
        let mut best: Option<Hit> = None;
        let (ray, start) = match bvh.approach(&test) {
            Approach::Miss => return None,
            Approach::Ray(ray, start) => (ray, start),
            // Last things first: nothing can be culled.
            Approach::Backwards(ray) => (ray, f64::NEG_INFINITY),
            Approach::Far => {
                // As numbers: −0 is no less than 0, here as in the tree.
                let t = |hit: &Hit| hit.t + 0.0;
                return bvh.all_hits(&test).min_by(|a, b| t(a).total_cmp(&t(b)).then(a.triangle.cmp(&b.triangle)));
            }
        };
        bvh.tree.visit_hits(ray, &test, bvh.space, lanes, |hit, triangle| {
            if best.is_none_or(|b| (hit.t, triangle) < (b.t, b.triangle)) {
                best = Some(Hit { triangle, t: hit.t, barycentric: hit.barycentric });
            }
            // Boxes beyond the hit are culled, but not those that may hold one with the same t or less.
            bvh.space.end(hit.t * test.length() - start)
        });
        best
    }
}

struct Occluded<'a> {
    bvh: &'a Bvh,
    segment: &'a Segment,
}

impl InLanes for Occluded<'_> {
    type Output = bool;

    #[inline(always)]
    fn run(self, lanes: impl Lanes) -> bool {
        let bvh = self.bvh;
        let test = SegmentTest::within(*self.segment, &bvh.bounds, bvh.slack);
        match bvh.approach(&test) {
            Approach::Miss => false,
            Approach::Ray(ray, _) | Approach::Backwards(ray) => bvh.tree.occluded(ray, &test, bvh.space, lanes),
            Approach::Far => bvh.all_hits(&test).next().is_some(),
        }
    }
}

struct VisitHits<'a, F> {
    bvh: &'a Bvh,
    segment: &'a Segment,
    visit: F,
}

impl<F: FnMut(Hit)> InLanes for VisitHits<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run(self, lanes: impl Lanes) {
        let Self { bvh, segment, mut visit } = self;
        let test = SegmentTest::within(*segment, &bvh.bounds, bvh.slack);
        let ray = match bvh.approach(&test) {
            Approach::Miss => return,
            Approach::Ray(ray, _) | Approach::Backwards(ray) => ray,
            Approach::Far => return bvh.all_hits(&test).for_each(visit),
        };
        bvh.tree.visit_hits(ray, &test, bvh.space, lanes, |hit, triangle| {
            visit(Hit { triangle, t: hit.t, barycentric: hit.barycentric });
            TreeDistance::INFINITY
        });
    }
}
