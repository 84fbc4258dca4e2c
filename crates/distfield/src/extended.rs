//! Extended safe neighbourhoods, the suffix `-xsn`.
//!
//! *Idea.* What makes a proof is a free cuboid between the two ends. For one light all such cuboids can be found at
//! once, without any distance field.
//!
//! *Definition.* For a box of voxels L, the light's: neigh⁺(L) = { U : the smallest box that holds U and L has no
//! occupied voxel }. For a point light L is one voxel V, and the box that holds U and V is their cuboid: the largest
//! neighbourhood with the free cuboid property (4.4.1 in \[Houska2013\]). For an area light L must hold all of it; its
//! own voxels are occupied by itself, so the occupied set to pass is that of the *other* occluders. If L is partly
//! outside the grid, or an occupied voxel is in it, the set is empty.
//!
//! *Guarantee.* A segment from a point of U to a point of L stays in the box that holds both. It contains the safe
//! neighbourhood of every field with the free cuboid property.
//!
//! *The sweep.* First let L be one voxel V. U is in the set S iff U is free and, for each axis on which U differs from
//! V, its neighbour one step towards V is in S: a voxel W ≠ U of the cuboid of U and V differs from U on some axis,
//! there it is nearer to V, and so it is in the cuboid of that neighbour and V. So S is found by one sweep outwards
//! from V, in any order that visits those neighbours first. Now let L be a box. Merge the columns that L covers on the
//! x axis into one column, its rows and its slices likewise, and call a merged voxel occupied if one of its parts is.
//! The smallest box that holds L and U is then the cuboid of the merged L and the merged U, and it has an occupied
//! voxel iff its merged image has one. So the sweep from one voxel solves it, and all parts of a merged voxel get its
//! answer.
//!
//! *Rows.* Along a row, S begins at L and goes on both ways through free voxels, as far as the rows one step towards L
//! let it: it is one run. So the sweep goes from row to row, intersects two runs and cuts them at the next occupied bit
//! on either side, 64 voxels a word; and S is stored as its runs, which is all there is to know.
//!
//! *Cost.* 8 bytes a row for each light, and one load a query. The build reads each bit of the occupied set at most
//! twice.
//!
//! *Departure.* The thesis scans lanes in two phases, in two dimensions (4.4.1), and sweeps an area light's projections
//! along its normal; the definition here has no normal, so it is the same on both sides of the light.
//!
//! *Limits.* One set per light. A voxel whose cuboid is not free is left open even if all of the light can be seen from
//! it.

use std::{borrow::Cow, ops::RangeInclusive};

use vdf_voxel::{Resolution, Voxel, VoxelSet};

use crate::{FieldError, Neighbourhood, VoxelBox, validate};

/// All voxels whose cuboid with the light is free; see the head of its source file.
#[derive(Clone, Debug)]
pub struct ExtendedNeighbourhood {
    resolution: Resolution,
    light: VoxelBox,
    /// One for each row (·, j, k), at j + k·Y.
    rows: Vec<Run>,
}

/// The voxels of a row from `first` to before `end`; none if `end` is not greater.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    first: u32,
    end: u32,
}

impl ExtendedNeighbourhood {
    /// The extended safe neighbourhood of `light`, among these occupied voxels: all voxels U such that the smallest box
    /// that holds U and `light` has no occupied one. Empty if `light` holds an occupied voxel or one outside the grid.
    /// For an area light pass the voxels of the other occluders.
    #[must_use]
    pub fn new(occupied: &VoxelSet, light: VoxelBox) -> Self {
        let resolution = occupied.resolution();
        let height = resolution.y() as usize;
        let mut rows = vec![Run::EMPTY; height * resolution.z() as usize];
        let at = |j: u32, k: u32| j as usize + height * k as usize;
        let (min, max) = (light.min(), light.max());
        if resolution.contains(max) {
            for (slices, towards_k) in outwards(min.k, max.k, resolution.z()) {
                for (lines, towards_j) in outwards(min.j, max.j, resolution.y()) {
                    let mut run = Run { first: 0, end: resolution.x() };
                    if let Some(k) = towards_k {
                        run = run.intersection(rows[at(*lines.start(), k)]);
                    }
                    if let Some(j) = towards_j {
                        run = run.intersection(rows[at(j, *slices.start())]);
                    }
                    let merged = slices.clone().flat_map(|k| lines.clone().map(move |j| (j, k)));
                    for (j, k) in merged.clone() {
                        if run.is_empty() {
                            break;
                        }
                        run = run.free_around(occupied.row(j, k), min.i, max.i);
                    }
                    merged.for_each(|(j, k)| rows[at(j, k)] = run);
                }
            }
        }
        Self { resolution, light, rows }
    }

    /// The memory of a neighbourhood in such a grid, in bytes; `u64::MAX` if it is more.
    #[must_use]
    pub const fn bytes_of(resolution: Resolution) -> u64 {
        (resolution.row_count() as u64).saturating_mul(size_of::<Run>() as u64)
    }

    #[inline]
    fn run(&self, j: u32, k: u32) -> Run {
        let index = j as usize + self.resolution.y() as usize * k as usize;
        self.rows.get(index).copied().unwrap_or(Run::EMPTY)
    }

    /// The members of the row (·, j, k), as their coordinates i.
    #[inline]
    pub(crate) fn members(&self, j: u32, k: u32) -> std::ops::Range<u32> {
        let Run { first, end } = self.run(j, k);
        first..end
    }

    /// Whether `voxel` must be a member, from the members one step towards the light and the occupied voxels.
    fn expected(&self, occupied: &VoxelSet, voxel: Voxel) -> bool {
        let (min, max) = (self.light.min(), self.light.max());
        if !self.resolution.contains(max) {
            return false;
        }
        // On an axis on which the light covers the voxel: its merged parts, of which the first one answers for all.
        let parts = |c: u32, min: u32, max: u32| if (min..=max).contains(&c) { (min, max) } else { (c, c) };
        let (i, j, k) = (parts(voxel.i, min.i, max.i), parts(voxel.j, min.j, max.j), parts(voxel.k, min.k, max.k));
        let first = Voxel::new(i.0, j.0, k.0);
        if voxel != first {
            return self.proves(first);
        }
        let step = |c: u32, min: u32, max: u32| i64::from(c < min) - i64::from(c > max);
        let steps = [
            [step(voxel.i, min.i, max.i), 0, 0],
            [0, step(voxel.j, min.j, max.j), 0],
            [0, 0, step(voxel.k, min.k, max.k)],
        ];
        let nearer = |step| validate::neighbour(self.resolution, voxel, step).is_some_and(|next| self.proves(next));
        steps.into_iter().filter(|&step| step != [0; 3]).all(nearer)
            && VoxelBox::spanning(first, Voxel::new(i.1, j.1, k.1)).voxels().all(|part| !occupied.contains(part))
    }
}

impl Neighbourhood for ExtendedNeighbourhood {
    #[inline]
    fn proves(&self, voxel: Voxel) -> bool {
        let run = self.run(voxel.j, voxel.k);
        (run.first <= voxel.i) & (voxel.i < run.end) & (voxel.j < self.resolution.y())
    }

    fn voxels(&self) -> Cow<'_, VoxelSet> {
        Cow::Owned(VoxelSet::from_rows(self.resolution, |j, k, row| {
            let run = self.run(j, k);
            for (word, first) in row.iter_mut().zip((0u32..).step_by(64)) {
                let bits = |end: u32| match end.saturating_sub(first) {
                    n @ 0..64 => (1 << n) - 1,
                    _ => u64::MAX,
                };
                *word = bits(run.end) & !bits(run.first);
            }
        }))
    }

    fn count(&self) -> usize {
        self.rows.iter().map(|run| run.end.saturating_sub(run.first) as usize).sum()
    }

    fn bytes(&self) -> usize {
        size_of_val(self.rows.as_slice())
    }

    /// Checks the resolution, that no member is occupied, and for each voxel that it is a member just if its merged
    /// parts are free and its neighbours towards the light are members. By induction outwards from the light that
    /// proves the definition, in time proportional to the number of voxels.
    fn validate(&self, occupied: &VoxelSet) -> Result<(), FieldError> {
        validate::same_resolution(self.resolution, occupied)?;
        let members = self.voxels();
        let wrong = |voxel| Err(FieldError::Member { voxel, expected: false, found: true });
        members.iter().find(|&voxel| occupied.contains(voxel)).map_or(Ok(()), wrong)?;
        validate::for_all(self.resolution, |voxel| {
            let (expected, found) = (self.expected(occupied, voxel), self.proves(voxel));
            if found == expected { Ok(()) } else { Err(FieldError::Member { voxel, expected, found }) }
        })
    }
}

impl Run {
    const EMPTY: Self = Self { first: 0, end: 0 };

    fn is_empty(self) -> bool {
        self.first >= self.end
    }

    fn intersection(self, other: Self) -> Self {
        Self { first: self.first.max(other.first), end: self.end.min(other.end) }
    }

    /// The part of the run that is reached from all of the columns `low` to `high`, which the run must hold, without an
    /// occupied voxel.
    fn free_around(self, occupied: &[u64], low: u32, high: u32) -> Self {
        match last_occupied(occupied, self.first, high) {
            Some(column) if column >= low => Self::EMPTY,
            before => Self {
                first: before.map_or(self.first, |column| column + 1),
                end: first_occupied(occupied, high + 1, self.end).unwrap_or(self.end),
            },
        }
    }
}

/// The coordinates of an axis outwards from `min..=max`, which are one, and for all but these the one before.
pub(crate) fn outwards(min: u32, max: u32, count: u32) -> impl Iterator<Item = (RangeInclusive<u32>, Option<u32>)> {
    let up = (max + 1..count).map(|c| (c..=c, Some(c - 1)));
    let down = (0..min).rev().map(|c| (c..=c, Some(c + 1)));
    std::iter::once((min..=max, None)).chain(up).chain(down)
}

/// The first occupied column from `first` to before `end`.
fn first_occupied(words: &[u64], first: u32, end: u32) -> Option<u32> {
    let mut mask = u64::MAX << (first % 64);
    (first / 64..end.div_ceil(64))
        .zip(words.get((first / 64) as usize..)?)
        .find_map(|(n, word)| {
            let word = word & std::mem::replace(&mut mask, u64::MAX);
            (word != 0).then(|| 64 * n + word.trailing_zeros())
        })
        .filter(|&column| column < end)
}

/// The last occupied column from `first` to `last`, both included.
fn last_occupied(words: &[u64], first: u32, last: u32) -> Option<u32> {
    let mut mask = u64::MAX >> (63 - last % 64);
    (first / 64..=last / 64)
        .rev()
        .zip(words.get(..=(last / 64) as usize)?.iter().rev())
        .find_map(|(n, word)| {
            let word = word & std::mem::replace(&mut mask, u64::MAX);
            (word != 0).then(|| 64 * n + 63 - word.leading_zeros())
        })
        .filter(|&column| column >= first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_moved_end_of_a_run_is_found() {
        let resolution = Resolution::new(70, 5, 4);
        let mut occupied = VoxelSet::new(resolution);
        occupied.extend([Voxel::new(3, 1, 1), Voxel::new(66, 3, 2), Voxel::new(40, 4, 0)]);
        for light in [
            Voxel::new(20, 2, 1).into(),
            Voxel::new(64, 0, 3).into(),
            VoxelBox::spanning(Voxel::new(30, 1, 1), Voxel::new(65, 2, 2)),
            VoxelBox::spanning(Voxel::new(2, 0, 0), Voxel::new(4, 2, 2)),
            VoxelBox::spanning(Voxel::new(2, 0, 0), Voxel::new(4, 2, 4)),
        ] {
            let mut near = ExtendedNeighbourhood::new(&occupied, light);
            assert_eq!(near.validate(&occupied), Ok(()));
            for n in 0..near.rows.len() {
                let run = near.rows[n];
                let changed = [
                    Run { first: run.first + 1, ..run },
                    Run { first: run.first.saturating_sub(1), end: run.end.max(1) },
                    Run { end: run.end + 1, ..run },
                    Run { end: run.end.saturating_sub(1), ..run },
                ];
                for changed in changed.into_iter().filter(|c| c.members() != run.members() && c.end <= resolution.x()) {
                    near.rows[n] = changed;
                    assert!(near.validate(&occupied).is_err(), "{light:?}: row {n} is {changed:?}, not {run:?}");
                }
                near.rows[n] = run;
            }
        }
    }

    impl Run {
        fn members(self) -> Vec<u32> {
            (self.first..self.end).collect()
        }
    }

    #[test]
    fn occupied_columns_at_the_borders_of_words() {
        let bits = |columns: &[u32]| {
            let mut words = [0u64; 3];
            columns.iter().for_each(|c| words[(c / 64) as usize] |= 1 << (c % 64));
            words
        };
        let words = bits(&[0, 63, 64, 127, 128, 191]);
        let columns = [0u32, 63, 64, 127, 128, 191];
        for first in 0..192 {
            for end in 0..=192 {
                let expected = columns.into_iter().find(|c| (first..end).contains(c));
                assert_eq!(first_occupied(&words, first, end), expected, "{first}..{end}");
                if end > 0 {
                    let expected = columns.into_iter().rev().find(|c| (first..end).contains(c));
                    assert_eq!(last_occupied(&words, first, end - 1), expected, "{first}..{end}");
                }
            }
        }
        assert_eq!(first_occupied(&words, 192, 192), None);
    }
}
