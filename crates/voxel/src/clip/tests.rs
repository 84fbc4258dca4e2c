use proptest::prelude::*;

use super::*;
use crate::Resolution;

fn grid() -> VoxelGrid {
    VoxelGrid::covering(DVec3::ZERO, DVec3::new(30.0, 21.0, 12.0), 3.0, 1 << 20).expect("a legal grid")
}

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

#[test]
fn ends_inside_keep_their_voxels() {
    let span = grid().voxel_span(v(1.0, 1.0, 1.0), v(29.0, 20.0, 11.0));
    assert_eq!(span, Span::Inside(Voxel::new(0, 0, 0), Voxel::new(9, 6, 3)));
}

#[test]
fn ends_outside_move_to_the_border() {
    let span = grid().voxel_span(v(-1e4, 10.0, 4.0), v(14.0, 10.0, 4.0));
    // The ends are rounded outwards, and at x = 0 there is no more outside.
    assert_eq!(span, Span::Inside(Voxel::new(0, 3, 1), Voxel::new(4, 3, 1)));
    let through = grid().voxel_span(v(10.0, -50.0, 4.0), v(10.0, 50.0, 4.0));
    assert_eq!(through, Span::Inside(Voxel::new(3, 0, 1), Voxel::new(3, 6, 1)));
}

#[test]
fn segments_that_miss_are_outside() {
    for (a, b) in [
        (v(-1.0, 10.0, 4.0), v(-1e-6, 11.0, 4.0)),
        (v(-5.0, 3.0, 4.0), v(3.0, -5.1, 4.0)),
        (v(1e12, 1.0, 1.0), v(1e12, 2.0, 1.0)),
        (v(31.0, 5.0, 5.0), v(31.0, 5.0, 5.0)),
    ] {
        assert_eq!(grid().voxel_span(a, b), Span::Outside, "{a} {b}");
    }
}

#[test]
fn touching_the_grid_is_not_outside() {
    // Through a corner, along a face, and up to a face.
    for (a, b) in [
        (v(-5.0, 5.0, 0.0), v(5.0, -5.0, 0.0)),
        (v(-5.0, 21.0, 12.0), v(50.0, 21.0, 12.0)),
        (v(30.0, 5.0, 5.0), v(31.0, 5.0, 5.0)),
        (v(-1.0, -1.0, -1.0), v(0.0, 0.0, 0.0)),
    ] {
        assert_ne!(grid().voxel_span(a, b), Span::Outside, "{a} {b}");
    }
}

#[test]
fn coordinates_that_are_not_finite_span_everything() {
    let corners = (Voxel::new(0, 0, 0), Resolution::new(10, 7, 4).last());
    let everything = |a, b| {
        let span = grid().voxel_span(a, b);
        span == Span::Inside(corners.0, corners.1) || span == Span::Inside(corners.1, corners.0)
    };
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        assert!(everything(v(bad, 1.0, 1.0), v(1.0, 1.0, 1.0)), "{bad}");
        assert!(everything(v(1.0, 1.0, 1.0), v(1.0, bad, 1.0)), "{bad}");
        assert!(everything(v(bad, bad, bad), v(bad, bad, bad)), "{bad}");
    }
}

/// Points one step below a face, whose grid coordinates round to the face: fl(1/5) > 1/5. Without moving the ends
/// outwards the voxel that truly holds the segment would be left out.
#[test]
fn ends_are_rounded_outwards() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(50.0), 5.0, 1 << 20).expect("a legal grid");
    let mut rounded_to_the_face = 0;
    for face in 1..10u32 {
        let y = f64::from(5 * face);
        let (below, above) = (y.next_down(), y.next_up());
        rounded_to_the_face += u32::from(grid.grid_coordinates(DVec3::splat(below)).0.y == f64::from(face));
        // Along the face; through it, downwards and upwards, with the middle in the grid.
        for (ya, yb) in [(below, below), (above, below), (below, above)] {
            let Span::Inside(from, to) = grid.voxel_span(v(-1e4, ya, 7.0), v(1e4, yb, 7.0)) else {
                panic!("the segment meets the grid")
            };
            assert!((from.j.min(to.j)..=from.j.max(to.j)).contains(&(face - 1)), "{ya} {yb}");
        }
    }
    assert!(rounded_to_the_face > 0, "the test is about rounding");
}

/// Coordinates near and on faces of voxels and of the grid, and far away.
fn coordinate() -> impl Strategy<Value = f64> {
    let step = prop_oneof![Just(0i8), -1i8..=1];
    let face = (-4i32..15, step).prop_map(|(face, step)| match step {
        1 => f64::from(3 * face).next_up(),
        -1 => f64::from(3 * face).next_down(),
        _ => f64::from(3 * face),
    });
    prop_oneof![4 => face, 4 => -10f64..40.0, 1 => -1e9f64..1e9, 1 => Just(-0.0)]
}

fn point() -> impl Strategy<Value = DVec3> {
    (coordinate(), coordinate(), coordinate()).prop_map(|(x, y, z)| v(x, y, z))
}

/// Often on the border: at edges and corners of the grid a careless clip loses the segment.
fn within(side: i64) -> impl Strategy<Value = i64> {
    prop_oneof![0..=side, Just(0), Just(side)]
}

/// Up to 2⁵¹, where steps of the last place are a sizeable part of a voxel, so that careless clipping shows.
fn distance() -> impl Strategy<Value = i64> {
    prop_oneof![-20i64..20, Just(0), -1_000_000_000_000i64..1_000_000_000_000, -(1i64 << 51)..1 << 51]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(20_000))]

    #[test]
    fn reversing_swaps_the_voxels(a in point(), b in point()) {
        let reversed = match grid().voxel_span(b, a) {
            Span::Inside(b, a) => Span::Inside(a, b),
            Span::Outside => Span::Outside,
        };
        prop_assert_eq!(grid().voxel_span(a, b), reversed);
    }

    /// A point known to be on the segment and in the grid is in the spanned cuboid: the ends are integers, at distances
    /// from it of an exact ratio. At 1 alone errors would cancel by symmetry.
    #[test]
    fn the_cuboid_holds_what_is_inside(
        middle in (within(30), within(21), within(12)),
        ratio in 1i64..=3,
        direction in prop::array::uniform3(distance()),
    ) {
        let middle = [middle.0, middle.1, middle.2];
        let end = |factor: i64| {
            let at = |axis: usize| (middle[axis] + factor * direction[axis]) as f64;
            v(at(0), at(1), at(2))
        };
        let Span::Inside(a, b) = grid().voxel_span(end(-1), end(ratio)) else {
            return Err(TestCaseError::fail("the segment meets the grid"));
        };
        let (a, b) = ([a.i, a.j, a.k], [b.i, b.j, b.k]);
        for axis in 0..3 {
            let (low, high) = (i64::from(a[axis].min(b[axis])), i64::from(a[axis].max(b[axis])));
            prop_assert!((3 * low..=3 * high + 3).contains(&middle[axis]), "{:?} {:?}", a, b);
        }
    }
}

/// The twin of the voxel of entry: along each axis every place of the segment that is in the grid lies between that voxel and the one of the
/// end inside. Segments along axes, through corners and from absurdly far are among them; what cannot be clipped has no entry.
#[test]
fn the_part_in_the_grid_lies_between_entry_and_end() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::new(7.0, 5.0, 3.0), 1.0, 1 << 20).unwrap();
    let mut state = 1_u64;
    let mut unit = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut places = 0;
    for case in 0..20_000 {
        let mut inside = DVec3::new(7.0 * unit(), 5.0 * unit(), 3.0 * unit());
        let far = [0.5, 3.0, 1e3, 1e9, 1e15][case % 5];
        let mut outside = inside + DVec3::new(unit() - 0.5, unit() - 0.5, unit() - 0.5) * far;
        for axis in 0..3 {
            if unit() < 0.3 {
                inside[axis] = inside[axis].round();
            }
            if unit() < 0.3 {
                outside[axis] = inside[axis];
            }
        }
        let end = grid.voxel_containing(inside).unwrap();
        if grid.voxel_containing(outside).is_some() {
            continue;
        }
        let entry = grid.entry_voxel(outside, inside).unwrap();
        for k in 0..200 {
            // Dense near the end inside, where the part in the grid of a long segment is.
            let t = (f64::from(k) / 199.0).powi(3) * (12.0 / outside.distance(inside)).min(1.0);
            let Some(v) = grid.voxel_containing(inside + (outside - inside) * t) else { continue };
            places += 1;
            let between = |a: u32, v: u32, b: u32| (a.min(b)..=a.max(b)).contains(&v);
            assert!(
                between(entry.i, v.i, end.i) && between(entry.j, v.j, end.j) && between(entry.k, v.k, end.k),
                "{outside} to {inside}: {v} is not between {entry} and {end}"
            );
        }
    }
    assert!(places > 100_000, "{places}");
    for bad in [f64::NAN, f64::INFINITY, 1e201] {
        assert_eq!(grid.entry_voxel(DVec3::new(bad, 1.0, 1.0), DVec3::ONE), None);
    }
}
