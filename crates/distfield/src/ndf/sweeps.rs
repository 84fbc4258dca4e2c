//! Chessboard distances by sweeps, axis by axis \[Rosenfeld1966\].
//!
//! *Idea.* A shortest chain from an occupied voxel can be walked so that it first stays in its row, then goes on from
//! row to row of its slice, then from slice to slice, each time without turning back: a step to the next row may also
//! move along x, and a step to the next slice along x and y. So the distances within rows are found first; then d =
//! min(d, 1 + the least of 3 voxels of the row before) up and down each slice; then d = min(d, 1 + the least of 3 × 3
//! voxels of the slice before) up and down the grid.
//!
//! *Threads.* The sweeps from slice to slice meet in the middle: while one thread sweeps the lower half upwards,
//! another sweeps the upper half downwards. After that the two slices at the middle know all of their own half, and
//! each half is swept the other way, beginning with the slice across the middle. Two threads do both at no extra cost.
//! With more of them, the rows of a slice are shared out, too, which are independent within a sweep from slice to
//! slice.
//!
//! *Cost.* Two passes over the field, in both of which the slice before is still in the cache, and two slices of
//! scratch. All loops are over whole rows and vectorize. Along x nothing is swept: the distances within a row are ramps
//! that are copied.

use rayon::prelude::*;
use vdf_voxel::VoxelSet;

use crate::rows::{self, FAR, Ways};

/// Fewer voxels than this are done by the calling thread: another would take longer to wake up.
const FEW: usize = 1 << 17;

/// Voxels of a slice that one job of a sweep from slice to slice takes, where there are more than two threads.
const JOB: usize = 1 << 15;

/// Writes the distance of each voxel to the nearest occupied one, saturated at [`FAR`].
pub(super) fn distances(occupied: &VoxelSet, field: &mut [u8]) {
    let [width, height, depth] = occupied.resolution().sides().map(|n| n as usize);
    let slice = width * height;
    let few = field.len() < FEW;
    let threads = if few { 1 } else { rayon::current_num_threads() };
    let sweep = Sweep { width, slice, jobs: threads > 2 && slice > JOB };
    let start = |k: usize, slice: &mut [u8], padded: &mut Padded| within_slice(occupied, k as u32, slice, padded);
    let both = |lower: &mut (dyn FnMut() + Send), upper: &mut (dyn FnMut() + Send)| {
        if few {
            lower();
            upper();
        } else {
            rayon::join(lower, upper);
        }
    };

    if threads > 2 {
        let slices = field.par_chunks_exact_mut(slice).enumerate();
        slices.for_each_init(|| Padded::new(width), |padded, (k, slice)| start(k, slice, padded));
    }
    let middle = depth / 2;
    let (lower, upper) = field.split_at_mut(middle * slice);
    let start = |k: usize, slice: &mut [u8], padded: &mut Padded| {
        if threads <= 2 {
            start(k, slice, padded);
        }
    };
    both(&mut || sweep.up(lower, None, |k, slice, padded| start(k, slice, padded)), &mut || {
        sweep.down(upper, None, |k, slice, padded| start(middle + k, slice, padded))
    });
    if middle == 0 {
        return;
    }
    let (below, above) = (lower[lower.len() - slice..].to_vec(), upper[..slice].to_vec());
    let nothing = |_: usize, _: &mut [u8], _: &mut Padded| {};
    both(&mut || sweep.down(lower, Some(&above), nothing), &mut || sweep.up(upper, Some(&below), nothing));
}

/// Writes the distances to the occupied voxels of the same slice.
fn within_slice(occupied: &VoxelSet, k: u32, slice: &mut [u8], padded: &mut Padded) {
    let width = padded.width();
    padded.clear();
    for (row, j) in slice.chunks_exact_mut(width).zip(0..) {
        rows::along_row(occupied.row(j, k), row, Ways::Both);
        padded.relax(row);
        padded.set(row);
    }
    padded.clear();
    for row in slice.chunks_exact_mut(width).rev() {
        padded.relax(row);
        padded.set(row);
    }
}

/// A row with a voxel beyond each end, where nothing is.
struct Padded(Vec<u8>);

impl Padded {
    fn new(width: usize) -> Self {
        Self(vec![FAR; width + 2])
    }

    fn width(&self) -> usize {
        self.0.len() - 2
    }

    fn clear(&mut self) {
        self.0.fill(FAR);
    }

    fn set(&mut self, row: &[u8]) {
        let width = self.width();
        self.0[1..=width].copy_from_slice(row);
    }

    /// Takes the minimum of up to three rows.
    fn set_least(&mut self, [a, b, c]: [&[u8]; 3]) {
        for (((least, &a), &b), &c) in self.0[1..].iter_mut().zip(a).zip(b).zip(c) {
            *least = a.min(b).min(c);
        }
    }

    /// row\[x\] = min(row\[x\], 1 + the least of this row at x − 1, x and x + 1).
    fn relax(&self, row: &mut [u8]) {
        let least = self.0.iter().zip(&self.0[1..]).zip(&self.0[2..]);
        for (d, ((&before, &here), &after)) in row.iter_mut().zip(least) {
            *d = before.min(here).min(after).saturating_add(1).min(*d);
        }
    }
}

/// Sweeps from slice to slice.
#[derive(Clone, Copy)]
struct Sweep {
    width: usize,
    slice: usize,
    /// Whether the rows of a slice are shared out among threads.
    jobs: bool,
}

impl Sweep {
    /// Sweeps slices towards greater z, beginning with the slice `before` them. Each is given to `start` first, with
    /// its number.
    fn up(self, slices: &mut [u8], before: Option<&[u8]>, start: impl Fn(usize, &mut [u8], &mut Padded)) {
        let mut padded = Padded::new(self.width);
        for k in 0..slices.len() / self.slice {
            let (done, rest) = slices.split_at_mut(k * self.slice);
            let slice = &mut rest[..self.slice];
            start(k, slice, &mut padded);
            let last = done.len().checked_sub(self.slice).map(|last| &done[last..]);
            if let Some(before) = last.or(before) {
                self.step(before, slice, &mut padded);
            }
        }
    }

    /// Sweeps slices towards smaller z, beginning with the slice `after` them. Each is given to `start` first, with its
    /// number.
    fn down(self, slices: &mut [u8], after: Option<&[u8]>, start: impl Fn(usize, &mut [u8], &mut Padded)) {
        let mut padded = Padded::new(self.width);
        for k in (0..slices.len() / self.slice).rev() {
            let (rest, done) = slices.split_at_mut((k + 1) * self.slice);
            let slice = &mut rest[k * self.slice..];
            start(k, slice, &mut padded);
            if let Some(after) = done.get(..self.slice).or(after) {
                self.step(after, slice, &mut padded);
            }
        }
    }

    /// Takes distances from a finished slice over into the next one.
    fn step(self, from: &[u8], to: &mut [u8], padded: &mut Padded) {
        if !self.jobs {
            return self.rows(from, 0, to, padded);
        }
        let rows = JOB.div_ceil(self.width);
        to.par_chunks_mut(rows * self.width)
            .enumerate()
            .for_each_init(|| Padded::new(self.width), |padded, (n, part)| self.rows(from, n * rows, part, padded));
    }

    /// The rows of a slice from number `first` on.
    fn rows(self, from: &[u8], first: usize, to: &mut [u8], padded: &mut Padded) {
        let row = |j: usize| from.get(j * self.width..(j + 1) * self.width);
        for (to, j) in to.chunks_exact_mut(self.width).zip(first..) {
            let here = row(j).unwrap_or_default();
            let before = j.checked_sub(1).and_then(row).unwrap_or(here);
            padded.set_least([before, here, row(j + 1).unwrap_or(here)]);
            padded.relax(to);
        }
    }
}
