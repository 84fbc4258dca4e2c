//! Building the tree.
//!
//! *Idea:* obvhs builds a binary tree \[Meister2018\]; here it is collapsed to nodes of eight children and leaves of up
//! to four triangles.
//!
//! *Cost:* O(n log n); quadratic if the boxes are nested.

use obvhs::{
    BvhBuildParams,
    aabb::Aabb,
    bvh2::{Bvh2, reinsertion::ReinsertionOptimizer},
    ploc::PlocBuilder,
};
use smallvec::SmallVec;

use super::{
    layout::{CHILDREN, Child, Leaf, Node, TOO_MANY, Tree, WIDTH},
    space::{TreeBox, TreeSpace},
};
use crate::Triangle;

impl Tree {
    /// The tree over triangles in this space.
    pub(super) fn build(triangles: &[Triangle], space: TreeSpace) -> Self {
        let n = match u32::try_from(triangles.len()) {
            Ok(n) if triangles.len() < TOO_MANY => n,
            _ => return Self::without_nodes(triangles),
        };
        if n == 0 {
            return Self::without_nodes(&[]);
        }
        let boxes: Vec<Aabb> = triangles
            .iter()
            .zip(0_u32..)
            .map(|(triangle, number)| {
                // Among equal boxes obvhs joins one pair at a time, into a chain, in quadratic time. So few are equal:
                // Fibonacci hashing spreads the numbers of neighbours over some hundred pads.
                let unequal = f64::from(number.wrapping_mul(0x9E37_79B9)) / f64::from(u32::MAX);
                let TreeBox { min, max } = space.padded_box(triangle, 1.0 + unequal);
                Aabb::new(min, max)
            })
            .collect();
        let p = BvhBuildParams::medium_build();
        let mut binary = PlocBuilder::with_capacity(boxes.len()).build(
            p.ploc_search_distance,
            &boxes,
            (0..n).collect(),
            p.sort_precision,
            p.search_depth_threshold,
        );
        ReinsertionOptimizer::default().run(&mut binary, p.reinsertion_batch_ratio, None);
        let counts = choose_leaves(&binary);
        let mut tree = Self { root: None, nodes: Vec::new(), leaves: Vec::new() };
        // Depth first, so that what is near in space is near in memory; without recursion, for the binary tree may be
        // as deep as it has triangles.
        let mut pending = vec![(0, None)];
        while let Some((from, place)) = pending.pop() {
            let child = if counts[from] != 0 {
                let mut numbers: SmallVec<[u32; WIDTH]> = SmallVec::new();
                collect(&binary, from, &mut numbers);
                tree.leaves.push(Leaf::new(triangles, &numbers));
                Child::leaf(tree.leaves.len() - 1, numbers.len())
            } else {
                let index = tree.nodes.len();
                let children = wide_children(&binary, &counts, from);
                let bounds = |&child: &usize| {
                    let Aabb { min, max } = *binary.nodes[child].aabb();
                    TreeBox { min, max }
                };
                tree.nodes.push(Node::new(children.iter().map(bounds)));
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
}

/// What a binary node costs a ray that comes into it, beside a leaf: a wide node takes the place of several. With more,
/// two walls of a room become one leaf whose box is the room (`docs/performance.md`).
const NODE_COST: f32 = 0.3;

/// For each binary node that becomes a leaf the number of its triangles, 0 for all others: a leaf where that is no
/// dearer than to go on.
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
