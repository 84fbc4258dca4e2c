//! The time of a shadow query for each method, on recorded streams: what `vdf report queries` says, in a harness that tells a change from noise.
//!
//! One thread, spatial queries in the order of the render, those without a proof answered by the hierarchy. `proof` asks the method alone: t_acc.
//! All answers are compared with the hierarchy's before anything is timed.

use std::{hint::black_box, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::{
    geometry::Segment,
    render::{Integrator, PreparedScene},
    visibility::{Answer, Counters, FieldKind, Method, PointProver, ShadowQuery},
};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;
use common::{Bench, RAYMARCH};

const STREAMS: [(&str, &str, Integrator); 4] = [
    ("cbox_vol2/volpath", "cbox_vol2", Integrator::Volpath),
    ("cbox_vol4/volpath", "cbox_vol4", Integrator::Volpath),
    ("cbox_vol4/raymarch", "cbox_vol4", RAYMARCH),
    ("san-miguel/volpath", "san-miguel", Integrator::Volpath),
];

/// Of the neighbourhoods only those of `amr`: with any field they answer alike.
fn measured(method: &Method) -> bool {
    method.point_prover() == PointProver::Field || method.field() == Some(FieldKind::Amr)
}

fn measure(c: &mut Criterion, stream: &'static str, prepared: &PreparedScene, queries: &[ShadowQuery]) {
    let (bvh, provers, method) = (&prepared.world().bvh, prepared.provers(), prepared.method());
    let visibility = prepared.visibility();
    let mut counters = Counters::default();
    for q in queries {
        let expected = !bvh.occluded(&Segment::new(q.from, q.to));
        assert_eq!(visibility.unoccluded(q, &mut counters), expected, "{method} answers {q:?} wrongly");
    }
    let mut group = c.benchmark_group("query");
    group.throughput(Throughput::Elements(queries.len() as u64));
    group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
    group.bench_function(BenchmarkId::new(stream, method), |b| {
        b.iter(|| {
            let mut counters = Counters::default();
            queries.iter().filter(|q| visibility.unoccluded(black_box(q), &mut counters)).count()
        });
    });
    if method != Method::NONE {
        group.bench_function(BenchmarkId::new(format!("{stream}/proof"), method), |b| {
            b.iter(|| queries.iter().filter(|q| provers.answer(black_box(q)) == Answer::Unoccluded).count());
        });
    }
    group.finish();
}

fn bench(c: &mut Criterion) {
    for (stream, scene, integrator) in STREAMS {
        let bench = Bench::new(scene, 128);
        let queries = bench.record_spatial(integrator, 30_000);
        for method in Method::all().filter(measured) {
            measure(c, stream, &bench.with(method), &queries);
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
