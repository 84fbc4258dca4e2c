//! The tree in which samples are summed.

use std::ops::{Add, Range};

use smallvec::SmallVec;

/// A block of samples: those with the numbers index·2^level to (index + 1)·2^level − 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BlockId {
    pub(super) level: u32,
    pub(super) index: u32,
}

impl BlockId {
    /// The block of this level and number, if its samples have 32-bit numbers.
    pub(super) fn checked(level: u32, index: u32) -> Option<Self> {
        let id = Self { level, index };
        (level <= 32 && id.samples().end <= 1 << 32).then_some(id)
    }

    pub(super) const fn samples(self) -> Range<u64> {
        let size = 1_u64 << self.level;
        self.index as u64 * size..(self.index as u64 + 1) * size
    }

    /// The block that has this one as its left half, and the other as its right half.
    pub(super) fn parent_with(self, right: Self) -> Option<Self> {
        let buddies = self.level == right.level && self.index.is_multiple_of(2) && right.index == self.index + 1;
        buddies.then_some(Self { level: self.level + 1, index: self.index / 2 })
    }
}

/// The sum of consecutive samples of one pixel, in the order of the tree.
#[derive(Clone, Debug)]
pub(crate) struct PixelSum<V> {
    pub(super) blocks: SmallVec<[(BlockId, V); 8]>,
}

impl<V: Copy + Add<Output = V>> PixelSum<V> {
    pub(crate) fn new() -> Self {
        Self { blocks: SmallVec::new() }
    }

    /// Adds sample number `sample`, the one after that added before.
    #[inline]
    pub(crate) fn add(&mut self, sample: u32, value: V) {
        let (mut id, mut sum) = (BlockId { level: 0, index: sample }, value);
        while let Some(&(left, left_sum)) = self.blocks.last()
            && let Some(parent) = left.parent_with(id)
        {
            (id, sum) = (parent, left_sum + sum);
            self.blocks.pop();
        }
        self.blocks.push((id, sum));
    }
}
