//! All curved shapes of a scene, in a hierarchy of boxes.
//!
//! *Guarantee.* The hierarchy only culls: its boxes are double precision and wider than the shapes, and a segment misses a box only by a comparison of
//! exact numbers, or by more than the rounding of the slab test. The first of several hits is that with the least (t, number), which is a function of
//! segment and shapes alone; shapes beyond a given place are left out if their boxes, widened by more than hits are rounded by, are beyond it.

use glam::DVec3;
use smallvec::{SmallVec, smallvec};

use super::CurvedShape;
use crate::{Bounds, Segment};

/// The first curved shape along a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurvedHit {
    /// Index of the shape in the order given to [`CurvedSet::new`].
    pub shape: u32,
    /// Parameter along the segment, in [0, 1]; rounded.
    pub t: f64,
}

/// Curved shapes in a hierarchy; immutable and shared by all threads.
#[derive(Clone, Debug)]
pub struct CurvedSet {
    shapes: Vec<CurvedShape>,
    nodes: Vec<Node>,
    /// The shapes' numbers in the order of the leaves.
    order: Vec<u32>,
    bounds: Bounds,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    bounds: Bounds,
    /// The first of two children, or of the shapes of a leaf.
    first: u32,
    /// How many shapes a leaf has; 0 for an inner node.
    count: u32,
}

/// Shapes of a leaf.
const LEAF: usize = 2;

impl CurvedSet {
    /// Builds the hierarchy, by medians. Cost: O(n log² n).
    #[must_use]
    pub fn new(shapes: Vec<CurvedShape>) -> Self {
        let bounds = shapes.iter().fold(Bounds::EMPTY, |all, s| all.union(*s.bounds()));
        let mut set = Self { order: (0..).take(shapes.len()).collect(), shapes, nodes: Vec::new(), bounds };
        if !set.shapes.is_empty() {
            set.nodes.push(Node { bounds, first: 0, count: 0 });
            set.build(0, 0, set.shapes.len());
        }
        set
    }

    fn build(&mut self, node: usize, first: usize, end: usize) {
        let (shapes, order) = (&self.shapes, &mut self.order[first..end]);
        let of = |&i: &u32| shapes[i as usize].bounds();
        let bounds = order.iter().fold(Bounds::EMPTY, |all, i| all.union(*of(i)));
        self.nodes[node].bounds = bounds;
        if order.len() <= LEAF {
            self.nodes[node] = Node { bounds, first: first as u32, count: order.len() as u32 };
            return;
        }
        let centre = |i: &u32| of(i).min + of(i).max;
        let spread = Bounds::of_points(order.iter().map(centre)).extent();
        let axis = if spread.x >= spread.y.max(spread.z) { 0 } else { 1 + usize::from(spread.z > spread.y) };
        order.sort_unstable_by(|a, b| centre(a)[axis].total_cmp(&centre(b)[axis]).then(a.cmp(b)));
        let middle = first + order.len() / 2;
        let children = self.nodes.len();
        self.nodes[node].first = children as u32;
        self.nodes.extend([Node { bounds, first: 0, count: 0 }; 2]);
        self.build(children, first, middle);
        self.build(children + 1, middle, end);
    }

    /// The shapes, in the order given.
    #[must_use]
    pub fn shapes(&self) -> &[CurvedShape] {
        &self.shapes
    }

    /// True if there are none.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.shapes.is_empty()
    }

    /// Bounds of the shapes; empty if there are none.
    #[must_use]
    pub const fn bounds(&self) -> &Bounds {
        &self.bounds
    }

    /// Whether any shape meets the closed segment, exactly.
    #[must_use]
    pub fn occluded(&self, segment: &Segment) -> bool {
        self.any(segment, f64::INFINITY, |_, shape| shape.meets(segment))
    }

    /// The first shape that the closed segment meets. One that is met beyond the parameter `before` only may be left out.
    #[must_use]
    pub fn intersect(&self, segment: &Segment, before: f64) -> Option<CurvedHit> {
        let mut best: Option<CurvedHit> = None;
        self.any(segment, before, |shape, curved| {
            for t in curved.hits(segment).into_iter().flatten() {
                if best.is_none_or(|b| (t, shape) < (b.t, b.shape)) {
                    best = Some(CurvedHit { shape, t });
                }
            }
            false
        });
        best
    }

    /// Calls `visit` with each place at which the closed segment meets a shape, in no particular order.
    pub fn visit_hits(&self, segment: &Segment, mut visit: impl FnMut(CurvedHit)) {
        self.any(segment, f64::INFINITY, |number, shape| {
            shape.hits(segment).into_iter().flatten().for_each(|t| visit(CurvedHit { shape: number, t }));
            false
        });
    }

    /// Whether `found` holds for a shape whose box the segment may meet up to the parameter `before`; asked until it does.
    #[inline]
    fn any(&self, segment: &Segment, before: f64, mut found: impl FnMut(u32, &CurvedShape) -> bool) -> bool {
        if self.nodes.is_empty() || self.bounds.misses(segment) {
            return false;
        }
        let inverse = (segment.q - segment.p).recip();
        let size = segment.p.abs().max(segment.q.abs()).max_element();
        let mut waiting: SmallVec<[u32; 32]> = smallvec![0];
        while let Some(node) = waiting.pop() {
            let node = &self.nodes[node as usize];
            if node.bounds.misses(segment) || passes_by(&node.bounds, segment.p, inverse, size, before) {
                continue;
            }
            if node.count == 0 {
                waiting.extend([node.first, node.first + 1]);
                continue;
            }
            let first = node.first as usize;
            for &number in &self.order[first..first + node.count as usize] {
                if found(number, &self.shapes[number as usize]) {
                    return true;
                }
            }
        }
        false
    }
}

/// True only if the line misses the box, or enters it beyond the parameter `before`. The slab test (b − p)/d errs by three roundings of a parameter; widening the box by 2⁻⁴⁵ of the
/// largest coordinate moves each plane by 64 of them or more. It is widened by a thousandth of its size as well, for where a line touches a shape the place of the hit may be off by
/// the root of the rounding.
fn passes_by(bounds: &Bounds, p: DVec3, inverse: DVec3, size: f64, before: f64) -> bool {
    let pad = (size + bounds.largest_coordinate()) * (1.0 / 35_184_372_088_832.0);
    let pad = pad + bounds.extent().max_element() * (1.0 / 1024.0);
    let (t0, t1) = ((bounds.min - pad - p) * inverse, (bounds.max + pad - p) * inverse);
    // A direction parallel to a slab gives infinities of two signs if the start is between its planes, and NaN on one: those decide nothing.
    let near = t0.min(t1);
    let far = t0.max(t1);
    near.max_element() > far.min_element().min(before)
        && near.is_nan_mask().bitmask() == 0
        && far.is_nan_mask().bitmask() == 0
}
