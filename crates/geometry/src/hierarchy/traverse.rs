//! The way of a ray through the tree.
//!
//! *Idea:* the eight boxes of a node are tested at once, the nearest child is next, the others wait. Leaves ask the
//! exact test.
//!
//! *Guarantee:* [`Tree::traverse`] visits every hit of the segment once, but those beyond the ray's end.
//!
//! *Cost:* one load of four cache lines a node and of two and a half a leaf; no allocation but in trees deeper than
//! nine levels.

use glam::{DVec3, Vec3A, Vec4};
use smallvec::SmallVec;

use super::{
    layout::{CHILDREN, Child, Leaf, Node, Tree, WIDTH},
    leaf::Line,
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

/// A ray in the tree's space, prepared for boxes and leaves.
#[derive(Clone, Copy, Debug)]
struct TreeRay {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// For each axis 1 if the direction points backwards along it.
    backwards: [usize; 3],
    end: TreeDistance,
    line: Line,
}

/// The smallest component of a direction, 2⁻²³ of the largest; keeps reciprocals finite.
const SMALLEST_COMPONENT: f32 = f32::EPSILON;

impl TreeRay {
    /// The ray on the line of a segment; its start is within the padded bounds.
    #[inline(always)]
    fn new(start: Start, segment: &SegmentTest, space: TreeSpace) -> Self {
        let Start { origin, direction, end } = start;
        let o = space.point(origin).0;
        let d = direction.as_vec3a();
        let small = d.abs().cmple(Vec3A::splat(SMALLEST_COMPONENT));
        let d = Vec3A::select(small, d.signum() * SMALLEST_COMPONENT, d);
        let inverse = d.recip();
        Self {
            origin: [Vec4::splat(o.x), Vec4::splat(o.y), Vec4::splat(o.z)],
            inverse: [Vec4::splat(inverse.x), Vec4::splat(inverse.y), Vec4::splat(inverse.z)],
            backwards: [usize::from(d.x < 0.0), usize::from(d.y < 0.0), usize::from(d.z < 0.0)],
            end,
            line: Line::new(origin, segment, space.scale()),
        }
    }
}

impl Node {
    /// Where the ray comes into each box, and in which it comes at all, a bit for each.
    #[inline(always)]
    fn intersect(&self, ray: &TreeRay) -> ([f32; CHILDREN], u32) {
        let [x, y, z] = ray.backwards;
        let mut nears = [0.0; CHILDREN];
        let mut hits = 0;
        for (r, nears) in nears.chunks_exact_mut(WIDTH).enumerate() {
            let side =
                |axis: usize, upper: usize| (self.planes[axis][upper & 1][r] - ray.origin[axis]) * ray.inverse[axis];
            let near = side(0, x).max(side(1, y)).max(side(2, z).max(Vec4::ZERO));
            let far = side(0, x ^ 1).min(side(1, y ^ 1)).min(side(2, z ^ 1).min(Vec4::splat(ray.end.0)));
            near.write_to_slice(nears);
            hits |= near.cmple(far).bitmask() << (r * WIDTH);
        }
        (nears, hits)
    }
}

impl Tree {
    /// Calls `visit` with every hit of the segment and its triangle's number; boxes in front come first, roughly. The
    /// ray ends at the smallest distance that `visit` returned; −∞ ends the traversal.
    #[inline(always)]
    pub(super) fn traverse(
        &self,
        start: Start,
        test: &SegmentTest,
        space: TreeSpace,
        mut visit: impl FnMut(TriangleHit, u32) -> TreeDistance,
    ) {
        let Some(mut next) = self.root else {
            for (triangle, number) in self.all() {
                if let Some(hit) = test.intersect(&triangle)
                    && visit(hit, number) == TreeDistance::NEG_INFINITY
                {
                    return;
                }
            }
            return;
        };
        let (nodes, leaves): (&[Node], &[Leaf]) = (&self.nodes, &self.leaves);
        let mut ray = TreeRay::new(start, test, space);
        // Seven of a node's children wait at most, and hardly ever more than two: only trees deeper than nine levels
        // can make this allocate.
        let mut waiting: SmallVec<[(Child, TreeDistance); 64]> = SmallVec::new();
        loop {
            if next.triangles() == 0 {
                let node = &nodes[next.index()];
                let (near, mut hits) = node.intersect(&ray);
                if hits != 0 {
                    let mut take = || {
                        let i = hits.trailing_zeros() as usize & (CHILDREN - 1);
                        hits &= hits - 1;
                        ((node.children[i], TreeDistance(near[i])), hits != 0)
                    };
                    let (mut nearest, mut more) = take();
                    while more {
                        let child;
                        (child, more) = take();
                        if child.1 < nearest.1 {
                            waiting.push(nearest);
                            nearest = child;
                        } else {
                            waiting.push(child);
                        }
                    }
                    next = nearest.0;
                    continue;
                }
            } else {
                let leaf = &leaves[next.index()];
                let mut candidates = leaf.candidates(next.triangles(), &ray.line);
                while candidates != 0 {
                    let i = candidates.trailing_zeros() as usize & (WIDTH - 1);
                    candidates &= candidates - 1;
                    let Some(hit) = leaf.intersect(i, test) else { continue };
                    let end = visit(hit, leaf.numbers[i]);
                    if end < ray.end {
                        if end == TreeDistance::NEG_INFINITY {
                            return;
                        }
                        ray.end = end;
                    }
                }
            }
            loop {
                let Some((child, near)) = waiting.pop() else { return };
                if near <= ray.end {
                    next = child;
                    break;
                }
            }
        }
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
        Tree::without_nodes(&triangles).traverse(start, &test, space, |_, number| {
            numbers.push(number);
            TreeDistance::INFINITY
        });
        assert_eq!(numbers, (0..11).collect::<Vec<_>>());
    }
}
