//! Every field equals its brute-force definition, and what it proves has the free cuboid property.

use proptest::prelude::*;
use vdf_distfield::{Amr, Ndf, SafeNeighbourhood, SafeZones, chessboard_distance};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

/// The distance to the nearest occupied voxel for which `admits` holds, saturated like the fields.
fn nearest(occupied: &[Voxel], from: Voxel, admits: impl Fn(Voxel) -> bool) -> u8 {
    let distances = occupied.iter().filter(|&&u| admits(u)).map(|&u| chessboard_distance(from, u));
    distances.min().map_or(255, |d| d.min(255) as u8)
}

/// True if `u` is in the closed octant of `v`: Def. 9, with bit 0, 1, 2 for the negative direction of x, y, z.
fn in_octant(octant: usize, v: Voxel, u: Voxel) -> bool {
    let in_order = |bit: usize, v: u32, u: u32| if octant & bit == 0 { v <= u } else { v >= u };
    in_order(1, v.i, u.i) && in_order(2, v.j, u.j) && in_order(4, v.k, u.k)
}

fn cuboid_is_free(occupied: &VoxelSet, a: Voxel, b: Voxel) -> bool {
    (a.k.min(b.k)..=a.k.max(b.k)).all(|k| {
        (a.j.min(b.j)..=a.j.max(b.j))
            .all(|j| (a.i.min(b.i)..=a.i.max(b.i)).all(|i| !occupied.contains(Voxel::new(i, j, k))))
    })
}

fn check_values(occupied: &VoxelSet) {
    let list: Vec<_> = occupied.iter().collect();
    let (ndf, amr) = (Ndf::build(occupied), Amr::build(occupied));
    for v in occupied.resolution().voxels() {
        assert_eq!(ndf.distance(v), nearest(&list, v, |_| true), "ndf at {v:?}");
        for octant in 0..8 {
            let expected = nearest(&list, v, |u| in_octant(octant, v, u));
            assert_eq!(amr.distance(octant, v), expected, "amr at {v:?}, octant {octant}");
        }
    }
}

/// Checks all pairs of a few voxels with all voxels: the definition of the safe zones, soundness and symmetry.
fn check_proofs(occupied: &VoxelSet, chosen: &[Voxel]) {
    let list: Vec<_> = occupied.iter().collect();
    let (ndf, amr) = (Ndf::build(occupied), Amr::build(occupied));
    let safe_ndf = |a, b| chessboard_distance(a, b) < u32::from(nearest(&list, a, |_| true));
    let safe_amr = |a, b| {
        let octants = (0..8).filter(|&octant| in_octant(octant, a, b));
        octants
            .into_iter()
            .any(|octant| chessboard_distance(a, b) < u32::from(nearest(&list, a, |u| in_octant(octant, a, u))))
    };
    for &a in chosen {
        let near = [SafeNeighbourhood::new(&ndf, occupied, a), SafeNeighbourhood::new(&amr, occupied, a)];
        let mut counts = [0, 0];
        for b in occupied.resolution().voxels() {
            let proofs = [ndf.proves(a, b), amr.proves(a, b)];
            assert_eq!(proofs[0], safe_ndf(a, b) || safe_ndf(b, a), "ndf {a:?} {b:?}");
            assert_eq!(proofs[1], safe_amr(a, b) || safe_amr(b, a), "amr {a:?} {b:?}");
            assert_eq!(proofs, [ndf.proves(b, a), amr.proves(b, a)], "symmetry {a:?} {b:?}");
            assert_eq!(proofs, [near[0].proves(b), near[1].proves(b)], "neighbourhood {a:?} {b:?}");
            assert!(!(proofs[0] || proofs[1]) || cuboid_is_free(occupied, a, b), "unsound: {a:?} {b:?}");
            assert!(proofs[1] || !proofs[0], "amr proves whatever ndf does: {a:?} {b:?}");
            counts = [counts[0] + usize::from(proofs[0]), counts[1] + usize::from(proofs[1])];
        }
        assert_eq!(counts, [near[0].count(), near[1].count()]);
    }
}

fn set(resolution: Resolution, voxels: impl IntoIterator<Item = Voxel>) -> VoxelSet {
    let mut set = VoxelSet::new(resolution);
    set.extend(voxels);
    set
}

fn shapes() -> impl Strategy<Value = Resolution> {
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

fn scene() -> impl Strategy<Value = (VoxelSet, Vec<Voxel>)> {
    let indices = |max| prop::collection::vec(any::<prop::sample::Index>(), 0..=max);
    let count = prop_oneof![Just(1usize), Just(3), Just(12), Just(100)].prop_flat_map(indices);
    (shapes(), count, indices(6)).prop_map(|(resolution, occupied, chosen)| {
        let at = |index: prop::sample::Index| {
            let n = index.index(resolution.voxel_count()) as u32;
            Voxel::new(n % resolution.x, n / resolution.x % resolution.y, n / (resolution.x * resolution.y))
        };
        (set(resolution, occupied.into_iter().map(at)), chosen.into_iter().map(at).collect())
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn fields_equal_their_definitions((occupied, chosen) in scene()) {
        check_values(&occupied);
        check_proofs(&occupied, &chosen);
    }
}

#[test]
fn empty_and_full_grids() {
    for shape in [(1, 1, 1), (5, 4, 3), (65, 2, 2)] {
        let resolution = Resolution::new(shape.0, shape.1, shape.2);
        let corners = [Voxel::new(0, 0, 0), resolution.last()];
        for occupied in [VoxelSet::new(resolution), set(resolution, resolution.voxels())] {
            check_values(&occupied);
            check_proofs(&occupied, &corners);
            assert_eq!(Amr::build(&occupied).proves(corners[0], corners[1]), occupied.is_empty());
            assert_eq!(Ndf::build(&occupied).proves(corners[0], corners[1]), occupied.is_empty());
        }
    }
}

#[test]
fn one_voxel_in_each_corner() {
    let resolution = Resolution::new(6, 5, 4);
    let all: Vec<_> = resolution.voxels().collect();
    let last = resolution.last();
    for corner in 0..8 {
        let pick = |bit: u32, c: u32| if corner & bit == 0 { 0 } else { c };
        let occupied = set(resolution, [Voxel::new(pick(1, last.i), pick(2, last.j), pick(4, last.k))]);
        check_values(&occupied);
        check_proofs(&occupied, &all);
    }
}

#[test]
fn long_corridors_saturate() {
    for axis in 0..3 {
        let along = |n: u32, width: u32| {
            let mut c = [width; 3];
            c[axis] = n;
            c
        };
        let [x, y, z] = along(700, 2);
        let [i, j, k] = along(600, 1);
        let occupied = set(Resolution::new(x, y, z), [Voxel::new(i, j, k)]);
        check_values(&occupied);
        let at = |n| {
            let [i, j, k] = along(n, 0);
            Voxel::new(i, j, k)
        };
        check_proofs(&occupied, &[at(0), at(340), at(345), at(346), at(600), at(699)]);
        let amr = Amr::build(&occupied);
        assert!(amr.proves(at(10), at(264)), "254 voxels apart");
        assert!(!amr.proves(at(10), at(265)), "255 voxels apart: a saturated distance must not say so");
    }
}

#[test]
fn a_light_in_an_occupied_voxel_proves_nothing() {
    let resolution = Resolution::new(5, 5, 5);
    let light = Voxel::new(2, 2, 2);
    let occupied = set(resolution, [light]);
    let near = SafeNeighbourhood::new(&Amr::build(&occupied), &occupied, light);
    assert_eq!((near.count(), near.bytes()), (0, 8 * 25));
}

/// Prints build rates: `cargo test --release -p vdf-distfield --test fields -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement"]
fn speed() {
    let resolution = Resolution::new(153, 146, 338);
    let hollow = resolution.voxels().filter(|v| {
        let block = (40..80).contains(&v.i) && v.j < 70 && (220..270).contains(&v.k);
        let surface = v.i == 40 || v.i == 79 || v.k == 220 || v.k == 269 || v.j == 69;
        v.i == 6 || v.j == 4 || v.k == 336 || (block && surface)
    });
    let occupied = set(resolution, hollow);
    let voxels = resolution.voxel_count() as f64;
    let time = |name: &str, run: &dyn Fn()| {
        let seconds = (0..5).map(|_| {
            let start = std::time::Instant::now();
            run();
            start.elapsed().as_secs_f64()
        });
        let best = seconds.fold(f64::INFINITY, f64::min);
        println!("{name}: {:.1} ms, {:.0} M voxels/s", best * 1e3, voxels / best * 1e-6);
    };
    time("ndf", &|| drop(std::hint::black_box(Ndf::build(&occupied))));
    time("amr", &|| drop(std::hint::black_box(Amr::build(&occupied))));
    let amr = Amr::build(&occupied);
    let light = Voxel::new(39, 124, 232);
    time("amr-sn", &|| drop(std::hint::black_box(SafeNeighbourhood::new(&amr, &occupied, light))));
}
