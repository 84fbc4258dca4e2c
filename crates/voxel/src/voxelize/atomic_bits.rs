//! A voxel set under construction by many threads.

use std::sync::atomic::{AtomicU64, Ordering};

use crate::set::{bit_address, words_per_row};
use crate::{Resolution, Voxel, VoxelSet};

/// Bits that many threads set at once. OR commutes, so the result does not depend on their timing.
#[derive(Debug)]
pub(crate) struct AtomicBits {
    resolution: Resolution,
    words_per_row: usize,
    words: Vec<AtomicU64>,
}

impl AtomicBits {
    pub(crate) fn new(resolution: Resolution) -> Self {
        let words_per_row = words_per_row(resolution);
        let count = words_per_row.saturating_mul(resolution.row_count());
        Self { resolution, words_per_row, words: std::iter::repeat_with(AtomicU64::default).take(count).collect() }
    }

    /// Adds the voxels from (`first`, j, k) to (`last`, j, k), which the grid must have.
    #[inline]
    pub(crate) fn insert_run(&self, j: u32, k: u32, [first, last]: [u32; 2]) {
        let (start, first_bit) = bit_address(self.resolution, self.words_per_row, Voxel::new(first, j, k));
        let (end, last_bit) = bit_address(self.resolution, self.words_per_row, Voxel::new(last, j, k));
        let (from_first, to_last) = (u64::MAX << first_bit, u64::MAX >> (63 - last_bit));
        if start == end {
            self.add(start, from_first & to_last);
            return;
        }
        self.add(start, from_first);
        for index in start + 1..end {
            self.add(index, u64::MAX);
        }
        self.add(end, to_last);
    }

    #[inline]
    fn add(&self, index: usize, mask: u64) {
        let word = &self.words[index];
        // Reading first keeps a word that many threads hit shared between their caches.
        if word.load(Ordering::Relaxed) & mask != mask {
            word.fetch_or(mask, Ordering::Relaxed);
        }
    }

    pub(crate) fn into_set(self) -> VoxelSet {
        VoxelSet::from_words(self.resolution, self.words.into_iter().map(AtomicU64::into_inner).collect())
    }
}
