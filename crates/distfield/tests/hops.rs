//! Sets made by hops hold all free cuboids and no voxel from which a segment to the light could meet an occupied one.

mod common;

use common::{random, scene, set};
use proptest::prelude::*;
use vdf_distfield::{ExtendedNeighbourhood, HopNeighbourhood, Neighbourhood, VoxelBox};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

fn array(v: Voxel) -> [i64; 3] {
    [v.i, v.j, v.k].map(i64::from)
}

/// Whether a segment from a point of `u` to one of `light` can meet the inside of `o`: for some t in [0, 1] the box
/// (1 − t)u + t·light overlaps it. On each axis that is an open interval of t, with ends that are fractions.
fn can_meet(u: Voxel, light: VoxelBox, o: Voxel) -> bool {
    let (u, min, max, o) = (array(u), array(light.min()), array(light.max()), array(o));
    // Fractions n/d with d > 0: the open interval, which has to meet [0, 1].
    let (mut low, mut high) = ((-1, 1), (2, 1));
    for axis in 0..3 {
        // c·t < e for the lower end against o's upper face, and for the upper end against its lower face.
        for (c, e) in [(min[axis] - u[axis], o[axis] + 1 - u[axis]), (u[axis] - max[axis], u[axis] + 1 - o[axis])] {
            match c {
                0 if e <= 0 => return false,
                0 => {}
                1.. if e * high.1 < high.0 * c => high = (e, c),
                ..0 if -e * low.1 > low.0 * -c => low = (-e, -c),
                _ => {}
            }
        }
    }
    low.0 * high.1 < high.0 * low.1 && low.0 < low.1 && high.0 > 0
}

/// The set by its definition, voxel by voxel. A merged voxel is given by how far it is from the light on each axis, with a sign.
fn by_definition(occupied: &VoxelSet, light: VoxelBox) -> VoxelSet {
    let resolution = occupied.resolution();
    let mut all = VoxelSet::new(resolution);
    if !resolution.contains(light.max()) {
        return all;
    }
    let (min, max) = (array(light.min()), array(light.max()));
    let merged = |v: Voxel| {
        let v = array(v);
        [0, 1, 2].map(|a| (v[a] - min[a]).min(0) + (v[a] - max[a]).max(0))
    };
    let mut parts = std::collections::BTreeMap::<[i64; 3], Vec<Voxel>>::new();
    resolution.voxels().for_each(|v| parts.entry(merged(v)).or_default().push(v));
    let is_free = |c: [i64; 3]| parts[&c].iter().all(|&v| !occupied.contains(v));
    let mut order: Vec<_> = parts.keys().copied().collect();
    order.sort_by_key(|c| c.map(i64::abs).iter().sum::<i64>());
    for u in order {
        let (near, far) = (u.map(i64::abs), [0, 1, 2].map(|a| u[a].abs() + max[a] - min[a] + 1));
        // So much nearer to the light.
        let at = |offset: [i64; 3]| [0, 1, 2].map(|a| u[a] - u[a].signum() * offset[a]);
        let cube = |d: i64| {
            let [x, y, z] = near.map(|n| 0..d.min(n + 1));
            x.flat_map(|x| y.clone().map(move |y| [x, y])).all(|[x, y]| z.clone().all(|z| is_free(at([x, y, z]))))
        };
        let d = (1..=255).take_while(|&d| cube(d)).last().unwrap_or(0);
        let sees = std::iter::successors(Some(d), |s| Some(s / 2)).take_while(|&s| s > 0).any(|s| {
            (0..3).filter(|&a| near[a] >= s).all(|a| {
                // Segments are on the plane for t from (s − 1)/(far − 1) to s/near. On axis b they are then from t·near to 1 + t(far − 1).
                let holds_a_point = |b: usize, o: i64| {
                    let end = if o == near[b] { far[b] } else { o + 1 };
                    (s - 1) * near[b] < end * (far[a] - 1) && near[a] + s * (far[b] - 1) > o * near[a]
                };
                let within = |b: usize| (0..s.min(near[b] + 1)).filter(move |&o| holds_a_point(b, o));
                let [b, c] = [(a + 1) % 3, (a + 2) % 3];
                within(b).all(|v| {
                    within(c).all(|w| {
                        let mut offset = [s; 3];
                        (offset[b], offset[c]) = (v, w);
                        parts[&at(offset)].iter().all(|&v| all.contains(v))
                    })
                })
            })
        });
        if sees {
            all.extend(parts[&u].iter().copied());
        }
    }
    all
}

/// Checks the set of a light; how many voxels it, cuboids, and free shafts prove.
fn check(occupied: &VoxelSet, light: VoxelBox) -> [usize; 3] {
    let resolution = occupied.resolution();
    let hops = HopNeighbourhood::new(occupied, light);
    let cuboids = ExtendedNeighbourhood::new(occupied, light);
    assert_eq!(hops.validate(occupied), Ok(()));
    let obstacles: Vec<_> = occupied.iter().collect();
    let in_grid = resolution.contains(light.max());
    let mut shafts = 0;
    for u in resolution.voxels() {
        let free = in_grid && !obstacles.iter().any(|&o| o == u || light.contains(o) || can_meet(u, light, o));
        assert!(free || !hops.proves(u), "unsound: {u:?} to {light:?}");
        assert!(hops.proves(u) || !cuboids.proves(u), "a free cuboid is missed: {u:?} to {light:?}");
        assert_eq!(cuboids.proves(u), hops.cuboids().proves(u));
        shafts += usize::from(free);
    }
    assert_eq!(hops.count(), hops.voxels().count());
    [hops.count(), cuboids.count(), shafts]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn what_hops_prove_is_free((occupied, chosen) in scene()) {
        for &light in &chosen {
            check(&occupied, light.into());
        }
        for pair in chosen.windows(2) {
            check(&occupied, VoxelBox::spanning(pair[0], pair[1]));
        }
    }
}

/// Boxes in a room of at least 12 voxels a side.
fn room(seed: u64) -> (VoxelSet, impl FnMut(u32) -> u32) {
    let mut next = random(seed);
    let resolution = Resolution::new(12 + next(8), 12 + next(5), 12 + next(5));
    let mut occupied = VoxelSet::new(resolution);
    for _ in 0..next(12) {
        let [x, y, z] = resolution.sides().map(&mut next);
        let corner = Voxel::new(x + next(4), y + next(4), z + next(4));
        let all = VoxelBox::spanning(Voxel::new(x, y, z), corner).voxels();
        occupied.extend(all.filter(|&v| resolution.contains(v)));
    }
    (occupied, next)
}

/// Hops prove more than cuboids, and shafts more than hops.
#[test]
fn more_than_cuboids() {
    let mut sums = [[0; 3]; 2];
    for seed in 0..40 {
        let (occupied, mut next) = room(seed);
        let [i, j, k] = occupied.resolution().sides().map(&mut next);
        let light = Voxel::new(i, j, k);
        let area = VoxelBox::spanning(light, Voxel::new(i.saturating_sub(next(4)), j, k.saturating_sub(next(3))));
        for (sums, light) in sums.iter_mut().zip([light.into(), area]) {
            sums.iter_mut().zip(check(&occupied, light)).for_each(|(sum, n)| *sum += n);
        }
    }
    for [hops, cuboids, shafts] in sums {
        assert!(shafts >= hops && hops * 100 > cuboids * 110, "{sums:?}");
    }
}

/// Lights of many voxels, which cover others on one axis or two.
#[test]
fn wide_lights() {
    for seed in 0..20 {
        let (occupied, mut next) = room(seed);
        let [x, y, z] = occupied.resolution().sides();
        let (i, j, k) = (next(x - 6), next(y - 6), next(z - 6));
        let light = VoxelBox::spanning(Voxel::new(i, j, k), Voxel::new(i + next(7), j + next(3), k + next(7)));
        check(&occupied, light);
    }
}

/// No voxel more and none less than the definition says, for lights of one voxel and of many.
#[test]
fn what_the_definition_says() {
    let mut more = 0;
    for seed in 0..60 {
        let mut next = random(seed);
        let resolution = Resolution::new(3 + next(8), 3 + next(7), 3 + next(6));
        let sides = resolution.sides();
        let mut any = || Voxel::new(next(sides[0]), next(sides[1]), next(sides[2]));
        let occupied = set(resolution, (0..seed % 7).map(|_| any()));
        for light in [any().into(), VoxelBox::spanning(any(), any())] {
            let hops = HopNeighbourhood::new(&occupied, light);
            assert_eq!(*hops.voxels(), by_definition(&occupied, light), "{light:?}");
            more += hops.count() - hops.cuboids().count();
        }
    }
    assert!(more > 500, "{more}");
}

/// All that is visible past one small obstacle, but for what rounding outwards costs.
#[test]
fn around_an_obstacle() {
    let occupied = set(Resolution::new(16, 16, 16), [Voxel::new(7, 7, 7)]);
    for (light, most) in
        [(Voxel::new(1, 2, 3).into(), 40), (VoxelBox::spanning(Voxel::new(0, 0, 0), Voxel::new(2, 0, 2)), 60)]
    {
        let [hops, cuboids, shafts] = check(&occupied, light);
        assert!(shafts - hops <= most && cuboids + 300 < hops, "{light:?}: {hops}, {cuboids}, {shafts}");
    }
}

#[test]
fn a_light_outside_the_grid_proves_nothing() {
    let occupied = VoxelSet::new(Resolution::new(5, 4, 3));
    for light in [Voxel::new(5, 0, 0), Voxel::new(0, 4, 0), Voxel::new(0, 0, 3), Voxel::new(u32::MAX, 9, 9)] {
        assert_eq!(check(&occupied, light.into()), [0; 3]);
        assert_eq!(check(&occupied, VoxelBox::spanning(Voxel::new(1, 1, 1), light)), [0; 3]);
        assert!(!HopNeighbourhood::new(&occupied, Voxel::new(1, 1, 1).into()).proves(light));
    }
}

/// Free distances of more than a byte, along each axis and along a diagonal.
#[test]
fn far_away() {
    for axis in 0..3 {
        let mut sides = [3, 2, 2];
        sides.swap(0, axis);
        sides[axis] = 600;
        let resolution = Resolution::new(sides[0], sides[1], sides[2]);
        for at in [0, 300, 599] {
            let mut light = [1, 1, 1];
            light[axis] = at;
            for obstacle in [None, Some(290), Some(550)] {
                let mut v = [0, 0, 0];
                let obstacle = obstacle.map(|n| {
                    v[axis] = n;
                    Voxel::new(v[0], v[1], v[2])
                });
                let light = Voxel::new(light[0], light[1], light[2]);
                check(&set(resolution, obstacle), light.into());
            }
        }
    }
    let free = VoxelSet::new(Resolution::new(300, 290, 2));
    assert_eq!(HopNeighbourhood::new(&free, Voxel::new(0, 289, 1).into()).count(), 300 * 290 * 2);
}
