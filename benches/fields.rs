//! Builds of the distance fields in voxels a second, on grids of 128³ and 256³ voxels.
//!
//! `RAYON_NUM_THREADS` sets the number of threads.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::distfield::{Amr, Dsz, Dual, Ndf};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;

fn bench(c: &mut Criterion) {
    for n in [128, 256] {
        let occupied = common::room(n);
        let mut group = c.benchmark_group("field");
        group.sample_size(10).throughput(Throughput::Elements(occupied.resolution().voxel_count() as u64));
        group.bench_with_input(BenchmarkId::new("ndf", n), &occupied, |b, set| b.iter(|| Ndf::build(black_box(set))));
        group.bench_with_input(BenchmarkId::new("amr", n), &occupied, |b, set| b.iter(|| Amr::build(black_box(set))));
        group.bench_with_input(BenchmarkId::new("dsz", n), &occupied, |b, set| b.iter(|| Dsz::build(black_box(set))));
        group.bench_with_input(BenchmarkId::new("dual", n), &occupied, |b, set| b.iter(|| Dual::build(black_box(set))));
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
