//! Dividing a large set by many planes at once.
//!
//! *Idea:* each division looks at all of its triangles twice and moves them, and a million of triangles is twenty divisions deep. Here
//! triangles are put into the cells of a grid, each with the box around what it holds. Then cells are divided, in place of triangles, by
//! the surface area heuristic between planes of the grid, as long as a set is some cells wide. That decides several levels of the tree; the triangles are moved once.
//!
//! *Guarantee:* the same for any number of threads: sums of counts and unions of boxes do not depend on their order, and triangles stay in theirs within a set.
//!
//! *Cost:* each triangle is looked at three times and moved once, or twice by several threads. There are no more cells than a quarter of the triangles, and paths of divisions are bounded as for [`divide`](super::slices::divide).

use glam::Vec4;
use rayon::prelude::*;

use super::{
    reinsert::{Branch, low_bits},
    slices::{Hull, Item, Slices, TOGETHER, UNEVEN, count_uneven, partition_by},
};

/// Most cells along an axis.
const MOST: usize = 64;

/// Most cells.
const CELLS: usize = 1 << 15;

/// Triangles for each cell, if they were all occupied.
const PER_CELL: usize = 4;

/// A set of fewer cells along each axis is divided no further.
const NARROW: usize = 6;

/// Most parts of a set that are counted by themselves.
const PARTS: usize = 32;

/// Cells of equal size, in twice the coordinates of the tree, as centres are.
struct Grid {
    lower: Vec4,
    scale: Vec4,
    sides: [usize; 3],
}

impl Grid {
    /// For so many triangles. `None` if their centres are equal or not finite.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "small numbers"
    )]
    fn new(centres: Hull, triangles: usize) -> Option<Self> {
        let extent = (centres.max - centres.min).with_w(0.0);
        let longest = extent.max_element();
        if !(extent.is_finite() && longest > f32::MIN_POSITIVE * 1e6) {
            return None;
        }
        let most = (triangles / PER_CELL).min(CELLS);
        let mut side = longest / MOST as f32;
        let sides = loop {
            let sides = [extent.x, extent.y, extent.z].map(|e| ((e / side) as usize + 1).min(MOST));
            if sides[0] * sides[1] * sides[2] <= most || side > longest {
                break sides;
            }
            side *= 1.25;
        };
        let scale = Vec4::new(sides[0] as f32 - 0.01, sides[1] as f32 - 0.01, sides[2] as f32 - 0.01, 0.0) / extent;
        let flat = !(extent.cmpgt(Vec4::ZERO) & scale.cmplt(Vec4::INFINITY));
        Some(Self { lower: centres.min, scale: Vec4::select(flat, Vec4::ZERO, scale), sides })
    }

    fn cells(&self) -> usize {
        self.sides[0] * self.sides[1] * self.sides[2]
    }

    /// The cell of an item, rounded as by [`Slicing::slices`](super::slices::Slicing::slices).
    #[inline(always)]
    fn cell(&self, item: &Item) -> usize {
        let v = ((item.centre() - self.lower) * self.scale - 0.5) + 12_582_912.0;
        let [x, y, z] = [v.x, v.y, v.z].map(|x| x.to_bits() as usize & (MOST - 1));
        let [sx, sy, sz] = self.sides;
        (z.min(sz - 1) * sy + y.min(sy - 1)) * sx + x.min(sx - 1)
    }

    #[allow(clippy::cast_possible_truncation, reason = "less than `MOST`")]
    fn place(&self, cell: usize) -> [u8; 3] {
        let [sx, sy, _] = self.sides;
        [cell % sx, cell / sx % sy, cell / (sx * sy)].map(|x| x as u8)
    }
}

/// What the cells hold, each.
struct Contents {
    hulls: Vec<Hull>,
    counts: Vec<u32>,
}

impl Contents {
    fn of(items: &[Item], grid: &Grid) -> Self {
        let mut all = Self { hulls: vec![Hull::EMPTY; grid.cells()], counts: vec![0; grid.cells()] };
        for item in items {
            let cell = grid.cell(item);
            all.hulls[cell] = all.hulls[cell].with(item.min, item.max);
            all.counts[cell] += 1;
        }
        all
    }
}

/// A cell that holds something.
#[derive(Clone, Copy)]
struct Cell {
    hull: Hull,
    count: u32,
    place: [u8; 3],
    index: u32,
}

/// A set of cells that is divided no further here.
pub(super) struct End {
    pub(super) hull: Hull,
    pub(super) count: usize,
    pub(super) uneven: u32,
}

/// How a set is divided.
pub(super) struct Parts {
    /// A tree whose leaves are numbers of ends.
    pub(super) branches: Vec<Branch>,
    /// In the order of their triangles.
    pub(super) ends: Vec<End>,
    /// Whether the triangles are in the spare place now.
    pub(super) moved: bool,
}

impl Parts {
    /// Two, of which the first has so many of all triangles.
    pub(super) fn two(hull: Hull, hulls: [Hull; 2], lower: usize, all: usize, uneven: u32) -> Self {
        let [a, b] = hulls;
        let root = Branch { first: 1, ..Branch::new(hull, 0) };
        Self {
            branches: vec![root, Branch::new(a, 0), Branch { leaf: 1, ..Branch::new(b, 0) }],
            ends: vec![End { hull: a, count: lower, uneven }, End { hull: b, count: all - lower, uneven }],
            moved: false,
        }
    }
}

/// Divides a set, down to sets of a few cells or of no more than `bunch` triangles. `spare` is as long as `items`. `None` if that does not divide it.
pub(super) fn divide_by_grid(
    items: &mut [Item],
    spare: &mut [Item],
    hull: Hull,
    uneven: u32,
    bunch: usize,
) -> Option<Parts> {
    let grid = Grid::new(Hull::of_centres(items), items.len())?;
    let part = if items.len() < TOGETHER { items.len() } else { items.len().div_ceil(PARTS).max(TOGETHER / 4) };
    let contents: Vec<Contents> = if part == items.len() {
        vec![Contents::of(items, &grid)]
    } else {
        items.par_chunks(part).map(|part| Contents::of(part, &grid)).collect()
    };
    let mut cells = Vec::new();
    for i in 0..grid.cells() {
        let count = contents.iter().map(|part| part.counts[i]).sum();
        if count > 0 {
            let hull = contents.iter().fold(Hull::EMPTY, |hull, part| hull.union(part.hulls[i]));
            cells.push(Cell { hull, count, place: grid.place(i), index: low_bits(i) });
        }
    }
    let (branches, ends, ends_of_cells) = divide_cells(&mut cells, hull, uneven, bunch, &grid);
    if ends.len() < 2 {
        return None;
    }
    let end = |item: &Item| ends_of_cells[grid.cell(item)] as usize;
    if let [_] = contents[..] {
        let mut places = starts(ends.iter().map(|end| end.count));
        sort(items, spare, &mut places, end);
        return Some(Parts { branches, ends, moved: true });
    }
    // Each part is sorted by itself, then each end is gathered from all parts.
    let sorted: Vec<Vec<usize>> = items
        .par_chunks(part)
        .zip(spare.par_chunks_mut(part))
        .zip(&contents)
        .map(|((items, spare), contents)| {
            let mut counts = vec![0; ends.len()];
            for (&count, &end) in contents.counts.iter().zip(&ends_of_cells) {
                counts[end as usize] += count as usize;
            }
            let mut places = starts(counts.into_iter());
            sort(items, spare, &mut places, end);
            places
        })
        .collect();
    let mut rest = items;
    let mut places = Vec::with_capacity(ends.len());
    for end in &ends {
        let (place, other) = std::mem::take(&mut rest).split_at_mut(end.count);
        places.push(place);
        rest = other;
    }
    let spare = &*spare;
    places.into_par_iter().enumerate().for_each(|(end, mut place)| {
        for (part, after) in spare.chunks(part).zip(&sorted) {
            let from = &part[if end == 0 { 0 } else { after[end - 1] }..after[end]];
            let (here, others) = std::mem::take(&mut place).split_at_mut(from.len());
            here.copy_from_slice(from);
            place = others;
        }
    });
    Some(Parts { branches, ends, moved: false })
}

/// Where each of some sets begins that lie one behind the other.
fn starts(counts: impl Iterator<Item = usize>) -> Vec<usize> {
    let sum = |start: &mut usize, count| {
        *start += count;
        Some(*start - count)
    };
    counts.scan(0, sum).collect()
}

/// Copies items to their ends, in the order that they have; each place becomes that behind the end.
fn sort(items: &[Item], to: &mut [Item], places: &mut [usize], end: impl Fn(&Item) -> usize) {
    for item in items {
        let place = &mut places[end(item)];
        to[*place] = *item;
        *place += 1;
    }
}

/// The tree over sets of cells, the sets, and the set of each cell.
fn divide_cells(
    cells: &mut [Cell],
    hull: Hull,
    uneven: u32,
    bunch: usize,
    grid: &Grid,
) -> (Vec<Branch>, Vec<End>, Vec<u32>) {
    let mut branches = vec![Branch::new(hull, 0)];
    let mut ends = Vec::new();
    let mut ends_of_cells = vec![0; grid.cells()];
    let mut pending = vec![(0, cells, hull, uneven)];
    while let Some((i, cells, hull, uneven)) = pending.pop() {
        let count = cells.iter().map(|cell| cell.count as usize).sum();
        let division = if count <= bunch || uneven > UNEVEN { None } else { divide_set(cells) };
        let Some((lower, hulls)) = division else {
            branches[i].leaf = low_bits(ends.len());
            cells.iter().for_each(|cell| ends_of_cells[cell.index as usize] = low_bits(ends.len()));
            ends.push(End { hull, count, uneven });
            continue;
        };
        let first = branches.len();
        branches[i].first = low_bits(first);
        branches.extend(hulls.map(|hull| Branch::new(hull, low_bits(i))));
        let (a, b) = cells.split_at_mut(lower);
        let below = a.iter().map(|cell| cell.count as usize).sum();
        let uneven = count_uneven(uneven, below, count);
        pending.extend([(first + 1, b, hulls[1], uneven), (first, a, hulls[0], uneven)]);
    }
    (branches, ends, ends_of_cells)
}

/// Divides a set of cells in two: how many are on the lower side, which are moved to the front, and the hulls of both.
fn divide_set(cells: &mut [Cell]) -> Option<(usize, [Hull; 2])> {
    let (mut first, mut last) = ([u8::MAX; 3], [0; 3]);
    for cell in &*cells {
        for axis in 0..3 {
            first[axis] = first[axis].min(cell.place[axis]);
            last[axis] = last[axis].max(cell.place[axis]);
        }
    }
    let wide = [0, 1, 2].map(|axis| usize::from(last[axis] - first[axis]) + 1);
    match wide[0].max(wide[1]).max(wide[2]) {
        0..NARROW => None,
        NARROW..=8 => divide_between::<8>(cells, first, wide),
        _ => divide_between::<16>(cells, first, wide),
    }
}

fn divide_between<const N: usize>(cells: &mut [Cell], first: [u8; 3], wide: [usize; 3]) -> Option<(usize, [Hull; 2])> {
    let slice = |cell: &Cell, axis: usize| {
        let i = usize::from(cell.place[axis] - first[axis]);
        if wide[axis] <= N { i } else { i * N / wide[axis] }
    };
    let mut slices = Slices::<N>::EMPTY;
    for cell in &*cells {
        slices.add_set([0, 1, 2].map(|axis| slice(cell, axis) & (N - 1)), cell.hull, cell.count);
    }
    let (axis, last, hulls) = slices.cheapest()?;
    Some((partition_by(cells, |cell| slice(cell, axis) <= last), hulls))
}
