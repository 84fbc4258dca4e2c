//! Builds of the distance fields in voxels a second, and of the neighbourhoods of one light, on grids of 128³ and 256³ voxels.
//!
//! `RAYON_NUM_THREADS` sets the number of threads. The occupied set is a room with hollow boxes and clutter: walls as in a
//! building, and single voxels as in foliage.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::{
    distfield::{Amr, Dsz, Dual, ExtendedNeighbourhood, Ndf, SafeNeighbourhood, SafeZones, VoxelBox},
    render::Sampler,
    voxel::{Resolution, Voxel, VoxelSet},
};

/// The walls of the room, 24 hollow boxes on its floor, and one voxel in 2000.
fn occupied(n: u32) -> VoxelSet {
    let resolution = Resolution::new(n, n, n);
    let mut set = VoxelSet::new(resolution);
    let mut hollow = |walls: VoxelBox| {
        let (a, b) = (walls.min(), walls.max());
        let on = |v: &Voxel| v.i == a.i || v.i == b.i || v.j == a.j || v.j == b.j || v.k == a.k || v.k == b.k;
        set.extend(walls.voxels().filter(on));
    };
    hollow(VoxelBox::spanning(Voxel::new(0, 0, 0), resolution.last()));
    let mut s = Sampler::new(1, 0, 0, 0);
    let mut below = move |n: u32| (s.next_1d() * f64::from(n)) as u32;
    for _ in 0..24 {
        let (i, j) = (below(n * 7 / 8), below(n * 7 / 8));
        let far = Voxel::new(i + 1 + below(n / 8), j + 1 + below(n / 8), 1 + below(n / 2));
        hollow(VoxelBox::spanning(Voxel::new(i, j, 0), far));
    }
    set.extend((0..n * n / 2000 * n).map(|_| Voxel::new(below(n), below(n), below(n))));
    set
}

fn bench(c: &mut Criterion) {
    for n in [128, 256] {
        let occupied = occupied(n);
        let (ndf, amr) = (Ndf::build(&occupied), Amr::build(&occupied));
        let (dsz, dual) = (Dsz::build(&occupied), Dual::build(&occupied));
        // Above the boxes, as lights are: the first free voxel there.
        let light = (0..n).map(|i| Voxel::new(n / 2 + i, n / 2, n * 7 / 8)).find(|&v| !occupied.contains(v));
        let light = light.expect("the upper half is nearly empty");

        let mut group = c.benchmark_group("field");
        group.sample_size(10).throughput(Throughput::Elements(occupied.resolution().voxel_count() as u64));
        group.bench_with_input(BenchmarkId::new("ndf", n), &occupied, |b, set| b.iter(|| Ndf::build(black_box(set))));
        group.bench_with_input(BenchmarkId::new("amr", n), &occupied, |b, set| b.iter(|| Amr::build(black_box(set))));
        group.bench_with_input(BenchmarkId::new("dsz", n), &occupied, |b, set| b.iter(|| Dsz::build(black_box(set))));
        group.bench_with_input(BenchmarkId::new("dual", n), &occupied, |b, set| b.iter(|| Dual::build(black_box(set))));
        group.finish();

        let mut group = c.benchmark_group("neighbourhood");
        group.sample_size(10).throughput(Throughput::Elements(occupied.resolution().voxel_count() as u64));
        let fields: [(&str, &dyn SafeZones); 4] =
            [("ndf-sn", &ndf), ("amr-sn", &amr), ("dsz-sn", &dsz), ("dual-sn", &dual)];
        for (name, field) in fields {
            group.bench_with_input(BenchmarkId::new(name, n), field, |b, field| {
                b.iter(|| SafeNeighbourhood::new(field, &occupied, black_box(light)));
            });
        }
        group.bench_with_input(BenchmarkId::new("xsn", n), &occupied, |b, set| {
            b.iter(|| ExtendedNeighbourhood::new(black_box(set), light.into()));
        });
        // Nothing in the way is the slowest case: all rows are looked at from end to end.
        let empty = VoxelSet::new(occupied.resolution());
        group.bench_with_input(BenchmarkId::new("xsn, empty grid", n), &empty, |b, set| {
            b.iter(|| ExtendedNeighbourhood::new(black_box(set), light.into()));
        });
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
