//! The airlight integral: a point light scattered once into a ray. Fog with and without bounds, camera and light inside and outside.
//!
//! The light on the ray's axis has no finite integral; it is approached.

use glam::{DVec3, Vec3, dvec3, vec3};
use vdf::{
    render::Estimator,
    scene::{Emitter, IntegratorSettings, Phase, Rgb, Scene},
};

use crate::{
    check::{Check, RAYMARCH, VOLPATH, WAYS},
    common::empty_scene,
    fog::{Fog, add_fogs, single_scattering},
};

const PHASES: [Phase; 4] = [
    Phase::Isotropic,
    Phase::HenyeyGreenstein { g: 0.6 },
    Phase::HenyeyGreenstein { g: -0.6 },
    Phase::HenyeyGreenstein { g: 0.9 },
];

/// The camera at the origin looks along +Z through an angle that does not matter even for a light 10⁻³ off the axis.
fn scene(fogs: &[Fog], light: DVec3) -> Scene {
    let mut scene = empty_scene(32, 1, 1e-12);
    scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(3.0) });
    scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
    add_fogs(&mut scene, fogs);
    scene
}

fn compare(check: &mut Check, case: &str, fogs: &[Fog], light: DVec3) {
    let spp = if check.is(VOLPATH) { 192 } else { 4 };
    // Beyond optical depth 60 there is nothing left.
    let thinnest = fogs.iter().map(|f| f.sigma_t).fold(f64::INFINITY, f64::min);
    let end = if fogs[0].min.is_finite() { 100.0 } else { 60.0 / thinnest };
    check.mean(case, &check.render(&scene(fogs, light), spp), single_scattering(fogs, light, 3.0, end));
}

#[test]
fn in_unbounded_fog() {
    for way in WAYS {
        let mut check = Check::by("single scattering, unbounded", way);
        for phase in PHASES {
            for (sigma_t, light) in
                [(0.7, dvec3(0.0, 0.4, 1.5)), (0.7, dvec3(0.5, -0.6, -1.0)), (4.0, dvec3(0.3, 0.0, 0.6))]
            {
                let fog = Fog::unbounded(sigma_t, 0.8, phase);
                compare(&mut check, &format!("{phase:?}, σ_t {sigma_t}, light {light}"), &[fog], light);
            }
        }
    }
}

#[test]
fn in_boxes_of_fog() {
    for way in WAYS {
        let mut check = Check::by("single scattering, bounded", way);
        let two_lobes = Phase::TwoLobes { weight: 0.3, g: [0.9, -0.6] };
        // What a boundary does has no part in what a phase function does: of the others one case each.
        for (phase, kept) in [(PHASES[0], 0..6), (PHASES[1], 0..6), (Phase::Rayleigh, 0..1), (two_lobes, 1..2)] {
            let fog = |min: Vec3, max: Vec3, sigma_t| Fog { min, max, sigma_t, albedo: 0.8, phase };
            let around = fog(vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.5, 4.0), 0.7);
            let ahead = fog(vec3(-1.0, -1.5, 1.0), vec3(1.0, 1.0, 4.0), 0.9);
            let next = Fog { phase: Phase::Isotropic, ..fog(vec3(-2.0, -1.0, 4.0), vec3(1.0, 2.0, 5.0), 2.0) };
            let after = fog(vec3(-1.0, -1.0, 5.5), vec3(1.0, 1.0, 7.0), 0.3);
            let cases: [(&str, &[Fog], DVec3); 6] = [
                ("both inside", &[around], dvec3(0.0, 0.4, 1.5)),
                ("camera outside", &[ahead], dvec3(0.3, 0.4, 2.5)),
                ("light outside", &[around], dvec3(0.0, 2.0, 1.5)),
                ("both outside", &[ahead], dvec3(1.5, 0.5, 0.25)),
                ("three media, light in the second", &[ahead, next, after], dvec3(-0.2, 0.6, 4.4)),
                ("three media, light behind them", &[ahead, next, after], dvec3(0.4, 0.3, 8.0)),
            ];
            for (case, fogs, light) in &cases[kept] {
                compare(&mut check, &format!("{phase:?}, {case}"), fogs, *light);
            }
        }
    }
}

/// Thin fog is where ray marching must not lose digits (and where a path tracer finds next to nothing).
#[test]
fn in_thin_and_in_opaque_fog() {
    for estimator in Estimator::ALL {
        let mut check = Check::by("single scattering, thin to opaque", (RAYMARCH, estimator));
        for sigma_t in [1e-12, 1e-6, 1e-3, 30.0, 1000.0, 1e4] {
            let fog = Fog {
                min: vec3(-1.0, -1.0, 1.0),
                max: vec3(1.0, 1.0, 4.0),
                sigma_t,
                albedo: 1.0,
                phase: Phase::HenyeyGreenstein { g: 0.3 },
            };
            // Seen from the fog's near side, so that something is left of it.
            compare(&mut check, &format!("σ_t {sigma_t}"), &[fog], dvec3(0.2, 0.1, 0.5));
        }
    }
}

/// As the light nears the axis the integral grows like 1/h and its estimators' relative variance like 1/h.
#[test]
fn with_the_light_near_the_axis() {
    for way in WAYS {
        let mut check = Check::by("single scattering, light near the axis", way);
        for phase in [PHASES[0], PHASES[1]] {
            for h in [0.1, 0.01, 0.001] {
                let fog =
                    Fog { min: vec3(-1.0, -1.0, 1.0), max: vec3(1.0, 1.0, 4.0), sigma_t: 0.7, albedo: 0.8, phase };
                compare(&mut check, &format!("{phase:?}, h {h}"), &[fog], dvec3(h, 0.0, 2.2));
            }
        }
    }
}

/// What only distances drawn towards the light can do: a light all but on the ray, peaks of the phase function where the light is in front and
/// where it is behind, a light in clear air that is taken for one in dense fog.
#[test]
fn with_all_that_is_hard_for_a_density() {
    for estimator in [Estimator::Equiangular, Estimator::Lit] {
        let mut check = Check::by("single scattering, hard for a density", (RAYMARCH, estimator));
        let fog =
            |sigma_t, phase| Fog { min: vec3(-1.0, -1.0, 1.0), max: vec3(1.0, 1.0, 4.0), sigma_t, albedo: 0.8, phase };
        for h in [1e-5, 1e-7, 1e-9] {
            compare(&mut check, &format!("h {h}"), &[fog(0.7, Phase::Isotropic)], dvec3(h, 0.0, 2.2));
        }
        for g in [0.99, -0.99, 0.999, -0.999] {
            for light in [dvec3(0.05, 0.0, 0.5), dvec3(0.3, -0.2, 2.5), dvec3(0.05, 0.02, 5.0)] {
                let phase = Phase::HenyeyGreenstein { g };
                compare(&mut check, &format!("g {g}, light {light}"), &[fog(0.7, phase)], light);
            }
        }
        for light in [dvec3(0.0, 40.0, 2.0), dvec3(1e6, 0.0, 2.0), dvec3(3.0, 0.0, 1.5)] {
            compare(&mut check, &format!("light {light}"), &[fog(5.0, Phase::Isotropic)], light);
        }
    }
}
