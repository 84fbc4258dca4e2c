//! Dividing a set of triangles in two: by the cheapest plane between equal slices of their centres (binning, \[Wald2007\]).
//!
//! *Guarantee:* sums of counts and unions of boxes do not depend on their order, so a division does not depend on threads.
//!
//! *Cost:* each triangle is looked at a fixed number of times. A set that more than [`UNEVEN`] uneven divisions led to is divided in the
//! middle, and so are equal centres.

use bytemuck::{Pod, Zeroable};
use glam::{Vec3A, Vec4};
use rayon::prelude::*;

use super::{layout::WIDTH, space::TreeBox};

/// How many of the divisions above a set may leave more than seven eighths on one side. One more, and the set
/// is divided in the middle.
pub(super) const UNEVEN: u32 = 16;

/// Sets up to this size are built by one thread.
pub(super) const ALONE: usize = 4096;

/// Sets from this size on are looked at by several threads at once.
pub(super) const TOGETHER: usize = 1 << 16;

/// A triangle's padded box and its number. The number is in `max.w`, see [`Item::new`].
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Item {
    pub(super) min: Vec4,
    pub(super) max: Vec4,
}

impl Item {
    /// With this bit a number below 2²⁹ is that of a finite, normal float. So it may pass through arithmetic in the
    /// unused lane.
    pub(super) const NORMAL: u32 = 1 << 29;

    pub(super) fn new(TreeBox { min, max }: TreeBox, number: u32) -> Self {
        Self { min: min.extend(0.0), max: max.extend(f32::from_bits(number | Self::NORMAL)) }
    }

    pub(super) fn number(&self) -> u32 {
        self.max.w.to_bits() & !Self::NORMAL
    }

    /// Twice the centre.
    #[inline(always)]
    pub(super) fn centre(&self) -> Vec4 {
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
    pub(super) const EMPTY: Self = Self { min: Vec4::INFINITY, max: Vec4::NEG_INFINITY };

    #[inline(always)]
    pub(super) fn with(self, min: Vec4, max: Vec4) -> Self {
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

    pub(super) fn of(items: &[Item]) -> Self {
        gather(items, Self::EMPTY, |hull, item| hull.with(item.min, item.max), Self::union)
    }

    pub(super) fn of_centres(items: &[Item]) -> Self {
        gather(items, Self::EMPTY, |hull, item| hull.with(item.centre(), item.centre()), Self::union)
    }

    pub(super) fn tree_box(self) -> TreeBox {
        TreeBox { min: Vec3A::from_vec4(self.min), max: Vec3A::from_vec4(self.max) }
    }
}

/// A fold over items, by several threads if they are many.
pub(super) fn gather<T: Copy + Send + Sync>(
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
pub(super) struct Slices<const N: usize> {
    pub(super) hulls: [[Hull; N]; 3],
    counts: [[u32; N]; 3],
}

/// Which of `N` slices a centre is in.
#[derive(Clone, Copy)]
pub(super) struct Slicing<const N: usize> {
    pub(super) lower: Vec4,
    /// Slices per unit.
    scale: Vec4,
}

impl<const N: usize> Slicing<N> {
    #[allow(clippy::cast_precision_loss, reason = "a small number")]
    pub(super) fn new(centres: Hull) -> Self {
        // Less than one slice more than there are; and no slices along an axis without extent.
        let extent = centres.max - centres.min;
        let scale = Vec4::splat(N as f32 - 0.01) / extent;
        let flat = !(extent.cmpgt(Vec4::ZERO) & scale.cmplt(Vec4::INFINITY));
        Self { lower: centres.min, scale: Vec4::select(flat, Vec4::ZERO, scale) }
    }

    /// The slice along each axis. Adding 1.5·2²³ rounds to a whole number, which are then the last bits: no other
    /// conversion is as cheap, and what is not a number stays within the slices.
    #[inline(always)]
    pub(super) fn slices(&self, centre: Vec4) -> [usize; 3] {
        let v = ((centre - self.lower) * self.scale - 0.5) + 12_582_912.0;
        [v.x, v.y, v.z].map(|x| x.to_bits() as usize & (N - 1))
    }
}

/// Which of `N` slices along one axis a centre is in: the same as [`Slicing::slices`] says.
struct Along<const N: usize> {
    axis: usize,
    lower: f32,
    scale: f32,
}

impl<const N: usize> Slicing<N> {
    fn along(&self, axis: usize) -> Along<N> {
        Along { axis, lower: self.lower[axis], scale: self.scale[axis] }
    }
}

impl<const N: usize> Along<N> {
    #[inline(always)]
    fn slice(&self, item: &Item) -> usize {
        // An axis that is not known before makes a vector go through memory; here it is only an address.
        let [min, max] = bytemuck::cast_ref::<Item, [[f32; 4]; 2]>(item);
        let centre = min[self.axis & 3] + max[self.axis & 3];
        let v = ((centre - self.lower) * self.scale - 0.5) + 12_582_912.0;
        v.to_bits() as usize & (N - 1)
    }
}

impl<const N: usize> Slices<N> {
    pub(super) const EMPTY: Self = Self { hulls: [[Hull::EMPTY; N]; 3], counts: [[0; N]; 3] };

    #[inline(always)]
    pub(super) fn add(&mut self, slicing: &Slicing<N>, item: &Item) {
        for (axis, i) in slicing.slices(item.centre()).into_iter().enumerate() {
            self.hulls[axis][i] = self.hulls[axis][i].with(item.min, item.max);
            self.counts[axis][i] += 1;
        }
    }

    /// Adds a set with this box to a slice of each axis.
    #[inline(always)]
    pub(super) fn add_set(&mut self, slices: [usize; 3], hull: Hull, count: u32) {
        for (axis, i) in slices.into_iter().enumerate() {
            self.hulls[axis][i] = self.hulls[axis][i].union(hull);
            self.counts[axis][i] += count;
        }
    }

    pub(super) fn union(mut self, other: &Self) -> Self {
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
    pub(super) fn of(items: &[Item], slicing: &Slicing<N>) -> Self {
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
    pub(super) fn cheapest(&self) -> Option<(usize, usize, [Hull; 2])> {
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

/// Divides a set in two: how many are on the lower side, which are moved to the front, and the hulls of both. At least
/// two items.
pub(super) fn divide(items: &mut [Item], uneven: u32) -> (usize, [Hull; 2]) {
    let centres = Hull::of_centres(items);
    let e = centres.max - centres.min;
    let longest = if e.x >= e.y && e.x >= e.z { 0 } else { 1 + usize::from(e.y < e.z) };
    if uneven <= UNEVEN {
        // With few triangles the slices, not the triangles, take the time.
        let cheapest = match items.len() {
            0..=FEW => divide_sorted(items, longest),
            9..=64 => divide_cheapest::<8>(items, centres),
            _ => divide_cheapest::<16>(items, centres),
        };
        if let Some(division) = cheapest {
            return division;
        }
    }
    // In the middle along the longest axis; equal centres in the order that they have.
    let middle = items.len() / 2;
    if e[longest] > 0.0 {
        items.select_nth_unstable_by(middle, |a, b| {
            a.centre()[longest].total_cmp(&b.centre()[longest]).then(a.number().cmp(&b.number()))
        });
    }
    let (lower, upper) = items.split_at(middle);
    (middle, [Hull::of(lower), Hull::of(upper)])
}

/// So many items are sorted in place of slices.
const FEW: usize = 8;

/// A sorting network \[Batcher1968\]: exchanges of two places that sort eight.
const EXCHANGES: [(usize, usize); 19] = [
    (0, 1),
    (2, 3),
    (4, 5),
    (6, 7),
    (0, 2),
    (1, 3),
    (4, 6),
    (5, 7),
    (1, 2),
    (5, 6),
    (0, 4),
    (1, 5),
    (2, 6),
    (3, 7),
    (2, 4),
    (3, 5),
    (1, 2),
    (3, 4),
    (5, 6),
];

/// The cheapest division between two of up to eight items in the order of their centres along an axis. `None` if no cost is a number.
#[allow(clippy::cast_precision_loss, reason = "a cost")]
fn divide_sorted(items: &mut [Item], axis: usize) -> Option<(usize, [Hull; 2])> {
    let n = items.len().min(FEW);
    // Numbers in the order of the centres, with the item's place behind; so equal ones stay in order.
    let mut keys = [u64::MAX; FEW];
    for (i, (key, item)) in keys.iter_mut().zip(&*items).enumerate() {
        let [min, max] = bytemuck::cast_ref::<Item, [[f32; 4]; 2]>(item);
        let bits = (min[axis & 3] + max[axis & 3]).to_bits();
        let ordered = bits ^ if bits >> 31 == 1 { u32::MAX } else { 1 << 31 };
        *key = u64::from(ordered) << 32 | i as u64;
    }
    for (a, b) in EXCHANGES {
        (keys[a], keys[b]) = (keys[a].min(keys[b]), keys[a].max(keys[b]));
    }
    let mut sorted = [Item { min: Vec4::ZERO, max: Vec4::ZERO }; FEW];
    for (place, key) in sorted[..n].iter_mut().zip(keys) {
        *place = items[(key & (FEW as u64 - 1)) as usize];
    }
    items[..n].copy_from_slice(&sorted[..n]);
    let mut below = [Hull::EMPTY; FEW + 1];
    for (i, item) in sorted[..n].iter().enumerate() {
        below[i + 1] = below[i].with(item.min, item.max);
    }
    // So few are one leaf or two: to count triangles would make half-empty ones of equal triangles.
    let leaves = |n: usize| n.div_ceil(WIDTH) as f32;
    let mut above = Hull::EMPTY;
    let mut best = (f32::INFINITY, 0, above);
    for i in (1..n).rev() {
        above = above.with(sorted[i].min, sorted[i].max);
        let cost = below[i].area() * leaves(i) + above.area() * leaves(n - i);
        if cost < best.0 {
            best = (cost, i, above);
        }
    }
    let (_, lower, above) = best;
    (lower > 0).then_some((lower, [below[lower], above]))
}

/// The division between two of `N` slices that costs least. `None` if all centres are in one slice.
pub(super) fn divide_cheapest<const N: usize>(items: &mut [Item], centres: Hull) -> Option<(usize, [Hull; 2])> {
    let slicing = Slicing::<N>::new(centres);
    let (axis, last, hulls) = Slices::of(items, &slicing).cheapest()?;
    let along = slicing.along(axis);
    Some((partition_by(items, |item| along.slice(item) <= last), hulls))
}

/// Moves what belongs to the lower side to the front and counts it. Without a branch, which would be guessed
/// wrongly as often as not.
#[inline(always)]
pub(super) fn partition_by<T: Copy>(items: &mut [T], is_lower: impl Fn(&T) -> bool) -> usize {
    let mut lower = 0;
    for i in 0..items.len() {
        let goes = usize::from(is_lower(&items[i]));
        let (item, other) = (items[i], items[lower]);
        items[i] = other;
        items[lower] = item;
        lower += goes;
    }
    lower
}

/// The count of uneven divisions below a division.
pub(super) fn count_uneven(uneven: u32, lower: usize, all: usize) -> u32 {
    uneven + u32::from(lower.max(all - lower) > all - all / 8)
}
