//! Hard cases of voxelization, each a test of its own. The numbers are those of the list in `docs/numerics.md`.

use glam::{DVec3, Vec3, vec3};
use vdf_voxel::{Resolution, Voxel, VoxelError, VoxelGrid, VoxelSet, Voxelizer, voxelize_with};

fn covering(min: f64, max: f64, size: f64) -> VoxelGrid {
    VoxelGrid::covering(DVec3::splat(min), DVec3::splat(max), size, 1 << 28).expect("a legal grid")
}

/// The cube of 8³ voxels of size 1 at the origin.
fn cube() -> VoxelGrid {
    covering(0.0, 8.0, 1.0)
}

/// The set by both methods, which must agree, and must pass validation without excess.
fn voxels(grid: &VoxelGrid, triangles: &[[Vec3; 3]]) -> VoxelSet {
    let [set, twin] = [Voxelizer::Slices, Voxelizer::SeparatingAxes]
        .map(|method| voxelize_with(method, grid, triangles.to_vec()).expect("finite vertices"));
    assert_eq!(set, twin, "the methods differ");
    assert_eq!(set.validate(grid, triangles.to_vec()), Ok(0));
    set
}

/// Points of a triangle, with weights that are multiples of 1/`n`, all lie in occupied voxels.
fn assert_covered(grid: &VoxelGrid, set: &VoxelSet, triangle: &[Vec3; 3], n: u32) {
    let [a, b, c] = triangle.map(|v| v.as_dvec3());
    for (i, j) in (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))) {
        let point = (a * f64::from(n - i - j) + b * f64::from(i) + c * f64::from(j)) / f64::from(n);
        let voxel = grid.voxel_containing(point);
        assert!(voxel.is_none_or(|voxel| set.contains(voxel)), "{point} in {voxel:?}");
    }
}

fn coordinates(set: &VoxelSet) -> Vec<[u32; 3]> {
    set.iter().map(|v| [v.i, v.j, v.k]).collect()
}

/// The coordinates (x, y, z) as (z, x, y), `times` times.
fn turned<T>(mut v: [T; 3], times: usize) -> [T; 3] {
    v.rotate_right(times);
    v
}

#[test]
fn case_01_a_triangle_in_a_plane_of_faces_marks_both_sides() {
    for axis in 0..3 {
        let triangle = [[1.5, 1.5, 4.0], [2.5, 1.5, 4.0], [1.5, 2.5, 4.0]].map(|v| turned(v, axis).into());
        // The middle of the long edge is the common edge of the four columns.
        let mut expected = [3, 4].map(|k| [[1, 1, k], [2, 1, k], [1, 2, k], [2, 2, k]]).concat();
        expected.iter_mut().for_each(|v| *v = turned(*v, axis));
        expected.sort_by_key(|&[i, j, k]| [k, j, i]);
        assert_eq!(coordinates(&voxels(&cube(), &[triangle])), expected);
    }
}

#[test]
fn case_02_a_vertex_on_a_corner_marks_eight_voxels() {
    let corner = voxels(&cube(), &[[Vec3::splat(4.0); 3]]);
    assert_eq!(corner.count(), 8);
    assert!((0..8).all(|n| corner.contains(Voxel::new(3 + n % 2, 3 + n / 2 % 2, 3 + n / 4))));
    // The tip of a triangle that lies in one of them.
    let tip = voxels(&cube(), &[[Vec3::splat(4.0), vec3(4.5, 4.2, 4.2), vec3(4.2, 4.5, 4.2)]]);
    assert_eq!(tip, corner);
}

#[test]
fn case_03_an_edge_along_an_edge_of_voxels_marks_four_rows() {
    for axis in 0..3 {
        let triangle = [[0.0, 3.0, 5.0], [8.0, 3.0, 5.0], [4.0, 3.1, 5.1]].map(|v| turned(v, axis).into());
        let set = voxels(&cube(), &[triangle]);
        assert_eq!(set.count(), 4 * 8);
        for n in 0..8 {
            for side in [[n, 2, 4], [n, 3, 4], [n, 2, 5], [n, 3, 5]] {
                let [i, j, k] = turned(side, axis);
                assert!(set.contains(Voxel::new(i, j, k)));
            }
        }
    }
}

/// They are the segments or points that they are.
#[test]
fn case_04_triangles_without_area_block() {
    assert_eq!(coordinates(&voxels(&cube(), &[[vec3(2.5, 3.5, 4.5); 3]])), [[2, 3, 4]]);
    // The third vertex at an end, between the ends, and beyond.
    let ends = [vec3(0.5, 0.5, 0.5), vec3(7.5, 5.5, 3.5)];
    let middle = (ends[0] + ends[1]) / 2.0;
    let segments = [[ends[0], ends[1], ends[1]], [ends[0], ends[1], middle], [middle, ends[0], ends[1]]];
    let sets = segments.map(|t| voxels(&cube(), &[t]));
    assert!(sets.iter().all(|set| *set == sets[0]));
    assert_covered(&cube(), &sets[0], &segments[0], 64);
    assert!((8..=24).contains(&sets[0].count()), "a segment is no area: {}", sets[0].count());
}

/// 10⁶ and more to 1, along an axis, along a diagonal and askew.
#[test]
fn case_05_needles() {
    let grid = covering(0.0, 100.0, 1.0);
    for end in [vec3(99.5, 50.0, 0.5), Vec3::splat(99.5), vec3(3.3, 97.1, 61.7)] {
        for width in [1e-4, 1e-6, f32::EPSILON] {
            let needle = [vec3(0.5, 50.0, 0.5), end, end + vec3(0.0, width, -width)];
            let set = voxels(&grid, &[needle]);
            assert_covered(&grid, &set, &needle, 512);
            assert!(set.count() < 1000, "{}", set.count());
        }
    }
}

/// With all vertices on the grid, and with all of them far outside.
#[test]
fn case_06_a_triangle_across_the_whole_grid() {
    let grid = covering(0.0, 64.0, 1.0);
    for triangle in [
        [Vec3::ZERO, vec3(64.0, 64.0, 0.0), vec3(0.0, 64.0, 64.0)],
        [vec3(-1e4, 30.3, -1e4), vec3(3e4, 33.1, -1e4), vec3(-1e4, 31.7, 3e4)],
        [vec3(-1e6, -1e6, 32.5), vec3(1e6, -1e6, 33.5), vec3(0.0, 1e6, 31.5)],
    ] {
        let set = voxels(&grid, &[triangle]);
        assert_covered(&grid, &set, &triangle, 256);
        assert!((64 * 64 / 2..4 * 64 * 64).contains(&set.count()), "{}", set.count());
    }
}

#[test]
fn case_07_a_million_triangles_in_one_voxel() {
    let triangles: Vec<_> = (0..1_000_000u32)
        .map(|n| {
            let a = vec3((n % 97) as f32, (n % 89) as f32, (n % 83) as f32) * 0.009 + Vec3::splat(4.05);
            [a, a + vec3(0.01, 0.0, 0.003), a + vec3(0.0, 0.02, 0.001)]
        })
        .collect();
    let set = voxelize_with(Voxelizer::Slices, &cube(), triangles).expect("finite vertices");
    assert_eq!(coordinates(&set), [[4, 4, 4]]);
}

/// The step of single precision at 10⁶ is 1/16. The error names what works, and what works is sound.
#[test]
fn case_08_coordinates_of_a_million_and_voxels_of_a_thousandth() {
    let covering = |size| VoxelGrid::covering(DVec3::splat(1e6), DVec3::splat(1e6 + 16.0), size, 1 << 28);
    let Err(error @ VoxelError::TooFine { smallest, .. }) = covering(1e-3) else { panic!("must be too fine") };
    assert!(error.to_string().ends_with("the smallest usable voxel size is 0.25"), "{error}");
    let grid = covering(smallest).expect("the size that the error names");
    assert_eq!(grid.resolution(), Resolution::new(64, 64, 64));
    let triangle = [vec3(0.0625, 3.0, 15.9375), vec3(15.875, 0.25, 0.125), vec3(7.0, 16.0, 8.5)];
    let triangle = triangle.map(|v| v + Vec3::splat(1e6));
    assert_covered(&grid, &voxels(&grid, &[triangle]), &triangle, 128);
}

/// Products of such edges underflow in single and, in part, in double precision.
#[test]
fn case_09_edges_far_below_a_voxel_and_denormal_extents() {
    for edge in [1e-20f32, 1e-38, f32::from_bits(1)] {
        let small = [Vec3::ZERO, vec3(edge, 0.0, edge), vec3(0.0, edge, edge)];
        assert_eq!(coordinates(&voxels(&cube(), &[small])), [[0, 0, 0]]);
        assert_eq!(voxels(&cube(), &[small.map(|v| v + Vec3::splat(4.0))]).count(), 8);
        let across_the_border = [vec3(-edge, 4.5, 4.5), vec3(edge, 4.6, 4.5), vec3(-edge, 4.5, 4.6)];
        assert_eq!(coordinates(&voxels(&cube(), &[across_the_border])), [[0, 4, 4]]);
        let long = [Vec3::ZERO, vec3(edge, 7.5, edge), vec3(0.0, 7.5, edge)];
        assert_covered(&cube(), &voxels(&cube(), &[long]), &long, 64);
    }
    // A scene of denormal extent, four voxels of the finest size across.
    let step = f32::from_bits(1);
    let grid = covering(0.0, f64::from(16.0 * step), f64::from(4.0 * step));
    let triangle = [Vec3::ZERO, vec3(16.0, 8.0, 4.0) * step, vec3(1.0, 16.0, 16.0) * step];
    assert_covered(&grid, &voxels(&grid, &[triangle]), &triangle, 64);
}

#[test]
fn case_10_vertices_that_are_not_finite_are_errors() {
    for method in [Voxelizer::Slices, Voxelizer::SeparatingAxes] {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for n in 0..9 {
                let mut triangle = [Vec3::ONE, vec3(2.0, 1.0, 1.0), vec3(1.0, 2.0, 1.0)];
                triangle[n / 3][n % 3] = bad;
                let result = voxelize_with(method, &cube(), vec![[Vec3::ONE; 3], triangle]);
                assert_eq!(result, Err(VoxelError::NonFiniteTriangle));
            }
        }
    }
}

/// They belong to the last layer, also where the bound is no whole number of voxels.
#[test]
fn case_11_geometry_on_the_greatest_faces() {
    for axis in 0..3 {
        let wall = [[0.0, 0.0, 8.0], [8.0, 0.0, 8.0], [0.0, 8.0, 8.0]].map(|v| turned(v, axis).into());
        let set = voxels(&cube(), &[wall]);
        assert_covered(&cube(), &set, &wall, 16);
        assert!(set.iter().all(|v| [v.i, v.j, v.k][(axis + 2) % 3] == 7));
    }
    for (max, size) in [(0.3f32, 0.1), (0.7, 0.1), (1.1, 0.3), (1e6, 33333.3), (1.0, 1.0 / 49.0)] {
        let grid = covering(0.0, max.into(), size);
        let last = grid.voxel_containing(DVec3::splat(max.into())).expect("inside");
        assert_eq!(last, grid.resolution().last());
        assert!(voxels(&grid, &[[Vec3::splat(max); 3]]).contains(last));
    }
}

#[test]
fn case_12_a_flat_scene_has_one_layer() {
    let grid = VoxelGrid::covering(DVec3::new(0.0, 3.0, 0.0), DVec3::new(6.0, 3.0, 4.0), 1.0, 1 << 20);
    let grid = grid.expect("a legal grid");
    assert_eq!(grid.resolution(), Resolution::new(6, 1, 4));
    let [a, b, c, d] = [[0.0, 0.0], [6.0, 0.0], [6.0, 4.0], [0.0, 4.0]].map(|[x, z]| vec3(x, 3.0, z));
    assert_eq!(voxels(&grid, &[[a, b, c], [a, c, d]]).count(), 24);
    assert_eq!(voxels(&covering(5.0, 5.0, 1.0), &[[Vec3::splat(5.0); 3]]).count(), 1);
}

/// The voxels in the middle of a large triangle hold neither a vertex nor an edge.
#[test]
fn case_13_a_triangle_through_the_interior_of_a_voxel() {
    for axis in 0..3 {
        let triangle = [[-90.0, 4.4, -50.0], [100.0, 4.3, -50.0], [3.0, 4.7, 150.0]].map(|v| turned(v, axis).into());
        let set = voxels(&cube(), &[triangle]);
        assert_eq!(set.count(), 64);
        assert!(set.iter().all(|v| turned([v.i, v.j, v.k], 3 - axis)[1] == 4));
    }
}

/// Once or often, in one direction or the other.
#[test]
fn case_14_coincident_and_opposite_faces() {
    let [a, b, c] = [vec3(1.1, 2.0, 3.0), vec3(7.0, 2.5, 3.0), vec3(1.1, 6.0, 5.0)];
    let once = voxels(&cube(), &[[a, b, c]]);
    assert_eq!(voxels(&cube(), &[[a, b, c], [a, b, c], [a, c, b], [b, a, c], [c, a, b]]), once);
    assert_eq!(voxels(&cube(), &[[c, b, a]]), once);
}

/// An edge on one side meets two on the other, whose common vertex is rounded off it. Each side covers its own part
/// of the crack.
#[test]
fn case_15_cracks_at_t_junctions() {
    let grid = covering(0.0, 8.0, 1.0 / 3.0);
    let (a, b, apex) = (vec3(0.3, 0.1, 0.7), vec3(7.9, 7.3, 6.1), vec3(0.0, 7.0, 4.0));
    let junction = a + (b - a) / 3.0;
    let one = [a, b, vec3(7.0, 0.0, 3.0)];
    let other = [[a, apex, junction], [junction, apex, b]];
    let (left, right) = (voxels(&grid, &[one]), voxels(&grid, &other));
    let along = |from: Vec3, to: Vec3| [from, to, to];
    assert_covered(&grid, &left, &along(a, b), 512);
    assert_covered(&grid, &right, &along(a, junction), 512);
    assert_covered(&grid, &right, &along(junction, b), 512);
}

/// The third vertex is a step off the line or on it, on every side, so that the normal is a rounding error.
#[test]
fn case_16_normals_that_are_rounding_errors() {
    let grid = covering(-40.0, 40.0, 1.0);
    let (a, b) = (vec3(-33.1, -21.7, -11.3), vec3(35.9, 27.3, 38.7));
    let m = a + (b - a) * 0.37;
    for n in 0..27 {
        let step = |v: f32, n: usize| [v.next_down(), v, v.next_up()][n % 3];
        let triangle = [a, vec3(step(m.x, n), step(m.y, n / 3), step(m.z, n / 9)), b];
        let set = voxels(&grid, &[triangle]);
        assert_covered(&grid, &set, &triangle, 256);
        assert!(set.count() < 300, "{}", set.count());
    }
}

/// Sizes and coordinates at the ends of their ranges: a grid, or an error that says what works.
#[test]
fn absurd_voxel_sizes_and_coordinates_name_what_works() {
    let covering = |reach: f64, size| VoxelGrid::covering(DVec3::splat(-reach), DVec3::splat(reach), size, 1 << 22);
    for size in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -1.0, 1e300] {
        let Err(error @ VoxelError::InvalidVoxelSize { .. }) = covering(1.0, size) else { panic!("{size} is invalid") };
        assert!(error.to_string().contains("at most 1e60"), "{error}");
    }
    for reach in [0.0, f64::from(f32::from_bits(1)), 1e-20, 1.0, 1e30, f32::MAX.into()] {
        for size in [5e-324, f64::MIN_POSITIVE, 1e-60] {
            let Err(error @ (VoxelError::TooFine { smallest, .. } | VoxelError::TooManyVoxels { smallest, .. })) =
                covering(reach, size)
            else {
                panic!("{size} is too small for {reach}")
            };
            assert!(error.to_string().ends_with(&format!("the smallest usable voxel size is {smallest:?}")), "{error}");
            assert!(error.to_string().len() < 200, "{error}");
            let grid = covering(reach, smallest).expect("the size that the error names");
            let triangle = [vec3(-1.0, -1.0, -1.0), vec3(1.0, 0.5, 0.0), vec3(0.0, 1.0, 1.0)].map(|v| v * reach as f32);
            let set = voxelize_with(Voxelizer::Slices, &grid, vec![triangle]).expect("finite vertices");
            assert_covered(&grid, &set, &triangle, 64);
        }
        assert_eq!(covering(reach, 1e60).expect("one voxel").resolution(), Resolution::new(1, 1, 1));
    }
    for bound in [f64::NAN, f64::INFINITY, 1e300] {
        assert_eq!(covering(bound, 1.0), Err(VoxelError::NonFiniteBounds));
    }
}

/// In a grid of ordinary size: rounding is many voxels, and the dilation grows with it.
#[test]
fn triangles_far_larger_than_the_grid() {
    for reach in [1e9f32, 1e15, 1e30, f32::MAX] {
        let triangle = [vec3(-reach, -reach, 4.5), vec3(reach, -reach, 4.5), vec3(0.0, reach, 4.5)];
        for method in [Voxelizer::Slices, Voxelizer::SeparatingAxes] {
            let set = voxelize_with(method, &cube(), vec![triangle]).expect("finite vertices");
            assert!((0..64).all(|n| set.contains(Voxel::new(n % 8, n / 8, 4))), "{method:?} {reach}");
        }
    }
}
