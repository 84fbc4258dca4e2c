//! What the tests of this crate share: sets of occupied voxels of all shapes and the slow definitions.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses its own part")]

use proptest::prelude::*;
use vdf_distfield::{SafeZones, VoxelBox};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

/// All fields of these occupied voxels, with their names.
pub fn fields(occupied: &VoxelSet) -> [(&'static str, Box<dyn SafeZones>); 4] {
    [
        ("ndf", Box::new(vdf_distfield::Ndf::build(occupied))),
        ("amr", Box::new(vdf_distfield::Amr::build(occupied))),
        ("dsz", Box::new(vdf_distfield::Dsz::build(occupied))),
        ("dual", Box::new(vdf_distfield::Dual::build(occupied))),
    ]
}

pub fn cuboid_is_free(occupied: &VoxelSet, a: Voxel, b: Voxel) -> bool {
    VoxelBox::spanning(a, b).voxels().all(|v| !occupied.contains(v))
}

/// Reproducible pseudo-random numbers below a bound (SplitMix64).
pub fn random(seed: u64) -> impl FnMut(u32) -> u32 {
    let mut state = seed;
    move |bound| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % u64::from(bound)) as u32
    }
}

pub fn set(resolution: Resolution, voxels: impl IntoIterator<Item = Voxel>) -> VoxelSet {
    let mut set = VoxelSet::new(resolution);
    set.extend(voxels);
    set
}

pub fn shapes() -> impl Strategy<Value = Resolution> {
    let fixed: Vec<_> = [
        (1, 1, 1),
        (1, 1, 9),
        (1, 9, 1),
        (9, 1, 1),
        (2, 2, 2),
        (1, 2, 3),
        (3, 1, 2),
        (63, 2, 2),
        (64, 2, 2),
        (65, 2, 2),
        (2, 65, 1),
    ]
    .map(|(x, y, z)| Resolution::new(x, y, z))
    .into();
    let random = (1u32..9, 1u32..9, 1u32..9).prop_map(|(x, y, z)| Resolution::new(x, y, z));
    prop_oneof![prop::sample::select(fixed), random]
}

/// A set and some voxels of its grid, any of which may be occupied.
pub fn scene() -> impl Strategy<Value = (VoxelSet, Vec<Voxel>)> {
    let indices = |max| prop::collection::vec(any::<prop::sample::Index>(), 0..=max);
    let count = prop_oneof![Just(1usize), Just(3), Just(12), Just(100)].prop_flat_map(indices);
    (shapes(), count, indices(6)).prop_map(|(resolution, occupied, chosen)| {
        let at = |index: prop::sample::Index| {
            let n = index.index(resolution.voxel_count()) as u32;
            Voxel::new(n % resolution.x(), n / resolution.x() % resolution.y(), n / (resolution.x() * resolution.y()))
        };
        (set(resolution, occupied.into_iter().map(at)), chosen.into_iter().map(at).collect())
    })
}
