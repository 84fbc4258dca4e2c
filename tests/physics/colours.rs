//! Media that take more of one colour than of another, channel by channel.

use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3, dvec3, vec3};
use vdf::{
    render::{Estimator, Integrator},
    scene::{
        Emitter, Extinction, GridVolume, IntegratorSettings, Medium, MediumId, Phase, Rgb, Scene, VolumeFilter,
        VoxelGrid, Wrap,
    },
};

use crate::{
    check::{RAYMARCH, VOLPATH, WAYS},
    common::{Options, add_block_and_lights, add_fog, empty_scene, options, rendered},
};

const BOX: [Vec3; 2] = [vec3(-1.5, -1.0, 1.0), vec3(1.0, 2.0, 3.5)];

/// From clear to opaque in one channel or another, and from thin to thick.
const COLOURS: [DVec3; 4] =
    [dvec3(0.1, 0.5, 2.0), dvec3(0.0, 0.7, 0.7), dvec3(3.0, 0.0, 0.0), dvec3(0.6, 0.600_001, 0.6)];

fn with_fog(scene: &mut Scene, sigma_t: Extinction, albedo: f32, [min, max]: [Vec3; 2]) {
    let id = MediumId(u32::try_from(scene.media.len()).expect("few"));
    let mut medium = Medium::new(0.0, Rgb::splat(albedo), Phase::HenyeyGreenstein { g: 0.3 });
    medium.sigma_t = sigma_t;
    scene.media.push(medium);
    add_fog(scene, min, max, id);
}

/// Three channels on a grid over the box; some of each are zero, at other places.
fn coloured_grid([min, max]: [Vec3; 2]) -> Extinction {
    let size = [5, 4, 6];
    let values = (0..size.iter().product::<u32>() * 3).map(|i| ((i * 7919 % 13) as f32 - 4.0).max(0.0) / 4.0).collect();
    let grid = VoxelGrid::new(size, 3, values, [Vec3::ZERO, Vec3::ONE]).expect("a grid");
    let world_from_grid = DMat4::from_translation(min.as_dvec3()) * DMat4::from_scale((max - min).as_dvec3());
    let volume = GridVolume {
        grid: Arc::new(grid),
        filter: VolumeFilter::Trilinear,
        wrap: Wrap::Clamp,
        grid_from_world: world_from_grid.inverse(),
    };
    Extinction::Grid { volume, scale: 1.2 }
}

fn image(scene: &Scene, (integrator, estimator): (Integrator, Estimator), spp: u32, seed: u64) -> Vec<Rgb> {
    let o = Options { integrator, estimator, spp: Some(spp), seed: Some(seed), ..options() };
    rendered(scene, &o).image.pixels
}

/// Mean and standard error of each channel.
fn statistics(pixels: &[Rgb]) -> (DVec3, DVec3) {
    let n = pixels.len() as f64;
    let mean = pixels.iter().map(|p| p.as_dvec3()).sum::<DVec3>() / n;
    let square = |d: DVec3| d * d;
    let variance = pixels.iter().map(|p| square(p.as_dvec3() - mean)).sum::<DVec3>() / (n - 1.0);
    (mean, DVec3::from_array((variance / n).to_array().map(f64::sqrt)))
}

/// Each channel has the expectation of its own: 5 standard errors are a false alarm of 6·10⁻⁷.
#[track_caller]
fn assert_mean(case: &str, pixels: &[Rgb], expected: DVec3) {
    let (mean, error) = statistics(pixels);
    println!("{case}: {mean} ± {error}, expected {expected}");
    let off = (mean - expected).abs();
    assert!(off.cmple(5.0 * error + 1e-6 * expected).all(), "{case}: {mean} ± {error}, expected {expected}");
}

/// e^(−τ) of each colour, of fog that absorbs before the sky.
#[test]
fn colours_are_absorbed_each_by_itself() {
    for sigma_t in COLOURS {
        let mut scene = empty_scene(32, 1, 1e-12);
        with_fog(&mut scene, Extinction::Constant(sigma_t), 0.0, BOX);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let expected = DVec3::from_array((sigma_t * 2.5).to_array().map(|tau| (-tau).exp()));
        let marched = image(&scene, (RAYMARCH, Estimator::Thesis), 1, 1);
        assert!(marched.iter().all(|p| (p.as_dvec3() - expected).abs().max_element() < 1e-6), "{}", marched[0]);
        let traced = image(&scene, (VOLPATH, Estimator::Thesis), 16, 1);
        assert_mean(&format!("absorbed, {sigma_t}"), &traced, expected);
        // No sample is worth more than all three channels together.
        let single = image(&scene, (VOLPATH, Estimator::Thesis), 1, 2);
        assert!(single.iter().all(|p| p.max_element() <= 3.0 * (1.0 + 1e-6)));
    }
}

/// Fog of albedo 1 darkens no colour and brightens none, however often light is scattered.
#[test]
fn no_colour_is_lost_in_white_fog() {
    let all = COLOURS.map(Extinction::Constant).into_iter().chain([coloured_grid(BOX)]);
    for (i, sigma_t) in all.enumerate() {
        let mut scene = empty_scene(32, 1, 0.5);
        with_fog(&mut scene, sigma_t, 1.0, BOX);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        assert_mean(&format!("furnace {i}"), &image(&scene, (VOLPATH, Estimator::Thesis), 32, 1), DVec3::ONE);
        scene.sensor.world_from_camera = DMat4::from_translation(dvec3(0.1, 0.1, 1.2));
        scene.sensor.medium = Some(MediumId(0));
        assert_mean(&format!("furnace {i}, inside"), &image(&scene, (VOLPATH, Estimator::Thesis), 32, 1), DVec3::ONE);
    }
}

/// All ways to find light that is scattered once agree in each channel, with coloured fog, a coloured grid and grey fog; and each channel is what it is in a
/// grey scene of its own extinction.
#[test]
fn all_ways_find_the_same_colours() {
    let scene_of = |colour: Option<usize>| {
        let mut scene = empty_scene(32, 1, 0.6);
        scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
        let fog = dvec3(0.1, 0.5, 2.0);
        let fog = colour.map_or(Extinction::Constant(fog), |c| fog[c].into());
        with_fog(&mut scene, fog, 0.9, [vec3(-2.0, -1.5, 1.0), vec3(0.2, 1.5, 3.0)]);
        if colour.is_none() {
            let place = [vec3(0.2, -2.0, 1.5), vec3(2.0, 1.0, 4.0)];
            with_fog(&mut scene, coloured_grid(place), 0.7, place);
        }
        with_fog(&mut scene, 0.3.into(), 0.8, [vec3(-1.0, -2.0, 4.5), vec3(2.5, 1.0, 6.0)]);
        add_block_and_lights(&mut scene);
        scene
    };
    let compare = |case: &str, a: &[Rgb], b: &[Rgb], channels: &[usize]| {
        let differences: Vec<Rgb> = a.iter().zip(b).map(|(a, b)| *a - *b).collect();
        let ((mean, error), (level, _)) = (statistics(&differences), statistics(a));
        println!("{case}: {} ± {}", mean / level, error / level);
        for &c in channels {
            assert!(mean[c].abs() <= 5.0 * error[c], "{case}, channel {c}: {mean} ± {error}");
            // Or the test would prove little.
            assert!(error[c] < 0.012 * level[c], "{case}, channel {c}: too noisy, {error} of {level}");
        }
    };
    let coloured = scene_of(None);
    let traced = image(&coloured, (VOLPATH, Estimator::Thesis), 128, 1);
    for way in WAYS {
        let spp = if way.0 == VOLPATH { 128 } else { 2 };
        compare(&format!("{way:?}"), &traced, &image(&coloured, way, spp, 2), &[0, 1, 2]);
    }
    let mut without_grid = scene_of(None);
    without_grid.media.remove(1);
    without_grid.boundaries.remove(1);
    without_grid.boundaries[1].interior = Some(MediumId(1));
    let marched = image(&without_grid, (RAYMARCH, Estimator::Thesis), 4, 3);
    for c in 0..3 {
        let grey = image(&scene_of(Some(c)), (RAYMARCH, Estimator::Thesis), 4, 4);
        compare(&format!("grey of channel {c}"), &marched, &grey, &[c]);
    }
}
