//! `volpath` and `raymarch` agree where their models are one: single scattering before black surfaces, and any number of diffuse
//! reflections through fog that only absorbs. No closed form, so the scene may be anything.

use glam::{dvec3, vec3};
use vdf::{
    geometry::Triangle,
    render::{Estimator, Integrator, LightPaths, SamplerKind, SegmentSamples},
    scene::{Bsdf, Emitter, IntegratorSettings, Phase, Rgb, Scene, Surface},
};

use crate::{
    check::VOLPATH,
    common::{Options, cuboid, empty_scene, options, rendered},
    fog::{Fog, add_fogs},
};

/// Three fogs, one of them around the camera, bodies in them, and three lights, none of them in fog (or the variance is infinite).
fn scene(reflectance: f32, albedo: f32, density: f64) -> Scene {
    let mut scene = empty_scene(32, 1, 0.6);
    let fog = |min, max, sigma_t: f64, g| Fog {
        min,
        max,
        sigma_t: density * sigma_t,
        albedo,
        phase: Phase::HenyeyGreenstein { g },
    };
    let fogs = [
        fog(vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, 1.0), 0.4, 0.5),
        fog(vec3(-2.0, -1.5, 1.0), vec3(1.5, 1.5, 3.0), 1.2, -0.3),
        fog(vec3(-1.0, -2.0, 3.5), vec3(2.5, 1.0, 5.0), 0.8, 0.0),
    ];
    add_fogs(&mut scene, &fogs);
    let surface = |triangles, radiance| Surface {
        triangles,
        bsdf: Bsdf::lambertian(Rgb::splat(reflectance), Rgb::splat(reflectance)),
        radiance,
        ..Surface::default()
    };
    scene.surfaces.push(surface(cuboid(vec3(-0.9, -0.8, 1.5), vec3(-0.2, 0.1, 2.2)), None));
    scene.surfaces.push(surface(cuboid(vec3(0.3, -0.5, 2.6), vec3(0.9, 0.6, 4.0)), None));
    let lamp = Triangle::new(vec3(-1.2, 1.9, 1.2), vec3(0.8, 1.9, 1.2), vec3(0.8, 1.9, 2.4));
    scene.surfaces.push(surface(vec![lamp], Some(Rgb::splat(4.0).into())));
    scene.emitters.push(Emitter::Area { surface: 2 });
    scene.emitters.push(Emitter::Point { position: dvec3(2.0, 1.2, 0.6), intensity: Rgb::splat(5.0) });
    scene.emitters.push(Emitter::Constant { radiance: Rgb::splat(0.3) });
    scene
}

/// The mean of the differences of two renders over the pixels that are kept, and its standard error.
fn difference(a: &[Rgb], b: &[Rgb], keep: impl Fn(usize) -> bool) -> [f64; 2] {
    let kept = a.iter().zip(b).enumerate().filter(|(i, _)| keep(*i));
    let differences: Vec<f64> = kept.map(|(_, (a, b))| f64::from(a.x - b.x)).collect();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    [mean, (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt()]
}

/// The mean over the image of the difference of two independent renders: 5 standard errors are a false alarm of 6·10⁻⁷.
#[test]
fn the_integrators_agree_where_their_models_do() {
    let once = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
    let often = IntegratorSettings { max_depth: None, rr_depth: 4 };
    for (name, reflectance, albedo, density, settings) in [
        ("black surfaces, scattered once", 0.0, 0.9, 1.0, once),
        ("white surfaces, absorbing fog", 0.8, 0.0, 0.125, often),
    ] {
        let scene = Scene { integrator: settings, ..scene(reflectance, albedo, density) };
        let image = |integrator, estimator, sampler, spp, seed| {
            let o = Options { integrator, estimator, sampler, spp: Some(spp), seed: Some(seed), ..options() };
            rendered(&scene, &o).image.pixels
        };
        let traced = image(VOLPATH, Estimator::Thesis, SamplerKind::Independent, 384, 1);
        let all = Estimator::ALL.into_iter().flat_map(|e| SamplerKind::ALL.map(|s| (Integrator::raymarch(8), e, s)));
        let auto = Integrator::Raymarch(SegmentSamples::Auto);
        let by_need = Estimator::ALL.map(|e| (auto, e, SamplerKind::Independent));
        for (integrator, estimator, sampler) in all.chain(by_need) {
            let marched = image(integrator, estimator, sampler, 64, 2);
            let [mean, error] = difference(&traced, &marched, |_| true);
            let level = traced.iter().map(|p| f64::from(p.x)).sum::<f64>() / traced.len() as f64;
            println!(
                "{name}, {integrator}, {estimator:?}, {sampler:?}: volpath − raymarch = {:.1e} ± {:.1e} of the mean",
                mean / level,
                error / level
            );
            assert!(mean.abs() < 5.0 * error, "{name}: {mean} ± {error}");
            // Or the test would prove little.
            assert!(error < 3e-3 * level, "{name}: too noisy, {error} of {level}");
        }
    }
}

/// All light, scattered often in fog and on surfaces, from three kinds of light: both estimators of `volpath` have one mean, over the image and over
/// each of its quarters: 5 standard errors are a false alarm of 6·10⁻⁷ each. With roulette at once; and without it on short paths, of which the last ray is a large part.
#[test]
fn the_estimators_of_paths_agree() {
    for (max_depth, rr_depth) in [(8, 0), (2, 1000)] {
        let settings = IntegratorSettings { max_depth: Some(max_depth), rr_depth };
        let scene = Scene { integrator: settings, ..scene(0.6, 0.9, 1.0) };
        let image = |estimator, sampler, spp, seed| {
            let o = Options { estimator, sampler, spp: Some(spp), seed: Some(seed), ..options() };
            rendered(&scene, &o).image.pixels
        };
        let thesis = image(Estimator::Thesis, SamplerKind::Independent, 512, 1);
        for sampler in SamplerKind::ALL {
            let other = image(Estimator::Equiangular, sampler, 512, 2);
            let level = thesis.iter().map(|p| f64::from(p.x)).sum::<f64>() / thesis.len() as f64;
            for (part, keep) in [0, 1, 2, 3, 4].map(|q| (q, move |i: usize| q == 4 || (i % 32 / 16 + i / 512 * 2) == q))
            {
                let [mean, error] = difference(&thesis, &other, keep);
                println!("rr {rr_depth}, {sampler:?}, part {part}: {:.1e} ± {:.1e}", mean / level, error / level);
                assert!(mean.abs() < 5.0 * error, "{sampler:?}, part {part}: {mean} ± {error}");
                assert!(error < 6e-3 * level, "{sampler:?}, part {part}: too noisy, {error} of {level}");
            }
        }
    }
}

/// Light of several points: one outside, one in fog behind a body, one shut in, so that no ray sees it, and a faint one; beside an area light and a
/// sky. The mean over the image and over each row of it: 5 standard errors are a false alarm of 6·10⁻⁷ each.
#[test]
fn lit_parts_of_rays_agree_with_queries() {
    let once = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
    let mut scene = Scene { integrator: once, ..scene(0.0, 0.9, 1.0) };
    scene.surfaces[1].triangles.pop();
    for (position, intensity) in [
        (dvec3(-0.1, 0.3, 2.4), 1.0),
        (dvec3(-0.5, -0.4, 1.8), 100.0),
        (dvec3(0.1, -0.2, 4.4), 0.01),
        (dvec3(0.6, 0.0, 3.0), 3.0),
    ] {
        scene.emitters.push(Emitter::Point { position, intensity: Rgb::splat(intensity) });
    }
    let image = |estimator, sampler, samples, spp, seed| {
        let integrator = Integrator::raymarch(samples);
        let o = Options { integrator, estimator, sampler, spp: Some(spp), seed: Some(seed), ..options() };
        rendered(&scene, &o).image.pixels
    };
    let asked = image(Estimator::Equiangular, SamplerKind::Independent, 32, 128, 1);
    let level = asked.iter().map(|p| f64::from(p.x)).sum::<f64>() / asked.len() as f64;
    for (samples, sampler) in [(1, SamplerKind::Sobol), (1, SamplerKind::Independent), (6, SamplerKind::Independent)] {
        let lit = image(Estimator::Lit, sampler, samples, 128, 2);
        for part in 0..5 {
            let [mean, error] = difference(&asked, &lit, |i| part == 4 || i * 4 / asked.len() == part);
            println!("{samples} samples, {sampler:?}, part {part}: {:.1e} ± {:.1e}", mean / level, error / level);
            assert!(mean.abs() < 5.0 * error, "{samples} samples, {sampler:?}, part {part}: {mean} ± {error}");
            // A quarter of the image is twice as noisy as all of it.
            let enough = if part == 4 { 1e-2 } else { 2.5e-2 };
            assert!(
                error < enough * level,
                "{samples} samples, {sampler:?}, part {part}: too noisy, {error} of {level}"
            );
        }
    }
}

/// Thirty lamps, some of them strong, beside an area light and a sky: whether emitters are drawn alike, as `thesis` does, or by what they can give, with and without light paths,
/// and for samples on rays, the mean is one, over the image and over each quarter of it: 5 standard errors are a false alarm of 6·10⁻⁷ each.
#[test]
fn lamps_may_be_asked_by_what_they_give() {
    let settings = IntegratorSettings { max_depth: Some(4), rr_depth: 3 };
    let mut scene = Scene { integrator: settings, ..scene(0.6, 0.9, 1.0) };
    for i in 0..30 {
        let [x, y, z] = [0.7, 0.31, 0.83].map(|step| (step * f64::from(i) + 0.2).fract() - 0.5);
        let intensity = Rgb::splat([0.05, 0.01, 0.2][i as usize % 3]);
        // Above the fogs, or the variance is infinite.
        let position = dvec3(4.0 * x, 2.2 + y, 3.0 + 5.0 * z);
        scene.emitters.push(Emitter::Point { position, intensity });
    }
    for integrator in [Integrator::Volpath, Integrator::raymarch(3)] {
        let image = |estimator, light_paths, spp, seed| {
            let o = Options { integrator, estimator, light_paths, spp: Some(spp), seed: Some(seed), ..options() };
            rendered(&scene, &o).image.pixels
        };
        let thesis = image(Estimator::Thesis, LightPaths::Never, 1024, 1);
        let level = thesis.iter().map(|p| f64::from(p.x)).sum::<f64>() / thesis.len() as f64;
        for light_paths in [LightPaths::Never, LightPaths::Always] {
            if light_paths == LightPaths::Always && integrator != Integrator::Volpath {
                continue;
            }
            let other = image(Estimator::Equiangular, light_paths, 256, 2);
            for part in 0..5 {
                let [mean, error] = difference(&thesis, &other, |i| part == 4 || i * 4 / thesis.len() == part);
                println!("{integrator:?}, {light_paths:?}, part {part}: {:.1e} ± {:.1e}", mean / level, error / level);
                assert!(mean.abs() < 5.0 * error, "{integrator:?}, {light_paths:?}, part {part}: {mean} ± {error}");
                assert!(
                    error < 2.5e-2 * level,
                    "{integrator:?}, {light_paths:?}, part {part}: too noisy, {error} of {level}"
                );
            }
        }
    }
}
