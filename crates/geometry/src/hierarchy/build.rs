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
//! *Cost:* O(n log n) time for every input. A set that more than [`UNEVEN`] uneven divisions led to is divided in the
//! middle, and so are equal centres. So a path has no more than 17 + log n / log 8⁄7 divisions, and each looks at each
//! of its triangles a fixed number of times. The upper branches are then moved, which takes bounded work
//! ([`reinsert`]). While it is built the tree takes 32 bytes a triangle for the boxes and twice its nodes.
//!
//! *Limits:* as for [`layout`](super::layout). Where coordinates are not finite, so are boxes; the build ends all the
//! same.

use glam::{Vec3A, Vec4};
use rayon::prelude::*;
use smallvec::SmallVec;

use super::{
    layout::{CHILDREN, Child, Leaf, NONE, Node, TOO_MANY, Tree, WIDTH},
    reinsert::{Branch, reinsert},
    space::{TreeBox, TreeSpace},
};
use crate::Triangle;

/// What a division costs a ray that comes into it, beside a leaf: a wide node takes the place of several. With more,
/// two walls of a room become one leaf whose box is the room (`docs/performance.md`).
const NODE_COST: f32 = 0.3;

/// How many of the divisions above a set may leave more than seven eighths on one side. One more, and the set
/// is divided in the middle.
const UNEVEN: u32 = 16;

/// Sets up to this size are built by one thread.
const ALONE: usize = 4096;

/// The tree is divided into some tens of thousands of bunches of as many triangles, which are then arranged anew.
const BUNCHES: usize = 1 << 14;

/// Sets from this size on are looked at by several threads at once.
const TOGETHER: usize = 1 << 16;

/// A triangle's padded box and its number. The number is in `max.w`, see [`Item::new`].
#[derive(Clone, Copy)]
struct Item {
    min: Vec4,
    max: Vec4,
}

impl Item {
    /// With this bit a number below 2²⁹ is that of a finite, normal float. So it may pass through arithmetic in the
    /// unused lane.
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
pub(super) struct Hull {
    pub(super) min: Vec4,
    pub(super) max: Vec4,
}

impl Hull {
    const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline(always)]
    fn with(self, min: Vec4, max: Vec4) -> Self {
        Self { min: self.min.min(min), max: self.max.max(max) }
    }

    #[inline(always)]
    pub(super) fn union(self, other: Self) -> Self {
        self.with(other.min, other.max)
    }

    /// Half the surface; 0 of nothing.
    #[inline(always)]
    pub(super) fn area(self) -> f32 {
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

/// `N` slices of the centres' hull along each axis, a power of two: the box of the triangles in each, and their number.
#[derive(Clone, Copy)]
struct Slices<const N: usize> {
    hulls: [[Hull; N]; 3],
    counts: [[u32; N]; 3],
}

/// Which of `N` slices a centre is in.
#[derive(Clone, Copy)]
struct Slicing<const N: usize> {
    lower: Vec4,
    /// Slices per unit.
    scale: Vec4,
}

impl<const N: usize> Slicing<N> {
    #[allow(clippy::cast_precision_loss, reason = "a small number")]
    fn new(centres: Hull) -> Self {
        // Less than one slice more than there are; and no slices along an axis without extent.
        let extent = centres.max - centres.min;
        let scale = Vec4::splat(N as f32 - 0.01) / extent;
        let flat = !(extent.cmpgt(Vec4::ZERO) & scale.cmplt(Vec4::INFINITY));
        Self { lower: centres.min, scale: Vec4::select(flat, Vec4::ZERO, scale) }
    }

    /// The slice along each axis. Adding 1.5·2²³ rounds to a whole number, which are then the last bits: no other
    /// conversion is as cheap, and what is not a number stays within the slices.
    #[inline(always)]
    fn slices(&self, centre: Vec4) -> [usize; 3] {
        let v = ((centre - self.lower) * self.scale - 0.5) + 12_582_912.0;
        [v.x, v.y, v.z].map(|x| x.to_bits() as usize & (N - 1))
    }
}

impl<const N: usize> Slices<N> {
    const EMPTY: Self = Self { hulls: [[Hull::EMPTY; N]; 3], counts: [[0; N]; 3] };

    #[inline(always)]
    fn add(&mut self, slicing: &Slicing<N>, item: &Item) {
        for (axis, i) in slicing.slices(item.centre()).into_iter().enumerate() {
            self.hulls[axis][i] = self.hulls[axis][i].with(item.min, item.max);
            self.counts[axis][i] += 1;
        }
    }

    fn union(mut self, other: &Self) -> Self {
        for axis in 0..3 {
            for i in 0..N {
                self.hulls[axis][i] = self.hulls[axis][i].union(other.hulls[axis][i]);
                self.counts[axis][i] += other.counts[axis][i];
            }
        }
        self
    }

    /// Of these items.
    #[inline(never)]
    fn of(items: &[Item], slicing: &Slicing<N>) -> Self {
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

    /// The axis, the last slice on the lower side, and the hulls of both sides. `None` if all are in one slice.
    #[allow(clippy::cast_precision_loss, reason = "a cost")]
    fn cheapest(&self) -> Option<(usize, usize, [Hull; 2])> {
        let mut best = (f32::INFINITY, None);
        for axis in 0..3 {
            let (hulls, counts) = (&self.hulls[axis], &self.counts[axis]);
            let mut above = [(Hull::EMPTY, 0); N];
            let mut side = (Hull::EMPTY, 0);
            for i in (1..N).rev() {
                side = (side.0.union(hulls[i]), side.1 + counts[i]);
                above[i - 1] = side;
            }
            let mut side = (Hull::EMPTY, 0);
            for i in 0..N - 1 {
                side = (side.0.union(hulls[i]), side.1 + counts[i]);
                let cost = side.0.area() * side.1 as f32 + above[i].0.area() * above[i].1 as f32;
                if side.1 > 0 && above[i].1 > 0 && cost < best.0 {
                    best = (cost, Some((axis, i, [side.0, above[i].0])));
                }
            }
        }
        best.1
    }
}

/// How a large set was divided; its items are in that order.
struct Division {
    lower: usize,
    hulls: [Hull; 2],
    uneven: u32,
    below: [Option<Box<Division>>; 2],
}

/// Divides a set in two: how many are on the lower side, which are moved to the front, and the hulls of both. At least
/// two items.
fn divide(items: &mut [Item], uneven: u32) -> (usize, [Hull; 2]) {
    let centres = Hull::of_centres(items);
    if uneven <= UNEVEN {
        // With few triangles the slices, not the triangles, take the time.
        let cheapest = match items.len() {
            ..=8 => divide_cheapest::<4>(items, centres),
            9..=32 => divide_cheapest::<8>(items, centres),
            _ => divide_cheapest::<16>(items, centres),
        };
        if let Some(division) = cheapest {
            return division;
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

/// The division between two of `N` slices that costs least. `None` if all centres are in one slice.
fn divide_cheapest<const N: usize>(items: &mut [Item], centres: Hull) -> Option<(usize, [Hull; 2])> {
    let slicing = Slicing::<N>::new(centres);
    let (axis, last, hulls) = Slices::of(items, &slicing).cheapest()?;
    Some((partition(items, |item| slicing.slices(item.centre())[axis] <= last), hulls))
}

/// Moves the items that belong to the lower side to the front and counts them. Without a branch, which would be guessed
/// wrongly as often as not.
fn partition(items: &mut [Item], is_lower: impl Fn(&Item) -> bool) -> usize {
    let mut lower = 0;
    for i in 0..items.len() {
        let item = items[i];
        items.swap(i, lower);
        lower += usize::from(is_lower(&item));
    }
    lower
}

/// The count of uneven divisions below a division.
fn count_uneven(uneven: u32, lower: usize, all: usize) -> u32 {
    uneven + u32::from(lower.max(all - lower) > all - all / 8)
}

/// Divides large sets in parallel, down to those that a thread builds alone.
fn divide_large(items: &mut [Item], uneven: u32, bunch: usize) -> Option<Box<Division>> {
    if items.len() <= bunch {
        return None;
    }
    let items_len = items.len();
    let (lower, hulls) = divide(items, uneven);
    let uneven = count_uneven(uneven, lower, items_len);
    let (a, b) = items.split_at_mut(lower);
    let (mut of_a, mut of_b) = (|| divide_large(a, uneven, bunch), || divide_large(b, uneven, bunch));
    let (below_a, below_b) = if items_len > ALONE { rayon::join(of_a, of_b) } else { (of_a(), of_b()) };
    Some(Box::new(Division { lower, hulls, uneven, below: [below_a, below_b] }))
}

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
#[derive(Default)]
struct Part {
    nodes: Vec<Node>,
    /// The triangles of each leaf.
    leaves: Vec<[u32; WIDTH]>,
}

impl Part {
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
    let mut part = Part::default();
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
        let item = |(i, triangle): (usize, &Triangle)| Item::new(space.padded_box(triangle), i as u32);
        let mut items: Vec<Item> = triangles.par_iter().enumerate().map(item).collect();
        let hull = Hull::of(&items);
        let bunch = items.len() / BUNCHES;
        let division = divide_large(&mut items, 0, bunch.max(1));
        let (top, mut bunches) = Top::new(&mut items, hull, division);
        let limb = grow(top.set(0, &mut bunches), &top);
        drop(bunches);
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

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use glam::Vec3;

    use super::*;
    use crate::Bounds;

    fn build(triangles: &[Triangle]) -> Tree {
        Tree::build(triangles, TreeSpace::new(&Bounds::of_triangles(triangles)))
    }

    fn number(i: usize) -> f32 {
        f32::from(u16::try_from(i % 60_000).unwrap_or(0))
    }

    /// Inputs that ruin one builder or another.
    fn hard(n: usize) -> Vec<(&'static str, Vec<Triangle>)> {
        let mut noise = fastrand::Rng::with_seed(9);
        let mut point = |size: f32| Vec3::new(noise.f32() - 0.5, noise.f32() - 0.5, noise.f32() - 0.5) * size;
        let rim = |i: usize| {
            let angle = number(i) * 1e-4;
            Vec3::new(angle.cos(), angle.sin(), 0.3 * (3.0 * angle).sin())
        };
        let corners = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.3), Vec3::new(0.0, 1.0, 0.5)];
        let of =
            |f: &mut dyn FnMut(usize) -> [Vec3; 3]| -> Vec<_> { (0..n).map(|i| Triangle { vertices: f(i) }).collect() };
        vec![
            ("equal", of(&mut |_| corners)),
            ("fan", of(&mut |i| [Vec3::ZERO, rim(i), rim(i + 1)])),
            ("nested", of(&mut |i| corners.map(|v| v * (1.0 + number(i) * 1e-3)))),
            ("nested by powers", of(&mut |i| corners.map(|v| v * 0.999_f32.powf(number(i))))),
            (
                "equal centres",
                of(&mut |_| {
                    let [a, b] = [point(1.0), point(1.0)];
                    [a, b, -(a + b)]
                }),
            ),
            ("on a line", of(&mut |i| [Vec3::X, Vec3::X * 2.0, Vec3::Y].map(|v| v + Vec3::X * number(i)))),
            (
                "huge and tiny",
                of(&mut |i| {
                    let size = 10.0_f32.powf(30.0 - number(i) / number(n - 1) * 60.0);
                    [point(size), point(size), point(size)]
                }),
            ),
            ("without extent", of(&mut |_| [Vec3::ONE; 3])),
            ("not finite", of(&mut |i| [point(1.0), point(1.0), Vec3::splat([f32::NAN, f32::INFINITY, 1.0][i % 3])])),
        ]
    }

    /// The depth of the tree, and whether its boxes hold what is below them.
    fn depth(tree: &Tree, triangles: &[Triangle], space: TreeSpace) -> usize {
        let mut seen = vec![false; triangles.len()];
        let mut deepest = 0;
        let everything = TreeBox { min: Vec3A::NEG_INFINITY, max: Vec3A::INFINITY };
        let mut pending: Vec<_> = tree.root.into_iter().map(|root| (root, everything, 1)).collect();
        while let Some((child, bounds, depth)) = pending.pop() {
            deepest = deepest.max(depth);
            let holds = |b: TreeBox| !b.min.cmplt(bounds.min).any() && !b.max.cmpgt(bounds.max).any();
            if child.triangles() > 0 {
                let leaf = &tree.leaves[child.index()];
                for &number in &leaf.numbers[..child.triangles() as usize] {
                    assert!(!std::mem::replace(&mut seen[number as usize], true), "twice: {number}");
                    assert!(holds(space.padded_box(&triangles[number as usize])) || !bounds.min.is_finite());
                }
                continue;
            }
            let node = &tree.nodes[child.index()];
            for (i, &child) in node.children.iter().enumerate() {
                let side = |upper: usize| {
                    Vec3A::from_array([0, 1, 2].map(|axis| node.planes[axis][upper][i / WIDTH][i % WIDTH]))
                };
                let inner = TreeBox { min: side(0), max: side(1) };
                if inner.min.cmpgt(inner.max).all() {
                    continue;
                }
                assert!(holds(inner));
                pending.push((child, inner, depth + 1));
            }
        }
        assert!(seen.iter().all(|&seen| seen));
        deepest
    }

    /// No input makes a deep tree or takes long: of a hundred thousand triangles a tenth of a second, with a wide
    /// margin here for busy machines. (One after the other, obvhs took 26 s for the fan.)
    #[test]
    fn hard_inputs_take_neither_long_nor_deep_trees() {
        for (name, triangles) in hard(60_000).into_iter().chain([("none", vec![]), ("one", vec![hard(1)[0].1[0]])]) {
            let start = Instant::now();
            let tree = build(&triangles);
            assert!(start.elapsed() < Duration::from_secs(6), "{name}: {:?}", start.elapsed());
            if name != "not finite" {
                let depth = depth(&tree, &triangles, TreeSpace::new(&Bounds::of_triangles(&triangles)));
                assert!(depth <= 40, "{name}: {depth}");
            }
        }
        assert!(build(&vec![hard(1)[0].1[0]; 1_000_000]).nodes.len() < 200_000);
    }

    #[test]
    fn the_tree_does_not_depend_on_the_number_of_threads() {
        let mut noise = fastrand::Rng::with_seed(2);
        let mut point = |size: f32| Vec3::new(noise.f32(), noise.f32(), noise.f32()) * size;
        let mut inputs = hard(10_000);
        let scattered = (0..150_000).map(|_| (point(1.0), point(0.02), point(0.02)));
        inputs.push(("scattered", scattered.map(|(o, a, b)| Triangle::new(o, o + a, o + b)).collect()));
        for (name, triangles) in inputs {
            let trees = [1, 2, 5].map(|threads| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                let tree = pool.install(|| build(&triangles));
                let nodes = tree.nodes.iter().map(|node| {
                    (
                        node.planes.map(|p| p.map(|p| p.map(|v| v.to_array()))),
                        node.children.map(|c| (c.index(), c.triangles())),
                    )
                });
                let nodes: Vec<_> = nodes.collect();
                (format!("{nodes:?}"), tree.leaves.iter().map(|leaf| leaf.numbers).collect::<Vec<_>>())
            });
            assert!(trees[0] == trees[1] && trees[0] == trees[2], "{name}");
        }
    }

    #[test]
    fn few_triangles_become_the_cheapest_leaves() {
        let flat = |z: f32| Triangle::new(Vec3::Z * z, Vec3::X + Vec3::Z * z, Vec3::Y + Vec3::Z * z);
        // Two pairs far apart are two leaves, four together are one.
        assert_eq!(build(&[flat(0.0), flat(9.0), flat(0.01), flat(9.01)]).leaves.len(), 2);
        assert_eq!(build(&[flat(0.0), flat(0.02), flat(0.01), flat(0.03)]).leaves.len(), 1);
    }
}
