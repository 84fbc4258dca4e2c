use super::*;

#[test]
fn rows_are_padded_to_words() {
    for (x, words) in [(1, 1), (2, 1), (63, 1), (64, 1), (65, 2), (128, 2), (129, 3)] {
        let set = VoxelSet::new(Resolution::new(x, 3, 2));
        assert_eq!((set.words_per_row(), set.bytes()), (words, 8 * words * 6));
    }
}

#[test]
fn insert_contains_count_iter() {
    for x in [1, 63, 64, 65, 130] {
        let resolution = Resolution::new(x, 2, 3);
        let chosen: Vec<_> = resolution.voxels().filter(|v| (v.i * 7 + v.j * 3 + v.k) % 5 < 2).collect();
        let mut set = VoxelSet::new(resolution);
        assert!(set.is_empty());
        set.extend(chosen.iter().copied());
        assert_eq!(set.count(), chosen.len());
        assert_eq!(set.iter().collect::<Vec<_>>(), chosen);
        assert!(resolution.voxels().all(|v| set.contains(v) == chosen.contains(&v)));
    }
}

#[test]
fn voxels_beyond_the_grid_are_never_in_the_set() {
    let mut set = VoxelSet::from_rows(Resolution::new(65, 2, 2), |_, _, row| row.fill(u64::MAX));
    for v in [Voxel::new(65, 0, 0), Voxel::new(127, 1, 1), Voxel::new(0, 2, 0), Voxel::new(0, 0, 2)] {
        assert!(!set.contains(v));
        set.insert(v);
    }
    assert_eq!(set.count(), 65 * 4);
    // The row after the last one of a slice is none, not the first one of the next slice.
    for (j, k) in [(0, 2), (2, 0), (3, 0), (u32::MAX, 0), (0, u32::MAX), (u32::MAX, u32::MAX)] {
        assert!(set.row(j, k).is_empty(), "({j}, {k})");
    }
}

#[test]
fn filling_rows_keeps_the_padding_clear() {
    for x in [1, 63, 64, 65] {
        let resolution = Resolution::new(x, 3, 2);
        let full = VoxelSet::from_rows(resolution, |_, _, row| row.fill(u64::MAX));
        assert_eq!(full.count(), resolution.voxel_count());
        let one = VoxelSet::from_rows(resolution, |j, k, row| row[0] = u64::from(j == 2 && k == 1));
        assert_eq!(one.iter().collect::<Vec<_>>(), [Voxel::new(0, 2, 1)]);
    }
}

#[test]
fn sets_are_added_and_removed() {
    let resolution = Resolution::new(67, 2, 2);
    let every = |n: u32| {
        let mut set = VoxelSet::new(resolution);
        set.extend(resolution.voxels().filter(|v| (v.i + v.j + v.k) % n == 0));
        set
    };
    let (two, three) = (every(2), every(3));
    let (mut both, mut only) = (two.clone(), two.clone());
    assert_eq!((both.insert_all(&three), only.remove_all(&three)), (Ok(()), Ok(())));
    for v in resolution.voxels() {
        assert_eq!(both.contains(v), two.contains(v) || three.contains(v));
        assert_eq!(only.contains(v), two.contains(v) && !three.contains(v));
    }
    assert_eq!(VoxelSet::bytes_of(resolution), two.bytes() as u64);
    let other = VoxelSet::new(Resolution::new(67, 4, 1));
    assert!(both.insert_all(&other).is_err() && both.remove_all(&other).is_err());
}
