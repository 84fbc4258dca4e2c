//! How fast hierarchies are built: `san-miguel` from 10⁴ triangles on, and inputs that ruin one builder or another. The fastest
//! of some builds, by the clock and by the processor time of all threads, because other programs only ever slow a build down.
//!
//! ```text
//! RAYON_NUM_THREADS=2 cargo run --release -p vdf-scenes --example hierarchy -- [most triangles] [builds]
//! ```

use std::{hint::black_box, time::Instant};

use glam::Vec3;
use vdf_geometry::{Bvh, Triangle};
use vdf_scene::{LoadOptions, Scene, SceneSource};
use vdf_scenes::{GeneratedScene, generated};

/// Seconds of all threads of this process so far, as Linux counts them; else 0.
fn cpu_seconds() -> f64 {
    let of = |task: std::io::Result<std::fs::DirEntry>| {
        let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
        text.split_whitespace().next()?.parse::<f64>().ok()
    };
    std::fs::read_dir("/proc/self/task").map_or(0.0, |tasks| tasks.filter_map(of).sum::<f64>() * 1e-9)
}

fn print(name: &str, triangles: &[Triangle], builds: u32) {
    let (mut clock, mut cpu) = (f64::INFINITY, f64::INFINITY);
    let mut bytes = 0;
    for _ in 0..builds {
        let (start, cpu_start) = (Instant::now(), cpu_seconds());
        bytes = Bvh::new(black_box(triangles)).bytes();
        clock = clock.min(start.elapsed().as_secs_f64());
        cpu = cpu.min(cpu_seconds() - cpu_start);
    }
    let count = triangles.len() as f64;
    println!(
        "| {name} | {} | {:.1} ms | {:.1} ms | {:.2} | {:.2} | {:.0} |",
        triangles.len(),
        clock * 1e3,
        cpu * 1e3,
        count / clock * 1e-6,
        count / cpu * 1e-6,
        bytes as f64 / count
    );
}

fn court(triangles: u32) -> Vec<Triangle> {
    let size = triangles.clamp(GeneratedScene::MIN_TRIANGLES, GeneratedScene::MAX_TRIANGLES);
    let scene = generated("san-miguel").and_then(|scene| scene.with_triangles(size).ok());
    let scene = scene.and_then(|s| Scene::from_source(&SceneSource::from(s), &LoadOptions::default()).ok());
    let all = scene.into_iter().flat_map(|scene| scene.surfaces).flat_map(|surface| surface.triangles);
    all.step_by((size / triangles.max(1)).max(1) as usize).collect()
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let most: u32 = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(1_000_000);
    let builds = arguments.next().and_then(|n| n.parse().ok()).unwrap_or(5);
    println!("| triangles | number | clock | processor | M/s by the clock | M/s of one core | bytes a triangle |");
    println!("| --- | --- | --- | --- | --- | --- | --- |");
    for n in [10_000, 100_000, 1_000_000, 10_000_000].into_iter().filter(|&n| n <= most) {
        print("san-miguel", &court(n), builds);
    }
    let corners = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.3), Vec3::new(0.0, 1.0, 0.5)];
    let rim = |i: u16| {
        let angle = f32::from(i) * 1e-4;
        Vec3::new(angle.cos(), angle.sin(), 0.3 * (3.0 * angle).sin())
    };
    let of = |f: &dyn Fn(u16) -> [Vec3; 3]| -> Vec<_> { (0..60_000).map(|i| Triangle { vertices: f(i) }).collect() };
    print("equal", &vec![Triangle { vertices: corners }; most.min(1_000_000) as usize], builds);
    print("a fan", &of(&|i| [Vec3::ZERO, rim(i), rim(i + 1)]), builds);
    print("nested", &of(&|i| corners.map(|v| v * (1.0 + f32::from(i) * 1e-3))), builds);
    print("nested by powers", &of(&|i| corners.map(|v| v * 0.999_f32.powf(f32::from(i)))), builds);
}
