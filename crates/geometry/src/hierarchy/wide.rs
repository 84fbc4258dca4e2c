//! The tree under [`Bvh`](super::Bvh): nodes of eight boxes, leaves of up to four triangles.
//!
//! *Idea:* obvhs builds a binary tree \[Meister2018\]; here it is collapsed to nodes of eight children \[Ylitie2017\], but their boxes stay in single
//! precision and lie side by side: four are tested at once with the registers that every x86-64 has, and nothing is unpacked. The triangles of a leaf
//! lie side by side too, and all but the few that the line comes near are rejected at once in single precision.
//!
//! *Guarantee:* [`Tree::traverse`] visits every hit of the segment once, but those beyond the ray's end.
//!
//! *Cost:* a node is four cache lines, a leaf two and a half.
//!
//! *Limits:* 2²⁹ triangles; over more, and up to 2³² − 1, there are no nodes, and all triangles are tested.

use glam::{DVec3, Vec3, Vec3A, Vec4};
use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, reinsertion::ReinsertionOptimizer},
    ploc::PlocBuilder,
};
use smallvec::SmallVec;

use crate::{SegmentTest, Triangle, TriangleHit};

/// Triangles of a leaf: as many as a register holds numbers in single precision.
const WIDTH: usize = 4;

/// Registers for the children of a node.
const REGISTERS: usize = 2;

/// Children of a node.
const CHILDREN: usize = WIDTH * REGISTERS;

/// Eight boxes, side by side.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Node {
    /// For each axis the lower planes of the boxes and the upper ones, in tree coordinates. Where there is no child the lower is +∞ and the upper −∞.
    planes: [[[Vec4; REGISTERS]; 2]; 3],
    children: [Child; CHILDREN],
}

/// A node, or a leaf and how many triangles it has.
#[derive(Clone, Copy)]
struct Child(u32);

impl Child {
    fn node(index: usize) -> Self {
        Self(low_bits(index) << 3)
    }

    fn leaf(index: usize, count: usize) -> Self {
        Self(low_bits(index) << 3 | low_bits(count))
    }

    #[inline]
    fn index(self) -> usize {
        (self.0 >> 3) as usize
    }

    /// 0 for a node.
    #[inline]
    fn triangles(self) -> u32 {
        self.0 & 7
    }
}

#[allow(clippy::cast_possible_truncation, reason = "there are less than 2^29 triangles")]
fn low_bits(index: usize) -> u32 {
    index as u32
}

/// The triangles of a leaf, side by side, in world coordinates.
#[derive(Clone, Copy)]
#[repr(align(32))]
struct Leaf {
    /// By axis, vertex and triangle.
    vertices: [[[f32; WIDTH]; 3]; 3],
    /// The triangles' numbers; [`NONE`] where there is none.
    numbers: [u32; WIDTH],
}

const NONE: u32 = u32::MAX;

/// Where a ray starts in world coordinates, its direction (with ±1 for the largest component) and where it ends, in tree coordinates along that component.
#[derive(Clone, Copy, Debug)]
pub(super) struct Start {
    pub(super) origin: DVec3,
    pub(super) direction: DVec3,
    pub(super) end: f32,
}

/// A ray in tree coordinates, prepared for boxes and leaves.
#[derive(Clone, Copy, Debug)]
struct TreeRay {
    origin: [Vec4; 3],
    inverse: [Vec4; 3],
    /// For each axis 1 if the direction points backwards along it.
    backwards: [usize; 3],
    /// Where it ends, in units of the direction.
    end: f32,
    line: Line,
}

/// The ray's line as a leaf needs it.
#[derive(Clone, Copy, Debug)]
struct Line {
    /// The axis of the direction's largest component is the last.
    axes: [usize; 3],
    /// A point on it in world coordinates, in the order of `axes`.
    origin: [Vec4; 3],
    /// Tree coordinates per world unit.
    scale: Vec4,
    /// By how much the first two coordinates change with the last, times `scale`.
    shear: [Vec4; 2],
}

/// The smallest component of a direction, 2⁻²³ of the largest; keeps reciprocals finite.
const SMALLEST_COMPONENT: f32 = f32::EPSILON;

/// Largest error of a sheared coordinate in a leaf's test, see [`Leaf::candidates`].
const SHEAR_ERROR: f32 = 32.0 / 16_777_216.0;

impl TreeRay {
    /// The ray from `origin` (in world coordinates, within the padded bounds) along `direction` (its largest component is ±1) to the parameter `end`,
    /// on the line of a segment.
    #[inline(always)]
    #[allow(clippy::cast_possible_truncation, reason = "the pad and `SHEAR_ERROR` cover the rounding")]
    fn new(start: Start, segment: &SegmentTest, scale: f64) -> Self {
        let Start { origin, direction, end } = start;
        let axes = segment.axes();
        let o = origin.as_vec3().to_array();
        let line_scale = scale.min(LARGEST_SCALE) as f32;
        let [x, y] = segment.shear();
        let line = Line {
            axes,
            origin: [Vec4::splat(o[axes[0]]), Vec4::splat(o[axes[1]]), Vec4::splat(o[axes[2]])],
            scale: Vec4::splat(line_scale),
            shear: [Vec4::splat(x as f32 * line_scale), Vec4::splat(y as f32 * line_scale)],
        };
        let o = (origin * scale).as_vec3a();
        let d = direction.as_vec3a();
        let small = d.abs().cmple(Vec3A::splat(SMALLEST_COMPONENT));
        let d = Vec3A::select(small, d.signum() * SMALLEST_COMPONENT, d);
        let inverse = d.recip();
        Self {
            origin: [Vec4::splat(o.x), Vec4::splat(o.y), Vec4::splat(o.z)],
            inverse: [Vec4::splat(inverse.x), Vec4::splat(inverse.y), Vec4::splat(inverse.z)],
            backwards: [usize::from(d.x < 0.0), usize::from(d.y < 0.0), usize::from(d.z < 0.0)],
            end,
            line,
        }
    }
}

/// Scales are powers of two up to 2¹⁵⁰; a leaf's test uses none above 2¹²⁶, so that the spacing of the smallest
/// numbers, 2⁻¹⁴⁹, stays a rounding of 1 there. Its coordinates are then only smaller, and its error bound with them too large.
const LARGEST_SCALE: f64 = 8.507_059_173_023_462e37;

impl Node {
    const EMPTY: Self = Self {
        planes: [[[Vec4::INFINITY; REGISTERS], [Vec4::NEG_INFINITY; REGISTERS]]; 3],
        children: [Child(0); CHILDREN],
    };

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
            let far = side(0, x ^ 1).min(side(1, y ^ 1)).min(side(2, z ^ 1).min(Vec4::splat(ray.end)));
            near.write_to_slice(nears);
            hits |= near.cmple(far).bitmask() << (r * WIDTH);
        }
        (nears, hits)
    }
}

impl Leaf {
    /// Which of the first `count` triangles the line may meet, a bit for each.
    ///
    /// Rejects a triangle only if of the three edge functions of \[Woop2013\] one is certainly positive and one certainly negative. In units of
    /// u = 2⁻²⁴ and of tree coordinates, in which vertices and the line's start are at most 1 (but for the pad): the start is off the line by at most 8
    /// (see `FAR` in `bvh.rs`) and rounded by 1, which the shear doubles, 18; a difference of vertex and start, at most 2, is rounded by 2, again
    /// doubled, 4; the shear's factor is rounded by 1, times 2, its product by 2; the last difference, at most 4, by 4. So a sheared coordinate errs by
    /// δ = 30u ([`SHEAR_ERROR`] is 32u). With L the largest of them that was computed, at most 4 + δ, an edge function cx·by − cy·bx errs by at most
    /// 4δL + 2δ² and by the rounding of two products and a difference, 4uL² < 17uL < δL. So 8δ(L + δ) is more than enough: the rest is for its own
    /// rounding, and for 8u of δ more where the scale is so small that the shear's factor loses bits (8·38u < 8·2·32u).
    ///
    /// Where world coordinates overflow nothing is rejected: a vertex with NaN leaves only one edge function that is a number, and with infinity
    /// alone the bound is infinite.
    #[inline(always)]
    fn candidates(&self, count: u32, line: &Line) -> u32 {
        let [x, y, z] = [&self.vertices[line.axes[0]], &self.vertices[line.axes[1]], &self.vertices[line.axes[2]]];
        let sheared = |v: usize| {
            let z = Vec4::from_array(z[v]) - line.origin[2];
            let x = (Vec4::from_array(x[v]) - line.origin[0]) * line.scale - z * line.shear[0];
            let y = (Vec4::from_array(y[v]) - line.origin[1]) * line.scale - z * line.shear[1];
            [x, y]
        };
        let (a, b, c) = (sheared(0), sheared(1), sheared(2));
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        let size = |p: [Vec4; 2]| p[0].abs().max(p[1].abs());
        let largest = size(a).max(size(b)).max(size(c));
        let error = (largest + SHEAR_ERROR) * (8.0 * SHEAR_ERROR);
        let positive = u.cmpgt(error) | v.cmpgt(error) | w.cmpgt(error);
        let negative = u.cmplt(-error) | v.cmplt(-error) | w.cmplt(-error);
        !(positive & negative).bitmask() & ((1 << count) - 1)
    }

    /// The exact answer for one triangle.
    #[inline(always)]
    fn intersect(&self, i: usize, test: &SegmentTest) -> Option<TriangleHit> {
        let i = i & (WIDTH - 1);
        let along = |axis: usize| {
            let vertices = &self.vertices[axis];
            [f64::from(vertices[0][i]), f64::from(vertices[1][i]), f64::from(vertices[2][i])]
        };
        let [x, y, z] = test.axes();
        test.intersect_coordinates([along(x), along(y), along(z)], || self.triangle(i))
    }

    #[inline]
    fn triangle(&self, i: usize) -> Triangle {
        let i = i & (WIDTH - 1);
        let [x, y, z] = &self.vertices;
        Triangle { vertices: [0, 1, 2].map(|v| Vec3::new(x[v][i], y[v][i], z[v][i])) }
    }
}

/// The nodes and leaves.
pub(super) struct Tree {
    /// None if there are no nodes; then all leaves are visited.
    root: Option<Child>,
    nodes: Vec<Node>,
    leaves: Vec<Leaf>,
}

impl Tree {
    /// The tree over triangles with these boxes, in tree coordinates. Cost: O(n log n).
    pub(super) fn new(triangles: &[Triangle], boxes: &[Aabb]) -> Self {
        let n = match u32::try_from(boxes.len()) {
            Ok(n) if n < 1 << 29 => n,
            _ => return Self::without_nodes(triangles),
        };
        if n == 0 {
            return Self::without_nodes(&[]);
        }
        let p = BvhBuildParams::medium_build();
        let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
            p.ploc_search_distance,
            boxes,
            (0..n).collect(),
            p.sort_precision,
            p.search_depth_threshold,
        );
        ReinsertionOptimizer::default().run(&mut binary, p.reinsertion_batch_ratio, None);
        let counts = choose_leaves(&binary);
        let mut tree = Self { root: None, nodes: Vec::new(), leaves: Vec::new() };
        // Depth first, so that what is near in space is near in memory; without recursion, for the binary tree may be as deep as it has triangles.
        let mut pending = vec![(0, None)];
        while let Some((from, place)) = pending.pop() {
            let child = if counts[from] != 0 {
                let mut numbers: SmallVec<[u32; WIDTH]> = SmallVec::new();
                collect(&binary, from, &mut numbers);
                tree.leaves.push(leaf(triangles, &numbers));
                Child::leaf(tree.leaves.len() - 1, numbers.len())
            } else {
                let index = tree.nodes.len();
                let children = wide_children(&binary, &counts, from);
                tree.nodes.push(node(children.iter().map(|&child| *binary.nodes[child].aabb())));
                pending.extend(children.iter().enumerate().rev().map(|(i, &child)| (child, Some((index, i)))));
                Child::node(index)
            };
            match place {
                None => tree.root = Some(child),
                Some((parent, i)) => tree.nodes[parent].children[i] = child,
            }
        }
        tree.nodes.shrink_to_fit();
        tree.leaves.shrink_to_fit();
        tree
    }

    /// Leaves only.
    fn without_nodes(triangles: &[Triangle]) -> Self {
        let numbers: Vec<u32> = (0..NONE).take(triangles.len()).collect();
        let leaves = numbers.chunks(WIDTH).map(|numbers| leaf(triangles, numbers)).collect();
        Self { root: None, nodes: Vec::new(), leaves }
    }

    /// Bytes of nodes and leaves.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(&self.nodes[..]) + size_of_val(&self.leaves[..])
    }

    /// All triangles with their numbers.
    pub(super) fn all(&self) -> impl Iterator<Item = (Triangle, u32)> {
        self.leaves.iter().flat_map(|leaf| {
            let used = (0..WIDTH).filter(|&i| leaf.numbers[i] != NONE);
            used.map(|i| (leaf.triangle(i), leaf.numbers[i]))
        })
    }

    /// Calls `visit` with every hit of the segment and its triangle's number; boxes in front come first, roughly. The ray ends at the smallest
    /// parameter that `visit` returned; −∞ ends the traversal.
    #[inline(always)]
    pub(super) fn traverse(
        &self,
        start: Start,
        test: &SegmentTest,
        scale: f64,
        mut visit: impl FnMut(TriangleHit, u32) -> f32,
    ) {
        let Some(mut next) = self.root else {
            for (triangle, number) in self.all() {
                if let Some(hit) = test.intersect(&triangle)
                    && visit(hit, number) == f32::NEG_INFINITY
                {
                    return;
                }
            }
            return;
        };
        let mut ray = TreeRay::new(start, test, scale);
        // Seven of a node's children wait at most, and hardly ever more than two: only trees deeper than nine levels can make this allocate.
        let mut waiting: SmallVec<[(Child, f32); 64]> = SmallVec::new();
        loop {
            if next.triangles() == 0 {
                let node = &self.nodes[next.index()];
                let (near, mut hits) = node.intersect(&ray);
                if hits != 0 {
                    let mut take = || {
                        let i = hits.trailing_zeros() as usize & (CHILDREN - 1);
                        hits &= hits - 1;
                        ((node.children[i], near[i]), hits != 0)
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
                let leaf = &self.leaves[next.index()];
                let mut candidates = leaf.candidates(next.triangles(), &ray.line);
                while candidates != 0 {
                    let i = candidates.trailing_zeros() as usize & (WIDTH - 1);
                    candidates &= candidates - 1;
                    let Some(hit) = leaf.intersect(i, test) else { continue };
                    let end = visit(hit, leaf.numbers[i]);
                    if end < ray.end {
                        if end == f32::NEG_INFINITY {
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

/// What a binary node costs a ray that comes into it, beside a leaf: a wide node takes the place of several. With more, two walls of a room
/// become one leaf whose box is the room (`docs/performance.md`).
const NODE_COST: f32 = 0.3;

/// For each binary node that becomes a leaf the number of its triangles, 0 for all others: a leaf where that is no dearer than to go on.
fn choose_leaves(binary: &Bvh2) -> Vec<u32> {
    // Parents first.
    let mut order = vec![0];
    let mut next = 0;
    while let Some(&from) = order.get(next) {
        let node = &binary.nodes[from];
        if !node.is_leaf() {
            let first = node.first_index as usize;
            order.extend([first, first + 1]);
        }
        next += 1;
    }
    let mut counts = vec![0; binary.nodes.len()];
    // The number of triangles below each node, and their cost.
    let mut below = vec![(0_u32, 0.0_f32); binary.nodes.len()];
    for &from in order.iter().rev() {
        let node = &binary.nodes[from];
        let area = node.aabb().half_area();
        let (count, cost) = if node.is_leaf() {
            (1, 0.0)
        } else {
            let first = node.first_index as usize;
            let (left, right) = (below[first], below[first + 1]);
            (left.0 + right.0, NODE_COST * area + left.1 + right.1)
        };
        // A leaf costs the same with one triangle as with four.
        let is_leaf = node.is_leaf() || count as usize <= WIDTH && area <= cost;
        counts[from] = if is_leaf { count } else { 0 };
        below[from] = (count, if is_leaf { area } else { cost });
    }
    counts
}

/// Up to eight nodes below a binary node that take its place: the largest are opened first.
fn wide_children(binary: &Bvh2, counts: &[u32], from: usize) -> SmallVec<[usize; CHILDREN]> {
    let first = binary.nodes[from].first_index as usize;
    let mut children: SmallVec<[usize; CHILDREN]> = SmallVec::from_slice(&[first, first + 1]);
    let area = |i: usize| binary.nodes[i].aabb().half_area();
    while children.len() < CHILDREN {
        let open = (0..children.len()).filter(|&i| counts[children[i]] == 0);
        let Some(i) = open.max_by(|&i, &j| area(children[i]).total_cmp(&area(children[j]))) else { break };
        let first = binary.nodes[children[i]].first_index as usize;
        children[i] = first;
        children.push(first + 1);
    }
    children
}

/// A node with these boxes, at most eight; its children are not known yet.
fn node(boxes: impl Iterator<Item = Aabb>) -> Node {
    let mut node = Node::EMPTY;
    for (i, bounds) in boxes.enumerate() {
        for (axis, planes) in node.planes.iter_mut().enumerate() {
            planes[0][i / WIDTH][i % WIDTH] = bounds.min[axis];
            planes[1][i / WIDTH][i % WIDTH] = bounds.max[axis];
        }
    }
    node
}

/// The triangles below a binary node.
fn collect(binary: &Bvh2, from: usize, numbers: &mut SmallVec<[u32; WIDTH]>) {
    let node = &binary.nodes[from];
    let first = node.first_index as usize;
    if node.is_leaf() {
        numbers.push(binary.primitive_indices[first]);
    } else {
        collect(binary, first, numbers);
        collect(binary, first + 1, numbers);
    }
}

/// The leaf of these triangles, at most four.
fn leaf(triangles: &[Triangle], numbers: &[u32]) -> Leaf {
    let mut leaf = Leaf { vertices: [[[0.0; WIDTH]; 3]; 3], numbers: [NONE; WIDTH] };
    for (i, &number) in numbers.iter().enumerate() {
        leaf.numbers[i] = number;
        for (v, vertex) in triangles[number as usize].vertices.iter().enumerate() {
            for axis in 0..3 {
                leaf.vertices[axis][v][i] = vertex[axis];
            }
        }
    }
    leaf
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Segment;

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
        let test = SegmentTest::new(Segment::new(p, p + DVec3::Z * 20.0), DVec3::ZERO, DVec3::splat(10.0));
        let start = Start { origin: p, direction: DVec3::Z, end: 2.0 };
        let mut numbers = Vec::new();
        Tree::without_nodes(&triangles).traverse(start, &test, 0.0625, |_, number| {
            numbers.push(number);
            f32::INFINITY
        });
        assert_eq!(numbers, (0..11).collect::<Vec<_>>());
    }

    /// Lines through vertices and edges of small triangles, from near and far within the bounds: whatever the exact test hits is a candidate, and of those
    /// that the line passes at a tenth of their size nearly none is.
    #[test]
    fn candidates_are_all_that_is_hit_and_little_else() {
        let mut noise = fastrand::Rng::with_seed(11);
        let mut uniform = |size: f64| DVec3::from_array([(); 3].map(|()| size * (2.0 * noise.f64() - 1.0)));
        let (mut hits, mut beside, mut false_calls) = (0, 0, 0);
        for i in 0..40_000 {
            let size = [0.5, 0.05, 0.005][i % 3];
            let vertices = [(); 3].map(|()| uniform(1.0 - size));
            let (o, a, b) = (vertices[0], uniform(size), uniform(size));
            let t = Triangle { vertices: [o, o + a, o + b].map(|v| v.as_vec3()) };
            let leaf = leaf(&[t], &[0]);
            let [a, b, c] = t.vertices_f64();
            let target = [a, a + (b - a) * 0.375, (a + b + c) / 3.0, a + (a - b) * 0.1 + (a - c) * 0.1][i / 3 % 4];
            let p = if i % 2 == 0 { vertices[1] } else { target + (vertices[1] - target) * size };
            let segment = Segment::new(p, p + (target - p) * 1.5);
            let test = SegmentTest::new(segment, DVec3::NEG_ONE, DVec3::ONE);
            let start = Start { origin: p, direction: test.direction(), end: 8.0 };
            let candidate = leaf.candidates(1, &TreeRay::new(start, &test, 1.0).line) == 1;
            if test.intersect(&t).is_some() {
                hits += 1;
                assert!(candidate, "{segment:?} {t:?}");
            } else if i / 3 % 4 == 3 {
                beside += 1;
                false_calls += usize::from(candidate);
            }
        }
        assert!(hits > 15_000 && beside > 9000 && false_calls < beside / 20, "{hits} {beside} {false_calls}");
    }
}
