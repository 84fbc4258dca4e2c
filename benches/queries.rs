//! The time of a shadow query for each method, on recorded streams: what `vdf report queries` says, in a harness that tells a change from noise.
//!
//! One thread, spatial queries in the order of the render, those without a proof answered by the hierarchy. `proof` asks the method alone: t_acc.
//! All answers are compared with the hierarchy's before anything is timed.

use std::{hint::black_box, time::Duration};

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::render::{
    Answer, Counters, FieldKind, IntegratorKind, Method, NeighbourhoodKind, Proofs, ProofsVisitor, ShadowQuery,
    Visibility, geometry::Segment,
};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;
use common::{Prepared, RAYMARCH};

const STREAMS: [(&str, &str, IntegratorKind); 4] = [
    ("cbox_vol2/volpath", "cbox_vol2", IntegratorKind::Volpath),
    ("cbox_vol4/volpath", "cbox_vol4", IntegratorKind::Volpath),
    ("cbox_vol4/raymarch", "cbox_vol4", RAYMARCH),
    ("san-miguel/volpath", "san-miguel", IntegratorKind::Volpath),
];

/// Of the neighbourhoods only those of `amr`: with any field they answer alike.
fn measured(method: &Method) -> bool {
    matches!(method, Method::None | Method::Field(_, NeighbourhoodKind::None) | Method::Field(FieldKind::Amr, _))
}

struct Bench<'a> {
    c: &'a mut Criterion,
    stream: &'static str,
    method: Method,
    prepared: &'a Prepared,
    queries: &'a [ShadowQuery],
}

impl ProofsVisitor for Bench<'_> {
    type Output = ();

    fn visit<P: Proofs>(self, proofs: &P) {
        let bvh = &self.prepared.world.bvh;
        let visibility = Visibility::new(bvh, proofs, false);
        let mut counters = Counters::default();
        for q in self.queries {
            let expected = !bvh.occluded(&Segment::new(q.from, q.to));
            assert_eq!(visibility.unoccluded(q, &mut counters), expected, "{} answers {q:?} wrongly", self.method);
        }
        let mut group = self.c.benchmark_group("query");
        group.throughput(Throughput::Elements(self.queries.len() as u64));
        group.sample_size(20).warm_up_time(Duration::from_millis(300)).measurement_time(Duration::from_secs(1));
        group.bench_function(BenchmarkId::new(self.stream, self.method), |b| {
            b.iter(|| {
                let mut counters = Counters::default();
                self.queries.iter().filter(|q| visibility.unoccluded(black_box(q), &mut counters)).count()
            });
        });
        if self.method != Method::None {
            group.bench_function(BenchmarkId::new(format!("{}/proof", self.stream), self.method), |b| {
                let proved = |q: &&ShadowQuery| {
                    let q = black_box(*q);
                    proofs.answer(q.emitter, q.from, q.to) == Answer::Unoccluded
                };
                b.iter(|| self.queries.iter().filter(proved).count());
            });
        }
        group.finish();
    }
}

fn bench(c: &mut Criterion) {
    for (stream, scene, integrator) in STREAMS {
        let prepared = Prepared::new(scene, 128);
        let queries = prepared.record_spatial(integrator, 30_000);
        for method in Method::ALL.into_iter().filter(measured) {
            let acceleration = prepared.acceleration(method);
            acceleration.accept(Bench { c, stream, method, prepared: &prepared, queries: &queries });
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
