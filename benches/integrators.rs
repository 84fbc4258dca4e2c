//! Whole paths a second for each integrator, on one thread, without and with a method that is built beforehand.
//!
//! The images are compared before anything is timed.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::render::{self, BuildReport, FieldKind, IntegratorKind, Method, NeighbourhoodKind, RenderOptions};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;
use common::{Prepared, Quiet, RAYMARCH};

const METHODS: [Method; 3] = [
    Method::None,
    Method::Field(FieldKind::Amr, NeighbourhoodKind::Safe),
    Method::Field(FieldKind::Amr, NeighbourhoodKind::Extended),
];

const SIZE: u32 = 64;
const SPP: u32 = 4;

fn bench(c: &mut Criterion) {
    for scene in ["cbox_vol2", "cbox_vol4", "san-miguel"] {
        let prepared = Prepared::new(scene, SIZE);
        let emitters = prepared.scene.emitters.len();
        let build = BuildReport { neighbourhoods: vec![None; emitters], ..BuildReport::default() };
        for (name, integrator) in [("volpath", IntegratorKind::Volpath), ("raymarch", RAYMARCH)] {
            let mut group = c.benchmark_group(format!("{name}/{scene}"));
            group.sample_size(10).throughput(Throughput::Elements(u64::from(SIZE * SIZE * SPP)));
            let mut expected = None;
            for method in METHODS {
                let acceleration = prepared.acceleration(method);
                let options =
                    RenderOptions { method, integrator, spp: Some(SPP), threads: Some(1), ..RenderOptions::default() };
                let ready = render::Prepared {
                    world: &prepared.world,
                    t_hierarchy: 0.0,
                    acceleration: &acceleration,
                    build: &build,
                };
                let image = || {
                    let rendering = render::render_prepared(&prepared.scene, &ready, &options, &Quiet);
                    rendering.expect("usable options").image.pixels
                };
                assert_eq!(expected.get_or_insert_with(image), &image(), "{method} changes the image");
                group.bench_function(BenchmarkId::from_parameter(method), |b| b.iter(image));
            }
            group.finish();
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
