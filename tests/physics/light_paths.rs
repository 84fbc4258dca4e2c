//! Paths that are connected to paths of the lights have the mean of those that are not, whatever lies between.

use std::path::Path;

use glam::{DVec3, Vec3};
use vdf::{
    geometry::Triangle,
    render::{Estimator, LightPaths, SamplerKind},
    scene::{Bsdf, Emitter, IntegratorSettings, LoadOptions, Rgb, Scene, Surface},
};

use crate::{
    check::VOLPATH,
    common::{Options, options, rendered},
};

/// Whether an emitter of the scene is to shine.
type Keeps = fn(&Scene, &Emitter) -> bool;

/// The mean of the image and of each quarter, in each colour: all by one light or by all of them, by few events and by several. Of 16 pairs of renders
/// each; 5 of their standard errors, with 15 degrees of freedom, are a false alarm of 2·10⁻⁴ each; colours and parts are much the same, so that this is about 0.01 over all, for a
/// given seed.
fn light_paths_bring_what_rays_find(spp: u32, enough: f64) {
    let all = load();
    let kinds: [(&str, Keeps); 6] = [
        ("all", |_, _| true),
        ("point", |_, e| matches!(e, Emitter::Point { .. })),
        ("spot", |_, e| matches!(e, Emitter::Spot { .. })),
        ("projector", |_, e| matches!(e, Emitter::Projector { .. })),
        ("lamp", is_flat),
        ("ball", |scene, e| matches!(e, Emitter::Area { surface } if scene.surfaces[*surface].curved.is_some())),
    ];
    for (name, keeps) in kinds {
        compare(name, &all, keeps, spp, enough);
    }
}

fn is_flat(scene: &Scene, e: &Emitter) -> bool {
    matches!(e, Emitter::Area { surface } if scene.surfaces[*surface].curved.is_none())
}

fn load() -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/physics/light_paths.xml");
    Scene::load(&path, &LoadOptions::default()).expect("the scene loads")
}

/// By 2 events and by up to 6.
fn compare(name: &str, all: &Scene, keeps: Keeps, spp: u32, enough: f64) {
    for max_depth in [3, 7] {
        let mut scene = all.clone();
        scene.emitters.retain(|e| keeps(all, e));
        for (i, surface) in scene.surfaces.iter_mut().enumerate() {
            if !scene.emitters.iter().any(|e| matches!(e, Emitter::Area { surface } if *surface == i)) {
                surface.radiance = None;
            }
        }
        scene.integrator = IntegratorSettings { max_depth: Some(max_depth), ..scene.integrator };
        // Sums over the image and its quarters, in three colours.
        let sums = |light_paths, seed| {
            let (estimator, sampler) = (Estimator::Equiangular, SamplerKind::Sobol);
            let spp = Some(spp);
            let o =
                Options { integrator: VOLPATH, estimator, light_paths, sampler, spp, seed: Some(seed), ..options() };
            let mut sums = [[0.0; 3]; 5];
            for (i, pixel) in rendered(&scene, &o).image.pixels.iter().enumerate() {
                for part in [4, i % 16 / 8 + i / 128 * 2] {
                    (0..3).for_each(|c| sums[part][c] += f64::from(pixel[c]));
                }
            }
            sums
        };
        let pictures: Vec<_> =
            (0..PAIRS).map(|i| (sums(LightPaths::Never, 2 * i), sums(LightPaths::Always, 2 * i + 1))).collect();
        for (part, colour) in (0..5).flat_map(|part| [0, 1, 2].map(|colour| (part, colour))) {
            let n = PAIRS as f64;
            let level = pictures.iter().map(|(a, _)| a[part][colour]).sum::<f64>() / n;
            let difference = |(a, b): &([[f64; 3]; 5], [[f64; 3]; 5])| (b[part][colour] - a[part][colour]) / level;
            let mean = pictures.iter().map(difference).sum::<f64>() / n;
            let squares = pictures.iter().map(|p| (difference(p) - mean).powi(2)).sum::<f64>();
            let error = (squares / (n - 1.0) / n).sqrt();
            println!("{name}, depth {max_depth}, part {part}, colour {colour}: {mean:.1e} ± {error:.1e}");
            assert!(mean.abs() < 5.0 * error, "{name}, depth {max_depth}, part {part}: {mean} ± {error}");
            assert!(part < 4 || error < enough, "{name}, depth {max_depth}: too noisy, {error}");
        }
    }
}

/// Pairs of renders.
const PAIRS: u64 = 16;

#[test]
fn light_paths_bring_what_rays_find_in_short() {
    light_paths_bring_what_rays_find(128, 0.03);
}

#[test]
#[ignore = "minutes"]
fn light_paths_bring_what_rays_find_for_long() {
    light_paths_bring_what_rays_find(2048, 0.008);
}

/// Half of the lamp in dense fog: a ray of it starts in the medium of its own place.
#[test]
fn a_lamp_on_the_border_of_fog_shines_on_both_sides() {
    let mut scene = load();
    scene.media.iter_mut().for_each(|m| m.sigma_t = vdf::scene::Extinction::Constant(DVec3::splat(4.0)));
    for surface in &mut scene.surfaces {
        if surface.radiance.is_some() && surface.curved.is_none() {
            for triangle in &mut surface.triangles {
                triangle.vertices.iter_mut().for_each(|v| *v += Vec3::new(-0.3, -0.6, -1.1));
            }
        }
    }
    compare("on the border", &scene, is_flat, 64, 0.1);
}

/// A light that lies on a wall is hidden by it from everywhere: no ray of it brings what no query lets through.
#[test]
fn a_light_on_a_wall_sends_nothing() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/physics/light_paths.xml");
    let mut scene = Scene::load(&path, &LoadOptions::default()).expect("the scene loads");
    for surface in &mut scene.surfaces {
        surface.radiance = None;
    }
    scene.emitters = vec![Emitter::Point { position: DVec3::new(0.1, -0.25, 0.2), intensity: Rgb::ONE }];
    let [a, b, c, d] = [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)].map(|(x, z)| Vec3::new(x, -0.25, z));
    scene.surfaces.push(Surface {
        triangles: vec![Triangle::new(a, b, c), Triangle::new(a, c, d)],
        bsdf: Bsdf::lambertian(Rgb::ONE, Rgb::ONE),
        ..Surface::default()
    });
    for estimator in Estimator::ALL {
        let o = Options { integrator: VOLPATH, estimator, spp: Some(16), ..options() };
        assert!(rendered(&scene, &o).image.pixels.iter().all(|p| *p == Rgb::ZERO), "{estimator:?}");
    }
}

/// Where a lamp shines at the ceiling light paths pay; where one shines on what is seen they do not; and what is chosen is what could have been asked for.
#[test]
fn light_paths_are_taken_where_they_pay() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    for (file, pay) in [("physics/light_paths.xml", true), ("mitsuba/scenes/disney.xml", false)] {
        let mut scene = Scene::load(&tests.join(file), &LoadOptions::default()).expect("the scene loads");
        if pay {
            scene
                .emitters
                .retain(|e| matches!(e, Emitter::Area { surface } if scene.surfaces[*surface].curved.is_none()));
        }
        let render = |light_paths, threads| {
            let (estimator, spp, threads) = (Estimator::Equiangular, Some(2), Some(threads));
            rendered(&scene, &Options { integrator: VOLPATH, estimator, light_paths, spp, threads, ..options() })
        };
        let [never, always] = [LightPaths::Never, LightPaths::Always].map(|way| render(way, 2));
        assert!(never.statistics.connections == 0 && always.statistics.connections > 0);
        for threads in [1, 2] {
            let auto = render(LightPaths::Auto, threads);
            let chosen = if pay { &always } else { &never };
            assert_eq!(auto.statistics.connections, chosen.statistics.connections, "{file}");
            assert!(auto.image.pixels == chosen.image.pixels, "{file}");
        }
    }
}
