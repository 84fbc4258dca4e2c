//! What is written is read again with an OBJ reader that is not ours, and the set is made anew from the surface alone.

use std::collections::HashMap;

use glam::DVec3;
use proptest::prelude::*;

use super::*;

fn written(write: impl Fn(&mut Vec<u8>) -> io::Result<()>) -> String {
    let mut out = Vec::new();
    write(&mut out).unwrap();
    String::from_utf8(out).unwrap()
}

/// A surface in grid coordinates: lattice points and quads.
struct Surface {
    points: Vec<[i64; 3]>,
    quads: Vec<[usize; 4]>,
}

fn read(grid: &VoxelGrid, obj: &str) -> Surface {
    let options = tobj::LoadOptions::default();
    let (models, _) =
        tobj::load_obj_buf(&mut obj.as_bytes(), &options, |_| Err(tobj::LoadError::GenericFailure)).unwrap();
    let Some(model) = models.first() else { return Surface { points: vec![], quads: vec![] } };
    let mesh = &model.mesh;
    assert_eq!(models.len(), 1);
    assert!(mesh.face_arities.iter().all(|&n| n == 4), "all faces are squares");
    let lattice = |p: &[f32]| {
        let p = (DVec3::new(p[0].into(), p[1].into(), p[2].into()) - grid.origin()) / grid.voxel_size();
        assert!((p - p.round()).abs().max_element() < 1e-3, "{p}");
        p.round().to_array().map(|x| x as i64)
    };
    let quad = |q: &[u32]| [q[0], q[1], q[2], q[3]].map(|i| i as usize);
    Surface {
        points: mesh.positions.chunks_exact(3).map(lattice).collect(),
        quads: mesh.indices.chunks_exact(4).map(quad).collect(),
    }
}

impl Surface {
    /// Along each row of voxels, every square across x switches between outside and inside.
    fn inside(&self, resolution: Resolution) -> VoxelSet {
        let mut crossings: HashMap<[i64; 2], Vec<i64>> = HashMap::new();
        for quad in &self.quads {
            let corners = quad.map(|i| self.points[i]);
            if corners.iter().all(|c| c[0] == corners[0][0]) {
                let low = |axis: usize| corners.iter().map(|c| c[axis]).min().unwrap();
                crossings.entry([low(1), low(2)]).or_default().push(corners[0][0]);
            }
        }
        let mut set = VoxelSet::new(resolution);
        for voxel in resolution.voxels() {
            let row = crossings.get(&[i64::from(voxel.j), i64::from(voxel.k)]);
            let before = row.map_or(0, |xs| xs.iter().filter(|&&x| x <= i64::from(voxel.i)).count());
            if before % 2 == 1 {
                set.insert(voxel);
            }
        }
        set
    }

    /// Each edge has as many faces one way as the other, no point is there twice, and none is unused.
    fn assert_closed(&self) {
        let mut edges: HashMap<[usize; 2], i32> = HashMap::new();
        for quad in &self.quads {
            for k in 0..4 {
                let (a, b) = (quad[k], quad[(k + 1) % 4]);
                *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&n| n == 0), "an edge is open");
        let mut points = self.points.clone();
        points.sort_unstable();
        points.dedup();
        assert_eq!(points.len(), self.points.len(), "a vertex is there twice");
        let mut used: Vec<_> = self.quads.iter().flatten().copied().collect();
        used.sort_unstable();
        used.dedup();
        assert_eq!(used.len(), self.points.len(), "a vertex is not used");
    }

    /// By the divergence theorem, in voxels; positive if the faces look outwards.
    fn volume(&self) -> i64 {
        let six: i64 = self
            .quads
            .iter()
            .map(|quad| {
                let [a, b, c, d] = quad.map(|i| self.points[i]);
                let det = |a: [i64; 3], b: [i64; 3], c: [i64; 3]| {
                    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0])
                        + a[2] * (b[0] * c[1] - b[1] * c[0])
                };
                det(a, b, c) + det(a, c, d)
            })
            .sum();
        assert_eq!(six % 6, 0);
        six / 6
    }
}

fn check(grid: &VoxelGrid, set: &VoxelSet) {
    let obj = written(|out| write_obj(grid, set, out));
    let surface = read(grid, &obj);
    // The reader drops vertices that no face uses.
    assert_eq!(obj.lines().filter(|l| l.starts_with("v ")).count(), surface.points.len(), "a vertex is not used");
    surface.assert_closed();
    assert_eq!(&surface.inside(set.resolution()), set);
    assert_eq!(surface.volume(), set.count() as i64);

    let list = written(|out| write_indices(grid, set, out));
    let indices: Vec<usize> = list.lines().filter(|l| !l.starts_with('#')).map(|l| l.parse().unwrap()).collect();
    let expected: Vec<usize> = set.iter().map(|v| grid.linear_index(v)).collect();
    assert_eq!(indices, expected);
}

fn grid(resolution: [u32; 3], size: f64) -> VoxelGrid {
    let origin = DVec3::new(-3.0, 0.5, 100.0);
    let extent = DVec3::from_array(resolution.map(|n| (f64::from(n) - 0.5) * size));
    let grid = VoxelGrid::covering(origin, origin + extent, size, 1 << 20).unwrap();
    assert_eq!(grid.resolution().sides(), resolution);
    grid
}

#[test]
fn a_single_voxel_is_a_cube() {
    let grid = VoxelGrid::covering(DVec3::splat(-1.0), DVec3::splat(2.0), 0.5, 1000).unwrap();
    let mut set = VoxelSet::new(grid.resolution());
    set.insert(Voxel::new(2, 0, 5));
    let obj = written(|out| write_obj(&grid, &set, out));
    let expected = "# 1 of 216 voxels\n# resolution 6 6 6\n# origin -1 -1 -1\n# voxel size 0.5\n\
        v 0 -1 1.5\nv 0.5 -1 1.5\nv 0 -0.5 1.5\nv 0.5 -0.5 1.5\nv 0 -1 2\nv 0.5 -1 2\nv 0 -0.5 2\nv 0.5 -0.5 2\n\
        f 5 7 3 1\nf 2 4 8 6\nf 2 6 5 1\nf 3 7 8 4\nf 3 4 2 1\nf 5 6 8 7\n";
    assert_eq!(obj, expected);
    let list = written(|out| write_indices(&grid, &set, out));
    let expected = "# 1 of 216 voxels\n# resolution 6 6 6\n# origin -1 -1 -1\n# voxel size 0.5\n\
        # linear index = a + b*X + c*X*Y\n182\n";
    assert_eq!(list, expected);
    check(&grid, &set);
}

#[test]
fn empty_full_and_around_words() {
    for resolution in [[1, 1, 1], [1, 1, 5], [63, 2, 1], [64, 1, 2], [65, 2, 2], [128, 1, 1], [127, 2, 2]] {
        let grid = grid(resolution, 0.25);
        check(&grid, &VoxelSet::new(grid.resolution()));
        check(&grid, &VoxelSet::from_rows(grid.resolution(), |_, _, row| row.fill(u64::MAX)));
        check(&grid, &VoxelSet::from_rows(grid.resolution(), |_, _, row| row.fill(0x8000_0000_0000_0001)));
        check(&grid, &VoxelSet::from_rows(grid.resolution(), |j, k, row| row.fill(u64::MAX * u64::from((j + k) % 2))));
    }
}

#[test]
fn what_cannot_be_written_is_an_error() {
    let grid = grid([8, 8, 8], 1.0);
    let set = VoxelSet::from_rows(grid.resolution(), |_, _, row| row.fill(u64::MAX));
    let mut short = [0; 100];
    assert!(write_obj(&grid, &set, &mut short.as_mut_slice()).is_err());
    assert!(write_indices(&grid, &set, &mut short.as_mut_slice()).is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn the_set_comes_back(
        resolution in (prop_oneof![1..9u32, 60..70u32], 1..7u32, 1..7u32),
        size in prop::sample::select(vec![1.0, 0.1, 7.0 / 3.0]),
        words in prop::collection::vec(any::<u64>(), 1..9),
        dense in any::<bool>(),
    ) {
        let grid = grid([resolution.0, resolution.1, resolution.2], size);
        let mut bits = words.iter().cycle();
        let set: Vec<_> = grid.resolution().voxels().filter(|v| {
            let word = bits.next().copied().unwrap_or(0).rotate_left(v.i * 7 + v.j * 3 + v.k);
            if dense { word & 7 != 0 } else { word & 3 == 0 }
        }).collect();
        let mut voxels = VoxelSet::new(grid.resolution());
        voxels.extend(set);
        check(&grid, &voxels);
    }
}
