//! Operations on rows of one-byte distances, written so that the compiler vectorizes them.
//!
//! All fields saturate at [`FAR`]. For a recurrence d = 1 + min(...) saturating at each step gives min(exact, 255), and a
//! distance that is too small proves less, never something wrong.

/// The largest stored distance: "this or more". Also the distance from beyond the grid, where nothing is.
pub(crate) const FAR: u8 = u8::MAX;

/// Writes 0 for each occupied voxel of a row and [`FAR`] for each free one.
pub(crate) fn expand(words: &[u64], row: &mut [u8]) {
    for (bytes, &word) in row.chunks_mut(64).zip(words) {
        match word {
            0 => bytes.fill(FAR),
            _ => bytes.iter_mut().enumerate().for_each(|(bit, byte)| *byte = ((word >> bit) as u8 & 1).wrapping_sub(1)),
        }
    }
}

/// acc\[x\] = min(acc\[x\], row\[x\]).
pub(crate) fn min_with(acc: &mut [u8], row: &[u8]) {
    for (a, &r) in acc.iter_mut().zip(row) {
        *a = r.min(*a);
    }
}

/// row\[x\] = min(source\[x\], source\[x + 1\]), nothing beyond the end.
pub(crate) fn min_with_next(row: &mut [u8], source: &[u8]) {
    row.copy_from_slice(source);
    min_with(row, source.get(1..).unwrap_or_default());
}

/// row\[x\] = min(source\[x − 1\], source\[x\]), nothing before the start.
pub(crate) fn min_with_previous(row: &mut [u8], source: &[u8]) {
    row.copy_from_slice(source);
    min_with(row.get_mut(1..).unwrap_or_default(), source);
}

/// row\[x\] = 1 + `nearest`\[x\] where `row` is not already smaller.
pub(crate) fn relax(row: &mut [u8], nearest: &[u8]) {
    for (d, &n) in row.iter_mut().zip(nearest) {
        *d = n.saturating_add(1).min(*d);
    }
}

/// row\[x\] = min(row\[x\], 1 + row\[x − 1\]) from the start to the end.
pub(crate) fn sweep_up(row: &mut [u8]) {
    let mut last = FAR;
    for d in row {
        last = last.saturating_add(1).min(*d);
        *d = last;
    }
}

/// row\[x\] = min(row\[x\], 1 + row\[x + 1\]) from the end to the start.
pub(crate) fn sweep_down(row: &mut [u8]) {
    let mut last = FAR;
    for d in row.iter_mut().rev() {
        last = last.saturating_add(1).min(*d);
        *d = last;
    }
}
