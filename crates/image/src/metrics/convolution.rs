//! Separable filters: a row at a time, then a column at a time, so that a filter of k × k weights costs 2k.
//!
//! A kernel has an odd number of weights, the middle one for the pixel itself. Beyond the border the nearest pixel is
//! repeated. The loops run over whole rows, weight by weight: they are what the compiler turns into vector
//! instructions.

use std::ops::{AddAssign, Mul};

/// Copies `row` with `radius` repetitions of its ends on either side.
pub(super) fn pad<T: Copy>(row: impl ExactSizeIterator<Item = T>, radius: usize, padded: &mut Vec<T>) {
    padded.clear();
    padded.extend(row);
    let (Some(&first), Some(&last)) = (padded.first(), padded.last()) else { return };
    padded.resize(padded.len() + 2 * radius, last);
    padded.rotate_right(radius);
    padded[..radius].fill(first);
}

/// Adds the filtered row to `out`; `padded` is the row with at least the kernel's radius on either side, `padding`.
pub(super) fn add_row<T>(padded: &[T], padding: usize, kernel: &[T], out: &mut [T])
where
    T: Copy + Mul<Output = T> + AddAssign,
{
    let start = padding - kernel.len() / 2;
    for (k, &weight) in kernel.iter().enumerate() {
        for (out, &value) in out.iter_mut().zip(&padded[start + k..]) {
            *out += weight * value;
        }
    }
}

/// Adds the row `y` of the image filtered along columns to `out`; `row` gives the rows of the image, of which there are
/// `height`.
pub(super) fn add_column<'a, T>(row: impl Fn(usize) -> &'a [T], height: usize, y: usize, kernel: &[T], out: &mut [T])
where
    T: Copy + Mul<Output = T> + AddAssign + 'a,
{
    let radius = kernel.len() / 2;
    for (k, &weight) in kernel.iter().enumerate() {
        let from = (y + k).saturating_sub(radius).min(height - 1);
        for (out, &value) in out.iter_mut().zip(row(from)) {
            *out += weight * value;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_columns_against_the_definition() {
        let values = [3.0, -1.0, 4.0, 1.0, -5.0];
        for kernel in [vec![2.0], vec![1.0, 2.0, 4.0], vec![1.0, 0.5, 3.0, -2.0, 7.0, 1.0, 1.0, -1.0, 0.25]] {
            let radius = kernel.len() / 2;
            let by_definition: Vec<f64> = (0..values.len())
                .map(|x| (0..kernel.len()).map(|k| kernel[k] * values[(x + k).saturating_sub(radius).min(4)]).sum())
                .collect();
            for padding in [radius, radius + 2] {
                let mut padded = Vec::new();
                pad(values.iter().copied(), padding, &mut padded);
                let mut out = [0.0; 5];
                add_row(&padded, padding, &kernel, &mut out);
                assert_eq!(out, by_definition[..]);
            }
            for (y, expected) in by_definition.iter().enumerate() {
                let mut out = [10.0];
                add_column(|y| &values[y..=y], values.len(), y, &kernel, &mut out);
                assert_eq!(out[0], 10.0 + expected);
            }
        }
    }
}
