//! Distances between voxels.

use vdf_voxel::Voxel;

/// The chessboard distance, max(|Δi|, |Δj|, |Δk|) (3.4.3 in \[Houska2013\]).
#[must_use]
#[inline]
pub const fn chessboard_distance(a: Voxel, b: Voxel) -> u32 {
    const fn max(a: u32, b: u32) -> u32 {
        if a > b { a } else { b }
    }
    max(a.i.abs_diff(b.i), max(a.j.abs_diff(b.j), a.k.abs_diff(b.k)))
}

/// The Manhattan distance, |Δi| + |Δj| + |Δk| (3.4.2 in \[Houska2013\]), saturated at 2³² − 1.
#[must_use]
#[inline]
pub const fn manhattan_distance(a: Voxel, b: Voxel) -> u32 {
    a.i.abs_diff(b.i).saturating_add(a.j.abs_diff(b.j)).saturating_add(a.k.abs_diff(b.k))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chessboard_is_the_largest_difference() {
        let v = Voxel::new;
        assert_eq!(chessboard_distance(v(5, 5, 5), v(5, 5, 5)), 0);
        assert_eq!(chessboard_distance(v(1, 2, 3), v(4, 2, 2)), 3);
        assert_eq!(chessboard_distance(v(4, 9, 2), v(1, 2, 3)), 7);
        assert_eq!(chessboard_distance(v(0, 0, u32::MAX), v(0, 3, 0)), u32::MAX);
    }

    #[test]
    fn manhattan_is_the_sum_of_differences() {
        let v = Voxel::new;
        assert_eq!(manhattan_distance(v(5, 5, 5), v(5, 5, 5)), 0);
        assert_eq!(manhattan_distance(v(1, 2, 3), v(4, 2, 2)), 4);
        assert_eq!(manhattan_distance(v(4, 9, 2), v(1, 2, 3)), 11);
        assert_eq!(manhattan_distance(v(0, 0, u32::MAX), v(0, 3, 0)), u32::MAX);
    }
}
