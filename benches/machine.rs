//! What the machine can do, beside what a proof does: latency and bandwidth of memory by the size of what is read, and `amr` on fields of these sizes.
//!
//! `latency` follows a random cycle through all cache lines: each load waits for the one before. `bandwidth` sums all words in their order.
//! `amr/random` asks about pairs of voxels drawn uniformly, so that nearly every load is of another line: what a load costs when queries have no coherence.

use std::{hint::black_box, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::{
    distfield::{Amr, SafeZones},
    render::Sampler,
    voxel::Voxel,
};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;

const KIB: usize = 1024;
const SIZES: [usize; 5] = [32 * KIB, 512 * KIB, 8 * KIB * KIB, 64 * KIB * KIB, 512 * KIB * KIB];
/// Words of a cache line.
const LINE: usize = 8;
const STEPS: u64 = 1 << 16;

/// One cycle through all lines in random order (Sattolo's shuffle): the first word of a line is the index of the next.
fn cycle(bytes: usize) -> Vec<u64> {
    let lines = bytes / 64;
    let mut order: Vec<u64> = (0..lines as u64).collect();
    let mut s = Sampler::new(1, 0, 0, 0);
    for i in (1..lines).rev() {
        order.swap(i, (s.next_1d() * i as f64) as usize);
    }
    let mut words = vec![0; lines * LINE];
    for (line, next) in order.into_iter().enumerate() {
        words[line * LINE] = next * LINE as u64;
    }
    words
}

fn bench(c: &mut Criterion) {
    let mut group = c.benchmark_group("memory");
    group.sample_size(10).warm_up_time(Duration::from_millis(200)).measurement_time(Duration::from_secs(1));
    for bytes in SIZES {
        let words = cycle(bytes);
        group.throughput(Throughput::Elements(STEPS));
        let mut at = 0;
        group.bench_with_input(BenchmarkId::new("latency", bytes / KIB), &words, |b, words| {
            b.iter(|| {
                for _ in 0..STEPS {
                    at = words[at as usize];
                }
                at
            });
        });
        group.throughput(Throughput::Bytes(bytes as u64));
        group.bench_with_input(BenchmarkId::new("bandwidth", bytes / KIB), &words, |b, words| {
            b.iter(|| black_box(words).iter().fold(0_u64, |sum, w| sum.wrapping_add(*w)));
        });
    }
    for n in [32, 64, 128, 256, 512] {
        let field = Amr::build(&common::room(n));
        let mut s = Sampler::new(2, 0, 0, 0);
        let mut below = || (s.next_1d() * f64::from(n)) as u32;
        let mut voxel = || Voxel::new(below(), below(), below());
        let pairs: Vec<_> = (0..STEPS).map(|_| (voxel(), voxel())).collect();
        group.throughput(Throughput::Elements(STEPS));
        group.bench_with_input(BenchmarkId::new("amr/random", n), &pairs, |b, pairs| {
            b.iter(|| pairs.iter().filter(|(p, q)| field.proves(*p, *q)).count());
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
