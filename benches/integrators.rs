//! Whole paths a second for each integrator, on one thread, without and with a method that is built beforehand.
//!
//! The images are compared before anything is timed.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use vdf::{
    render::{Integrator, Quiet, RenderOptions},
    visibility::Method,
};

#[allow(dead_code, reason = "each bench uses its part")]
mod common;
use common::{Bench, RAYMARCH};

const METHODS: [&str; 3] = ["none", "amr-sn", "amr-xsn"];

const SIZE: u32 = 64;
const SPP: u32 = 4;

fn bench(c: &mut Criterion) {
    for scene in ["cbox_vol2", "cbox_vol4", "san-miguel"] {
        let bench = Bench::new(scene, SIZE);
        for integrator in [Integrator::Volpath, RAYMARCH] {
            let mut group = c.benchmark_group(format!("{}/{scene}", integrator.name()));
            group.sample_size(10).throughput(Throughput::Elements(u64::from(SIZE * SIZE * SPP)));
            let mut expected = None;
            for method in METHODS {
                let prepared = bench.with(method.parse::<Method>().expect("a method"));
                let options = RenderOptions { integrator, spp: Some(SPP), threads: Some(1), ..RenderOptions::thesis() };
                let image = || prepared.render(&options, &Quiet).expect("usable options").image.pixels;
                assert_eq!(expected.get_or_insert_with(image), &image(), "{method} changes the image");
                group.bench_function(BenchmarkId::from_parameter(method), |b| b.iter(image));
            }
            group.finish();
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
