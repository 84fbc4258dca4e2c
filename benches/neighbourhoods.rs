//! Builds of the neighbourhoods of one light, in voxels of the grid a second, at 128³ and 256³ voxels.
//!
//! `RAYON_NUM_THREADS` sets the number of threads; that of `-xsn` runs on one.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::{
    distfield::{Amr, Dsz, Dual, ExtendedNeighbourhood, Ndf, Neighbourhood, SafeNeighbourhood, SafeZones},
    voxel::{Voxel, VoxelSet},
};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;

fn bench(c: &mut Criterion) {
    for n in [128, 256] {
        let occupied = common::room(n);
        let (ndf, amr) = (Ndf::build(&occupied), Amr::build(&occupied));
        let (dsz, dual) = (Dsz::build(&occupied), Dual::build(&occupied));
        // Above the boxes, as lights are: the first free voxel there.
        let light = (0..n).map(|i| Voxel::new(n / 2 + i, n / 2, n * 7 / 8)).find(|&v| !occupied.contains(v));
        let light = light.expect("the upper half is nearly empty");
        let extended = ExtendedNeighbourhood::new(&occupied, light.into());
        extended.validate(&occupied).expect("a sound neighbourhood");

        let mut group = c.benchmark_group("neighbourhood");
        group.sample_size(10).throughput(Throughput::Elements(occupied.resolution().voxel_count() as u64));
        let fields: [(&str, &dyn SafeZones); 4] =
            [("ndf-sn", &ndf), ("amr-sn", &amr), ("dsz-sn", &dsz), ("dual-sn", &dual)];
        for (name, field) in fields {
            let safe = SafeNeighbourhood::new(field, &occupied, light);
            assert!(safe.voxels().iter().all(|v| extended.proves(v)), "{name} is not in xsn");
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
