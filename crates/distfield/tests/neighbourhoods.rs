//! The extended neighbourhood is the brute-force set of free cuboids, for points and boxes, and holds what any field
//! proves.

mod common;

use common::{fields, random, scene, set};
use proptest::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, FieldError, Neighbourhood, SafeNeighbourhood, VoxelBox};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

/// The smallest box that holds a voxel and a box.
fn hull(u: Voxel, light: VoxelBox) -> VoxelBox {
    let (min, max) = (light.min(), light.max());
    VoxelBox::spanning(
        Voxel::new(u.i.min(min.i), u.j.min(min.j), u.k.min(min.k)),
        Voxel::new(u.i.max(max.i), u.j.max(max.j), u.k.max(max.k)),
    )
}

/// Checks the neighbourhood of a light against the definition, voxel by voxel.
fn check(occupied: &VoxelSet, light: VoxelBox) -> ExtendedNeighbourhood {
    let resolution = occupied.resolution();
    let near = ExtendedNeighbourhood::new(occupied, light);
    let mut expected = VoxelSet::new(resolution);
    if resolution.contains(light.max()) {
        expected.extend(resolution.voxels().filter(|&u| hull(u, light).voxels().all(|w| !occupied.contains(w))));
    }
    for u in resolution.voxels() {
        assert_eq!(near.proves(u), expected.contains(u), "{light:?} {u:?}");
    }
    assert_eq!(*near.voxels(), expected);
    assert_eq!((near.count(), near.validate(occupied)), (expected.count(), Ok(())));
    near
}

/// Checks a point light, and that no field proves more.
fn check_point(occupied: &VoxelSet, light: Voxel) {
    let near = check(occupied, light.into());
    for (name, field) in fields(occupied) {
        let safe = SafeNeighbourhood::new(&*field, occupied, light);
        assert!(safe.voxels().iter().all(|u| near.proves(u)), "{name} proves more for a light in {light:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    #[test]
    fn free_cuboids_and_nothing_else((occupied, chosen) in scene()) {
        for light in &chosen {
            check_point(&occupied, *light);
        }
        for pair in chosen.windows(2) {
            check(&occupied, VoxelBox::spanning(pair[0], pair[1]));
        }
    }
}

#[test]
fn a_light_in_each_corner_and_on_the_border() {
    let resolution = Resolution::new(7, 6, 5);
    let mut below = random(3);
    let occupied = set(resolution, (0..6).map(|_| Voxel::new(1 + below(5), 1 + below(4), 1 + below(3))));
    let last = resolution.last();
    for light in resolution
        .voxels()
        .filter(|v| v.i == 0 || v.j == 0 || v.k == 0 || v.i == last.i || v.j == last.j || v.k == last.k)
    {
        check_point(&occupied, light);
        assert!(ExtendedNeighbourhood::new(&occupied, light.into()).proves(light));
    }
}

#[test]
fn a_light_in_an_occupied_voxel_proves_nothing() {
    let resolution = Resolution::new(5, 5, 5);
    let light = Voxel::new(2, 2, 2);
    let occupied = set(resolution, [light]);
    for (_, field) in fields(&occupied) {
        let near = SafeNeighbourhood::new(&*field, &occupied, light);
        assert_eq!((near.count(), near.bytes()), (0, 8 * 25));
    }
    assert_eq!(check(&occupied, light.into()).count(), 0);
    assert_eq!(check(&occupied, VoxelBox::spanning(Voxel::new(1, 1, 1), Voxel::new(4, 2, 3))).count(), 0);
}

#[test]
fn a_light_outside_the_grid_proves_nothing() {
    let resolution = Resolution::new(5, 4, 3);
    let occupied = VoxelSet::new(resolution);
    for light in [Voxel::new(5, 0, 0), Voxel::new(0, 4, 0), Voxel::new(0, 0, 3), Voxel::new(u32::MAX, 9, 9)] {
        assert_eq!(check(&occupied, light.into()).count(), 0);
        assert_eq!(check(&occupied, VoxelBox::spanning(Voxel::new(1, 1, 1), light)).count(), 0);
        for (_, field) in fields(&occupied) {
            let near = SafeNeighbourhood::new(&*field, &occupied, light);
            assert_eq!((near.count(), near.validate(&occupied)), (0, Ok(())));
        }
        assert!(!ExtendedNeighbourhood::new(&occupied, Voxel::new(1, 1, 1).into()).proves(light));
    }
}

#[test]
fn empty_full_and_single_voxels() {
    for (x, y, z) in [(1, 1, 1), (5, 4, 3), (65, 2, 2), (1, 1, 200), (200, 1, 1), (1, 200, 1)] {
        let resolution = Resolution::new(x, y, z);
        let light = Voxel::new(x / 2, y / 2, z / 2);
        assert_eq!(check(&VoxelSet::new(resolution), light.into()).count(), resolution.voxel_count());
        assert_eq!(check(&set(resolution, resolution.voxels()), light.into()).count(), 0);
        for corner in [Voxel::new(0, 0, 0), resolution.last()] {
            check_point(&set(resolution, [corner]), light);
        }
    }
}

/// Runs that begin and end on either side of the borders of words, and lights there.
#[test]
fn runs_at_the_borders_of_words() {
    let resolution = Resolution::new(193, 2, 2);
    let columns = [0, 1, 62, 63, 64, 65, 126, 127, 128, 129, 191, 192];
    for light in columns {
        for wall in columns.into_iter().filter(|&wall| wall != light) {
            let occupied = set(resolution, [Voxel::new(wall, 0, 1), Voxel::new(192 - wall, 1, 0)]);
            check(&occupied, Voxel::new(light, 0, 0).into());
            check(&occupied, VoxelBox::spanning(Voxel::new(light, 0, 0), Voxel::new(64, 1, 0)));
        }
    }
}

/// The box of a light is itself occupied by the light: the caller passes the others only, and the box is looked at like
/// any voxel.
#[test]
fn an_area_light_sees_past_itself_but_not_past_others() {
    let resolution = Resolution::new(9, 9, 9);
    let light = VoxelBox::spanning(Voxel::new(3, 8, 3), Voxel::new(5, 8, 5));
    assert_eq!(check(&set(resolution, light.voxels()), light).count(), 0, "occupied by itself");
    assert_eq!(check(&VoxelSet::new(resolution), light).count(), 729);
    // Under one end of the light: a box that holds a voxel below and the whole light holds the obstacle too.
    let near = check(&set(resolution, [Voxel::new(3, 5, 4)]), light);
    assert!(near.proves(Voxel::new(4, 6, 4)) && !near.proves(Voxel::new(4, 4, 4)));
    assert!(!near.proves(Voxel::new(8, 4, 8)) && near.proves(Voxel::new(8, 6, 8)));
}

#[test]
fn validation_finds_a_neighbourhood_of_other_occluders() {
    let resolution = Resolution::new(6, 5, 4);
    let occupied = set(resolution, [Voxel::new(0, 1, 2), Voxel::new(3, 3, 0)]);
    for light in [Voxel::new(2, 1, 1).into(), VoxelBox::spanning(Voxel::new(2, 1, 1), Voxel::new(3, 2, 2))] {
        let near = ExtendedNeighbourhood::new(&occupied, light);
        for voxel in resolution.voxels() {
            let mut others = occupied.clone();
            others.insert(voxel);
            let equal = ExtendedNeighbourhood::new(&others, light).voxels() == near.voxels();
            assert_eq!(near.validate(&others).is_ok(), equal, "{voxel:?}");
        }
        let other = VoxelSet::new(Resolution::new(6, 4, 5));
        assert!(matches!(near.validate(&other), Err(FieldError::Resolution { .. })));
    }
}
