use proptest::prelude::*;

use super::*;

const VOXELIZERS: [Voxelizer; 3] = [Voxelizer::Slices, Voxelizer::SeparatingAxes, Voxelizer::OffsetPolygon];

/// Units per voxel of the exact oracle: vertices are snapped to 1/16 voxel, dilations to 1/256.
const UNIT: i128 = 512;

/// The separating-axis test in integers: coordinates in 1/UNIT voxel, the box dilated by `dilation` units.
/// The 13 axes are taken as they are defined, with no thought to speed.
fn touches_exactly(vertices: &[[i128; 3]; 3], voxel: Voxel, dilation: i128) -> bool {
    let centre = [voxel.i, voxel.j, voxel.k].map(|c| i128::from(c) * UNIT + UNIT / 2);
    let radius = UNIT / 2 + dilation;
    let p = vertices.map(|v| [0, 1, 2].map(|axis| v[axis] - centre[axis]));
    let minus = |a: [i128; 3], b: [i128; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let cross =
        |a: [i128; 3], b: [i128; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let edges = [minus(p[1], p[0]), minus(p[2], p[1]), minus(p[0], p[2])];
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let mut axes = units.to_vec();
    axes.push(cross(edges[0], edges[1]));
    axes.extend(units.iter().flat_map(|&unit| edges.map(|edge| cross(unit, edge))));
    axes.iter().all(|axis| {
        let reach = radius * axis.iter().map(|c| c.abs()).sum::<i128>();
        let dots = p.map(|v| axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2]);
        dots.iter().any(|&d| d <= reach) && dots.iter().any(|&d| d >= -reach)
    })
}

/// A grid of voxels of size 1 whose origin is `offset`, and the set of triangles given in 1/16 voxel.
fn voxelize_snapped(resolution: [i32; 3], offset: f64, triangles: &[[[i32; 3]; 3]]) -> VoxelSet {
    snapped_with(Voxelizer::default(), resolution, offset, triangles)
}

fn snapped_with(voxelizer: Voxelizer, resolution: [i32; 3], offset: f64, triangles: &[[[i32; 3]; 3]]) -> VoxelSet {
    let extent = DVec3::from_array(resolution.map(f64::from));
    let grid = VoxelGrid::covering(DVec3::splat(offset), extent + offset, 1.0, 1 << 28).expect("a legal grid");
    let world = |c: i32| {
        let exact = f64::from(c) / 16.0 + offset;
        assert_eq!(f64::from(exact as f32), exact, "the test wants exact vertices");
        exact as f32
    };
    let triangles: Vec<_> = triangles.iter().map(|t| t.map(|v| Vec3::from_array(v.map(world)))).collect();
    voxelize_with(voxelizer, &grid, triangles).expect("finite vertices")
}

fn check(resolution: [i32; 3], offset: f64, triangle: [[i32; 3]; 3]) -> Result<(), TestCaseError> {
    let sets = VOXELIZERS.map(|voxelizer| (voxelizer, snapped_with(voxelizer, resolution, offset, &[triangle])));
    let exact = triangle.map(|v| v.map(|c| i128::from(c) * (UNIT / 16)));
    for voxel in sets[0].1.resolution().voxels() {
        let (touches, nearly) = (touches_exactly(&exact, voxel, 0), touches_exactly(&exact, voxel, 2));
        for (voxelizer, set) in &sets {
            let found = set.contains(voxel);
            prop_assert!(found || !touches, "{voxelizer:?}: {voxel:?} is missing for {triangle:?}");
            let tight = *voxelizer != Voxelizer::OffsetPolygon;
            prop_assert!(!tight || !found || nearly, "{voxelizer:?}: {voxel:?} is too much for {triangle:?}");
        }
    }
    Ok(())
}

const SIDES: [i32; 3] = [9, 7, 11];

/// Coordinates in 1/16 voxel: on faces, off faces, and outside the grid.
fn coordinate() -> impl Strategy<Value = i32> {
    prop_oneof![4 => (0..=11).prop_map(|c| 16 * c), 4 => 0..=176, 1 => -100..300, 1 => (-3..15).prop_map(|c| 16 * c + 1)]
}

fn vertex() -> impl Strategy<Value = [i32; 3]> {
    prop::array::uniform3(coordinate())
}

fn triangle() -> impl Strategy<Value = [[i32; 3]; 3]> {
    let offset = || prop::array::uniform3(-20..=20i32);
    let plus = |a: [i32; 3], b: [i32; 3]| [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
    prop_oneof![
        3 => prop::array::uniform3(vertex()),
        // Small ones.
        3 => (vertex(), offset(), offset()).prop_map(move |(a, d, e)| [a, plus(a, d), plus(a, e)]),
        // In a plane across an axis.
        2 => (prop::array::uniform3(vertex()), 0..3usize).prop_map(|(t, axis)| t.map(|mut v| { v[axis] = t[0][axis]; v })),
        // Slivers, down to segments.
        2 => (vertex(), vertex(), prop::array::uniform3(-1..=1i32)).prop_map(move |(a, b, d)| [a, b, plus(b, d)]),
        // Collinear and points.
        1 => (vertex(), offset(), -4..5i32).prop_map(move |(a, d, n)| [a, plus(a, d), plus(a, d.map(|c| n * c))]),
        1 => vertex().prop_map(|a| [a; 3]),
        // Huge: far beyond the grid.
        1 => prop::array::uniform3(prop::array::uniform3(-40_000..40_000i32)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4_000))]

    #[test]
    fn equals_the_exact_test_up_to_the_dilation(triangle in triangle()) {
        check(SIDES, 0.0, triangle)?;
    }

    /// At 2¹⁹ single precision has steps of 1/16, the finest that a voxel size of 1 allows.
    #[test]
    fn far_from_zero(triangle in triangle().prop_filter("exact", |t| t.iter().flatten().all(|&c| c >= 0))) {
        check(SIDES, 524_288.0, triangle.map(|v| v.map(|c| c.min(60_000))))?;
    }

    #[test]
    fn bounds_hold_all_voxels(triangle in triangle()) {
        let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::from_array(SIDES.map(f64::from)), 1.0, 1 << 28).expect("a legal grid");
        let world = triangle.map(|v| Vec3::from_array(v.map(|c| c as f32 / 16.0)));
        let set = voxelize(&grid, vec![world]).expect("finite");
        let bounds = voxel_bounds(&grid, world).expect("finite");
        prop_assert!(bounds.is_some() || set.is_empty());
        for v in set.iter() {
            let [first, last] = bounds.expect("not empty");
            prop_assert!(first.i <= v.i && first.j <= v.j && first.k <= v.k, "{first} {v}");
            prop_assert!(v.i <= last.i && v.j <= last.j && v.k <= last.k, "{last} {v}");
        }
    }

    #[test]
    fn vertex_order_does_not_matter(t in triangle()) {
        let set = voxelize_snapped(SIDES, 0.0, &[t]);
        for order in [[0, 2, 1], [1, 2, 0], [2, 1, 0]] {
            prop_assert_eq!(&voxelize_snapped(SIDES, 0.0, &[order.map(|i| t[i])]), &set);
        }
    }

    /// Voxel sizes that no binary fraction equals: rounding decides on which side of a face a point falls, so only
    /// the dilation saves these. The points are exactly on the triangle: vertices, and middles of edges.
    #[test]
    fn points_of_the_triangle_are_in_occupied_voxels(
        size in prop::sample::select(vec![3.0, 5.0, 7.0, 0.1, 1.0 / 3.0, 0.7]),
        origin in prop::array::uniform3(-20i32..=0),
        vertices in prop_oneof![
            2 => prop::array::uniform3(prop::array::uniform3(prop_oneof![0..=40i32, (0..=13).prop_map(|c| 3 * c)])),
            // Collinear: the computed normal is nothing but rounding error.
            1 => (prop::array::uniform3(12..=30i32), prop::array::uniform3(-4..=4i32), -3..=3i32)
                .prop_map(|(a, d, n)| [a, [a[0] + d[0], a[1] + d[1], a[2] + d[2]], [a[0] + n * d[0], a[1] + n * d[1], a[2] + n * d[2]]]),
        ],
    ) {
        let origin = DVec3::from_array(origin.map(f64::from));
        let grid = VoxelGrid::covering(origin, DVec3::splat(42.0), size, 1 << 30).expect("a legal grid");
        let [a, b, c] = vertices.map(|v| DVec3::from_array(v.map(f64::from)));
        for voxelizer in VOXELIZERS {
            let triangle = vertices.map(|v| Vec3::from_array(v.map(|c| c as f32)));
            let set = voxelize_with(voxelizer, &grid, vec![triangle]).expect("finite");
            for point in [a, b, c, (a + b) / 2.0, (b + c) / 2.0, (c + a) / 2.0, (2.0 * a + b + c) / 4.0] {
                let voxel = grid.voxel_containing(point).expect("inside");
                prop_assert!(set.contains(voxel), "{voxelizer:?}: {point} in {voxel:?}");
            }
        }
    }

    /// Vertices far outside the grid round by more than the grid's own dilation. The middle of an edge is known
    /// exactly.
    #[test]
    fn points_of_triangles_that_reach_far(
        size in prop::sample::select(vec![3.0, 7.0, 0.7]),
        middle in prop::array::uniform3((0..=13i32).prop_map(|c| 3 * c)),
        direction in prop::array::uniform3(-(1 << 23)..1 << 23i32),
        third in prop::array::uniform3(-(1 << 23)..1 << 23i32),
    ) {
        let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(42.0), size, 1 << 30).expect("a legal grid");
        let end = |sign: i32| Vec3::from_array([0, 1, 2].map(|axis| (middle[axis] + sign * direction[axis]) as f32));
        let triangle = [end(1), end(-1), Vec3::from_array(third.map(|c| c as f32))];
        let voxel = grid.voxel_containing(DVec3::from_array(middle.map(f64::from))).expect("inside");
        for voxelizer in VOXELIZERS {
            let set = voxelize_with(voxelizer, &grid, vec![triangle]).expect("finite");
            prop_assert!(set.contains(voxel), "{voxelizer:?}: {middle:?} in {voxel:?}");
        }
    }

    /// Closed to the last bit: right-angled triangles whose legs are powers of two along axes, where nothing rounds,
    /// without any dilation.
    #[test]
    fn equals_the_exact_test_without_dilation_where_nothing_rounds(
        corner in vertex(), axes in 0..6usize, exponent in 0..8u32, signs in any::<(bool, bool)>(),
    ) {
        let leg = |axis: usize, exponent: u32, negative: bool| {
            let mut v = corner;
            v[axis] += if negative { -(1 << exponent) } else { 1 << exponent };
            v
        };
        let (first, second) = (axes % 3, (axes % 3 + 1 + axes / 3) % 3);
        // Legs of one length, so that the slope of the third side is 1 as well.
        let snapped = [corner, leg(first, exponent, signs.0), leg(second, exponent, signs.1)];
        let triangle = snapped.map(|v| Vec3::from_array(v.map(|c| c as f32 / 16.0)));
        let sides = DVec3::from_array(SIDES.map(f64::from));
        let grid = VoxelGrid::covering(DVec3::ZERO, sides, 1.0, 1 << 28).expect("a legal grid");
        let bits = [(); 2].map(|()| AtomicBits::new(grid.resolution()));
        if let Some(triangle) = GridTriangle::new(&grid, triangle, 0.0).expect("finite") {
            slices::scan(&triangle, &bits[0]);
            triangle.scan_by_axes(|[i, j, k]| bits[1].insert_run(j, k, [i; 2]));
        }
        let exact = snapped.map(|v| v.map(|c| i128::from(c) * (UNIT / 16)));
        let sets = bits.map(AtomicBits::into_set);
        for voxel in grid.resolution().voxels() {
            let expected = touches_exactly(&exact, voxel, 0);
            prop_assert_eq!(sets[0].contains(voxel), expected, "slices: {:?}", voxel);
            prop_assert_eq!(sets[1].contains(voxel), expected, "axes: {:?}", voxel);
        }
    }
}

#[test]
fn a_triangle_across_a_large_grid_is_quadratic() {
    let n = 16 * 512;
    let set = voxelize_snapped([512, 512, 512], 0.0, &[[[0, 0, 0], [n, n, 0], [0, n, n]]]);
    // Half of a diagonal square takes at most some three voxels for each column.
    assert!((130_000..800_000).contains(&set.count()), "{}", set.count());
    let line = voxelize_snapped([512, 512, 512], 0.0, &[[[0, 0, 0], [n, n, n], [n / 2, n / 2, n / 2]]]);
    assert!((512..4 * 512 * 2).contains(&line.count()), "{}", line.count());
}

/// The offset polygon finds what slices find, and few voxels more.
#[test]
fn the_offset_polygon_is_conservative_and_nearly_tight() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(20.0), 0.4, 1 << 20).expect("a legal grid");
    for (size, most) in [(0.3, 0.02), (2.0, 0.12), (15.0, 0.02)] {
        let mut rng = fastrand::Rng::with_seed(7);
        let (mut slices, mut polygon) = (0, 0);
        for _ in 0..400 {
            let mut point = |reach: f32| Vec3::new(rng.f32(), rng.f32(), rng.f32()) * reach;
            let corner = point(19.0 - size);
            let triangle = vec![[corner + point(size), corner + point(size), corner + point(size)]];
            let set = |voxelizer| voxelize_with(voxelizer, &grid, triangle.clone()).expect("finite vertices");
            let (expected, found) = (set(Voxelizer::Slices), set(Voxelizer::OffsetPolygon));
            assert!(expected.iter().all(|v| found.contains(v)), "{triangle:?}");
            (slices, polygon) = (slices + expected.count(), polygon + found.count());
        }
        let excess = polygon as f64 / slices as f64 - 1.0;
        assert!((0.0..most).contains(&excess), "{size}: {excess}");
    }
}

#[test]
fn tiny_and_needle_triangles_do_not_vanish() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(8.0), 1.0, 1 << 20).expect("a legal grid");
    let at = |t: [[f32; 3]; 3]| voxelize(&grid, vec![t.map(Vec3::from_array)]).expect("finite");
    assert_eq!(at([[1e-40, 1e-42, 0.0], [1e-45, 1e-41, 0.0], [0.0, -0.0, 1e-45]]).count(), 1);
    let e = f32::EPSILON;
    let needle = at([[0.5, 0.5, 0.5], [7.5, 7.5, 7.5], [7.5, 7.5 + 4.0 * e, 7.5]]);
    assert!((0..8).all(|i| needle.contains(Voxel::new(i, i, i))));
    let across_zero = at([[-1e-30, 4.0, 4.0], [1e-30, 4.5, 4.5], [-1e-30, 4.0, 4.5]]);
    assert!(across_zero.contains(Voxel::new(0, 4, 4)));
}

/// The same set from one thread and from many, for every method, although threads race for the words.
#[test]
fn threads_do_not_matter() {
    let grid = VoxelGrid::covering(DVec3::ZERO, DVec3::splat(20.0), 0.3, 1 << 20).expect("a legal grid");
    let vertex = |n: u32| Vec3::new((n * 37 % 199) as f32, (n * 101 % 193) as f32, (n * 53 % 197) as f32) * 0.1;
    let triangles: Vec<_> = (0..2000u32).map(|n| [vertex(3 * n), vertex(3 * n + 1), vertex(n)]).collect();
    for voxelizer in VOXELIZERS {
        let sets = [1, 2, 7].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| voxelize_with(voxelizer, &grid, triangles.clone()).expect("finite vertices"))
        });
        assert!(sets.iter().all(|set| *set == sets[0]), "{voxelizer:?}");
    }
}
