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

/// From which neighbours along an axis a distance may come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ways {
    /// From both: occupied voxels on either side count.
    Both,
    /// From the greater one: only occupied voxels with the same or a greater coordinate count.
    Plus,
    /// From the smaller one.
    Minus,
}

const RISING: [u8; 255] = {
    let mut ramp = [0; 255];
    let mut n = 0;
    while n < 255 {
        ramp[n] = n as u8 + 1;
        n += 1;
    }
    ramp
};

const FALLING: [u8; 255] = {
    let mut ramp = RISING;
    ramp.reverse();
    ramp
};

/// The distances along a row to its own occupied voxels. Between two of them the distances rise and fall, so ramps are copied
/// and nothing is computed voxel by voxel.
pub(crate) fn along_row(words: &[u64], row: &mut [u8], ways: Ways) {
    let mut start = 0;
    for (&word, first) in words.iter().zip((0..).step_by(64)) {
        let mut rest = word;
        while rest != 0 {
            let column = first + rest.trailing_zeros() as usize;
            rest &= rest - 1;
            between(&mut row[start..column], ways, start > 0, true);
            row[column] = 0;
            start = column + 1;
        }
    }
    between(&mut row[start..], ways, start > 0, false);
}

/// A run of free voxels with or without an occupied one before and after it.
fn between(gap: &mut [u8], ways: Ways, before: bool, after: bool) {
    let (before, after) = (before && ways != Ways::Plus, after && ways != Ways::Minus);
    let rising = match (before, after) {
        (true, true) => gap.len().div_ceil(2),
        (true, false) => gap.len(),
        (false, _) => 0,
    };
    let (rise, rest) = gap.split_at_mut(rising);
    let ramp = rise.len().min(RISING.len());
    rise[..ramp].copy_from_slice(&RISING[..ramp]);
    rise[ramp..].fill(FAR);
    let ramp = if after { rest.len().min(FALLING.len()) } else { 0 };
    let (far, fall) = rest.split_at_mut(rest.len() - ramp);
    far.fill(FAR);
    fall.copy_from_slice(&FALLING[FALLING.len() - ramp..]);
}
