//! The two estimators of transmittance towards emitters: what analog draws, that both have one mean, and that analytic is quieter.

use glam::{dvec3, vec3};
use vdf::{
    geometry::Triangle,
    render::{Integrator, TransmittanceEstimator},
    scene::{Bsdf, Emitter, IntegratorSettings, Phase, Rgb, Scene, Surface},
};

use crate::common::{Options, add_fog, add_medium, cuboid, empty_scene, options, rendered};

const INTEGRATORS: [Integrator; 2] = [Integrator::Volpath, Integrator::raymarch(4)];

fn image(scene: &Scene, integrator: Integrator, transmittance: TransmittanceEstimator, seed: u64) -> Vec<Rgb> {
    let o = Options { integrator, transmittance, seed: Some(seed), ..options() };
    rendered(scene, &o).image.pixels
}

/// A wall lit by a point light in a box of fog that no camera ray meets: with one sample a pixel, an analog pixel is black or as bright as
/// without fog, and bright with probability exp(−τ); an analytic one is their mean.
#[test]
fn analog_is_all_or_nothing() {
    let light = dvec3(1.0, 0.0, 1.0);
    let mut scene = empty_scene(256, 1, 1e-9);
    scene.surfaces.push(Surface {
        triangles: vec![Triangle::new(vec3(-9.0, -9.0, 2.0), vec3(9.0, -9.0, 2.0), vec3(0.0, 9.0, 2.0))],
        bsdf: Bsdf::lambertian(Rgb::splat(0.5), Rgb::splat(0.5)),
        radiance: None,
        ..Surface::default()
    });
    scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(2.0) });
    scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
    // At 45° from the wall at (0, 0, 2) to the light: fog from x = 0.5 on.
    let fog = add_medium(&mut scene, 1.5, 0.0, Phase::Isotropic);
    add_fog(&mut scene, vec3(0.5, -0.5, 0.25), vec3(1.5, 0.5, 1.75), fog);
    let bright = 0.5 / std::f64::consts::PI * 2.0 * 0.5_f64.sqrt() / 2.0;
    let transmittance = (-1.5 * 0.5_f64.sqrt()).exp();
    let is = |p: &Rgb, expected: f64| (f64::from(p.x) - expected).abs() <= 1e-6 * expected;
    for integrator in INTEGRATORS {
        let analytic = image(&scene, integrator, TransmittanceEstimator::Analytic, 1);
        assert!(analytic.iter().all(|p| is(p, bright * transmittance)), "{integrator:?}: {}", analytic[0]);

        let analog = image(&scene, integrator, TransmittanceEstimator::Analog, 1);
        assert!(analog.iter().all(|p| is(p, bright) || *p == Rgb::ZERO), "{integrator:?}");
        // A binomial count; 5 standard deviations are a false alarm of 6·10⁻⁷.
        let n = analog.len() as f64;
        let passed = analog.iter().filter(|p| p.x > 0.0).count() as f64;
        let deviation = (passed - n * transmittance) / (n * transmittance * (1.0 - transmittance)).sqrt();
        assert!(deviation.abs() < 5.0, "{integrator:?}: {passed} of {n} for {transmittance}: {deviation} σ");
    }
}

/// A body in fog under a point light, an area light and light from everywhere: every kind of emitter sample. No light is in the fog, or
/// the variance would be infinite: 1/r⁴ has no integral about a point.
fn body_in_fog() -> Scene {
    let mut scene = empty_scene(32, 16, 0.6);
    let fog = add_medium(&mut scene, 1.0, 0.8, Phase::HenyeyGreenstein { g: 0.4 });
    add_fog(&mut scene, vec3(-1.5, -1.5, 0.5), vec3(1.5, 1.5, 4.0), fog);
    let surface = |triangles, radiance| Surface {
        triangles,
        bsdf: Bsdf::lambertian(Rgb::splat(0.7), Rgb::splat(0.7)),
        radiance,
        ..Surface::default()
    };
    scene.surfaces.push(surface(cuboid(vec3(-0.4, -1.4, 2.0), vec3(0.5, 0.2, 2.6)), None));
    scene.surfaces.push(surface(
        vec![Triangle::new(vec3(-1.2, 1.8, 1.2), vec3(-0.2, 1.8, 1.2), vec3(-0.2, 1.8, 2.2))],
        Some(Rgb::splat(4.0).into()),
    ));
    scene.emitters.push(Emitter::Point { position: dvec3(0.9, 0.7, 0.1), intensity: Rgb::splat(1.0) });
    scene.emitters.push(Emitter::Area { surface: 1 });
    scene.emitters.push(Emitter::Constant { radiance: Rgb::splat(0.2) });
    scene
}

/// The mean over the image of the difference of two independent renders, in standard errors: 5 are a false alarm of 6·10⁻⁷.
#[test]
fn both_estimators_have_one_mean() {
    for max_depth in [Some(2), None] {
        let mut scene = body_in_fog();
        scene.integrator.max_depth = max_depth;
        scene.sample_count = 64;
        for integrator in INTEGRATORS {
            let analytic = image(&scene, integrator, TransmittanceEstimator::Analytic, 1);
            let analog = image(&scene, integrator, TransmittanceEstimator::Analog, 2);
            let n = analytic.len() as f64;
            let differences: Vec<f64> =
                analytic.iter().zip(&analog).map(|(a, b)| f64::from(a.element_sum() - b.element_sum())).collect();
            let mean = differences.iter().sum::<f64>() / n;
            let variance = differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0);
            let deviation = mean / (variance / n).sqrt();
            println!("{max_depth:?}, {integrator:?}: analytic − analog = {deviation:.2} standard errors");
            assert!(deviation.abs() < 5.0, "{max_depth:?}, {integrator:?}: {deviation} standard errors");
        }
    }
}

/// Half the mean squared difference of two independent renders is the variance of a pixel.
#[test]
fn analytic_is_the_quieter_one() {
    let scene = body_in_fog();
    for integrator in INTEGRATORS {
        let [analytic, analog] = [TransmittanceEstimator::Analytic, TransmittanceEstimator::Analog].map(|t| {
            let (a, b) = (image(&scene, integrator, t, 1), image(&scene, integrator, t, 2));
            a.iter().zip(&b).map(|(a, b)| f64::from((*a - *b).length_squared())).sum::<f64>() / (2 * a.len()) as f64
        });
        println!("{integrator:?}: variance analog / analytic = {:.3}", analog / analytic);
        assert!(analog > analytic, "{integrator:?}: variance {analog} is not above {analytic}");
    }
}
