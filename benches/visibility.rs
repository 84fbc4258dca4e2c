//! Builds and queries on `cbox_vol2`: the time of a shadow query for each method beside the hierarchy's, on the same queries. The
//! answers are compared before anything is timed.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, dvec3};
use vdf::render::{
    Acceleration, Counters, Method, Proofs, ProofsVisitor, QueryKind, Sampler, ShadowQuery, Visibility, World,
    geometry::Segment,
    scene::{Emitter, LoadOptions, Scene, builtin},
};

const VOXEL: f64 = 8.0;
const MAX_VOXELS: u64 = 1 << 29;

fn scene() -> Scene {
    let source = builtin("cbox_vol2").expect("a built-in name");
    Scene::from_source(&source, &LoadOptions { defines: vec![] }).expect("built-in scenes load")
}

/// Queries from uniform points of the fog to the light.
fn queries(world: &World, light: DVec3) -> Vec<ShadowQuery> {
    let (min, max) = world.bounds;
    (0..20_000)
        .map(|i| {
            let mut s = Sampler::new(1, i, 0, 0);
            let from = min + (max - min) * dvec3(s.next_1d(), s.next_1d(), s.next_1d());
            ShadowQuery { from, to: light, emitter: 0, kind: QueryKind::Spatial }
        })
        .collect()
}

fn bench_queries<P: Proofs>(c: &mut Criterion, name: &str, world: &World, proofs: &P, queries: &[ShadowQuery]) {
    let visibility = Visibility::new(&world.bvh, proofs, false);
    let mut counters = Counters::default();
    for q in queries {
        assert_eq!(
            visibility.unoccluded(q, &mut counters),
            !world.bvh.occluded(&Segment::new(q.from, q.to)),
            "{name} answers {q:?} wrongly"
        );
    }
    let mut group = c.benchmark_group("query");
    group.throughput(Throughput::Elements(queries.len() as u64));
    group.bench_function(name, |b| {
        b.iter(|| {
            let mut counters = Counters::default();
            queries.iter().filter(|q| visibility.unoccluded(black_box(q), &mut counters)).count()
        });
    });
    group.finish();
}

struct BenchQueries<'a> {
    c: &'a mut Criterion,
    name: &'a str,
    world: &'a World,
    queries: &'a [ShadowQuery],
}

impl ProofsVisitor for BenchQueries<'_> {
    type Output = ();

    fn visit<P: Proofs>(self, proofs: &P) {
        bench_queries(self.c, self.name, self.world, proofs, self.queries);
    }
}

fn bench(c: &mut Criterion) {
    let scene = scene();
    let world = World::new(&scene);
    let Some(Emitter::Point { position, .. }) = scene.emitters.first() else { panic!("cbox_vol2 has a point light") };
    let queries = queries(&world, *position);
    let build = |method| {
        Acceleration::build(method, &world.triangles, world.bounds, &scene.light_shapes(), VOXEL, MAX_VOXELS)
            .expect("a sound grid")
            .0
    };
    for method in Method::ALL {
        build(method).accept(BenchQueries { c, name: method.name(), world: &world, queries: &queries });
    }
    let mut group = c.benchmark_group("build");
    group.sample_size(20);
    for method in Method::ALL.into_iter().filter(|&m| m != Method::None) {
        group.bench_function(method.name(), |b| b.iter(|| build(method)));
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
