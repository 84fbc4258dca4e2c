//! The way of a ray through the tree.
//!
//! *Idea:* the eight boxes of a node are tested at once, the nearest child is next, the others wait. Leaves ask the
//! exact test.
//!
//! *Guarantee:* [`Tree::traverse`] visits every hit of the segment once, but those beyond the ray's end.
//!
//! *Cost:* one load of four cache lines a node and of two and a half a leaf; no allocation but in trees deeper than
//! nine levels.

use glam::{DVec3, Vec3A};
use smallvec::SmallVec;

use super::{
    lanes::Lanes,
    layout::{CHILDREN, Child, Leaf, Node, Tree, WIDTH},
    leaf::{LeafTest, Sieved},
    space::{TreeDistance, TreeSpace},
};
use crate::{SegmentTest, TriangleHit};

/// Where a ray starts in world coordinates, its direction (with ±1 for the largest component) and where it ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    pub(super) end: TreeDistance,
}

/// A ray in the tree's space, prepared for boxes.
#[derive(Clone, Copy)]
struct TreeRay<L: Lanes> {
    lanes: L,
    origin: [L::Singles; 3],
    inverse: [L::Singles; 3],
    /// For each axis 1 if the direction points backwards along it.
    backwards: [usize; 3],
    end: TreeDistance,
}

/// The smallest component of a direction, 2⁻²³ of the largest; keeps reciprocals finite.
const SMALLEST_COMPONENT: f32 = f32::EPSILON;

impl<L: Lanes> TreeRay<L> {
    /// The ray; its start is within the padded bounds.
    #[inline(always)]
    fn new(start: Start, space: TreeSpace, lanes: L) -> Self {
        let Start { origin, direction, end } = start;
        let o = space.point(origin).0;
        let d = direction.as_vec3a();
        let small = d.abs().cmple(Vec3A::splat(SMALLEST_COMPONENT));
        let d = Vec3A::select(small, d.signum() * SMALLEST_COMPONENT, d);
        let inverse = d.recip();
        Self {
            lanes,
            origin: [lanes.splat(o.x), lanes.splat(o.y), lanes.splat(o.z)],
            inverse: [lanes.splat(inverse.x), lanes.splat(inverse.y), lanes.splat(inverse.z)],
            backwards: [usize::from(d.x < 0.0), usize::from(d.y < 0.0), usize::from(d.z < 0.0)],
            end,
        }
    }

    /// Where it comes to the planes of boxes across an axis.
    #[inline(always)]
    fn to(&self, node: &Node, axis: usize, upper: usize) -> L::Singles {
        let l = self.lanes;
        l.mul(l.sub(l.singles(&node.planes[axis][upper & 1]), self.origin[axis]), self.inverse[axis])
    }
}

impl Node {
    /// Where the ray comes into each box, and in which it comes at all, a bit for each.
    #[inline(always)]
    fn intersect<L: Lanes>(&self, ray: &TreeRay<L>) -> ([f32; CHILDREN], u32) {
        let l = ray.lanes;
        let [x, y, z] = ray.backwards;
        let near = l.max(l.max(ray.to(self, 0, x), ray.to(self, 1, y)), l.max(ray.to(self, 2, z), l.splat(0.0)));
        let far = l.min(ray.to(self, 2, z ^ 1), l.splat(ray.end.0));
        let far = l.min(l.min(ray.to(self, 0, x ^ 1), ray.to(self, 1, y ^ 1)), far);
        (l.array(near), l.at_most(near, far))
    }
}

/// A child and, before it, where the ray comes in: at 0 or later, so that the bits are ordered as the numbers are. In one number, because the choice of the
/// nearer one then needs no branch, which would be guessed wrongly as often as not.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Entry(u64);

impl Entry {
    /// The first of the children with a bit, which it loses.
    #[inline(always)]
    fn take(node: &Node, near: &[f32; CHILDREN], bits: &mut u32) -> Self {
        let i = bits.trailing_zeros() as usize & (CHILDREN - 1);
        *bits &= *bits - 1;
        Self(u64::from(near[i].to_bits()) << 32 | u64::from(node.children[i].bits()))
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the lower half")]
    fn child(self) -> Child {
        Child::from_bits(self.0 as u32)
    }

    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the upper half")]
    fn near(self) -> TreeDistance {
        TreeDistance(f32::from_bits((self.0 >> 32) as u32))
    }
}

/// Who is told of leaves. A trait in place of a closure: a closure is not compiled for the registers of its caller.
trait Visitor {
    /// The ray may meet this leaf, which has so many triangles. Returns where the ray ends now; −∞ ends the traversal.
    fn leaf(&mut self, leaf: &Leaf, count: u32) -> TreeDistance;
}

struct AnyHit<'a, L: Lanes> {
    test: &'a SegmentTest,
    lanes: LeafTest<L>,
    found: bool,
}

impl<L: Lanes> Visitor for AnyHit<'_, L> {
    #[inline(always)]
    fn leaf(&mut self, leaf: &Leaf, count: u32) -> TreeDistance {
        let Sieved { hits, mut close, .. } = leaf.sieve(count, &self.lanes);
        self.found = hits != 0;
        while close != 0 && !self.found {
            self.found = leaf.intersect(close.trailing_zeros() as usize, self.test).is_some();
            close &= close - 1;
        }
        if self.found { TreeDistance::NEG_INFINITY } else { TreeDistance::INFINITY }
    }
}

struct Hits<'a, L: Lanes, V> {
    test: &'a SegmentTest,
    lanes: LeafTest<L>,
    visit: V,
}

impl<L: Lanes, V: FnMut(TriangleHit, u32) -> TreeDistance> Visitor for Hits<'_, L, V> {
    #[inline(always)]
    fn leaf(&mut self, leaf: &Leaf, count: u32) -> TreeDistance {
        let sieved = leaf.sieve(count, &self.lanes);
        let Sieved { mut hits, mut close, .. } = sieved;
        let mut end = TreeDistance::INFINITY;
        if hits != 0 {
            let numbers = sieved.numbers(self.lanes.lanes());
            while hits != 0 {
                let i = hits.trailing_zeros() as usize & (WIDTH - 1);
                hits &= hits - 1;
                let [u, v, w, t] = [numbers[0][i], numbers[1][i], numbers[2][i], numbers[3][i]];
                let hit = self.test.certain_hit([u, v, w], t, || leaf.triangle(i));
                end = end.nearer((self.visit)(hit, leaf.numbers[i]));
            }
        }
        while close != 0 {
            let i = close.trailing_zeros() as usize & (WIDTH - 1);
            close &= close - 1;
            if let Some(hit) = leaf.intersect(i, self.test) {
                end = end.nearer((self.visit)(hit, leaf.numbers[i]));
            }
        }
        end
    }
}

impl Tree {
    /// Tells `visitor` of the leaves that the segment may meet; boxes in front come first, roughly. The
    /// ray ends at the smallest distance that it returned.
    #[inline(always)]
    fn traverse(&self, start: Start, space: TreeSpace, lanes: impl Lanes, visitor: &mut impl Visitor) {
        let Some(mut next) = self.root else {
            for leaf in self.leaves.iter() {
                if visitor.leaf(leaf, leaf.count()) == TreeDistance::NEG_INFINITY {
                    return;
                }
            }
            return;
        };
        let (nodes, leaves): (&[Node], &[Leaf]) = (&self.nodes, &self.leaves);
        let mut ray = TreeRay::new(start, space, lanes);
        // Seven of a node's children wait at most, and hardly ever more than two: only trees deeper than nine levels
        // can make this allocate.
        let mut waiting: SmallVec<[Entry; 64]> = SmallVec::new();
        loop {
            if next.triangles() == 0 {
                let node = &nodes[next.index()];
                let (near, mut hits) = node.intersect(&ray);
                if hits != 0 {
                    let mut nearest = Entry::take(node, &near, &mut hits);
                    while hits != 0 {
                        let entry = Entry::take(node, &near, &mut hits);
                        waiting.push(nearest.max(entry));
                        nearest = nearest.min(entry);
                    }
                    next = nearest.child();
                    continue;
                }
            } else {
                let end = visitor.leaf(&leaves[next.index()], next.triangles());
                if end < ray.end {
                    if end == TreeDistance::NEG_INFINITY {
                        return;
                    }
                    ray.end = end;
                }
            }
            loop {
                let Some(entry) = waiting.pop() else { return };
                if entry.near() <= ray.end {
                    next = entry.child();
                    break;
                }
            }
        }
    }

    /// Whether the segment meets a triangle.
    #[inline(always)]
    pub(super) fn occluded(&self, start: Start, test: &SegmentTest, space: TreeSpace, lanes: impl Lanes) -> bool {
        let mut any = AnyHit { test, lanes: LeafTest::new(test, lanes), found: false };
        self.traverse(start, space, lanes, &mut any);
        any.found
    }

    /// Calls `visit` with every hit of the segment and its triangle's number. The
    /// ray ends at the smallest distance that `visit` returned.
    #[inline(always)]
    pub(super) fn visit_hits(
        &self,
        start: Start,
        test: &SegmentTest,
        space: TreeSpace,
        lanes: impl Lanes,
        visit: impl FnMut(TriangleHit, u32) -> TreeDistance,
    ) {
        self.traverse(start, space, lanes, &mut Hits { test, lanes: LeafTest::new(test, lanes), visit });
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::{Bounds, Segment, Triangle};

    /// What is built for more triangles than a child can number.
    #[test]
    fn without_nodes_all_triangles_are_visited() {
        let triangles: Vec<_> = (0..11_u8)
            .map(|i| {
                let z = Vec3::Z * f32::from(i);
                Triangle::new(z, Vec3::X + z, Vec3::Y + z)
            })
            .collect();
        let p = DVec3::new(0.25, 0.25, -1.0);
        let space = TreeSpace::new(&Bounds::of_triangles(&triangles));
        let test = SegmentTest::new(Segment::new(p, p + DVec3::Z * 20.0), DVec3::ZERO, DVec3::splat(10.0));
        let start = Start { origin: p, direction: DVec3::Z, end: TreeDistance(2.0) };
        let mut numbers = Vec::new();
        Tree::without_nodes(&triangles).visit_hits(start, &test, space, pulp::Scalar, |_, number| {
            numbers.push(number);
            TreeDistance::INFINITY
        });
        assert_eq!(numbers, (0..11).collect::<Vec<_>>());
    }
}
