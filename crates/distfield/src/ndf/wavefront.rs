//! Chessboard distances by a wavefront from the occupied voxels (3.5.3 in \[Houska2013\]), 64 voxels at a time.
//!
//! *Idea.* Let R(r) be the set of the voxels within distance r of an occupied one. R(0) is the occupied set. The next
//! one, R(r + 1), is R(r) and all 26 neighbours of its voxels: a dilation along x, y and z, which are shifts and ORs of
//! whole words. Its voxels that are not in R(r) are the shell at distance r + 1, and each is written once.
//!
//! *Threads.* A step reads R(r) and writes R(r + 1), so all its slices are independent.
//!
//! *Cost.* A step looks at all rows, but works only on those that can change: not full, and with a row that changed in
//! the step before among itself and its eight neighbours. In a crowded grid a few steps reach everything. In an empty
//! one there are up to 254, and a row is touched by most of them. Scratch: two sets of voxels and two bytes a row.

use rayon::prelude::*;
use vdf_voxel::VoxelSet;

use crate::rows::{self, FAR};

/// Writes the distance of each voxel to the nearest occupied one, saturated at [`FAR`].
pub(super) fn distances(occupied: &VoxelSet, field: &mut [u8]) {
    let resolution = occupied.resolution();
    let [width, height, _] = resolution.sides().map(|n| n as usize);
    let words = occupied.words_per_row();
    let shape = Shape { width, height, words, last_word: u64::MAX >> ((64 - width % 64) % 64) };

    let mut front = Front::new(resolution.row_count(), words);
    let parts = front.reached.par_chunks_exact_mut(height * words).zip(front.changed.par_chunks_exact_mut(height));
    field.par_chunks_exact_mut(width * height).zip(parts).zip(0..resolution.z()).for_each(|((slice, parts), k)| {
        let (reached, changed) = parts;
        let rows = slice.chunks_exact_mut(width).zip(reached.chunks_exact_mut(words)).zip(changed).zip(0..);
        for (((row, reached), changed), j) in rows {
            let occupied = occupied.row(j, k);
            rows::expand(occupied, row);
            reached.copy_from_slice(occupied);
            *changed = occupied.iter().any(|&word| word != 0);
        }
    });

    let mut next = Front { reached: front.reached.clone(), changed: vec![false; front.changed.len()] };
    let nowhere = vec![0; words];
    for distance in 1..FAR {
        let parts = next.reached.par_chunks_exact_mut(height * words).zip(next.changed.par_chunks_exact_mut(height));
        let any = field
            .par_chunks_exact_mut(width * height)
            .zip(parts)
            .enumerate()
            .map(|(k, (slice, (reached, changed)))| {
                let mut any = false;
                let rows = slice.chunks_exact_mut(width).zip(reached.chunks_exact_mut(words)).zip(changed);
                for (j, ((row, reached), changed)) in rows.enumerate() {
                    *changed = front.step(shape, [j, k], &nowhere, distance, reached, row);
                    any |= *changed;
                }
                any
            })
            .reduce(|| false, |a, b| a | b);
        if !any {
            return;
        }
        std::mem::swap(&mut front, &mut next);
    }
}

/// What a row is.
#[derive(Clone, Copy)]
struct Shape {
    width: usize,
    height: usize,
    words: usize,
    /// The bits of a row's last word that stand for voxels.
    last_word: u64,
}

/// The voxels that were reached so far.
struct Front {
    /// Their bits, row after row.
    reached: Vec<u64>,
    /// For each row whether the last step added to it.
    changed: Vec<bool>,
}

impl Front {
    fn new(rows: usize, words: usize) -> Self {
        Self { reached: vec![0; rows * words], changed: vec![false; rows] }
    }

    /// Writes what the row (j, k) has reached after one more step into `next`, which holds what it had one step ago,
    /// and the new voxels' distances into `row`. True if there are any.
    #[inline]
    fn step(
        &self,
        shape: Shape,
        [j, k]: [usize; 2],
        nowhere: &[u64],
        distance: u8,
        next: &mut [u64],
        row: &mut [u8],
    ) -> bool {
        let Shape { width, height, words, last_word } = shape;
        let here = j + height * k;
        let of = |row: usize| &self.reached[row * words..(row + 1) * words];
        let reached = of(here);
        let (rows_j, rows_k) = (j.saturating_sub(1)..(j + 2).min(height), k.saturating_sub(1)..k + 2);
        let touched = rows_k.clone().any(|k| {
            let slice = self.changed.get(height * k + rows_j.start..height * k + rows_j.end);
            slice.is_some_and(|rows| rows.contains(&true))
        });
        let full = |n: usize, word: u64| word == if n + 1 == words { last_word } else { u64::MAX };
        if !touched || reached.iter().enumerate().all(|(n, &word)| full(n, word)) {
            if self.changed[here] {
                next.copy_from_slice(reached);
            }
            return false;
        }

        let mut around = [nowhere; 9];
        let slices = rows_k.filter(|k| (k + 1) * height * words <= self.reached.len());
        let rows = slices.flat_map(|k| rows_j.clone().map(move |j| j + height * k));
        for (slot, row) in around.iter_mut().zip(rows) {
            *slot = of(row);
        }
        let all = |n: usize| around.iter().fold(0, |all, row| all | row[n]);
        let (mut before, mut word, mut any) = (0, all(0), 0);
        for n in 0..words {
            let after = if n + 1 < words { all(n + 1) } else { 0 };
            let mut spread = word | word << 1 | word >> 1 | before >> 63 | after << 63;
            if n + 1 == words {
                spread &= last_word;
            }
            let fresh = spread & !reached[n];
            next[n] = spread;
            any |= fresh;
            write(fresh, distance, &mut row[64 * n..width.min(64 * (n + 1))]);
            (before, word) = (word, after);
        }
        any != 0
    }
}

/// Writes `distance` for each bit of `fresh`.
#[inline]
fn write(fresh: u64, distance: u8, row: &mut [u8]) {
    if fresh == u64::MAX {
        row.fill(distance);
        return;
    }
    let mut rest = fresh;
    while rest != 0 {
        row[rest.trailing_zeros() as usize] = distance;
        rest &= rest - 1;
    }
}
