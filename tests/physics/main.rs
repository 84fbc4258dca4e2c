//! Light transport against closed forms: Beer–Lambert, the white furnace, the airlight integral, a lit wall.
//!
//! Statistical comparisons allow 5 standard errors, the error being estimated from the image itself: a false alarm has a
//! probability of 6·10⁻⁷ each. Seeds are fixed, so a test that passes keeps passing.

#[path = "../common/mod.rs"]
mod common;
mod estimators;

use common::{add_fog, add_medium, cuboid, empty_scene, integrate, mean_and_error, options, rendered};
use glam::{DVec3, dvec3, vec3};
use vdf::render::{
    IntegratorKind, Rgb, Triangle,
    scene::{Boundary, Bsdf, Emitter, IntegratorSettings, Phase, Scene, Surface},
};

const RAYMARCH: IntegratorKind = IntegratorKind::Raymarch { samples_per_segment: 4 };

fn assert_mean(name: &str, pixels: &[Rgb], expected: f64) {
    let (mean, error) = mean_and_error(pixels);
    // Radiance is single precision: about six roundings of 6·10⁻⁸ on the way to a pixel.
    let floor = 4e-7 * expected.abs();
    assert!((mean - expected).abs() <= 5.0 * error + floor, "{name}: {mean} ± {error}, expected {expected}");
}

/// The background through slabs of absorbing fog: exp(−Σσ_t d). `raymarch` knows it exactly, `volpath` in the mean.
#[test]
fn transmittance_through_slabs_is_beer_lambert() {
    for (sigma, depth) in [(0.0, 1.0), (1e-9, 1.0), (0.3, 2.0), (1.0, 5.0), (30.0, 40.0)] {
        let mut scene = empty_scene(32, 64, 1e-5);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let a = add_medium(&mut scene, sigma, 0.0, Phase::Isotropic);
        let b = add_medium(&mut scene, 0.25 * sigma, 0.0, Phase::Isotropic);
        add_fog(&mut scene, vec3(-9.0, -9.0, 1.0), vec3(9.0, 9.0, 1.0 + depth), a);
        // A second slab that touches the first: the media follow each other without any reference between them.
        add_fog(&mut scene, vec3(-9.0, -9.0, 1.0 + depth), vec3(9.0, 9.0, 3.0 + depth), b);
        let expected = (-sigma * (f64::from(depth) + 0.5)).exp();

        let marched = rendered(&scene, &vdf::render::RenderOptions { integrator: RAYMARCH, ..options() });
        for p in &marched.image.pixels {
            assert!((f64::from(p.x) - expected).abs() <= 1e-6 * expected, "σ = {sigma}: {} for {expected}", p.x);
        }
        assert_mean(&format!("σ = {sigma}"), &rendered(&scene, &options()).image.pixels, expected);
    }
}

/// Fog of albedo 1 and a box of reflectance 1 under a uniform sky do not darken anything: radiance is 1 everywhere.
#[test]
fn nothing_is_lost_in_a_white_furnace() {
    for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.7 }, Phase::HenyeyGreenstein { g: -0.4 }] {
        let mut scene = empty_scene(32, 32, 0.5);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let fog = add_medium(&mut scene, 1.0, 1.0, phase);
        add_fog(&mut scene, vec3(-2.0, -2.0, 1.0), vec3(2.0, 2.0, 4.0), fog);
        scene.surfaces.push(Surface {
            triangles: cuboid(vec3(-0.5, -0.5, 2.0), vec3(0.7, 0.4, 3.0)),
            bsdf: Bsdf { front: Rgb::ONE, back: Rgb::ONE },
            radiance: None,
        });
        assert_mean(&format!("{phase:?}"), &rendered(&scene, &options()).image.pixels, 1.0);
        // From inside the fog.
        scene.sensor.world_from_camera = glam::DMat4::from_translation(dvec3(0.1, 0.1, 1.2));
        scene.sensor.medium = Some(fog);
        assert_mean(&format!("inside, {phase:?}"), &rendered(&scene, &options()).image.pixels, 1.0);
    }
}

/// A closed room that emits 1 − ρ and reflects ρ everywhere, filled with fog of albedo 1, has radiance 1: emission met by rays and
/// sampled from emitters add up.
#[test]
fn a_glowing_room_is_uniform() {
    let mut scene = empty_scene(24, 64, 0.7);
    let fog = add_medium(&mut scene, 0.8, 1.0, Phase::HenyeyGreenstein { g: 0.3 });
    scene.sensor.medium = Some(fog);
    // Seen from inside, so the normals of the room point inwards.
    let room = cuboid(vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.2, 1.5));
    let inwards = room.iter().map(|t| Triangle::new(t.vertices[0], t.vertices[2], t.vertices[1])).collect();
    scene.surfaces.push(Surface {
        triangles: inwards,
        bsdf: Bsdf { front: Rgb::splat(0.5), back: Rgb::ZERO },
        radiance: Some(Rgb::splat(0.5)),
    });
    scene.emitters.push(Emitter::Area { surface: 0 });
    assert_mean("room", &rendered(&scene, &options()).image.pixels, 1.0);
}

/// The airlight integral: ∫ σ_s p(θ) I/r² exp(−σ_t(t + r)) dt over the part of the axis that lies in fog.
fn airlight(sigma_t: f64, albedo: f64, phase: Phase, light: DVec3, intensity: f64, fog: (f64, f64)) -> f64 {
    let f = |t: f64| {
        let to_light = light - dvec3(0.0, 0.0, t);
        let r = to_light.length();
        let p = phase.pdf_direction(DVec3::Z, to_light / r);
        sigma_t * albedo * p * intensity / (r * r) * (-sigma_t * (t - fog.0 + r)).exp()
    };
    integrate(&f, fog.0, fog.1)
}

/// Single scattering of a point light in a box of fog that also holds the light, and in unbounded fog.
#[test]
fn single_scattering_is_the_airlight_integral() {
    let light = dvec3(0.0, 0.4, 1.5);
    for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.6 }, Phase::HenyeyGreenstein { g: -0.6 }] {
        for bounded in [true, false] {
            let mut scene = empty_scene(32, 256, 1e-6);
            scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(3.0) });
            let fog = add_medium(&mut scene, 0.7, 0.8, phase);
            scene.sensor.medium = Some(fog);
            if bounded {
                add_fog(&mut scene, vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.0, 4.0), fog);
            }
            scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
            let expected =
                airlight(0.7, f64::from(0.8_f32), phase, light, 3.0, (0.0, if bounded { 4.0 } else { 60.0 }));
            for integrator in [IntegratorKind::Volpath, RAYMARCH] {
                let o = vdf::render::RenderOptions { integrator, ..options() };
                let name = format!("{phase:?}, bounded: {bounded}, {integrator:?}");
                assert_mean(&name, &rendered(&scene, &o).image.pixels, expected);
            }
        }
    }
}

/// A black wall behind fog that it limits, so that both integrators have the same model; then a white wall lit through fog:
/// ρ/π · I cos θ/r² · exp(−σ_t(d + r)).
#[test]
fn a_wall_lit_through_fog() {
    let wall = |reflectance: f32| Surface {
        triangles: vec![
            Triangle::new(vec3(-50.0, -50.0, 2.0), vec3(50.0, -50.0, 2.0), vec3(50.0, 50.0, 2.0)),
            Triangle::new(vec3(-50.0, -50.0, 2.0), vec3(50.0, 50.0, 2.0), vec3(-50.0, 50.0, 2.0)),
        ],
        bsdf: Bsdf { front: Rgb::splat(reflectance), back: Rgb::splat(reflectance) },
        radiance: None,
    };
    let light = dvec3(0.3, 0.4, 1.0);
    let make = |reflectance: f32, albedo: f32| -> Scene {
        let mut scene = empty_scene(32, 256, 1e-6);
        scene.surfaces.push(wall(reflectance));
        scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(2.0) });
        let fog = add_medium(&mut scene, 0.5, albedo, Phase::Isotropic);
        scene.sensor.medium = Some(fog);
        scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
        scene
    };
    let r = light.distance(dvec3(0.0, 0.0, 2.0));
    let lit = f64::from(0.6_f32) / std::f64::consts::PI * 2.0 * (1.0 / r) / (r * r) * (-0.5 * (2.0 + r)).exp();
    let air = airlight(0.5, f64::from(0.9_f32), Phase::Isotropic, light, 2.0, (0.0, 2.0));
    for integrator in [IntegratorKind::Volpath, RAYMARCH] {
        let o = vdf::render::RenderOptions { integrator, ..options() };
        assert_mean(&format!("lit wall, {integrator:?}"), &rendered(&make(0.6, 0.0), &o).image.pixels, lit);
        assert_mean(&format!("black wall, {integrator:?}"), &rendered(&make(0.0, 0.9), &o).image.pixels, air);
        assert_mean(&format!("both, {integrator:?}"), &rendered(&make(0.6, 0.9), &o).image.pixels, lit + air);
    }
}

/// Leaving fog through a boundary whose exterior is another fog, seen by the shadow ray too.
#[test]
fn nested_media_change_at_their_boundaries() {
    let mut scene = empty_scene(16, 64, 1e-6);
    let outer = add_medium(&mut scene, 0.2, 0.0, Phase::Isotropic);
    let inner = add_medium(&mut scene, 1.0, 0.0, Phase::Isotropic);
    scene.sensor.medium = Some(outer);
    add_fog(&mut scene, vec3(-5.0, -5.0, -5.0), vec3(5.0, 5.0, 5.0), outer);
    scene.boundaries.push(Boundary {
        triangles: cuboid(vec3(-1.0, -1.0, 1.0), vec3(1.0, 1.0, 2.0)),
        interior: Some(inner),
        exterior: Some(outer),
    });
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let expected = (-(0.2 * 4.0 + 1.0_f64)).exp();
    let o = vdf::render::RenderOptions { integrator: RAYMARCH, ..options() };
    for p in rendered(&scene, &o).image.pixels {
        assert!((f64::from(p.x) - expected).abs() < 1e-6, "{} for {expected}", p.x);
    }
}
