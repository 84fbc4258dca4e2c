//! Diffuse surfaces lit through fog: point lights in closed form, area lights by quadrature.

use std::f64::consts::PI;

use glam::{DVec3, dvec3, vec3};
use vdf::{
    geometry::Triangle,
    render::Estimator,
    scene::{Bsdf, Emitter, IntegratorSettings, Phase, Rgb, Scene, Surface},
};

use crate::{
    check::{Check, INTEGRATORS, RAYMARCH, TRACED, VOLPATH},
    common::empty_scene,
    fog::{Fog, add_fogs, optical_depth, single_scattering},
    furnace::gauss_legendre,
};

const REFLECTANCE: f32 = 0.6;

/// A wall across the axis at z = 2; the camera looks at (0, 0, 2) from the origin.
fn wall(reflectance: f32) -> Scene {
    let mut scene = empty_scene(32, 1, 1e-12);
    scene.surfaces.push(Surface {
        triangles: vec![Triangle::new(vec3(-50.0, -50.0, 2.0), vec3(50.0, -50.0, 2.0), vec3(0.0, 50.0, 2.0))],
        bsdf: Bsdf::lambertian(Rgb::splat(reflectance), Rgb::splat(reflectance)),
        radiance: None,
        ..Surface::default()
    });
    scene.integrator = IntegratorSettings { max_depth: Some(2), rr_depth: 10 };
    scene
}

const SEEN: DVec3 = dvec3(0.0, 0.0, 2.0);

/// Radiance of the wall at (0, 0, 2) by a point light: ρ/π · I cos θ/r² · exp(−τ), seen and lit through fog.
fn lit_by_point(fogs: &[Fog], light: DVec3, intensity: f64) -> f64 {
    let d = light - SEEN;
    let depth = optical_depth(fogs, DVec3::ZERO, SEEN) + optical_depth(fogs, SEEN, light);
    f64::from(REFLECTANCE) / PI * intensity * (-d.z).max(0.0) / d.length().powi(3) * (-depth).exp()
}

fn point_light(scene: &mut Scene, light: DVec3) {
    scene.emitters.push(Emitter::Point { position: light, intensity: Rgb::splat(2.0) });
}

/// With fog that absorbs, and none of it on the camera's way for `volpath`, whose free flights are random: no noise at all.
#[test]
fn by_a_point_light_through_absorbing_fog() {
    let fog = Fog::absorbing;
    let around_light = [fog(vec3(0.5, -0.5, 0.25), vec3(1.5, 0.5, 1.75), 1.5)];
    let two = [
        fog(vec3(0.25, -1.0, 0.5), vec3(0.75, 1.0, 1.875), 0.7),
        fog(vec3(0.75, -1.0, 0.25), vec3(2.0, 1.0, 1.875), 3.0),
    ];
    let beside = [fog(vec3(-3.0, -1.0, 0.5), vec3(-1.0, 1.0, 1.5), 9.0)];
    let everywhere = [Fog::absorbing(vec3(-5.0, -5.0, -1.0), vec3(5.0, 5.0, 1.75), 0.8)];
    let cases: [(&str, &[Fog], DVec3); 7] = [
        ("no fog", &[], dvec3(0.3, 0.4, 1.0)),
        ("light in fog", &around_light, dvec3(1.0, 0.0, 1.0)),
        ("light behind two fogs", &two, dvec3(2.5, 0.3, 0.5)),
        ("grazing", &two, dvec3(1.9, 0.3, 1.8)),
        ("fog elsewhere", &beside, dvec3(1.0, 0.0, 1.0)),
        ("light on the other side", &around_light, dvec3(1.0, 0.0, 3.0)),
        ("everything in fog", &everywhere, dvec3(0.3, 0.4, 1.0)),
    ];
    for integrator in INTEGRATORS {
        let mut check = Check::new("wall lit through absorbing fog", integrator);
        for (case, fogs, light) in cases {
            let mut scene = wall(REFLECTANCE);
            add_fogs(&mut scene, fogs);
            point_light(&mut scene, light);
            let expected = lit_by_point(fogs, light, 2.0);
            if check.is(VOLPATH) && optical_depth(fogs, DVec3::ZERO, SEEN) > 0.0 {
                check.mean(case, &check.render(&scene, 256), expected);
            } else {
                check.exact(case, &check.render(&scene, 1), expected);
            }
        }
    }
}

/// The light of the wall and that of the fog before it add up; a black wall leaves the fog's alone.
#[test]
fn by_a_point_light_through_scattering_fog() {
    let phase = Phase::HenyeyGreenstein { g: 0.5 };
    let boxed = Fog { min: vec3(-2.0, -2.0, -1.0), max: vec3(2.0, 2.0, 1.5), sigma_t: 0.9, albedo: 0.9, phase };
    let light = dvec3(0.3, 0.4, 1.0);
    for integrator in INTEGRATORS {
        let mut check = Check::new("wall lit through scattering fog", integrator);
        let spp = if check.is(VOLPATH) { 256 } else { 4 };
        for (name, fogs) in [("unbounded", [Fog::unbounded(0.5, 0.9, phase)]), ("bounded", [boxed])] {
            let air = single_scattering(&fogs, light, 2.0, 2.0);
            for (reflectance, expected) in [(0.0, air), (REFLECTANCE, air + lit_by_point(&fogs, light, 2.0))] {
                let mut scene = wall(reflectance);
                add_fogs(&mut scene, &fogs);
                point_light(&mut scene, light);
                check.mean(&format!("{name}, reflectance {reflectance}"), &check.render(&scene, spp), expected);
            }
        }
    }
}

/// Irradiance by a rectangle of radiance 1 that faces the wall: ∫ cos θ cos θ'/r² exp(−τ) dA by Gauss–Legendre quadrature, and in vacuum
/// Lambert's formula, ½ Σ Θ_i Γ_i·n over the edges as seen from the point [Arvo1994].
#[test]
fn by_an_area_light() {
    let corners = [vec3(0.25, -0.5, 1.0), vec3(1.5, -0.5, 0.5), vec3(1.5, 0.75, 0.5), vec3(0.25, 0.75, 1.0)];
    let [a, b, c, d] = corners.map(|p| p.as_dvec3());
    let normal = (b - a).cross(d - a);
    let area = normal.length();
    assert!(normal.dot(SEEN - a) > 0.0, "the front emits");
    let irradiance = |fogs: &[Fog]| -> f64 {
        let nodes = gauss_legendre(24);
        let at = |u: f64, v: f64| {
            let p = a + (b - a) * v + (d - a) * u;
            let to = p - SEEN;
            let r = to.length();
            (-to.z / r) * (-to.dot(normal) / (r * area)) / (r * r) * (-optical_depth(fogs, p, SEEN)).exp()
        };
        nodes
            .iter()
            .flat_map(|&[u, wu]| nodes.iter().map(move |&[v, wv]| (u, v, wu * wv)))
            .map(|(u, v, w)| w * at(u, v))
            .sum::<f64>()
            * area
    };
    let seen = [a, b, c, d].map(|p| (p - SEEN).normalize());
    let lambert: f64 = (0..4)
        .map(|i| {
            let (p, q) = (seen[i], seen[(i + 1) % 4]);
            0.5 * p.dot(q).acos() * p.cross(q).normalize().dot(-DVec3::Z)
        })
        .sum::<f64>()
        .abs();
    assert!((irradiance(&[]) - lambert).abs() < 1e-9 * lambert, "{} is not {lambert}", irradiance(&[]));

    let fog = Fog::absorbing(vec3(-1.0, -1.0, 1.25), vec3(2.0, 1.0, 1.75), 2.0);
    for way in [TRACED[0], TRACED[1], (RAYMARCH, Estimator::Thesis)] {
        let mut check = Check::by("wall lit by an area light", way);
        for (case, fogs) in [("vacuum", &[][..]), ("absorbing fog", &[fog])] {
            let mut scene = wall(REFLECTANCE);
            add_fogs(&mut scene, fogs);
            scene.surfaces.push(Surface {
                triangles: vec![
                    Triangle::new(corners[0], corners[1], corners[2]),
                    Triangle::new(corners[0], corners[2], corners[3]),
                ],
                bsdf: Bsdf::lambertian(Rgb::ZERO, Rgb::ZERO),
                radiance: Some(Rgb::ONE.into()),
                ..Surface::default()
            });
            scene.emitters.push(Emitter::Area { surface: 1 });
            let through = (-optical_depth(fogs, DVec3::ZERO, SEEN)).exp();
            let expected = f64::from(REFLECTANCE) / PI * irradiance(fogs) * through;
            check.mean(case, &check.render(&scene, 192), expected);
        }
    }
}

/// Uniform light from everywhere: every diffuse surface has the radiance ρ.
#[test]
fn by_the_sky() {
    for integrator in INTEGRATORS {
        let mut check = Check::new("wall lit by the sky", integrator);
        for radiance in [1.0_f32, 3.5] {
            let mut scene = wall(REFLECTANCE);
            scene.emitters.push(Emitter::Constant { radiance: Rgb::splat(radiance) });
            let expected = f64::from(REFLECTANCE) * f64::from(radiance);
            // The wall is finite: it sees all of its half of the sky.
            check.mean(&format!("{radiance}"), &check.render(&scene, 64), expected);
        }
    }
}
