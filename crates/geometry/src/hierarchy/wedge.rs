//! The triangles that may come between a point and any point of a segment.
//!
//! *Idea:* all ways from an apex to the points of a segment lie in one flat triangle, the wedge. A box or a triangle that lies beyond the wedge
//! along some axis meets none of them. Seven axes are asked: those of the coordinates, the normal of the wedge's plane, and those in the
//! plane that point out of its sides. Four boxes or four triangles are asked at once.
//!
//! *Guarantee:* [`Tree::visit_wedge`] visits every triangle that a way meets, from the rounded points of [`Segment::at`], too. For any axis
//! separates what lies beyond along it, so an axis in single precision is exact as it is, and only projections are rounded. Those of the
//! wedge's corners are computed in double precision and enlarged by 64·2⁻⁵³ of the largest coordinate: three products and two sums err by 12 of
//! these, a point of the segment by 6 along each axis. Those of boxes and vertices, in single precision and in the tree's space, where they are at
//! most 1, err by less than 16·2⁻²⁴: three products by 3, two sums by 5, twice over. The wedge is enlarged by that, rounded outwards.
//!
//! *Cost:* about that of a ray for each node and leaf; no allocation but in trees deeper than nine levels.
//!
//! *Limits:* some triangles are visited that no way meets. Vertices are finite.

use std::ops::ControlFlow;

use glam::{DVec3, Vec4};
use smallvec::SmallVec;

use super::{
    layout::{Child, Leaf, Node, REGISTERS, Tree, WIDTH},
    space::TreeSpace,
};
use crate::{Segment, Triangle};

/// An axis, its largest component ±1.
#[derive(Clone, Copy, Debug)]
struct Axis {
    components: [Vec4; 3],
    /// Of each axis of the space which plane of a box comes first along this one.
    lower: [usize; 3],
}

/// The wedge in the tree's space.
#[derive(Clone, Copy, Debug)]
struct Wedge {
    /// Its bounds.
    min: [Vec4; 3],
    max: [Vec4; 3],
    /// Its normal, and where it lies along it.
    normal: Axis,
    plane: [Vec4; 2],
    /// Axes that point out of its sides, and how far it reaches along them.
    sides: [(Axis, Vec4); 3],
    /// Tree coordinates per world unit.
    scale: Vec4,
}

/// By how much projections of boxes and triangles err.
const ERROR: f64 = 16.0 / 16_777_216.0;

/// By how much those of the corners err, in multiples of the largest coordinate.
const CORNER_ERROR: f64 = 64.0 / 9_007_199_254_740_992.0;

/// Scales that single precision can hold; beyond it leaves are not filtered.
const SCALES: std::ops::Range<f64> = 1e-37..1e37;

impl Axis {
    #[allow(clippy::cast_possible_truncation, reason = "any axis will do")]
    fn new(direction: DVec3) -> (Self, DVec3) {
        let unit = direction / direction.abs().max_element();
        let axis = if unit.is_finite() { unit.as_vec3() } else { glam::Vec3::X };
        let components = axis.to_array();
        let lower = components.map(|c| usize::from(c < 0.0));
        (Self { components: components.map(Vec4::splat), lower }, axis.as_dvec3())
    }

    /// Where the boxes begin (`end` is 0) or end (1) along the axis.
    #[inline(always)]
    fn of_boxes(&self, node: &Node, r: usize, end: usize) -> Vec4 {
        let [x, y, z] = &self.components;
        let plane = |axis: usize| node.planes[axis][(self.lower[axis] ^ end) & 1][r];
        *x * plane(0) + *y * plane(1) + *z * plane(2)
    }

    #[inline(always)]
    fn of_vertices(&self, vertices: &[Vec4; 3]) -> Vec4 {
        self.components[0] * vertices[0] + self.components[1] * vertices[1] + self.components[2] * vertices[2]
    }
}

impl Wedge {
    fn new(apex: DVec3, segment: &Segment, space: TreeSpace) -> Self {
        let corners = [apex, segment.p, segment.q].map(|c| c * space.scale());
        let [a, b, c] = corners;
        let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
        let error = ERROR + CORNER_ERROR * largest;
        let along = |axis: DVec3| {
            let places = corners.map(|c| c.dot(axis));
            [places[0].min(places[1]).min(places[2]) - error, places[0].max(places[1]).max(places[2]) + error]
        };
        let bounds = [DVec3::X, DVec3::Y, DVec3::Z].map(along);
        let edges = [b - a, c - b, a - c];
        let normal = edges[0].cross(edges[1]);
        let size = |v: DVec3| v.abs().max_element();
        let longest = edges.into_iter().max_by(|v, w| size(*v).total_cmp(&size(*w))).unwrap_or(DVec3::X);
        // In a line: any plane through it.
        let flat = size(normal) > 1e-12 * size(longest) * size(longest);
        let normal = if flat { normal } else { longest.any_orthogonal_vector() };
        let (axis, exact) = Axis::new(normal);
        Self {
            min: bounds.map(|b| Vec4::splat(rounded_down(b[0]))),
            max: bounds.map(|b| Vec4::splat(rounded_up(b[1]))),
            normal: axis,
            plane: [Vec4::splat(rounded_down(along(exact)[0])), Vec4::splat(rounded_up(along(exact)[1]))],
            sides: edges.map(|edge| {
                let (side, exact) = Axis::new(edge.cross(normal));
                (side, Vec4::splat(rounded_up(along(exact)[1])))
            }),
            scale: Vec4::splat(if SCALES.contains(&space.scale()) { narrow(space.scale()) } else { f32::NAN }),
        }
    }

    /// Which boxes the wedge may meet, a bit for each.
    #[inline(always)]
    fn meets(&self, node: &Node) -> u32 {
        let mut bits = 0;
        for r in 0..REGISTERS {
            let planes = |axis: usize, end: usize| node.planes[axis][end][r];
            // Where there is no box the lower plane is beyond the upper; only then is a projection no number.
            let mut apart = planes(0, 0).cmpgt(planes(0, 1));
            for axis in 0..3 {
                apart |= planes(axis, 0).cmpgt(self.max[axis]) | planes(axis, 1).cmplt(self.min[axis]);
            }
            apart |= self.normal.of_boxes(node, r, 0).cmpgt(self.plane[1]);
            apart |= self.normal.of_boxes(node, r, 1).cmplt(self.plane[0]);
            for (side, reach) in &self.sides {
                apart |= side.of_boxes(node, r, 0).cmpgt(*reach);
            }
            bits |= (!apart).bitmask() << (r * WIDTH);
        }
        bits
    }

    /// Which of the leaf's first `count` triangles it may meet, a bit for each.
    #[inline(always)]
    fn candidates(&self, leaf: &Leaf, count: u32) -> u32 {
        let vertices = [0, 1, 2].map(|v| [0, 1, 2].map(|axis| Vec4::from_array(leaf.vertices[axis][v]) * self.scale));
        let [a, b, c] = &vertices;
        let along = |axis: &Axis| [axis.of_vertices(a), axis.of_vertices(b), axis.of_vertices(c)];
        // Each vertex for itself: a scale that is no number separates nothing.
        let [x, y, z] = along(&self.normal);
        let mut apart = x.cmpgt(self.plane[1]) & y.cmpgt(self.plane[1]) & z.cmpgt(self.plane[1]);
        apart |= x.cmplt(self.plane[0]) & y.cmplt(self.plane[0]) & z.cmplt(self.plane[0]);
        for (side, reach) in &self.sides {
            let [x, y, z] = along(side);
            apart |= x.cmpgt(*reach) & y.cmpgt(*reach) & z.cmpgt(*reach);
        }
        (!apart).bitmask() & ((1 << count) - 1)
    }
}

#[allow(clippy::cast_possible_truncation, reason = "rounded outwards by who calls")]
fn narrow(x: f64) -> f32 {
    x as f32
}

fn rounded_down(x: f64) -> f32 {
    narrow(x).next_down()
}

fn rounded_up(x: f64) -> f32 {
    narrow(x).next_up()
}

impl Tree {
    /// Calls `visit` with every triangle that a segment from a point of `segment` to `apex` meets, with some others, until it breaks.
    #[inline(always)]
    pub(super) fn visit_wedge(
        &self,
        apex: DVec3,
        segment: &Segment,
        space: TreeSpace,
        mut visit: impl FnMut(&Triangle) -> ControlFlow<()>,
    ) {
        let Some(mut next) = self.root else {
            let _ = self.all().try_for_each(|(triangle, _)| visit(&triangle));
            return;
        };
        let (nodes, leaves): (&[Node], &[Leaf]) = (&self.nodes, &self.leaves);
        let wedge = Wedge::new(apex, segment, space);
        let mut waiting: SmallVec<[Child; 64]> = SmallVec::new();
        loop {
            if next.triangles() == 0 {
                let node = &nodes[next.index()];
                let mut hits = wedge.meets(node);
                while hits != 0 {
                    waiting.push(node.children[hits.trailing_zeros() as usize & 7]);
                    hits &= hits - 1;
                }
            } else {
                let leaf = &leaves[next.index()];
                let mut candidates = wedge.candidates(leaf, next.triangles());
                while candidates != 0 {
                    let i = candidates.trailing_zeros() as usize & (WIDTH - 1);
                    candidates &= candidates - 1;
                    if visit(&leaf.triangle(i)).is_break() {
                        return;
                    }
                }
            }
            let Some(child) = waiting.pop() else { return };
            next = child;
        }
    }
}

#[cfg(test)]
mod tests;
