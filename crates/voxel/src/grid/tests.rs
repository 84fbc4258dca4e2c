use proptest::prelude::*;

use super::*;

const BUDGET: u64 = 1 << 30;

fn cornell(size: f64) -> VoxelGrid {
    let (min, max) = (DVec3::new(-26.0, -16.0, -790.0), DVec3::new(584.0, 566.0, 560.0));
    VoxelGrid::covering(min, max, size, BUDGET).expect("a legal grid")
}

#[test]
fn resolutions_of_the_thesis() {
    assert_eq!(cornell(16.0).resolution(), Resolution::new(39, 37, 85));
    assert_eq!(cornell(8.0).resolution(), Resolution::new(77, 73, 169));
    assert_eq!(cornell(4.0).resolution(), Resolution::new(153, 146, 338));
}

#[test]
fn linear_index_is_i_plus_j_x_plus_k_x_y() {
    let grid = cornell(8.0);
    assert_eq!(grid.linear_index(Voxel::new(3, 5, 7)), 3 + 5 * 77 + 7 * 77 * 73);
    let indices: Vec<_> = Resolution::new(3, 2, 4).voxels().map(|v| Resolution::new(3, 2, 4).linear_index(v)).collect();
    assert_eq!(indices, (0..24).collect::<Vec<_>>());
}

#[test]
fn faces_belong_to_the_voxel_above_and_the_last_face_to_the_last_voxel() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(24.0), 8.0, BUDGET).expect("a legal grid");
    let at = |x| grid.voxel_containing(DVec3::new(x, 1.0, 1.0)).map(|v| v.i);
    assert_eq!([0.0, -0.0, 8.0, 8f64.next_down(), 24.0].map(at), [Some(0), Some(0), Some(1), Some(0), Some(2)]);
    for outside in [-1e-9, 24.001, f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        assert_eq!(at(outside), None, "{outside}");
    }
}

#[test]
fn negative_zero_as_origin() {
    let grid = VoxelGrid::covering(DVec3::splat(-0.0), DVec3::ONE, 0.5, BUDGET).expect("a legal grid");
    assert!(grid.origin().x.is_sign_positive());
    assert_eq!(grid.voxel_containing(DVec3::splat(-0.0)), Some(Voxel::new(0, 0, 0)));
}

#[test]
fn no_resolution_is_empty() {
    let one = Resolution::new(0, 0, 0);
    assert_eq!((one, one.voxel_count(), one.last()), (Resolution::new(1, 1, 1), 1, Voxel::new(0, 0, 0)));
    let most = Resolution::new(u32::MAX, u32::MAX, u32::MAX);
    assert_eq!((most.voxel_count(), most.sides()), (usize::MAX, [u32::MAX; 3]), "counts do not wrap around");
}

#[test]
fn the_nearest_voxel_is_in_the_grid() {
    for offset in [0.0, 1e6] {
        let min = DVec3::splat(offset);
        let grid = VoxelGrid::covering(min, min + DVec3::splat(9.0), 0.3, BUDGET).expect("a legal grid");
        for (x, i) in [(-1e300, 0), (-0.1, 0), (0.4, 1), (8.9, 29), (9.1, 29), (1e300, 29), (f64::NAN, 0)] {
            assert_eq!(grid.nearest_voxel(DVec3::splat(offset + x)), Voxel::new(i, i, i), "{x}");
        }
    }
}

#[test]
fn flat_scenes_get_one_layer() {
    let grid = VoxelGrid::covering(DVec3::new(0.0, 3.0, 0.0), DVec3::new(4.0, 3.0, 0.0), 1.0, BUDGET);
    let grid = grid.expect("a legal grid");
    assert_eq!(grid.resolution(), Resolution::new(4, 1, 1));
    assert_eq!(grid.voxel_containing(DVec3::new(4.0, 3.0, 0.0)), Some(Voxel::new(3, 0, 0)));
    assert!(VoxelGrid::covering(DVec3::ZERO, DVec3::ZERO, 1.0, BUDGET).is_ok(), "a scene that is one point");
}

#[test]
fn bad_bounds_and_sizes_are_errors() {
    let covering = |min: f64, max: f64, size| VoxelGrid::covering(DVec3::splat(min), DVec3::splat(max), size, BUDGET);
    for bound in [f64::NAN, f64::INFINITY, 1e39] {
        assert_eq!(covering(0.0, bound, 1.0), Err(VoxelError::NonFiniteBounds));
    }
    assert_eq!(covering(f64::NAN, 1.0, 1.0), Err(VoxelError::NonFiniteBounds));
    assert_eq!(covering(f64::INFINITY, f64::NEG_INFINITY, 1.0), Err(VoxelError::NonFiniteBounds));
    assert_eq!(covering(1.0, 0.0, 1.0), Err(VoxelError::EmptyBounds));
    for size in [0.0, -0.0, -1.0, f64::NAN, f64::INFINITY, 1e300] {
        assert!(matches!(covering(0.0, 1.0, size), Err(VoxelError::InvalidVoxelSize { .. })), "{size}");
    }
}

#[test]
fn voxels_below_single_precision_are_an_error_that_names_what_works() {
    let covering = |size| VoxelGrid::covering(DVec3::splat(1e6), DVec3::splat(1e6 + 1.0), size, BUDGET);
    // The step at 10⁶ is 1/16.
    let Err(VoxelError::TooFine { smallest, .. }) = covering(1e-3) else { panic!("must be too fine") };
    assert_eq!(smallest, 0.25);
    assert!(covering(smallest).is_ok());
    assert!(covering(f64::MIN_POSITIVE).is_err());
}

proptest! {
    #[test]
    fn the_size_named_for_too_much_memory_works(
        extent in prop::array::uniform3(0f64..100.0), size in 0.1f64..3.0, limit in prop_oneof![0u64..1000, 0u64..10_000_000],
    ) {
        let extent = DVec3::from_array(extent);
        let bytes = |r: Resolution| 8 * r.voxel_count() as u64 + 8 * r.row_count() as u64;
        let covering = |size| VoxelGrid::covering_within(DVec3::ZERO, extent, size, BUDGET, limit, bytes);
        match covering(size) {
            Ok(grid) => prop_assert!(bytes(grid.resolution()) <= limit.max(16)),
            Err(error @ VoxelError::TooMuchMemory { smallest, bytes, .. }) => {
                prop_assert!(bytes > limit && smallest > size, "{error}");
                prop_assert!(covering(smallest).is_ok(), "{error}");
                prop_assert!(covering((smallest * 0.98).max(size)).is_err(), "{error}");
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn the_named_size_works_and_is_nearly_the_smallest(
        min in prop::array::uniform3(-1e4f64..1e4), extent in prop::array::uniform3(0f64..1e4),
        exponent in -12f64..1.0, budget in prop_oneof![0u64..100, 100u64..1_000_000],
    ) {
        let min = DVec3::from_array(min);
        let max = min + DVec3::from_array(extent);
        let covering = |size| VoxelGrid::covering(min, max, size, budget);
        match covering(10f64.powf(exponent)) {
            Ok(grid) => prop_assert!(grid.resolution().voxel_count() as u64 <= budget.max(1)),
            Err(VoxelError::TooFine { smallest, size } | VoxelError::TooManyVoxels { smallest, size, .. }) => {
                prop_assert!(smallest > size);
                prop_assert!(covering(smallest).is_ok());
                prop_assert!(covering(smallest * 0.98).is_err());
            }
            Err(other) => prop_assert!(false, "{other}"),
        }
    }

    #[test]
    fn everything_within_the_bounds_has_a_voxel(
        min in prop::array::uniform3(-1e3f64..1e3), extent in prop::array::uniform3(0f64..100.0),
        steps in 1u32..200, size in 0.01f64..10.0, exact in any::<bool>(), weight in prop::array::uniform3(0f64..=1.0),
    ) {
        let min = DVec3::from_array(min);
        // A whole number of voxels, as nearly as can be, is the hard case.
        let max = if exact { min + f64::from(steps) * size } else { min + DVec3::from_array(extent) };
        let grid = VoxelGrid::covering(min, max, size, 1 << 48).expect("a legal grid");
        prop_assert!(grid.dilation() <= 1.0 / 64.0);
        prop_assert_eq!(grid.voxel_containing(min), Some(Voxel::new(0, 0, 0)));
        let last = grid.voxel_containing(max);
        prop_assert!(last.is_some());
        let inner = (min + (max - min) * DVec3::from_array(weight)).clamp(min, max);
        let voxel = grid.voxel_containing(inner);
        prop_assert!(voxel.is_some_and(|v| grid.resolution().contains(v)));
        let corner = grid.corner(voxel.expect("tested above"));
        prop_assert!((inner - corner).cmpge(DVec3::splat(-1e-9)).all());
        prop_assert!((inner - corner).cmple(DVec3::splat(grid.voxel_size() + 1e-9)).all());
    }
}
