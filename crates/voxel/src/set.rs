//! A set of voxels: one bit each.

use rayon::prelude::*;

use crate::{Resolution, Voxel, VoxelError};

/// A set of voxels of one grid.
///
/// Rows along x start at a new 64-bit word; the bits of a row behind its last voxel are always 0, so that rows can be
/// counted, compared and combined by whole words.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VoxelSet {
    resolution: Resolution,
    words_per_row: usize,
    words: Vec<u64>,
}

impl VoxelSet {
    /// The empty set.
    #[must_use]
    pub fn new(resolution: Resolution) -> Self {
        let words_per_row = words_per_row(resolution);
        let words = vec![0; words_per_row.saturating_mul(resolution.row_count())];
        Self { resolution, words_per_row, words }
    }

    /// The set whose rows `fill` writes, in parallel over slices: `fill(j, k, row)` gets the zeroed words of the row
    /// (·, j, k), bit i % 64 of word i / 64 for the voxel (i, j, k). Bits behind the last voxel are dropped.
    #[must_use]
    pub fn from_rows(resolution: Resolution, fill: impl Fn(u32, u32, &mut [u64]) + Sync) -> Self {
        let mut set = Self::new(resolution);
        let per_row = set.words_per_row;
        let mask = padding_mask(resolution);
        set.words.par_chunks_mut(per_row * resolution.y() as usize).zip(0..resolution.z()).for_each(|(slice, k)| {
            for (row, j) in slice.chunks_exact_mut(per_row).zip(0..resolution.y()) {
                fill(j, k, row);
                if let Some(last) = row.last_mut() {
                    *last &= mask;
                }
            }
        });
        set
    }

    /// A set from all its words, row after row; the caller has kept the padding clear.
    pub(crate) fn from_words(resolution: Resolution, words: Vec<u64>) -> Self {
        let words_per_row = words_per_row(resolution);
        debug_assert_eq!(words.len(), words_per_row.saturating_mul(resolution.row_count()));
        Self { resolution, words_per_row, words }
    }

    /// The resolution of the grid whose voxels these are.
    #[must_use]
    pub fn resolution(&self) -> Resolution {
        self.resolution
    }

    /// True if `voxel` is in the set; false for a voxel that the grid does not have.
    #[must_use]
    #[inline]
    pub fn contains(&self, voxel: Voxel) -> bool {
        let (word, bit) = bit_address(self.resolution, self.words_per_row, voxel);
        self.resolution.contains(voxel) && self.words.get(word).is_some_and(|w| (w >> bit) & 1 != 0)
    }

    /// Adds a voxel; a voxel that the grid does not have is ignored.
    pub fn insert(&mut self, voxel: Voxel) {
        let (word, bit) = bit_address(self.resolution, self.words_per_row, voxel);
        if self.resolution.contains(voxel) {
            self.words[word] |= 1 << bit;
        }
    }

    /// Adds all voxels of another set.
    ///
    /// # Errors
    /// If it is of a grid of another resolution.
    pub fn insert_all(&mut self, other: &Self) -> Result<(), VoxelError> {
        self.each_word(other, |word, other| *word |= other)
    }

    /// Removes all voxels of another set.
    ///
    /// # Errors
    /// If it is of a grid of another resolution.
    pub fn remove_all(&mut self, other: &Self) -> Result<(), VoxelError> {
        self.each_word(other, |word, other| *word &= !other)
    }

    fn each_word(&mut self, other: &Self, change: impl Fn(&mut u64, u64)) -> Result<(), VoxelError> {
        if self.resolution != other.resolution {
            return Err(VoxelError::ResolutionMismatch { set: other.resolution, grid: self.resolution });
        }
        self.words.iter_mut().zip(&other.words).for_each(|(word, &other)| change(word, other));
        Ok(())
    }

    /// The memory of the bits of a set of such a grid, in bytes; `u64::MAX` if it is more.
    #[must_use]
    pub const fn bytes_of(resolution: Resolution) -> u64 {
        8_u64.saturating_mul(resolution.x().div_ceil(64) as u64).saturating_mul(resolution.row_count() as u64)
    }

    /// The number of voxels in the set.
    #[must_use]
    pub fn count(&self) -> usize {
        self.words.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// True if no voxel is in the set.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.words.iter().all(|&w| w == 0)
    }

    /// The words of the row (·, j, k); empty if the grid has no such row.
    #[must_use]
    #[inline]
    pub fn row(&self, j: u32, k: u32) -> &[u64] {
        // Without these checks a row beyond Y would be one of the next slice.
        if j >= self.resolution.y() || k >= self.resolution.z() {
            return &[];
        }
        let start = (j as usize + self.resolution.y() as usize * k as usize) * self.words_per_row;
        self.words.get(start..start + self.words_per_row).unwrap_or_default()
    }

    /// The number of words of a row: ceil(X / 64).
    #[must_use]
    pub fn words_per_row(&self) -> usize {
        self.words_per_row
    }

    /// The voxels of the set in the order of their linear coordinates.
    pub fn iter(&self) -> impl Iterator<Item = Voxel> {
        let rows = (0..self.resolution.z()).flat_map(move |k| (0..self.resolution.y()).map(move |j| (j, k)));
        rows.flat_map(move |(j, k)| {
            self.row(j, k).iter().zip(0u32..).flat_map(move |(&word, w)| {
                let clear_lowest = |&rest: &u64| Some(rest & (rest - 1)).filter(|&rest| rest != 0);
                std::iter::successors(Some(word).filter(|&word| word != 0), clear_lowest)
                    .map(move |rest| Voxel::new(64 * w + rest.trailing_zeros(), j, k))
            })
        })
    }

    /// The memory of the bits in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        size_of_val(self.words.as_slice())
    }
}

impl Extend<Voxel> for VoxelSet {
    fn extend<T: IntoIterator<Item = Voxel>>(&mut self, voxels: T) {
        for voxel in voxels {
            self.insert(voxel);
        }
    }
}

pub(crate) fn words_per_row(resolution: Resolution) -> usize {
    (resolution.x() as usize).div_ceil(64)
}

/// Index of the word and number of the bit of a voxel.
#[inline]
pub(crate) fn bit_address(resolution: Resolution, words_per_row: usize, voxel: Voxel) -> (usize, u32) {
    let row = voxel.j as usize + resolution.y() as usize * voxel.k as usize;
    (row * words_per_row + (voxel.i / 64) as usize, voxel.i % 64)
}

/// The bits of a row's last word that stand for voxels.
pub(crate) fn padding_mask(resolution: Resolution) -> u64 {
    match resolution.x() % 64 {
        0 => u64::MAX,
        used => (1 << used) - 1,
    }
}

#[cfg(test)]
mod tests;
