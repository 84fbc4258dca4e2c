//! Building the tree: from the top, in parallel.
//!
//! *Idea:* a set of triangles is divided in two where the surface area heuristic says so. It looks at the planes between a few
//! equal slices of the triangles' centres along each axis (binning, \[Wald2007\]). Which divisions make one node of eight
//! children is a second question: the child with the largest surface is opened first. Sets of up to four triangles become a
//! leaf, or several, whichever is cheapest of all possibilities.
//!
//! *Guarantee:* the tree is the same for any number of threads. Slices are counted in parallel, but sums of counts and
//! unions of boxes do not depend on their order, and all else depends on one set alone.
//!
//! *Cost:* O(n log n) time for every input; 32 bytes a triangle beside the tree. A set whose ancestors were divided too
//! unevenly ([`UNEVEN`]) is divided in the middle. So no path is longer than 16 + log n / log 8⁄7, and
//! each level looks at each triangle a fixed number of times. Equal centres are divided in the middle at once.
//!
//! *Limits:* as for [`layout`](super::layout). Where coordinates are not finite, so are boxes; the build ends all the same.

use glam::{Vec3A, Vec4};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::{
    layout::{CHILDREN, Child, Leaf, NONE, Node, TOO_MANY, Tree, WIDTH},
    space::{TreeBox, TreeSpace},
};
use crate::Triangle;

/// What a division costs a ray that comes into it, beside a leaf: a wide node takes the place of several. With more, two
/// walls of a room become one leaf whose box is the room (`docs/performance.md`).
const NODE_COST: f32 = 0.3;

/// Slices along each axis; a power of two.
const SLICES: usize = 16;

/// How many of the divisions above a set may leave more than seven eighths on one side. One more, and the set
/// is divided in the middle.
const UNEVEN: u32 = 16;

/// Sets up to this size are built by one thread.
const ALONE: usize = 4096;

/// Sets from this size on are looked at by several threads at once.
const TOGETHER: usize = 1 << 16;

/// A triangle's padded box and its number. The number is in `max.w`, see [`Item::new`].
#[derive(Clone, Copy)]
struct Item {
    min: Vec4,
    max: Vec4,
}

impl Item {
    /// With this bit a number below 2²⁹ is that of a finite, normal float. So it may pass through arithmetic in the unused lane.
    const NORMAL: u32 = 1 << 29;

    fn new(TreeBox { min, max }: TreeBox, number: u32) -> Self {
        Self { min: min.extend(0.0), max: max.extend(f32::from_bits(number | Self::NORMAL)) }
    }

    fn number(&self) -> u32 {
        self.max.w.to_bits() & !Self::NORMAL
    }

    /// Twice the centre.
    #[inline(always)]
    fn centre(&self) -> Vec4 {
        self.min + self.max
    }
}

/// A box while it grows; the fourth lane means nothing.
#[derive(Clone, Copy)]
struct Hull {
    min: Vec4,
    max: Vec4,
}

impl Hull {
    const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline(always)]
    fn with(self, min: Vec4, max: Vec4) -> Self {
        Self { min: self.min.min(min), max: self.max.max(max) }
    }

    #[inline(always)]
    fn union(self, other: Self) -> Self {
        self.with(other.min, other.max)
    }

    /// Half the surface; 0 of nothing.
    #[inline(always)]
    fn area(self) -> f32 {
        let e = (self.max - self.min).max(Vec4::ZERO);
        e.x * e.y + e.y * e.z + e.z * e.x
    }

    fn of(items: &[Item]) -> Self {
        gather(items, Self::EMPTY, |hull, item| hull.with(item.min, item.max), Self::union)
    }

    fn of_centres(items: &[Item]) -> Self {
        gather(items, Self::EMPTY, |hull, item| hull.with(item.centre(), item.centre()), Self::union)
    }

    fn tree_box(self) -> TreeBox {
        TreeBox { min: Vec3A::from_vec4(self.min), max: Vec3A::from_vec4(self.max) }
    }
}

/// A fold over items, by several threads if they are many.
fn gather<T: Copy + Send + Sync>(
    items: &[Item],
    start: T,
    fold: impl Fn(T, &Item) -> T + Sync,
    join: impl Fn(T, T) -> T + Sync + Send,
) -> T {
    if items.len() < TOGETHER {
        return items.iter().fold(start, fold);
    }
    items.par_chunks(TOGETHER / 4).map(|part| part.iter().fold(start, &fold)).reduce(|| start, join)
}

/// Slices of the centres' hull along each axis: the box of the triangles in each, and their number.
#[derive(Clone, Copy)]
struct Slices {
    hulls: [[Hull; SLICES]; 3],
    counts: [[u32; SLICES]; 3],
}

/// Which slice a centre is in.
#[derive(Clone, Copy)]
struct Slicing {
    lower: Vec4,
    /// Slices per unit.
    scale: Vec4,
}

impl Slicing {
    #[allow(clippy::cast_precision_loss, reason = "a small number")]
    fn new(centres: Hull) -> Self {
        // Less than one slice more than there are; and no slices along an axis without extent.
        let extent = centres.max - centres.min;
        let scale = Vec4::splat(SLICES as f32 - 0.01) / extent;
        let flat = !(extent.cmpgt(Vec4::ZERO) & scale.cmplt(Vec4::INFINITY));
        Self { lower: centres.min, scale: Vec4::select(flat, Vec4::ZERO, scale) }
    }

    /// The slice along each axis. Adding 1.5·2²³ rounds to a whole number, which are then the last bits: no other conversion is
    /// as cheap, and what is not a number stays within the slices.
    #[inline(always)]
    fn slices(&self, centre: Vec4) -> [usize; 3] {
        let v = ((centre - self.lower) * self.scale - 0.5) + 12_582_912.0;
        [v.x, v.y, v.z].map(|x| x.to_bits() as usize & (SLICES - 1))
    }
}

impl Slices {
    const EMPTY: Self = Self { hulls: [[Hull::EMPTY; SLICES]; 3], counts: [[0; SLICES]; 3] };

    #[inline(always)]
    fn add(&mut self, slicing: &Slicing, item: &Item) {
        for (axis, i) in slicing.slices(item.centre()).into_iter().enumerate() {
            self.hulls[axis][i] = self.hulls[axis][i].with(item.min, item.max);
            self.counts[axis][i] += 1;
        }
    }

    fn union(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            for i in 0..SLICES {
                self.hulls[axis][i] = self.hulls[axis][i].union(other.hulls[axis][i]);
                self.counts[axis][i] += other.counts[axis][i];
            }
        }
        self
    }

    /// Of these items.
    #[inline(never)]
    fn of(items: &[Item], slicing: &Slicing) -> Self {
        let fold = |part: &[Item]| {
            let mut slices = Self::EMPTY;
            part.iter().for_each(|item| slices.add(slicing, item));
            slices
        };
        if items.len() < TOGETHER {
            return fold(items);
        }
        items.par_chunks(TOGETHER / 4).map(fold).reduce(|| Self::EMPTY, |a, b| a.union(&b))
    }

    /// The axis, the last slice on the lower side, the hulls of both sides and how many are on the lower. `None` if all are in one slice.
    #[allow(clippy::cast_precision_loss, reason = "a cost")]
    fn cheapest(&self) -> Option<(usize, usize, [Hull; 2], u32)> {
        let mut best = (f32::INFINITY, None);
        for axis in 0..3 {
            let (hulls, counts) = (&self.hulls[axis], &self.counts[axis]);
            let mut above = [(Hull::EMPTY, 0); SLICES];
            let mut side = (Hull::EMPTY, 0);
            for i in (1..SLICES).rev() {
                side = (side.0.union(hulls[i]), side.1 + counts[i]);
                above[i - 1] = side;
            }
            let mut side = (Hull::EMPTY, 0);
            for i in 0..SLICES - 1 {
                side = (side.0.union(hulls[i]), side.1 + counts[i]);
                let cost = side.0.area() * side.1 as f32 + above[i].0.area() * above[i].1 as f32;
                if side.1 > 0 && above[i].1 > 0 && cost < best.0 {
                    best = (cost, Some((axis, i, [side.0, above[i].0], side.1)));
                }
            }
        }
        best.1
    }
}

/// A set of triangles that is to become a part of the tree.
struct Set<'a> {
    items: &'a mut [Item],
    hull: Hull,
    /// How many divisions above were uneven.
    uneven: u32,
    /// How it is divided, if that is known.
    division: Option<Box<Division>>,
}

/// How a large set was divided; its items are in that order.
struct Division {
    lower: usize,
    hulls: [Hull; 2],
    uneven: u32,
    below: [Option<Box<Division>>; 2],
}

/// Divides a set in two: how many are on the lower side, which are moved to the front, and the hulls of both. At least two items.
fn divide(items: &mut [Item], uneven: u32) -> (usize, [Hull; 2]) {
    let centres = Hull::of_centres(items);
    if uneven <= UNEVEN {
        let slicing = Slicing::new(centres);
        if let Some((axis, last, hulls, count)) = Slices::of(items, &slicing).cheapest() {
            let lower = partition(items, |item| slicing.slices(item.centre())[axis] <= last);
            debug_assert_eq!(lower, count as usize);
            return (lower, hulls);
        }
    }
    // In the middle along the longest axis; equal centres in the order that they have.
    let middle = items.len() / 2;
    let e = centres.max - centres.min;
    let axis = if e.x >= e.y && e.x >= e.z { 0 } else { 1 + usize::from(e.y < e.z) };
    if e[axis] > 0.0 {
        items.select_nth_unstable_by(middle, |a, b| {
            a.centre()[axis].total_cmp(&b.centre()[axis]).then(a.number().cmp(&b.number()))
        });
    }
    let (lower, upper) = items.split_at(middle);
    (middle, [Hull::of(lower), Hull::of(upper)])
}

/// Moves the items that belong to the lower side to the front and counts them.
fn partition(items: &mut [Item], is_lower: impl Fn(&Item) -> bool) -> usize {
    let (mut from, mut to) = (0, items.len());
    loop {
        while from < to && is_lower(&items[from]) {
            from += 1;
        }
        while from < to && !is_lower(&items[to - 1]) {
            to -= 1;
        }
        if from >= to {
            return from;
        }
        items.swap(from, to - 1);
        from += 1;
        to -= 1;
    }
}

/// The count of uneven divisions below a division.
fn count_uneven(uneven: u32, lower: usize, all: usize) -> u32 {
    uneven + u32::from(lower.max(all - lower) > all - all / 8)
}

/// Divides large sets in parallel, down to those that a thread builds alone.
fn divide_large(items: &mut [Item], uneven: u32) -> Option<Box<Division>> {
    if items.len() <= ALONE {
        return None;
    }
    let (lower, hulls) = divide(items, uneven);
    let uneven = count_uneven(uneven, lower, items.len());
    let (a, b) = items.split_at_mut(lower);
    let (a, b) = rayon::join(|| divide_large(a, uneven), || divide_large(b, uneven));
    Some(Box::new(Division { lower, hulls, uneven, below: [a, b] }))
}

/// The cheapest way to make leaves of up to four triangles.
struct FewLeaves {
    /// The cost of each subset (a bit for each item), in surfaces of leaves that a ray comes into.
    costs: [f32; 1 << WIDTH],
    /// The lower side of the cheapest division of each, 0 if it is a leaf.
    divisions: [usize; 1 << WIDTH],
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
                        (few.costs[set], few.divisions[set]) = (cost, lower);
                    }
                }
                lower = (lower - 1) & set;
            }
        }
        few
    }
}

impl<'a> Set<'a> {
    /// Its two parts, or itself if it is a leaf.
    fn open(self) -> Result<[Self; 2], Self> {
        let Self { items, division, uneven, .. } = self;
        let (lower, hulls, uneven, below) = if let Some(division) = division {
            (division.lower, division.hulls, division.uneven, division.below)
        } else if items.len() <= WIDTH {
            let few = FewLeaves::new(items);
            let all = (1 << items.len()) - 1;
            let division = few.divisions[all];
            if division == 0 {
                return Err(Self { items, division: None, uneven, hull: self.hull });
            }
            let mut sorted: SmallVec<[Item; WIDTH]> = SmallVec::new();
            sorted.extend((0..items.len()).filter(|i| division >> i & 1 == 1).map(|i| items[i]));
            let lower = sorted.len();
            sorted.extend((0..items.len()).filter(|i| division >> i & 1 == 0).map(|i| items[i]));
            items.copy_from_slice(&sorted);
            (lower, [Hull::of(&sorted[..lower]), Hull::of(&sorted[lower..])], uneven, [None, None])
        } else {
            let (lower, hulls) = divide(items, uneven);
            (lower, hulls, count_uneven(uneven, lower, items.len()), [None, None])
        };
        let (a, b) = items.split_at_mut(lower);
        let [of_a, of_b] = below;
        Ok([
            Self { items: a, hull: hulls[0], uneven, division: of_a },
            Self { items: b, hull: hulls[1], uneven, division: of_b },
        ])
    }

    /// Up to eight parts: the children of a node. One if it is a leaf.
    fn children(self) -> SmallVec<[(Self, bool); CHILDREN]> {
        // With each whether it is known to be a leaf.
        let mut children: SmallVec<[(Self, bool); CHILDREN]> = SmallVec::new();
        children.push((self, false));
        while children.len() < CHILDREN {
            let open = (0..children.len()).filter(|&i| !children[i].1);
            let area = |i: usize| children[i].0.hull.area();
            let Some(i) = open.max_by(|&i, &j| area(i).total_cmp(&area(j))) else { break };
            match children.swap_remove(i).0.open() {
                Ok(parts) => children.extend(parts.map(|part| {
                    let single = part.items.len() == 1;
                    (part, single)
                })),
                Err(leaf) => children.push((leaf, true)),
            }
        }
        children
    }
}

/// A part of the tree, numbered by itself.
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    /// The triangles of each leaf.
    leaves: Vec<[u32; WIDTH]>,
}

impl Part {
    /// Adds all that is below a set. Depth first, so that what is near in space is near in memory, and without recursion.
    fn add(&mut self, set: Set<'_>) -> Child {
        let mut root = None;
        let mut pending = vec![(set, None)];
        while let Some((set, place)) = pending.pop() {
            let children = set.children();
            let child = if let [(leaf, _)] = &children[..] {
                self.leaves.push(numbers(leaf.items));
                Child::leaf(self.leaves.len() - 1, leaf.items.len())
            } else {
                let index = self.nodes.len();
                self.nodes.push(Node::new(children.iter().map(|(child, _)| child.hull.tree_box())));
                pending.extend(children.into_iter().enumerate().rev().map(|(i, (child, _))| (child, Some((index, i)))));
                Child::node(index)
            };
            match place {
                None => root = Some(child),
                Some((parent, i)) => self.nodes[parent].children[i] = child,
            }
        }
        root.unwrap_or(Child::node(0))
    }
}

/// The numbers of a leaf's triangles.
fn numbers(items: &[Item]) -> [u32; WIDTH] {
    let mut numbers = [NONE; WIDTH];
    for (number, item) in numbers.iter_mut().zip(items) {
        *number = item.number();
    }
    numbers
}

/// The upper part of the tree.
enum Limb {
    Part(Part, Child),
    Node(Box<Node>, Vec<Limb>),
}

/// All that is below a set, in parallel.
fn grow(set: Set<'_>) -> Limb {
    if set.items.len() <= ALONE {
        let mut part = Part::default();
        let root = part.add(set);
        return Limb::Part(part, root);
    }
    let children = set.children();
    let node = Node::new(children.iter().map(|(child, _)| child.hull.tree_box()));
    let children: Vec<_> = children.into_iter().collect();
    Limb::Node(Box::new(node), children.into_par_iter().map(|(child, _)| grow(child)).collect())
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
        let item = |(i, triangle): (usize, &Triangle)| Item::new(space.padded_box(triangle), i as u32);
        let mut items: Vec<Item> = triangles.par_iter().enumerate().map(item).collect();
        let hull = Hull::of(&items);
        let division = divide_large(&mut items, 0);
        let limb = grow(Set { items: &mut items, hull, uneven: 0, division });
        drop(items);
        let mut pieces = Pieces::default();
        let root = Some(pieces.add(limb));
        let nodes = (0..pieces.nodes).into_par_iter().map(|i| pieces.node(i)).collect();
        let Pieces { leaves, pieces, .. } = pieces;
        drop(pieces);
        let leaves = leaves.par_iter().map(|numbers| Leaf::new(triangles, used(numbers))).collect();
        Self { root, nodes, leaves }
    }
}

/// The numbers that are those of triangles.
fn used(numbers: &[u32; WIDTH]) -> &[u32] {
    &numbers[..numbers.iter().take_while(|&&number| number != NONE).count()]
}
