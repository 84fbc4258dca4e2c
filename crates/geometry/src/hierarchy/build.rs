//! Building the tree: from the top, in parallel.
//!
//! *Idea:* a set of triangles is divided in two where the surface area heuristic says so. It looks at the planes
//! between a few equal slices of the triangles' centres along each axis (binning, \[Wald2007\]). Which divisions make
//! one node of eight children is a second question: the child with the largest surface is opened first. Sets of up to
//! four triangles become a leaf, or several, whichever is cheapest of all possibilities.
//!
//! *Guarantee:* the tree is the same for any number of threads. Slices are counted in parallel, but sums of counts and
//! unions of boxes do not depend on their order, and all else depends on one set alone.
//!
//! *Cost:* O(n log n) time for every input. A set that more than [`UNEVEN`](super::slices::UNEVEN) uneven divisions led to is divided in the
//! middle, and so are equal centres. So a path has no more than 17 + log n / log 8⁄7 divisions, and each looks at each
//! of its triangles a fixed number of times. The upper branches are then moved, which takes bounded work
//! ([`reinsert`]). While it is built the tree takes 32 bytes a triangle for the boxes and twice its nodes.
//!
//! *Limits:* as for [`layout`](super::layout). Where coordinates are not finite, so are boxes; the build ends all the
//! same.

use rayon::prelude::*;
use smallvec::SmallVec;

use super::{
    layout::{CHILDREN, Child, Leaf, NONE, Node, TOO_MANY, Tree, WIDTH},
    reinsert::{Branch, reinsert},
    slices::{ALONE, Division, Hull, Item, count_uneven, divide, divide_large},
    space::TreeSpace,
    table::Table,
};
use crate::Triangle;

/// What a division costs a ray that comes into it, beside a leaf: a wide node takes the place of several. With more,
/// two walls of a room become one leaf whose box is the room (`docs/performance.md`).
const NODE_COST: f32 = 0.3;

/// The tree is divided into some tens of thousands of bunches of as many triangles, which are then arranged anew.
const BUNCHES: usize = 1 << 14;

/// The cheapest way to make leaves of up to four triangles.
struct FewLeaves {
    /// The cost of each subset (a bit for each item), in surfaces of leaves that a ray comes into.
    costs: [f32; 1 << WIDTH],
    /// The lower side of the cheapest division of each, 0 if it is a leaf.
    divisions: [u8; 1 << WIDTH],
}

#[allow(clippy::cast_possible_truncation, reason = "there are four items")]
fn bits(set: usize) -> u8 {
    set as u8
}

impl FewLeaves {
    fn new(items: &[Item]) -> Self {
        let mut few = Self { costs: [0.0; 1 << WIDTH], divisions: [0; 1 << WIDTH] };
        let mut hulls = [Hull::EMPTY; 1 << WIDTH];
        for set in 1..1_usize << items.len().min(WIDTH) {
            let rest = set & (set - 1);
            let first = &items[set.trailing_zeros() as usize];
            hulls[set] = hulls[rest].with(first.min, first.max);
            let area = hulls[set].area();
            // A leaf costs the same with one triangle as with four.
            (few.costs[set], few.divisions[set]) = (area, 0);
            let mut lower = (set - 1) & set;
            // Each division once: the lower side is the one without the first item.
            while lower > 0 {
                if lower & rest == lower {
                    let cost = NODE_COST * area + few.costs[lower] + few.costs[set ^ lower];
                    if cost < area && cost < few.costs[set] {
                        (few.costs[set], few.divisions[set]) = (cost, bits(lower));
                    }
                }
                lower = (lower - 1) & set;
            }
        }
        few
    }
}

/// A set of triangles that is divided only when it is built.
struct Bunch<'a> {
    items: &'a mut [Item],
    hull: Hull,
    /// How many divisions above were uneven.
    uneven: u32,
}

/// The upper part of the binary tree, down to sets of a few triangles.
struct Top {
    branches: Vec<Branch>,
    /// How many bunches are below each branch, and how many triangles.
    below: Vec<(usize, usize)>,
}

impl Top {
    /// The tree of these divisions, made cheaper, and its bunches in the order of the tree.
    fn new(items: &mut [Item], hull: Hull, division: Option<Box<Division>>) -> (Self, Vec<Bunch<'_>>) {
        let mut branches = Vec::new();
        let mut bunches = Vec::new();
        let branch = |hull: Hull, parent| Branch { hull, area: hull.area(), parent, first: 0, leaf: 0 };
        branches.push(branch(hull, 0));
        let mut pending = vec![(0, items, division, 0)];
        while let Some((i, items, division, uneven)) = pending.pop() {
            if let Some(division) = division {
                let Division { lower, hulls, uneven, below: [below_a, below_b] } = *division;
                let first = branches.len();
                branches[i].first = low_bits(first);
                branches.extend(hulls.map(|hull| branch(hull, low_bits(i))));
                let (a, b) = items.split_at_mut(lower);
                pending.extend([(first + 1, b, below_b, uneven), (first, a, below_a, uneven)]);
            } else {
                branches[i].leaf = low_bits(bunches.len());
                bunches.push(Some(Bunch { items, hull: branches[i].hull, uneven }));
            }
        }
        reinsert(&mut branches);
        // Parents first, so that the children of each are known when it is looked at from behind.
        let mut order = Vec::with_capacity(branches.len());
        let mut sorted = Vec::with_capacity(bunches.len());
        let mut below = vec![(0, 0); branches.len()];
        let mut pending = vec![0];
        while let Some(i) = pending.pop() {
            order.push(i);
            let Branch { first, leaf, .. } = branches[i];
            if first != 0 {
                pending.extend([first as usize + 1, first as usize]);
            } else if let Some(bunch) = bunches[leaf as usize].take() {
                below[i] = (1, bunch.items.len());
                sorted.push(bunch);
            }
        }
        for i in order.into_iter().rev() {
            let first = branches[i].first as usize;
            if first != 0 {
                below[i] = (below[first].0 + below[first + 1].0, below[first].1 + below[first + 1].1);
            }
        }
        (Self { branches, below }, sorted)
    }

    /// The set below a branch with these bunches.
    fn set<'a, 'b>(&self, branch: usize, bunches: &'a mut [Bunch<'b>]) -> Set<'a, 'b> {
        let hull = self.branches[branch].hull;
        match bunches {
            [Bunch { items, uneven, .. }] => Set::Bunch(Bunch { items: std::mem::take(items), hull, uneven: *uneven }),
            _ if self.below[branch].1 <= WIDTH => {
                Set::Few(bunches.iter().flat_map(|bunch| bunch.items.iter().copied()).collect(), hull)
            }
            _ => Set::Branch(branch, bunches, hull),
        }
    }
}

#[allow(clippy::cast_possible_truncation, reason = "there are less than 2^32 branches")]
fn low_bits(i: usize) -> u32 {
    i as u32
}

/// The numbers of a leaf's triangles, and how many there are.
#[derive(Clone, Copy)]
struct Numbers([u32; WIDTH], usize);

/// A set of triangles that is to become a part of the tree.
enum Set<'a, 'b> {
    /// A branch of the top with its bunches: more than one, and more triangles than a leaf has.
    Branch(usize, &'a mut [Bunch<'b>], Hull),
    Bunch(Bunch<'b>),
    /// Triangles of several bunches, no more than a leaf has.
    Few(Vec<Item>, Hull),
    Leaf(Numbers, Hull),
}

impl Set<'_, '_> {
    fn hull(&self) -> Hull {
        match self {
            Set::Branch(_, _, hull) | Set::Bunch(Bunch { hull, .. }) | Set::Few(_, hull) | Set::Leaf(_, hull) => *hull,
        }
    }

    /// How many triangles there are.
    fn len(&self, top: &Top) -> usize {
        match self {
            Set::Branch(i, ..) => top.below[*i].1,
            Set::Bunch(bunch) => bunch.items.len(),
            Set::Few(items, _) => items.len(),
            Set::Leaf(numbers, _) => numbers.1,
        }
    }

    /// Its two parts, or its triangles if it is a leaf.
    fn open(self, top: &Top) -> Result<[Self; 2], Numbers> {
        match self {
            Set::Branch(i, bunches, _) => {
                let first = top.branches[i].first as usize;
                let (a, b) = bunches.split_at_mut(top.below[first].0);
                Ok([top.set(first, a), top.set(first + 1, b)])
            }
            Set::Bunch(Bunch { items, hull, uneven }) => {
                let (lower, hulls, uneven) = if items.len() > WIDTH {
                    let (lower, hulls) = divide(items, uneven);
                    (lower, hulls, count_uneven(uneven, lower, items.len()))
                } else {
                    let (lower, hulls) = divide_few(items, hull).ok_or_else(|| numbers(items))?;
                    (lower, hulls, uneven)
                };
                let (a, b) = items.split_at_mut(lower);
                let [of_a, of_b] = hulls;
                let part = |items, hull| Set::Bunch(Bunch { items, hull, uneven });
                Ok([part(a, of_a), part(b, of_b)])
            }
            Set::Few(mut items, hull) => {
                let (lower, [a, b]) = divide_few(&mut items, hull).ok_or_else(|| numbers(&items))?;
                let upper = items.split_off(lower);
                Ok([Set::Few(items, a), Set::Few(upper, b)])
            }
            Set::Leaf(numbers, _) => Err(numbers),
        }
    }

    /// Up to eight parts, the children of a node; or the triangles of a leaf.
    fn children(self, top: &Top) -> Result<SmallVec<[Self; CHILDREN]>, Numbers> {
        let mut children: SmallVec<[Self; CHILDREN]> = SmallVec::from_iter(self.open(top)?);
        while children.len() < CHILDREN {
            let open = (0..children.len()).filter(|&i| !matches!(children[i], Set::Leaf(..)));
            let area = |i: usize| children[i].hull().area();
            let Some(i) = open.max_by(|&i, &j| area(i).total_cmp(&area(j))) else { break };
            let hull = children[i].hull();
            match std::mem::replace(&mut children[i], Set::Few(Vec::new(), hull)).open(top) {
                Ok([a, b]) => {
                    children[i] = a;
                    children.push(b);
                }
                Err(leaf) => children[i] = Set::Leaf(leaf, hull),
            }
        }
        Ok(children)
    }
}

/// Divides up to four triangles in two where that is cheaper than a leaf.
fn divide_few(items: &mut [Item], hull: Hull) -> Option<(usize, [Hull; 2])> {
    let n = items.len();
    let side = |bits: usize, bit: usize| (0..n).filter(move |i| bits >> i & 1 == bit);
    let lower = match n {
        ..=1 => 0,
        // Two are common, and have one division only.
        2 => {
            let [a, b] = [&items[..1], &items[1..]].map(|items| Hull::of(items).area());
            usize::from(NODE_COST * hull.area() + a + b < hull.area())
        }
        _ => usize::from(FewLeaves::new(items).divisions[(1 << n) - 1]),
    };
    if lower == 0 {
        return None;
    }
    let sorted: SmallVec<[Item; WIDTH]> = side(lower, 1).chain(side(lower, 0)).map(|i| items[i]).collect();
    items.copy_from_slice(&sorted);
    let lower = side(lower, 1).count();
    Some((lower, [Hull::of(&items[..lower]), Hull::of(&items[lower..])]))
}

/// A part of the tree, numbered by itself.
struct Part {
    nodes: Vec<Node>,
    /// The triangles of each leaf.
    leaves: Vec<[u32; WIDTH]>,
}

impl Part {
    /// With room for what so many triangles become, as a rule.
    fn of(triangles: usize) -> Self {
        Self { nodes: Vec::with_capacity(triangles / 8), leaves: Vec::with_capacity(triangles / 2) }
    }

    /// Adds all that is below a set. Depth first, so that what is near in space is near in memory, and without
    /// recursion.
    fn add(&mut self, set: Set<'_, '_>, top: &Top) -> Child {
        let mut root = Child::node(0);
        let mut pending = vec![(set, None)];
        while let Some((set, place)) = pending.pop() {
            let child = match set.children(top) {
                Err(Numbers(numbers, count)) => {
                    self.leaves.push(numbers);
                    Child::leaf(self.leaves.len() - 1, count)
                }
                Ok(children) => {
                    let index = self.nodes.len();
                    self.nodes.push(Node::new(children.iter().map(|child| child.hull().tree_box())));
                    pending.extend(children.into_iter().enumerate().rev().map(|(i, child)| (child, Some((index, i)))));
                    Child::node(index)
                }
            };
            match place {
                None => root = child,
                Some((parent, i)) => self.nodes[parent].children[i] = child,
            }
        }
        root
    }
}

fn numbers(items: &[Item]) -> Numbers {
    let mut numbers = [NONE; WIDTH];
    for (number, item) in numbers.iter_mut().zip(items) {
        *number = item.number();
    }
    Numbers(numbers, items.len().min(WIDTH))
}

/// The upper part of the tree.
enum Limb {
    Part(Part, Child),
    Node(Box<Node>, Vec<Limb>),
}

/// All that is below a set, in parallel.
fn grow(set: Set<'_, '_>, top: &Top) -> Limb {
    let mut part = Part::of(set.len(top).min(ALONE));
    if set.len(top) <= ALONE {
        let root = part.add(set, top);
        return Limb::Part(part, root);
    }
    match set.children(top) {
        Ok(children) => {
            let node = Node::new(children.iter().map(|child| child.hull().tree_box()));
            let children: Vec<_> = children.into_iter().collect();
            Limb::Node(Box::new(node), children.into_par_iter().map(|child| grow(child, top)).collect())
        }
        Err(Numbers(numbers, count)) => {
            part.leaves.push(numbers);
            Limb::Part(part, Child::leaf(0, count))
        }
    }
}

/// Nodes that get their places in the tree.
struct Piece {
    /// The place of the first.
    first: usize,
    /// By how much the numbers of their children grow: those of nodes, those of leaves.
    shift: [usize; 2],
    nodes: Vec<Node>,
}

/// The pieces of a tree in order.
#[derive(Default)]
struct Pieces {
    pieces: Vec<Piece>,
    nodes: usize,
    leaves: Vec<[u32; WIDTH]>,
}

impl Pieces {
    fn add(&mut self, limb: Limb) -> Child {
        let first = self.nodes;
        match limb {
            Limb::Part(part, root) => {
                let shift = [first, self.leaves.len()];
                self.nodes += part.nodes.len();
                self.leaves.extend(part.leaves);
                if !part.nodes.is_empty() {
                    self.pieces.push(Piece { first, shift, nodes: part.nodes });
                }
                root.shifted(shift)
            }
            Limb::Node(mut node, limbs) => {
                self.nodes += 1;
                let piece = self.pieces.len();
                self.pieces.push(Piece { first, shift: [0, 0], nodes: Vec::new() });
                for (child, limb) in node.children.iter_mut().zip(limbs) {
                    *child = self.add(limb);
                }
                self.pieces[piece].nodes = vec![*node];
                Child::node(first)
            }
        }
    }

    fn node(&self, i: usize) -> Node {
        let Piece { first, shift, nodes } = &self.pieces[self.pieces.partition_point(|piece| piece.first <= i) - 1];
        let mut node = nodes[i - first];
        for child in &mut node.children {
            *child = child.shifted(*shift);
        }
        node
    }
}

impl Tree {
    /// The tree over triangles in this space.
    pub(super) fn build(triangles: &[Triangle], space: TreeSpace) -> Self {
        if triangles.len() >= TOO_MANY {
            return Self::without_nodes(triangles);
        }
        if triangles.is_empty() {
            return Self::without_nodes(&[]);
        }
        // There are fewer than 2²⁹.
        #[allow(clippy::cast_possible_truncation, reason = "there are fewer than 2^29")]
        let item = |i: usize| Item::new(space.padded_box(&triangles[i]), i as u32);
        let mut items = Table::new(triangles.len(), item);
        let hull = Hull::of(&items);
        let bunch = items.len() / BUNCHES;
        let division = divide_large(&mut items, 0, bunch.max(1));
        let (top, mut bunches) = Top::new(&mut items, hull, division);
        let limb = grow(top.set(0, &mut bunches), &top);
        drop(bunches);
        drop(items);
        let mut pieces = Pieces::default();
        let root = Some(pieces.add(limb));
        let nodes = Table::new(pieces.nodes, |i| pieces.node(i));
        let Pieces { leaves, pieces, .. } = pieces;
        drop(pieces);
        let leaves = Table::new(leaves.len(), |i| Leaf::new(triangles, used(&leaves[i])));
        Self { root, nodes, leaves }
    }
}

/// The numbers that are those of triangles.
fn used(numbers: &[u32; WIDTH]) -> &[u32] {
    &numbers[..numbers.iter().take_while(|&&number| number != NONE).count()]
}

#[cfg(test)]
mod tests;
