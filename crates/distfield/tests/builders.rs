//! The builders of `ndf` give the same bytes, which validation proves to be the definition, on grids of all shapes and
//! densities.

mod common;

use common::{random, set};
use proptest::prelude::*;
use vdf_distfield::{Ndf, NdfBuilder, SafeZones};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

/// Builds with each builder on 1, 2 and 5 threads.
fn check(occupied: &VoxelSet) {
    let resolution = occupied.resolution();
    let bytes = |field: &Ndf| resolution.voxels().map(|voxel| field.distance(voxel)).collect::<Vec<_>>();
    let expected = Ndf::build(occupied);
    assert_eq!(expected.validate(occupied), Ok(()), "{resolution}");
    for threads in [1, 2, 5] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        for builder in [NdfBuilder::Sweeps, NdfBuilder::Wavefront] {
            let field = pool.install(|| Ndf::build_with(builder, occupied));
            assert!(bytes(&field) == bytes(&expected), "{builder:?} on {threads} threads, {resolution}");
        }
    }
}

/// One voxel in `share`, at random places.
fn scattered(resolution: Resolution, share: usize, seed: u64) -> VoxelSet {
    let mut below = random(seed);
    let [x, y, z] = resolution.sides();
    let count = resolution.voxel_count().div_ceil(share);
    set(resolution, (0..count).map(|_| Voxel::new(below(x), below(y), below(z))))
}

const SHAPES: [[u32; 3]; 16] = [
    [1, 1, 1],
    [1, 1, 700],
    [1, 700, 1],
    [700, 1, 1],
    [2, 1, 3],
    [64, 3, 2],
    [63, 5, 4],
    [65, 4, 5],
    [128, 7, 1],
    [130, 1, 9],
    [5, 300, 3],
    [3, 2, 301],
    [64, 64, 64],
    [100, 40, 33],
    // More than one job a slice, and more voxels than one thread is left alone with.
    [300, 150, 4],
    [190, 350, 3],
];

#[test]
fn empty_full_and_single_voxels() {
    for [x, y, z] in SHAPES {
        let resolution = Resolution::new(x, y, z);
        check(&VoxelSet::new(resolution));
        check(&VoxelSet::from_rows(resolution, |_, _, row| row.fill(u64::MAX)));
        for voxel in
            [Voxel::new(0, 0, 0), resolution.last(), Voxel::new(x / 2, y / 2, z / 2), Voxel::new(x - 1, 0, z / 3)]
        {
            check(&set(resolution, [voxel]));
        }
    }
}

#[test]
fn all_densities() {
    for ([x, y, z], seed) in SHAPES.into_iter().zip(0..) {
        for share in [2, 50, 5_000] {
            check(&scattered(Resolution::new(x, y, z), share, seed));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn any_shape(
        x in prop_oneof![1u32..10, 60u32..70, 120u32..140], y in 1u32..20, z in 1u32..20,
        share in prop::sample::select(vec![1usize, 3, 30, 300, 100_000]), seed in any::<u64>(),
    ) {
        check(&scattered(Resolution::new(x, y, z), share, seed));
    }
}

/// A voxel that the grid does not have has the distance 0, about which nothing is proved, not that of some other voxel.
#[test]
fn there_is_nothing_beyond_the_grid() {
    let resolution = Resolution::new(5, 4, 3);
    let empty = VoxelSet::new(resolution);
    let (ndf, amr) = (Ndf::build(&empty), vdf_distfield::Amr::build(&empty));
    let (dsz, dual) = (vdf_distfield::Dsz::build(&empty), vdf_distfield::Dual::build(&empty));
    for beyond in
        [Voxel::new(5, 0, 0), Voxel::new(0, 4, 0), Voxel::new(0, 0, 3), Voxel::new(u32::MAX, u32::MAX, u32::MAX)]
    {
        assert_eq!((ndf.distance(beyond), dual.distance(beyond)), (0, 0), "{beyond}");
        for octant in 0..8 {
            assert_eq!(amr.distance(octant, beyond), 0, "{beyond}");
        }
        for face in 0..6 {
            let found = (dsz.half_space_distance(face, beyond), dsz.distance(face, beyond), dual.extent(face, beyond));
            assert_eq!(found, (0, 0, 0), "{beyond}");
        }
    }
}
