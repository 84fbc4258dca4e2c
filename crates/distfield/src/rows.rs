//! Operations on rows of one-byte distances, written so that the compiler vectorizes them.
//!
//! All fields saturate at [`FAR`]. For a recurrence d = 1 + min(...) saturating at each step gives min(exact, 255), and
//! a distance that is too small proves less, never something wrong.

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

/// row\[x\] = 1 + `nearest`\[x\] where `row` is not already smaller.
pub(crate) fn relax(row: &mut [u8], nearest: &[u8]) {
    for (d, &n) in row.iter_mut().zip(nearest) {
        *d = n.saturating_add(1).min(*d);
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

/// Voxels of a word of occupied bits.
const WORD: usize = 64;

/// RISING\[n\] = min(n + 1, [`FAR`]): the distances of free voxels behind one at distance d begin at n = d.
const RISING: [u8; 255 + WORD] = {
    let mut ramp = [FAR; 255 + WORD];
    let mut n = 0;
    while n < 255 {
        ramp[n] = n as u8 + 1;
        n += 1;
    }
    ramp
};

/// [`RISING`] backwards.
const FALLING: [u8; 255 + WORD] = {
    let mut ramp = RISING;
    ramp.reverse();
    ramp
};

/// The distances of eight free voxels behind one at distance d, the first one in the lowest byte.
static RISING_8: [u64; 256] = {
    let mut ramps = [0; 256];
    let mut d = 0;
    while d < 256 {
        let mut n = 8;
        while n > 0 {
            n -= 1;
            ramps[d] = ramps[d] << 8 | RISING[d + n] as u64;
        }
        d += 1;
    }
    ramps
};

/// For eight voxels, of which bits say whether they are occupied.
#[derive(Clone, Copy)]
struct Eight {
    /// The distance of each to the last occupied one at or before it; 0 before the first.
    distances: u64,
    /// All bits of the voxels before the first occupied one.
    before: u64,
}

static EIGHTS: [Eight; 256] = {
    let mut eights = [Eight { distances: 0, before: u64::MAX }; 256];
    let mut bits = 1;
    while bits < 256 {
        let (mut n, mut last, mut distances, mut before) = (0, None::<u64>, 0, 0);
        while n < 8 {
            if bits >> n & 1 != 0 {
                last = Some(n);
            }
            match last {
                Some(last) => distances |= (n - last) << (8 * n),
                None => before |= 0xff << (8 * n),
            }
            n += 1;
        }
        eights[bits] = Eight { distances, before };
        bits += 1;
    }
    eights
};

/// Writes the distances along a row to its own occupied voxels on the sides `ways`.
///
/// Voxels go by the word, of which the distance at its end is handed on to the next one. A word without an occupied
/// voxel is a ramp that is copied; of others each byte is looked up. Nothing branches on single bits, so a crowded row
/// takes no more than two or three times as long as an empty one.
pub(crate) fn along_row(words: &[u64], row: &mut [u8], ways: Ways) {
    if ways != Ways::Plus {
        let mut last = FAR;
        for (voxels, &word) in row.chunks_mut(WORD).zip(words) {
            match voxels.try_into() {
                Ok(voxels) => last = forwards(word, last, voxels),
                // Less than a word: the end of the row.
                Err(_) => {
                    let mut whole = [FAR; WORD];
                    forwards(word, last, &mut whole);
                    voxels.copy_from_slice(&whole[..voxels.len()]);
                }
            }
        }
    }
    if ways != Ways::Minus {
        let mut last = FAR;
        for (voxels, &word) in row.chunks_mut(WORD).zip(words).rev() {
            let mut whole = [FAR; WORD];
            last = backwards(word, last, &mut whole);
            if ways == Ways::Both {
                voxels.iter_mut().zip(&whole).for_each(|(d, &other)| *d = other.min(*d));
            } else {
                voxels.copy_from_slice(&whole[..voxels.len()]);
            }
        }
    }
}

/// Writes the distances to the last occupied voxel at or before each of a word's, where `last` is that of the voxel
/// before the word; gives that of its last voxel.
#[inline]
fn forwards(word: u64, last: u8, voxels: &mut [u8; WORD]) -> u8 {
    if word == 0 {
        voxels.copy_from_slice(&RISING[usize::from(last)..][..WORD]);
        return voxels[WORD - 1];
    }
    let mut last = last;
    for (voxels, bits) in voxels.as_chunks_mut::<8>().0.iter_mut().zip(word.to_le_bytes()) {
        *voxels = eight(bits, last).to_le_bytes();
        last = after_eight(bits, last);
    }
    last
}

/// [`forwards`] from the end of a word to its start: distances to the first occupied voxel at or after each.
#[inline]
fn backwards(word: u64, last: u8, voxels: &mut [u8; WORD]) -> u8 {
    if word == 0 {
        voxels.copy_from_slice(&FALLING[usize::from(FAR - last)..][..WORD]);
        return voxels[0];
    }
    let mut last = last;
    for (voxels, bits) in voxels.as_chunks_mut::<8>().0.iter_mut().rev().zip(word.reverse_bits().to_le_bytes()) {
        *voxels = eight(bits, last).to_be_bytes();
        last = after_eight(bits, last);
    }
    last
}

/// The distances of eight voxels to the last occupied one at or before each, the first one in the lowest byte.
#[inline]
fn eight(bits: u8, last: u8) -> u64 {
    let Eight { distances, before } = EIGHTS[usize::from(bits)];
    distances | (RISING_8[usize::from(last)] & before)
}

/// The last of these distances. Each waits for the one before, so it takes as few operations as possible.
#[inline]
fn after_eight(bits: u8, last: u8) -> u8 {
    let (within, beyond) = ((EIGHTS[usize::from(bits)].distances >> 56) as u8, last.saturating_add(8));
    if bits == 0 { beyond } else { within }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, voxel by voxel.
    fn slow(words: &[u64], width: usize, ways: Ways) -> Vec<u8> {
        let occupied = |i: usize| words[i / WORD] >> (i % WORD) & 1 != 0;
        let distance = |i: usize| {
            let before = (0..=i).rev().find(|&u| ways != Ways::Plus && occupied(u)).map(|u| i - u);
            let after = (i..width).find(|&u| ways != Ways::Minus && occupied(u)).map(|u| u - i);
            before.into_iter().chain(after).min().map_or(FAR, |d| d.min(255) as u8)
        };
        (0..width).map(distance).collect()
    }

    #[test]
    fn rows_equal_their_definition() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            state.rotate_left(32)
        };
        for width in [1, 7, 8, 9, 63, 64, 65, 127, 128, 130, 320, 700] {
            for density in 0..40 {
                let words: Vec<u64> = (0..width)
                    .step_by(WORD)
                    .map(|first| {
                        let used = u64::MAX >> (WORD - (width - first).min(WORD));
                        let word = match density {
                            0 => 0,
                            1 => u64::MAX,
                            2..8 => random(),
                            8..16 => random() & random() & random() & random(),
                            // Words with one voxel, and often none.
                            _ => {
                                if random() % 4 == 0 {
                                    1 << (random() % 64)
                                } else {
                                    0
                                }
                            }
                        };
                        word & used
                    })
                    .collect();
                for ways in [Ways::Both, Ways::Plus, Ways::Minus] {
                    let mut row = vec![77; width];
                    along_row(&words, &mut row, ways);
                    assert_eq!(row, slow(&words, width, ways), "{width} {words:x?} {ways:?}");
                }
            }
        }
    }
}
