//! The upper part of the binary tree: large sets are divided down to bunches.
//!
//! *Guarantee:* the result does not depend on the number of threads.

use rayon::prelude::*;

use super::{
    grid::{Parts, divide_by_grid},
    reinsert::{Branch, low_bits},
    slices::{ALONE, Hull, Item, UNEVEN, count_uneven, divide},
};

/// Sets from this size on are divided by a grid.
const GRID: usize = 512;

/// A set of triangles that is divided only when it is built.
pub(super) struct Bunch<'a> {
    pub(super) items: &'a mut [Item],
    pub(super) hull: Hull,
    /// How many divisions above were uneven.
    pub(super) uneven: u32,
}

/// A set with a place as large.
pub(super) struct Large<'a> {
    pub(super) bunch: Bunch<'a>,
    pub(super) spare: &'a mut [Item],
}

/// A tree whose leaves are numbers of bunches.
#[derive(Default)]
pub(super) struct Divided<'a> {
    pub(super) branches: Vec<Branch>,
    pub(super) bunches: Vec<Bunch<'a>>,
}

impl<'a> Divided<'a> {
    /// Divides a set down to bunches of no more than `most` triangles.
    pub(super) fn new(set: Large<'a>, most: usize) -> Self {
        let mut divided = Self { branches: vec![Branch::new(set.bunch.hull, 0)], bunches: Vec::new() };
        let mut pending = vec![(0, set)];
        while let Some((i, Large { bunch: Bunch { items, hull, uneven }, spare })) = pending.pop() {
            let n = items.len();
            if n <= most {
                divided.branches[i].leaf = low_bits(divided.bunches.len());
                divided.bunches.push(Bunch { items, hull, uneven });
                continue;
            }
            let by_grid = if n >= GRID && uneven <= UNEVEN && spare.len() == n {
                divide_by_grid(items, spare, hull, uneven, most)
            } else {
                None
            };
            let parts = by_grid.unwrap_or_else(|| {
                let (lower, hulls) = divide(items, uneven);
                Parts::two(hull, hulls, lower, n, count_uneven(uneven, lower, n))
            });
            let (mut items, mut spare) = if parts.moved { (spare, items) } else { (items, spare) };
            let mut sets = Vec::with_capacity(parts.ends.len());
            for end in &parts.ends {
                let (here, others) = std::mem::take(&mut items).split_at_mut(end.count);
                let (place, places) =
                    std::mem::take(&mut spare).split_at_mut(if spare.is_empty() { 0 } else { end.count });
                (items, spare) = (others, places);
                sets.push(Large { bunch: Bunch { items: here, hull: end.hull, uneven: end.uneven }, spare: place });
            }
            let places = divided.graft(i, &parts.branches);
            if n > ALONE {
                let parts: Vec<_> = sets.into_par_iter().map(|set| Self::new(set, most)).collect();
                places.into_iter().zip(parts).for_each(|(place, part)| divided.insert(place, part));
            } else {
                pending.extend(places.into_iter().zip(sets).rev());
            }
        }
        divided
    }

    /// Divides the bunches with the largest surfaces down to single triangles, as many as `count`. Large triangles then find their places near the root.
    pub(super) fn divide_largest(&mut self, count: usize) {
        let mut leaves: Vec<usize> = (0..self.branches.len()).filter(|&i| self.branches[i].first == 0).collect();
        let larger = |&i: &usize, &j: &usize| {
            self.branches[j]
                .area
                .total_cmp(&self.branches[i].area)
                .then(self.branches[i].leaf.cmp(&self.branches[j].leaf))
        };
        if count < leaves.len() {
            leaves.select_nth_unstable_by(count, larger);
            leaves.truncate(count);
        }
        leaves.sort_unstable_by(larger);
        for at in leaves {
            let Bunch { items, hull, uneven } = &mut self.bunches[self.branches[at].leaf as usize];
            let (hull, uneven) = (*hull, *uneven);
            let bunch = Bunch { items: std::mem::take(items), hull, uneven };
            self.insert(at, Self::new(Large { bunch, spare: &mut [] }, 1));
        }
    }

    /// Puts a tree with its bunches in the place of a branch.
    fn insert(&mut self, at: usize, tree: Self) {
        let bunches = self.bunches.len();
        for (i, leaf) in self.graft(at, &tree.branches).into_iter().zip(bunches..) {
            self.branches[i].leaf = low_bits(leaf);
        }
        self.bunches.extend(tree.bunches);
    }

    /// Puts a tree in the place of a branch. Returns where its leaves are, in the order of their numbers.
    fn graft(&mut self, at: usize, tree: &[Branch]) -> Vec<usize> {
        // The root takes that place; all others go behind what is there.
        let base = self.branches.len() - 1;
        let place = |i: usize| if i == 0 { at } else { base + i };
        let mut leaves = vec![0; tree.len() / 2 + 1];
        for (i, &branch) in tree.iter().enumerate() {
            let parent = if i == 0 { self.branches[at].parent } else { low_bits(place(branch.parent as usize)) };
            let first = if branch.first == 0 { 0 } else { low_bits(place(branch.first as usize)) };
            let branch = Branch { parent, first, ..branch };
            if branch.first == 0 {
                leaves[branch.leaf as usize] = place(i);
            }
            if i == 0 {
                self.branches[at] = branch;
            } else {
                self.branches.push(branch);
            }
        }
        leaves
    }
}
