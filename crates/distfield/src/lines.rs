//! Lines of voxels that follow each other along an axis, for passes that work on whole lines and vectorize.
//!
//! Rows of a slice lie behind each other in memory and need no list. Parts of slices do not: they are listed, for
//! blocks of at least some hundred voxels, so that the list stays small beside the voxels whatever the shape of the
//! grid.

use crate::rows::{self, Ways};

/// Lines of equal length in their order along an axis.
pub(crate) trait Lines {
    /// How many lines there are.
    fn count(&self) -> usize;

    /// Line `n`.
    fn line(&mut self, n: usize) -> &mut [u8];

    /// Lines `n` and `n + 1`.
    fn pair(&mut self, n: usize) -> (&mut [u8], &mut [u8]);
}

/// Lines of `width` voxels that lie behind each other.
pub(crate) struct Contiguous<'a> {
    pub(crate) voxels: &'a mut [u8],
    pub(crate) width: usize,
}

impl Lines for Contiguous<'_> {
    fn count(&self) -> usize {
        self.voxels.len() / self.width
    }

    #[inline]
    fn line(&mut self, n: usize) -> &mut [u8] {
        &mut self.voxels[n * self.width..(n + 1) * self.width]
    }

    #[inline]
    fn pair(&mut self, n: usize) -> (&mut [u8], &mut [u8]) {
        self.voxels[n * self.width..(n + 2) * self.width].split_at_mut(self.width)
    }
}

impl Lines for Vec<&mut [u8]> {
    fn count(&self) -> usize {
        self.len()
    }

    #[inline]
    fn line(&mut self, n: usize) -> &mut [u8] {
        self[n]
    }

    #[inline]
    fn pair(&mut self, n: usize) -> (&mut [u8], &mut [u8]) {
        let (done, rest) = self.split_at_mut(n + 1);
        (done[n], rest[0])
    }
}

/// Cuts each slice into blocks; gives for each block its part of all slices. The list takes 16 bytes for each part of
/// `block` voxels or less, so slices should be larger than a block: smaller ones are [`Contiguous`] as they are.
pub(crate) fn columns(field: &mut [u8], slice: usize, block: usize) -> Vec<Vec<&mut [u8]>> {
    let mut columns: Vec<Vec<&mut [u8]>> = Vec::new();
    columns.resize_with(slice.div_ceil(block), Vec::new);
    for slice in field.chunks_exact_mut(slice) {
        for (column, part) in columns.iter_mut().zip(slice.chunks_mut(block)) {
            column.push(part);
        }
    }
    columns
}

/// Propagates Manhattan distances along the axis on which the lines follow each other: d = min(d, 1 + d of the line
/// before).
pub(crate) fn relax(lines: &mut impl Lines, ways: Ways) {
    if ways != Ways::Plus {
        for n in 1..lines.count() {
            let (before, line) = lines.pair(n - 1);
            rows::relax(line, before);
        }
    }
    if ways != Ways::Minus {
        for n in (1..lines.count()).rev() {
            let (line, after) = lines.pair(n - 1);
            rows::relax(line, after);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn listed_and_contiguous_lines_are_the_same() {
        let voxels: Vec<u8> = (0..60).map(|n| (n * 37 % 101) as u8).collect();
        for ways in [Ways::Both, Ways::Plus, Ways::Minus] {
            let (mut a, mut b) = (voxels.clone(), voxels.clone());
            relax(&mut Contiguous { voxels: &mut a, width: 12 }, ways);
            columns(&mut b, 12, 5).iter_mut().for_each(|lines| relax(lines, ways));
            assert_eq!(a, b, "{ways:?}");
            assert_ne!(a, voxels);
        }
    }
}
