//! Every field equals its brute-force definition, and what it proves has the free cuboid property.

mod common;

use common::{cuboid_is_free, fields, random, scene, set};
use proptest::prelude::*;
use vdf_distfield::{Amr, Dsz, Dual, Ndf, Neighbourhood, SafeNeighbourhood, SafeZones, VoxelBox};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

const AXES: [usize; 3] = [0, 1, 2];

fn array(v: Voxel) -> [i64; 3] {
    [v.i, v.j, v.k].map(i64::from)
}

/// The values of all fields by their definitions, for each voxel: all occupied voxels are looked at.
struct Definitions {
    resolution: Resolution,
    occupied: VoxelSet,
    ndf: Vec<u32>,
    /// Bits 0, 1, 2 of the octant's number for the negative direction of x, y, z.
    amr: Vec<[u32; 8]>,
    /// x+, x−, y+, y−, z+, z−.
    dsz: Vec<[u32; 6]>,
    manhattan: Vec<u32>,
    extents: Vec<[u32; 6]>,
}

impl Definitions {
    fn new(occupied: &VoxelSet) -> Self {
        let resolution = occupied.resolution();
        let n = resolution.voxel_count();
        let mut d = Self {
            resolution,
            occupied: occupied.clone(),
            ndf: vec![255; n],
            amr: vec![[255; 8]; n],
            dsz: vec![[256; 6]; n],
            manhattan: vec![255; n],
            extents: vec![[0; 6]; n],
        };
        let list: Vec<_> = occupied.iter().map(array).collect();
        for (n, v) in resolution.voxels().map(array).enumerate() {
            for u in &list {
                let delta = AXES.map(|a| u[a] - v[a]);
                let chessboard = delta.map(i64::unsigned_abs).into_iter().max().expect("three") as u32;
                let manhattan = delta.map(i64::unsigned_abs).iter().sum::<u64>() as u32;
                d.ndf[n] = d.ndf[n].min(chessboard);
                d.manhattan[n] = d.manhattan[n].min(manhattan);
                for (octant, value) in d.amr[n].iter_mut().enumerate() {
                    if AXES.iter().all(|&a| if octant & (1 << a) == 0 { delta[a] >= 0 } else { delta[a] <= 0 }) {
                        *value = chessboard.min(*value);
                    }
                }
                for (face, value) in d.dsz[n].iter_mut().enumerate() {
                    if delta[face / 2].signum() == sign(face) {
                        *value = manhattan.min(*value);
                    }
                }
            }
        }
        for v in resolution.voxels() {
            let here = d.manhattan[resolution.linear_index(v)];
            if here == 0 {
                continue;
            }
            for direction in 0..6 {
                let ahead = (1..).map_while(|n| moved(resolution, v, direction, n));
                let steps = ahead.take_while(|&w| d.manhattan[resolution.linear_index(w)] >= here).count();
                d.extents[resolution.linear_index(v)][direction] = steps.min(255) as u32;
            }
        }
        d
    }

    fn check_values(&self) {
        let (ndf, amr) = (Ndf::build(&self.occupied), Amr::build(&self.occupied));
        let (dsz, dual) = (Dsz::build(&self.occupied), Dual::build(&self.occupied));
        for (n, v) in self.resolution.voxels().enumerate() {
            assert_eq!(u32::from(ndf.distance(v)), self.ndf[n], "ndf at {v:?}");
            assert_eq!(u32::from(dual.distance(v)), self.manhattan[n], "dual at {v:?}");
            for octant in 0..8 {
                assert_eq!(u32::from(amr.distance(octant, v)), self.amr[n][octant], "amr at {v:?}, octant {octant}");
            }
            for face in 0..6 {
                assert_eq!(u32::from(dsz.distance(face, v)), self.dsz[n][face], "dsz at {v:?}, face {face}");
                assert_eq!(u32::from(dual.extent(face, v)), self.extents[n][face], "extent at {v:?}, direction {face}");
            }
        }
        for (name, field) in fields(&self.occupied) {
            assert_eq!(field.validate(&self.occupied), Ok(()), "{name}");
        }
    }

    /// Is `b` in the safe zone of `a`: Def. 8, 10, 12 and 13, the last one corrected.
    fn safe(&self, a: Voxel, b: Voxel) -> [bool; 4] {
        let n = self.resolution.linear_index(a);
        let delta = AXES.map(|axis| array(b)[axis] - array(a)[axis]);
        let size = delta.map(|c| c.unsigned_abs() as u32);
        let (chessboard, manhattan) = (size.into_iter().max().expect("three"), size.iter().sum::<u32>());
        let amr = (0..8).any(|octant| {
            AXES.iter().all(|&a| if octant & (1 << a) == 0 { delta[a] >= 0 } else { delta[a] <= 0 })
                && chessboard < self.amr[n][octant]
        });
        let mut faces = (0..6).filter(|&face| delta[face / 2].signum() == sign(face));
        let dsz = !self.occupied.contains(a) && faces.all(|face| manhattan < self.dsz[n][face]);
        let dual = (0..6).any(|direction| {
            let axis = direction / 2;
            delta[axis] * sign(direction) >= 0
                && manhattan - size[axis] < self.manhattan[n]
                && manhattan < self.extents[n][direction] + self.manhattan[n]
        });
        [chessboard < self.ndf[n], amr, dsz, dual]
    }

    /// Checks all pairs of a few voxels with all voxels: the definition of the safe zones, soundness and symmetry.
    fn check_proofs(&self, chosen: &[Voxel]) {
        let fields = fields(&self.occupied);
        let dsz = Dsz::build(&self.occupied);
        for &a in chosen {
            self.check_faces(&dsz, a);
            let near = fields.each_ref().map(|(_, field)| SafeNeighbourhood::new(&**field, &self.occupied, a));
            for near in &near {
                assert_eq!(near.validate(&self.occupied), Ok(()));
            }
            let mut counts = [0; 4];
            for b in self.resolution.voxels() {
                let proofs = fields.each_ref().map(|(_, field)| field.proves(a, b));
                let (ab, ba) = (self.safe(a, b), self.safe(b, a));
                let free = cuboid_is_free(&self.occupied, a, b);
                for (n, (name, field)) in fields.iter().enumerate() {
                    assert_eq!(proofs[n], ab[n] || ba[n], "{name} {a:?} {b:?}");
                    assert_eq!(proofs[n], field.proves(b, a), "{name}: symmetry {a:?} {b:?}");
                    assert_eq!(proofs[n], near[n].proves(b), "{name}: neighbourhood {a:?} {b:?}");
                    assert!(free || !proofs[n], "{name}: unsound {a:?} {b:?}");
                    counts[n] += usize::from(proofs[n]);
                }
                assert!(proofs[1] || !proofs[0], "amr proves whatever ndf does: {a:?} {b:?}");
            }
            assert_eq!(counts, near.each_ref().map(|near| near.count()));
        }
    }

    /// By the ray's face, from `a` to every voxel: Def. 12 for each face alone, and that no voxel beyond the face is occupied.
    fn check_faces(&self, dsz: &Dsz, a: Voxel) {
        let n = self.resolution.linear_index(a);
        for b in self.resolution.voxels() {
            let delta = AXES.map(|axis| array(b)[axis] - array(a)[axis]);
            let manhattan: u32 = delta.iter().map(|c| c.unsigned_abs() as u32).sum();
            for axis in AXES {
                let face = 2 * axis + usize::from(delta[axis] < 0);
                let expected = !self.occupied.contains(a) && delta[axis] != 0 && manhattan < self.dsz[n][face];
                let (this, none) = (AXES.map(|other| other == axis), [false; 3]);
                assert_eq!(dsz.proves_leaving(a, b, || this, || none), expected, "{a:?} {b:?} axis {axis}");
                assert_eq!(dsz.proves_leaving(b, a, || none, || this), expected, "{b:?} {a:?} axis {axis}");
                let beyond = |w: &Voxel| array(*w)[axis] != array(a)[axis];
                let free = || VoxelBox::spanning(a, b).voxels().filter(beyond).all(|w| !self.occupied.contains(w));
                assert!(!expected || free(), "unsound: {a:?} {b:?} axis {axis}");
            }
            assert!(!dsz.proves_leaving(a, b, || [false; 3], || [false; 3]), "no face is left");
        }
    }
}

/// The sign of a direction or face.
fn sign(direction: usize) -> i64 {
    if direction.is_multiple_of(2) { 1 } else { -1 }
}

fn moved(resolution: Resolution, v: Voxel, direction: usize, n: i64) -> Option<Voxel> {
    let mut c = array(v);
    c[direction / 2] += n * sign(direction);
    let [i, j, k] = c.map(|c| u32::try_from(c).ok());
    Some(Voxel::new(i?, j?, k?)).filter(|&v| resolution.contains(v))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn fields_equal_their_definitions((occupied, chosen) in scene()) {
        let definitions = Definitions::new(&occupied);
        definitions.check_values();
        definitions.check_proofs(&chosen);
    }
}

#[test]
fn empty_and_full_grids() {
    for shape in [(1, 1, 1), (5, 4, 3), (65, 2, 2)] {
        let resolution = Resolution::new(shape.0, shape.1, shape.2);
        let corners = [Voxel::new(0, 0, 0), resolution.last()];
        for occupied in [VoxelSet::new(resolution), set(resolution, resolution.voxels())] {
            let definitions = Definitions::new(&occupied);
            definitions.check_values();
            definitions.check_proofs(&corners);
            for (name, field) in fields(&occupied) {
                assert_eq!(field.proves(corners[0], corners[1]), occupied.is_empty(), "{name}");
            }
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
        let definitions = Definitions::new(&occupied);
        definitions.check_values();
        definitions.check_proofs(&all);
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
        let occupied_at = |n| {
            let [i, j, k] = along(n, 1);
            set(Resolution::new(x, y, z), [Voxel::new(i, j, k)])
        };
        let at = |n| {
            let [i, j, k] = along(n, 0);
            Voxel::new(i, j, k)
        };
        // From there distances rise, and fall, to more than a byte holds.
        for (n, ends) in [(600, [0, 340, 345, 346, 600, 699]), (99, [0, 99, 353, 354, 359, 699])] {
            let definitions = Definitions::new(&occupied_at(n));
            definitions.check_values();
            definitions.check_proofs(&ends.map(at));
        }
        let occupied = occupied_at(600);
        // What is proved at most from a voxel without anything near: one less than the saturated distance.
        let farthest = [254, 254, 255, 254 + 255];
        for ((name, field), farthest) in fields(&occupied).into_iter().zip(farthest) {
            assert!(field.proves(at(10), at(10 + farthest)), "{name}: {farthest} voxels apart");
            assert!(!field.proves(at(10), at(11 + farthest)), "{name}: a saturated distance must not say more");
        }
    }
}

#[test]
fn one_row_of_voxels_just_longer_than_a_word() {
    for axis in 0..3 {
        for length in [63, 64, 65, 66, 129] {
            let at = |n| {
                let mut c = [0; 3];
                c[axis] = n;
                Voxel::new(c[0], c[1], c[2])
            };
            let last = at(length - 1);
            let resolution = Resolution::new(last.i + 1, last.j + 1, last.k + 1);
            for occupied in [vec![0], vec![63.min(length - 1)], vec![length - 1], vec![31, 62], vec![]] {
                let definitions = Definitions::new(&set(resolution, occupied.into_iter().map(at)));
                definitions.check_values();
                definitions.check_proofs(&[at(0), at(30), at(62), at(length - 2), last]);
            }
        }
    }
}

/// Def. 13 as printed, for the directions that look towards `b`, which is what 4.3.1 chooses from.
fn printed_dual_extent(dual: &Dual, a: Voxel, b: Voxel) -> bool {
    let size = AXES.map(|axis| (array(b)[axis] - array(a)[axis]).unsigned_abs() as u32);
    let radius = u32::from(dual.distance(a));
    AXES.iter().any(|&axis| {
        let direction = 2 * axis + usize::from(array(b)[axis] < array(a)[axis]);
        AXES.iter().all(|&other| other == axis || size[other] < radius)
            && size.iter().sum::<u32>() < u32::from(dual.extent(direction, a)) + radius
    })
}

/// Does the segment between the centres of two voxels meet the closed voxel `w`: separating axes, in integers, lengths
/// doubled.
fn centres_meet(a: Voxel, b: Voxel, w: Voxel) -> bool {
    let (a, b, w) = (array(a), array(b), array(w));
    let d = AXES.map(|c| 2 * (b[c] - a[c]));
    let m = AXES.map(|c| 2 * (a[c] + b[c] - 2 * w[c]));
    AXES.iter().all(|&x| {
        let (y, z) = ((x + 1) % 3, (x + 2) % 3);
        m[x].abs() <= 2 + d[x].abs() && (m[y] * d[z] - m[z] * d[y]).abs() <= 2 * (d[y].abs() + d[z].abs())
    })
}

#[test]
fn the_printed_dual_extent_is_wrong_at_its_counterexample() {
    // An edge of occupied voxels beside the x axis through V, and a wall that ends the walk after ten steps.
    let resolution = Resolution::new(20, 9, 9);
    let v = Voxel::new(3, 4, 4);
    let mut occupied = set(resolution, (0..20).map(|i| Voxel::new(i, 5, 5)));
    occupied.insert(Voxel::new(3 + 12, 4, 4));
    let dual = Dual::build(&occupied);
    assert_eq!((dual.distance(v), dual.extent(0, v)), (2, 10));
    let u = Voxel::new(3 + 5, 4 + 1, 4 + 1);
    assert!(occupied.contains(u));
    assert!(printed_dual_extent(&dual, v, u), "the printed form admits an occupied voxel");
    assert!(!dual.proves(v, u));
    assert!(dual.proves(v, Voxel::new(3 + 10, 5, 4)) && !dual.proves(v, Voxel::new(3 + 12, 4, 4)));
}

#[test]
fn the_printed_dual_extent_gives_wrong_proofs_and_the_corrected_one_none() {
    let resolution = Resolution::new(8, 8, 8);
    let (mut wrong, mut proofs) = ([0; 2], [0; 2]);
    for seed in 0..200 {
        let mut below = random(seed);
        let voxel = |below: &mut dyn FnMut(u32) -> u32| Voxel::new(below(8), below(8), below(8));
        let count = 1 + below(10);
        let occupied = set(resolution, (0..count).map(|_| voxel(&mut below)));
        let dual = Dual::build(&occupied);
        for _ in 0..200 {
            let (a, b) = (voxel(&mut below), voxel(&mut below));
            let occluded = occupied.iter().any(|w| centres_meet(a, b, w));
            let answers = [printed_dual_extent(&dual, a, b) || printed_dual_extent(&dual, b, a), dual.proves(a, b)];
            for n in 0..2 {
                proofs[n] += u32::from(answers[n]);
                wrong[n] += u32::from(answers[n] && occluded);
            }
        }
    }
    println!("printed: {} of {} proofs wrong; corrected: {} of {}", wrong[0], proofs[0], wrong[1], proofs[1]);
    assert!(wrong[0] > 100, "the printed form was right too often: {wrong:?}");
    assert_eq!(wrong[1], 0);
    assert!(2 * proofs[1] > proofs[0], "the corrected form hardly proves anything: {proofs:?}");
}

#[test]
fn validation_finds_a_field_of_other_occluders() {
    let resolution = Resolution::new(5, 4, 4);
    let occupied = set(resolution, [Voxel::new(0, 1, 2), Voxel::new(3, 3, 0), Voxel::new(3, 3, 1)]);
    for (name, field) in fields(&occupied) {
        for voxel in resolution.voxels() {
            let others = if occupied.contains(voxel) {
                set(resolution, occupied.iter().filter(|&v| v != voxel))
            } else {
                set(resolution, occupied.iter().chain([voxel]))
            };
            let error = field.validate(&others).expect_err(name);
            assert!(error.to_string().contains("build it again"), "{error}");
        }
    }
}
