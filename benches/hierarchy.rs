//! The hierarchy: any hit, first hit and all hits of the same recorded segments, and the build.
//!
//! The three answers are compared before anything is timed.

use std::{hint::black_box, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::{
    geometry::{Bvh, Segment},
    render::Integrator,
};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;
use common::Bench;

fn bench(c: &mut Criterion) {
    for scene in ["cbox_vol2", "san-miguel"] {
        let bench = Bench::new(scene, 128);
        let bvh = &bench.none.world().bvh;
        let queries = bench.record(Integrator::Volpath, 30_000);
        let segments: Vec<_> = queries.iter().map(|q| Segment::new(q.from, q.to)).collect();
        for s in &segments {
            let mut nearest = f64::INFINITY;
            bvh.visit_hits(s, |hit| nearest = nearest.min(hit.t));
            let first = bvh.intersect(s);
            assert_eq!(first.map_or(f64::INFINITY, |hit| hit.t), nearest, "{s:?}");
            assert_eq!(bvh.occluded(s), first.is_some(), "{s:?}");
        }

        let mut group = c.benchmark_group("hierarchy");
        group.throughput(Throughput::Elements(segments.len() as u64));
        group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
        group.bench_function(BenchmarkId::new("any", scene), |b| {
            b.iter(|| segments.iter().filter(|s| bvh.occluded(black_box(s))).count());
        });
        group.bench_function(BenchmarkId::new("first", scene), |b| {
            b.iter(|| segments.iter().filter(|s| bvh.intersect(black_box(s)).is_some()).count());
        });
        group.bench_function(BenchmarkId::new("all", scene), |b| {
            b.iter(|| {
                let mut hits = 0;
                segments.iter().for_each(|s| bvh.visit_hits(black_box(s), |_| hits += 1));
                hits
            });
        });
        let triangles = &bench.none.world().triangles;
        group.throughput(Throughput::Elements(triangles.len() as u64)).sample_size(10);
        group.bench_function(BenchmarkId::new("build", scene), |b| b.iter(|| Bvh::new(black_box(triangles))));
        group.finish();
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
