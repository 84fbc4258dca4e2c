use glam::DVec3;
use proptest::prelude::*;

use super::*;
use crate::{Resolution, Voxelizer, voxelize, voxelize_with};

fn grid() -> VoxelGrid {
    VoxelGrid::covering(DVec3::ZERO, DVec3::new(70.0, 9.0, 6.0), 1.0, 1 << 20).expect("a legal grid")
}

/// Through voxel interiors: the vertices of the second lie outside the grid.
const TRIANGLES: [[Vec3; 3]; 2] = [
    [Vec3::new(1.2, 1.3, 1.4), Vec3::new(66.3, 2.6, 4.7), Vec3::new(3.3, 7.6, 2.2)],
    [Vec3::new(-40.0, 5.5, -30.0), Vec3::new(110.0, 5.6, -30.0), Vec3::new(35.0, 5.4, 90.0)],
];

fn sound() -> VoxelSet {
    voxelize(&grid(), TRIANGLES.to_vec()).expect("finite vertices")
}

/// `set` without one of its voxels.
fn without(set: &VoxelSet, voxel: Voxel) -> VoxelSet {
    VoxelSet::from_rows(set.resolution(), |j, k, row| {
        row.copy_from_slice(set.row(j, k));
        if (j, k) == (voxel.j, voxel.k) {
            row[voxel.i as usize / 64] &= !(1 << (voxel.i % 64));
        }
    })
}

#[test]
fn sound_sets_pass_and_excess_is_counted() {
    assert_eq!(sound().validate(&grid(), TRIANGLES.to_vec()), Ok(0));
    let mut more = sound();
    more.extend([Voxel::new(69, 8, 5), Voxel::new(0, 0, 0)]);
    assert_eq!(more.validate(&grid(), TRIANGLES.to_vec()), Ok(2));
    let all = VoxelSet::from_rows(grid().resolution(), |_, _, row| row.fill(u64::MAX));
    assert_eq!(all.validate(&grid(), Vec::new()), Ok(70 * 9 * 6));
}

#[test]
fn another_resolution_is_an_error() {
    let resolution = Resolution::new(70, 9, 7);
    let result = VoxelSet::new(resolution).validate(&grid(), TRIANGLES.to_vec());
    assert_eq!(result, Err(VoxelError::ResolutionMismatch { set: resolution, grid: grid().resolution() }));
    let message = result.expect_err("tested above").to_string();
    assert!(message.contains("70 × 9 × 7") && message.contains("70 × 9 × 6"), "{message}");
}

#[test]
fn set_padding_bits_are_an_error_that_names_where() {
    let set = sound();
    let mut words: Vec<_> =
        (0..6).flat_map(|k| (0..9).map(move |j| (j, k))).flat_map(|(j, k)| set.row(j, k).to_vec()).collect();
    // Row (·, 2, 1): 70 voxels leave the bits 6 to 63 of the second word unused.
    words[2 * (2 + 9) + 1] |= 1 << 6;
    let damaged = VoxelSet::from_words(set.resolution(), words);
    let error = VoxelError::PaddingNotClear { voxel: Voxel::new(70, 2, 1) };
    assert_eq!(damaged.validate(&grid(), TRIANGLES.to_vec()), Err(error));
    assert!(error.to_string().contains("(70, 2, 1)"));
}

#[test]
fn every_missing_voxel_is_found_and_named_with_its_triangle() {
    let per_triangle = TRIANGLES.map(|t| voxelize(&grid(), vec![t]).expect("finite vertices"));
    for voxel in sound().iter() {
        let triangle = usize::from(!per_triangle[0].contains(voxel));
        let result = without(&sound(), voxel).validate(&grid(), TRIANGLES.to_vec());
        assert_eq!(result, Err(VoxelError::NotOccupied { triangle, voxel }));
    }
    let message = VoxelError::NotOccupied { triangle: 7, voxel: Voxel::new(1, 2, 3) }.to_string();
    assert!(message.contains("triangle 7") && message.contains("(1, 2, 3)"), "{message}");
}

#[test]
fn the_vertices_are_checked_first() {
    // Triangle 1 misses voxels long before the vertices of triangle 2 are asked for in the dear pass.
    let triangles = vec![TRIANGLES[1], [Vec3::new(0.5, 0.5, 0.5); 3]];
    let error = VoxelError::NotOccupied { triangle: 1, voxel: Voxel::new(0, 0, 0) };
    assert_eq!(VoxelSet::new(grid().resolution()).validate(&grid(), triangles), Err(error));
}

#[test]
fn vertices_that_are_not_finite_are_errors() {
    let result = sound().validate(&grid(), vec![[Vec3::NAN; 3]]);
    assert_eq!(result, Err(VoxelError::NonFiniteTriangle));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// No false alarm: triangles whose vertices lie within a few steps of faces, in a grid where nothing is exact.
    #[test]
    fn what_either_method_finds_passes(
        size in prop::sample::select(vec![0.1, 0.7, 1.0 / 3.0, 3.0]),
        vertices in prop::collection::vec(prop::array::uniform3((0..=9i32, -2..=2i32, any::<bool>())), 3..30),
    ) {
        let origin = DVec3::new(-0.3, 1e3, 0.1);
        let grid = VoxelGrid::covering(origin, origin + 9.0 * size, size, 1 << 20).expect("a legal grid");
        let on = |axis: usize, (face, steps, inside): (i32, i32, bool)| {
            let x = (origin[axis] + (f64::from(face) + if inside { 0.37 } else { 0.0 }) * size) as f32;
            (0..steps.abs()).fold(x, |x, _| if steps < 0 { x.next_down() } else { x.next_up() })
        };
        let vertices: Vec<_> = vertices.iter().map(|v| Vec3::new(on(0, v[0]), on(1, v[1]), on(2, v[2]))).collect();
        let triangles: Vec<_> = vertices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
        for voxelizer in [Voxelizer::Slices, Voxelizer::SeparatingAxes] {
            let set = voxelize_with(voxelizer, &grid, triangles.clone()).expect("finite vertices");
            prop_assert!(set.validate(&grid, triangles.clone()).is_ok(), "{voxelizer:?}");
        }
    }
}
