//! How fast fields are built: millions of voxels a second by size, scene and builder; the fastest of some runs, because
//! other programs only ever slow a run down.
//!
//! ```text
//! RAYON_NUM_THREADS=2 cargo run --release -p vdf-distfield --example builds -- [greatest side] [part of a builder's name] [least side]
//! ```

use std::{hint::black_box, time::Instant};

use vdf_distfield::{Amr, Dsz, Dual, Ndf, NdfBuilder};
use vdf_voxel::{Resolution, Voxel, VoxelSet};

/// Reproducible pseudo-random numbers below a bound (SplitMix64).
fn random(mut state: u64) -> impl FnMut(u32) -> u32 {
    move |bound| {
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % u64::from(bound)) as u32
    }
}

/// Single voxels, one among `share`.
fn scattered(n: u32, share: u32) -> VoxelSet {
    let mut below = random(7);
    let mut set = VoxelSet::new(Resolution::new(n, n, n));
    set.extend((0..(n * n / share * n).max(1)).map(|_| Voxel::new(below(n), below(n), below(n))));
    set
}

/// The walls of a room and of 24 boxes in it.
fn room(n: u32) -> VoxelSet {
    let mut below = random(3);
    let mut boxes = vec![([0; 3], [n - 1; 3])];
    for _ in 0..24 {
        let low = [below(n * 7 / 8), below(n * 7 / 8), 0];
        boxes.push((low, [low[0] + 1 + below(n / 8), low[1] + 1 + below(n / 8), 1 + below(n / 2)]));
    }
    VoxelSet::from_rows(Resolution::new(n, n, n), |j, k, row| {
        for (low, high) in &boxes {
            if (low[1]..=high[1]).contains(&j) && (low[2]..=high[2]).contains(&k) {
                let all = j == low[1] || j == high[1] || k == low[2] || k == high[2];
                for i in (low[0]..=high[0]).filter(|&i| all || i == low[0] || i == high[0]) {
                    row[(i / 64) as usize] |= 1 << (i % 64);
                }
            }
        }
    })
}

type Build = fn(&VoxelSet);

const BUILDERS: [(&str, Build); 5] = [
    ("ndf sweeps", |set| drop(black_box(Ndf::build_with(NdfBuilder::Sweeps, set)))),
    ("ndf wavefront", |set| drop(black_box(Ndf::build_with(NdfBuilder::Wavefront, set)))),
    ("amr", |set| drop(black_box(Amr::build(set)))),
    ("dsz", |set| drop(black_box(Dsz::build(set)))),
    ("dual", |set| drop(black_box(Dual::build(set)))),
];

/// Seconds of all threads of this process so far, as Linux counts them; else NaN.
fn cpu_seconds() -> f64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let ticks = stat
        .rsplit(')')
        .next()
        .map(|rest| rest.split_whitespace().skip(11).take(2).filter_map(|t| t.parse::<f64>().ok()));
    ticks.map_or(f64::NAN, |t| t.sum::<f64>() / 100.0)
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let greatest = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(256);
    let name = arguments.next().unwrap_or_default();
    let least = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(32);
    println!("M voxels/s, {} threads; in brackets M voxels a second of one core", rayon::current_num_threads());
    println!("| builder | voxels | one voxel | 1 in 2¹⁸ | room | 1 in 50 |");
    println!("| --- | --- | --- | --- | --- | --- |");
    for n in [32, 64, 128, 256, 512].into_iter().filter(|&n| n <= greatest && n >= least) {
        let scenes = [scattered(n, u32::MAX), scattered(n, (1 << 18).min(n * n)), room(n), scattered(n, 50)];
        for (builder, build) in BUILDERS.into_iter().filter(|(b, _)| b.contains(&name)) {
            let speeds = scenes.each_ref().map(|set| {
                let voxels = set.resolution().voxel_count();
                let cpu = cpu_seconds();
                let runs = (1 << 27) / voxels.max(1 << 19) + 7;
                let seconds = (0..runs)
                    .map(|_| {
                        let start = Instant::now();
                        build(black_box(set));
                        start.elapsed().as_secs_f64()
                    })
                    .fold(f64::INFINITY, f64::min);
                let cpu = (cpu_seconds() - cpu) / runs as f64;
                format!("{:.0} ({:.0})", voxels as f64 / seconds * 1e-6, voxels as f64 / cpu * 1e-6)
            });
            println!("| {builder} | {n}³ | {} |", speeds.join(" | "));
        }
    }
}
