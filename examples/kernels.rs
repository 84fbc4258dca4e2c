//! Runs one kernel of visibility on a fixed recorded stream, so that callgrind can count its instructions: the same for the same binary on any day, however busy the machine.
//! `docs/performance.md` has the command and the counts.
//!
//! Usage: `kernels SCENE KERNEL`; kernels are the names of the methods (the proof alone), `any-hit` and `first-hit`. Each answers the
//! same 1000 spatial queries. Prints how many were proved or met something.

use std::hint::black_box;

use anyhow::{Context as _, anyhow, ensure};
use vdf::{
    geometry::{Bvh, Segment},
    render::Integrator,
    visibility::{Answer, Method, Provers, ShadowQuery},
};

#[path = "../benches/common/mod.rs"]
#[allow(dead_code, reason = "made for the benches")]
mod common;

const QUERIES: usize = 1000;

/// Its name is in callgrind's command.
#[inline(never)]
fn kernel_proof(provers: &Provers, queries: &[ShadowQuery]) -> usize {
    queries.iter().filter(|q| provers.answer(q) == Answer::Unoccluded).count()
}

#[inline(never)]
fn kernel_any_hit(bvh: &Bvh, queries: &[ShadowQuery]) -> usize {
    queries.iter().filter(|q| bvh.occluded(&Segment::new(q.from, q.to))).count()
}

#[inline(never)]
fn kernel_first_hit(bvh: &Bvh, queries: &[ShadowQuery]) -> usize {
    queries.iter().filter(|q| bvh.intersect(&Segment::new(q.from, q.to)).is_some()).count()
}

fn main() -> anyhow::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scene), Some(kernel), None) = (arguments.next(), arguments.next(), arguments.next()) else {
        return Err(anyhow!("usage: kernels SCENE KERNEL"));
    };
    let bench = common::Bench::new(&scene, 64);
    let mut queries = bench.record_spatial(Integrator::Volpath, 20 * QUERIES as u64);
    ensure!(queries.len() >= QUERIES, "only {} spatial queries", queries.len());
    queries.truncate(QUERIES);
    let bvh = black_box(&bench.none.world().bvh);
    let count = match kernel.as_str() {
        "any-hit" => kernel_any_hit(bvh, black_box(&queries)),
        "first-hit" => kernel_first_hit(bvh, black_box(&queries)),
        method => {
            let method: Method = method.parse().with_context(|| format!("no kernel {method}"))?;
            let prepared = bench.with(method);
            kernel_proof(black_box(prepared.provers()), black_box(&queries))
        }
    };
    println!("{scene} {kernel}: {count} of {QUERIES}");
    Ok(())
}
