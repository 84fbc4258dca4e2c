//! Voxelization by each method: triangles a second on millions of small ones, voxels a second on a few large ones.
//!
//! All input is generated. The sets are compared before anything is timed.

use std::f32::consts::{PI, TAU};

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, Vec3, vec3};
use rayon::prelude::*;
use vdf::{
    render::Sampler,
    voxel::{VoxelGrid, Voxelizer, voxelize_with},
};

const VOXELIZERS: [(&str, Voxelizer); 3] = [
    ("slices", Voxelizer::Slices),
    ("offset-polygon", Voxelizer::OffsetPolygon),
    ("separating-axes", Voxelizer::SeparatingAxes),
];

/// The unit cube, `n` voxels along each side.
fn grid(n: u32) -> VoxelGrid {
    VoxelGrid::covering(DVec3::ZERO, DVec3::ONE, f64::from(n).recip(), 1 << 30).expect("a legal grid")
}

/// A wavy sphere of 2·`n`·`n` triangles, as a scanned mesh would be: neighbours in memory are neighbours in space.
fn wavy_sphere(n: u32) -> Vec<[Vec3; 3]> {
    let point = |i: u32, j: u32| {
        let (theta, phi) = (PI * i as f32 / n as f32, TAU * (j % n) as f32 / n as f32);
        let radius = 0.4 + 0.05 * (9.0 * theta).sin() * (7.0 * phi).cos();
        let direction = vec3(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
        Vec3::splat(0.5) + radius * direction
    };
    (0..n)
        .flat_map(|i| (0..n).map(move |j| (i, j)))
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect()
}

/// Triangles with vertices anywhere in the unit cube.
fn across(count: u32) -> Vec<[Vec3; 3]> {
    (0..count)
        .map(|i| {
            let mut s = Sampler::new(1, i, 0, 0);
            [(); 3].map(|()| vec3(s.next_1d() as f32, s.next_1d() as f32, s.next_1d() as f32))
        })
        .collect()
}

/// Half a square across the cube at right angles to each axis: the walls of a room.
fn walls() -> Vec<[Vec3; 3]> {
    (0..3)
        .flat_map(|axis| {
            let turned = |a: f32, b: f32, c: f32| {
                let mut p = [a, b, c];
                p.rotate_right(axis);
                Vec3::from_array(p)
            };
            [0.1003, 0.9003].map(|h| [turned(0.05, 0.05, h), turned(0.95, 0.05, h), turned(0.05, 0.95, h)])
        })
        .collect()
}

fn bench_input(c: &mut Criterion, name: &str, n: u32, triangles: &[[Vec3; 3]], count_voxels: bool) {
    let grid = grid(n);
    let voxelized = |method| voxelize_with(method, &grid, triangles.par_iter().copied()).expect("finite vertices");
    let expected = voxelized(Voxelizer::SeparatingAxes);
    assert_eq!(voxelized(Voxelizer::Slices), expected, "{name}: the methods differ");
    let polygon = voxelized(Voxelizer::OffsetPolygon);
    assert!(expected.iter().all(|v| polygon.contains(v)), "{name}: the offset polygon misses a voxel");
    let excess = 100.0 * (polygon.count() as f64 / expected.count() as f64 - 1.0);
    println!("{name}: the offset polygon marks {excess:.3} % too many voxels");
    let mut group = c.benchmark_group(name);
    group.sample_size(10);
    let elements = if count_voxels { expected.count() } else { triangles.len() };
    group.throughput(Throughput::Elements(elements as u64));
    for (method_name, method) in VOXELIZERS {
        group.bench_function(method_name, |b| b.iter(|| voxelized(method)));
    }
    group.finish();
}

fn bench(c: &mut Criterion) {
    let fine = wavy_sphere(1000);
    bench_input(c, "small/0.6-voxels", 256, &fine, false);
    bench_input(c, "small/2-voxels", 1024, &fine, false);
    bench_input(c, "large/across", 512, &across(64), true);
    bench_input(c, "large/walls", 512, &walls(), true);
}

criterion_group!(benches, bench);
criterion_main!(benches);
