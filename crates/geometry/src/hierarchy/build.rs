//! Building the tree: from the top, in parallel.
//!
//! *Idea:* a set of triangles is divided in two where the surface area heuristic says so, by cells of a grid as long as it is large ([`grid`](super::grid)), then
//! by slices ([`slices`](super::slices)). The upper part of that tree is rearranged ([`reinsert`]). Which divisions make
//! one node of eight children is a second question: the child with the largest surface is opened first. Sets of up to
//! four triangles become a leaf, or several, whichever is cheapest of all possibilities.
//!
//! *Guarantee:* the tree is the same for any number of threads. Triangles are counted in parallel, but sums of counts and
//! unions of boxes do not depend on their order, and all else depends on one set alone.
//!
//! *Cost:* O(n log n) time for every input. A set that more than [`UNEVEN`](super::slices::UNEVEN) uneven divisions led to is divided in the
//! middle, and so are equal centres. So a path has no more than 17 + log n / log 8⁄7 divisions, and each looks at each
//! of its triangles a fixed number of times. Rearranging takes bounded work.
//! While it is built the tree takes 64 bytes a triangle for boxes, and a third of its own size.
//!
//! *Limits:* as for [`layout`](super::layout). Where coordinates are not finite, so are boxes; the build ends all the
//! same.

use rayon::prelude::*;
use smallvec::SmallVec;

use super::{
    divide::{Bunch, Divided, Large},
    layout::{CHILDREN, Child, Leaf, NONE, Node, TOO_MANY, Tree, WIDTH},
    reinsert::{Branch, low_bits, reinsert},
    slices::{ALONE, Hull, Item, count_uneven, divide},
    space::TreeSpace,
    table::Table,
};
use crate::Triangle;

/// What a division costs a ray that comes into it, beside a leaf: a wide node takes the place of several. With more,
/// two walls of a room become one leaf whose box is the room (`docs/performance.md`).
const NODE_COST: f32 = 0.3;

/// The tree is divided into some tens of thousands of bunches of as many triangles, which are then arranged anew.
const BUNCHES: usize = 1 << 14;

/// A bunch has so many triangles, or fewer: to arrange single ones anew takes half of the build of a small scene and saves a query 1 %.
const BUNCH: usize = 8;

/// Into so many parts a large tree is divided for threads. Above them no set of triangles is opened.
const TASKS: usize = 64;

/// So many of the bunches, those with the largest surfaces, are divided down to single triangles before they are arranged.
const LARGEST: usize = 256;

/// The cheapest way to make leaves of up to four triangles.
struct FewLeaves {
    /// The cost of each subset (a bit for each item), in surfaces of leaves that a ray comes into.
    costs: [f32; 1 << WIDTH],
    /// The lower side of the cheapest division of each, 0 if it is a leaf.
    divisions: [u8; 1 << WIDTH],
    hulls: [Hull; 1 << WIDTH],
}

#[allow(clippy::cast_possible_truncation, reason = "there are four items")]
fn bits(set: usize) -> u8 {
    set as u8
}

impl FewLeaves {
    fn new(items: &[Item]) -> Self {
        let mut few = Self { costs: [0.0; 1 << WIDTH], divisions: [0; 1 << WIDTH], hulls: [Hull::EMPTY; 1 << WIDTH] };
        for set in 1..1_usize << items.len().min(WIDTH) {
            let rest = set & (set - 1);
            let first = &items[set.trailing_zeros() as usize];
            few.hulls[set] = few.hulls[rest].with(first.min, first.max);
            let area = few.hulls[set].area();
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

/// The upper part of the binary tree, down to sets of a few triangles.
struct Top {
    branches: Vec<Branch>,
    /// How many bunches are below each branch, and how many triangles.
    below: Vec<(usize, usize)>,
    /// Sets up to this size are built by one thread.
    alone: usize,
}

impl Top {
    /// A tree made cheaper, and its bunches in the order of the tree.
    fn new(divided: Divided<'_>) -> (Self, Vec<Bunch<'_>>) {
        let Divided { mut branches, bunches } = divided;
        let mut bunches: Vec<_> = bunches.into_iter().map(Some).collect();
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
        let alone = ALONE.max(below[0].1 / TASKS);
        (Self { branches, below, alone }, sorted)
    }
}

/// A node of the lower part of the binary tree.
#[derive(Clone, Copy)]
struct Twig {
    hull: Hull,
    /// Half the surface of the hull.
    area: f32,
    /// The first of two children that lie side by side, or a leaf.
    first: u32,
    /// How many triangles a leaf has, else 0.
    count: u32,
}

/// A part of the tree, numbered by itself.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    /// The triangles of each leaf.
    leaves: Vec<[u32; WIDTH]>,
}

/// A part that is built, and what it is made from.
struct Builder<'a> {
    part: Part,
    twigs: &'a mut Vec<Twig>,
}

impl<'a> Builder<'a> {
    /// All that is below a branch with these bunches.
    fn build(branch: usize, bunches: &mut [Bunch<'_>], top: &Top, twigs: &'a mut Vec<Twig>) -> (Part, Child) {
        // With room for what so many triangles become, as a rule.
        let n = top.below[branch].1;
        let part = Part { nodes: Vec::with_capacity(n / 8), leaves: Vec::with_capacity(n / 2) };
        twigs.clear();
        twigs.push(Twig { hull: top.branches[branch].hull, area: 0.0, first: 0, count: 0 });
        let mut builder = Self { part, twigs };
        let mut bunches = bunches.iter_mut();
        let mut pending = vec![(branch, 0)];
        while let Some((branch, at)) = pending.pop() {
            let Branch { first, .. } = top.branches[branch];
            let (sets, triangles) = top.below[branch];
            if triangles <= WIDTH {
                let mut items: SmallVec<[Item; WIDTH]> = SmallVec::new();
                bunches.by_ref().take(sets).for_each(|bunch| items.extend_from_slice(bunch.items));
                builder.add_few(at, &items);
            } else if first == 0 {
                if let Some(Bunch { items, uneven, .. }) = bunches.next() {
                    builder.add_items(at, items, *uneven);
                }
            } else {
                let first = first as usize;
                let below = builder.add_two(at, [first, first + 1].map(|i| top.branches[i].hull));
                pending.extend([(first + 1, below + 1), (first, below)]);
            }
        }
        let root = builder.collapse();
        (builder.part, root)
    }

    /// Gives a twig two children and returns the place of the first.
    #[inline(always)]
    fn add_two(&mut self, at: usize, hulls: [Hull; 2]) -> usize {
        let first = self.twigs.len();
        self.twigs[at].first = low_bits(first);
        self.twigs.extend(hulls.map(|hull| Twig { hull, area: hull.area(), first: 0, count: 0 }));
        first
    }

    /// Divides a set of triangles down to leaves.
    fn add_items(&mut self, at: usize, items: &mut [Item], uneven: u32) {
        let mut pending: SmallVec<[_; 64]> = SmallVec::new();
        pending.push((at, items, uneven));
        while let Some((at, items, uneven)) = pending.pop() {
            if items.len() <= WIDTH {
                self.add_few(at, items);
                continue;
            }
            let (lower, hulls) = divide(items, uneven);
            let uneven = count_uneven(uneven, lower, items.len());
            let first = self.add_two(at, hulls);
            let (a, b) = items.split_at_mut(lower);
            pending.extend([(first + 1, b, uneven), (first, a, uneven)]);
        }
    }

    /// Makes up to four triangles leaves.
    fn add_few(&mut self, at: usize, items: &[Item]) {
        let area = self.twigs[at].hull.area();
        let (mut least, mut most) = (f32::INFINITY, 0.0_f32);
        for item in items {
            let area = Hull { min: item.min, max: item.max }.area();
            (least, most) = (least.min(area), most.max(area));
        }
        // Of several leaves one holds the largest triangle and another one holds one.
        if items.len() < 2 || NODE_COST * area + most + least >= area {
            return self.add_leaf(at, items.iter());
        }
        let few = FewLeaves::new(items);
        let mut pending: SmallVec<[_; WIDTH]> = SmallVec::new();
        pending.push((at, (1 << items.len()) - 1));
        while let Some((at, set)) = pending.pop() {
            let lower = usize::from(few.divisions[set]);
            if lower == 0 {
                self.add_leaf(at, items.iter().enumerate().filter(|(i, _)| set >> i & 1 == 1).map(|(_, item)| item));
            } else {
                let first = self.add_two(at, [few.hulls[lower], few.hulls[set ^ lower]]);
                pending.extend([(first + 1, set ^ lower), (first, lower)]);
            }
        }
    }

    #[inline(always)]
    fn add_leaf<'b>(&mut self, at: usize, items: impl Iterator<Item = &'b Item>) {
        let mut numbers = [NONE; WIDTH];
        let mut count = 0;
        for (number, item) in numbers.iter_mut().zip(items) {
            *number = item.number();
            count += 1;
        }
        (self.twigs[at].first, self.twigs[at].count) = (low_bits(self.part.leaves.len()), count);
        self.part.leaves.push(numbers);
    }

    /// Makes the twigs wide nodes. Depth first, so that what is near in space is near in memory, and without recursion.
    fn collapse(&mut self) -> Child {
        let mut root = Child::node(0);
        let mut pending: SmallVec<[_; 64]> = SmallVec::new();
        pending.push((0, None));
        while let Some((i, place)) = pending.pop() {
            let Twig { first, count, .. } = self.twigs[i];
            let child = if count > 0 {
                Child::leaf(first as usize, count as usize)
            } else {
                let index = self.part.nodes.len();
                let twigs = &*self.twigs;
                let children = widen(i, |i| {
                    let Twig { area, first, count, .. } = twigs[i];
                    (area, (count == 0).then_some(first as usize))
                });
                self.part.nodes.push(Node::EMPTY);
                let node = &mut self.part.nodes[index];
                children.iter().enumerate().for_each(|(k, &i)| node.set_box(k, twigs[i].hull.tree_box()));
                pending.extend(children.iter().enumerate().rev().map(|(k, &i)| (i, Some((index, k)))));
                Child::node(index)
            };
            match place {
                None => root = child,
                Some((parent, k)) => self.part.nodes[parent].children[k] = child,
            }
        }
        root
    }
}

/// The up to eight children of a wide node in the place of a binary one, in order: the one with the largest surface is opened first. `look`
/// says the surface of each, and the first of its two children, which lie side by side.
#[inline(always)]
fn widen(root: usize, look: impl Fn(usize) -> (f32, Option<usize>)) -> SmallVec<[usize; CHILDREN]> {
    let mut children = [root; CHILDREN];
    // Of those that can be opened.
    let mut areas = [f32::NEG_INFINITY; CHILDREN];
    let mut below = [look(root).1.unwrap_or(root); CHILDREN];
    let (mut n, mut i) = (1, 0);
    loop {
        let first = below[i];
        children.copy_within(i..n, i + 1);
        areas.copy_within(i..n, i + 1);
        below.copy_within(i..n, i + 1);
        for (place, child) in [(i, first), (i + 1, first + 1)] {
            let (area, first) = look(child);
            children[place] = child;
            (areas[place], below[place]) = first.map_or((f32::NEG_INFINITY, 0), |first| (area, first));
        }
        n += 1;
        let mut largest = f32::NEG_INFINITY;
        for (k, &area) in areas[..n].iter().enumerate() {
            if area > largest {
                (largest, i) = (area, k);
            }
        }
        if n == CHILDREN || largest == f32::NEG_INFINITY {
            return SmallVec::from_slice(&children[..n]);
        }
    }
}

/// The upper part of the tree, parents first: nodes with so many children, and parts.
enum Limb {
    Node(Box<Node>, usize),
    Part,
}

/// A part that is to be built: a branch and its bunches.
type Task<'a, 'b> = (usize, &'a mut [Bunch<'b>]);

/// Makes wide nodes below a branch down to parts that a thread builds alone.
fn grow<'a, 'b>(top: &Top, all: &'a mut [Bunch<'b>]) -> (Vec<Limb>, Vec<Task<'a, 'b>>) {
    let (mut limbs, mut tasks) = (Vec::new(), Vec::new());
    let mut pending = vec![(0, all)];
    while let Some((branch, bunches)) = pending.pop() {
        let whole = |i: usize| top.branches[i].first == 0 || top.below[i].1 <= WIDTH;
        if top.below[branch].1 <= top.alone || whole(branch) {
            limbs.push(Limb::Part);
            tasks.push((branch, bunches));
            continue;
        }
        let children = widen(branch, |i| {
            let Branch { area, first, .. } = top.branches[i];
            (area, (!whole(i)).then_some(first as usize))
        });
        let node = Node::new(children.iter().map(|&i| top.branches[i].hull.tree_box()));
        limbs.push(Limb::Node(Box::new(node), children.len()));
        // Bunches are in the order of the tree, and so are children.
        let (mut rest, start) = (bunches, pending.len());
        for i in children {
            let (set, others) = std::mem::take(&mut rest).split_at_mut(top.below[i].0);
            pending.push((i, set));
            rest = others;
        }
        pending[start..].reverse();
    }
    (limbs, tasks)
}

/// Nodes and leaves that get their places in the tree.
struct Piece {
    /// By how much the numbers of children grow: those of nodes, those of leaves.
    shift: [usize; 2],
    part: Part,
}

/// The pieces of a tree in order.
#[derive(Default)]
struct Pieces {
    pieces: Vec<Piece>,
    nodes: usize,
    leaves: usize,
}

impl Pieces {
    /// Adds the next of `limbs` with all that is below it.
    fn add(
        &mut self,
        limbs: &mut impl Iterator<Item = Limb>,
        parts: &mut impl Iterator<Item = (Part, Child)>,
    ) -> Child {
        match limbs.next() {
            Some(Limb::Node(mut node, children)) => {
                let (first, piece) = (self.nodes, self.pieces.len());
                self.nodes += 1;
                self.pieces.push(Piece { shift: [0, 0], part: Part::default() });
                for child in node.children.iter_mut().take(children) {
                    *child = self.add(limbs, parts);
                }
                self.pieces[piece].part.nodes = vec![*node];
                Child::node(first)
            }
            _ => {
                let (part, root) = parts.next().unwrap_or((Part::default(), Child::node(0)));
                let shift = [self.nodes, self.leaves];
                self.nodes += part.nodes.len();
                self.leaves += part.leaves.len();
                self.pieces.push(Piece { shift, part });
                root.shifted(shift)
            }
        }
    }

    /// The nodes and leaves, in their places.
    fn put_together(self, triangles: &[Triangle]) -> (Table<Node>, Table<Leaf>) {
        let (mut nodes, mut leaves) = (Table::zeroed(self.nodes), Table::zeroed(self.leaves));
        let (mut rest_nodes, mut rest_leaves): (&mut [Node], &mut [Leaf]) = (&mut nodes, &mut leaves);
        let mut places = Vec::with_capacity(self.pieces.len());
        for Piece { shift, part } in self.pieces {
            let (nodes, other_nodes) = std::mem::take(&mut rest_nodes).split_at_mut(part.nodes.len());
            let (leaves, other_leaves) = std::mem::take(&mut rest_leaves).split_at_mut(part.leaves.len());
            (rest_nodes, rest_leaves) = (other_nodes, other_leaves);
            places.push((shift, part, nodes, leaves));
        }
        places.into_par_iter().for_each(|(shift, part, nodes, leaves)| {
            for (place, node) in nodes.iter_mut().zip(&part.nodes) {
                *place = *node;
                place.children = node.children.map(|child| child.shifted(shift));
            }
            Leaf::fill(leaves, triangles, &part.leaves);
        });
        (nodes, leaves)
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
        let mut spare = Table::zeroed(triangles.len());
        let most = (items.len() / BUNCHES).max(BUNCH);
        let hull = Hull::of(&items);
        let set = Large { bunch: Bunch { items: &mut items, hull, uneven: 0 }, spare: &mut spare };
        let mut divided = Divided::new(set, most);
        divided.divide_largest(LARGEST);
        let (top, mut bunches) = Top::new(divided);
        let (limbs, tasks) = grow(&top, &mut bunches);
        // The twigs of one part after the other lie in the same memory.
        let parts =
            tasks.into_par_iter().map_init(Vec::new, |twigs, (i, bunches)| Builder::build(i, bunches, &top, twigs));
        let parts: Vec<_> = parts.collect();
        drop(bunches);
        drop((top, items, spare));
        let mut pieces = Pieces::default();
        let root = Some(pieces.add(&mut limbs.into_iter(), &mut parts.into_iter()));
        let (nodes, leaves) = pieces.put_together(triangles);
        Self { root, nodes, leaves }
    }
}

#[cfg(test)]
mod tests;
