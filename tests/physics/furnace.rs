//! Balances of energy: what is neither absorbed nor lost comes back.

use glam::{DMat3, DMat4, dvec3, vec3};
use vdf::{
    geometry::{CurvedKind, CurvedShape, Triangle},
    scene::{Boundary, Bsdf, Emitter, IntegratorSettings, MediumId, Phase, Rgb, Scene, Surface, Texture},
};

use crate::{
    check::{Check, INTEGRATORS, TRACED, VOLPATH, WAYS},
    common::{add_fog, add_medium, cuboid, empty_scene},
};

/// Fog of albedo 1 and a box of reflectance 1 under a uniform sky do not darken anything: radiance is 1 everywhere.
#[test]
fn nothing_is_lost_under_a_uniform_sky() {
    for way in TRACED {
        let mut check = Check::by("white furnace, uniform sky", way);
        for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.7 }, Phase::HenyeyGreenstein { g: -0.4 }] {
            let mut scene = empty_scene(32, 1, 0.5);
            scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
            // A light that gives none, but is aimed at.
            scene.emitters.push(Emitter::Point { position: dvec3(1.0, 0.8, 1.8), intensity: Rgb::ZERO });
            let fog = add_medium(&mut scene, 1.0, 1.0, phase);
            add_fog(&mut scene, vec3(-2.0, -2.0, 1.0), vec3(2.0, 2.0, 4.0), fog);
            scene.surfaces.push(Surface {
                triangles: cuboid(vec3(-0.5, -0.5, 2.0), vec3(0.7, 0.4, 3.0)),
                bsdf: Bsdf::lambertian(Rgb::ONE, Rgb::ONE),
                radiance: None,
                ..Surface::default()
            });
            check.mean(&format!("{phase:?}"), &check.render(&scene, 32), 1.0);
            // From inside the fog.
            scene.sensor.world_from_camera = DMat4::from_translation(dvec3(0.1, 0.1, 1.2));
            scene.sensor.medium = Some(fog);
            check.mean(&format!("inside, {phase:?}"), &check.render(&scene, 32), 1.0);
        }
    }
}

/// White curved shapes, and a ball of clear glass with white fog inside, in a ball of white fog under a uniform sky: radiance is 1 everywhere. In glass it is the square of the
/// index times that, which is undone where light leaves. The phase functions are those that the test above has not.
#[test]
fn curved_shapes_lose_nothing_under_a_uniform_sky() {
    let shape = |kind, size: f64, at| {
        let linear = DMat3::from_rotation_x(0.4) * size;
        CurvedShape::new(kind, linear, at, false).expect("it can be inverted")
    };
    let glass = Bsdf::Dielectric {
        eta: 1.5,
        reflectance: Texture::grey(1.0),
        transmittance: Texture::grey(1.0),
        roughness: None,
    };
    let white = Bsdf::lambertian(Rgb::ONE, Rgb::ONE);
    for way in TRACED {
        let mut check = Check::by("white furnace, curved shapes", way);
        let mut scene = empty_scene(16, 1, 0.35);
        scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
        let fog = add_medium(&mut scene, 0.6, 1.0, Phase::TwoLobes { weight: 0.4, g: [0.6, -0.3] });
        let thick = add_medium(&mut scene, 2.0, 1.0, Phase::Rayleigh);
        let outer = shape(CurvedKind::Sphere, 2.0, dvec3(0.0, 0.0, 3.0));
        let ball = shape(CurvedKind::Sphere, 0.4, dvec3(-0.3, -0.3, 2.4));
        for (curved, interior, exterior) in [(outer, fog, None), (ball, thick, Some(fog))] {
            let interior = Some(interior);
            scene.boundaries.push(Boundary { curved: Some(curved), interior, exterior, ..Boundary::default() });
        }
        for (curved, bsdf) in [
            (shape(CurvedKind::Sphere, 0.4, dvec3(-0.6, 0.5, 3.0)), &white),
            (shape(CurvedKind::Disk, 0.5, dvec3(0.5, 0.6, 2.6)), &white),
            (shape(CurvedKind::Cylinder, 0.4, dvec3(0.6, -0.5, 2.8)), &white),
            (ball, &glass),
        ] {
            scene.surfaces.push(Surface { curved: Some(curved), bsdf: bsdf.clone(), ..Surface::default() });
        }
        check.mean("glass, ball, disk, cylinder", &check.render(&scene, 32), 1.0);
    }
}

/// A closed room whose walls (or only the one at +Z) emit and reflect that; the rest reflects all. The camera is in it.
fn room(emitted: f32, reflectance: f32, one_wall_only: bool) -> Scene {
    let mut scene = empty_scene(32, 1, 0.7);
    // Seen from inside, so the normals point inwards.
    let walls = cuboid(vec3(-1.0, -1.0, -1.0), vec3(1.0, 1.2, 1.5));
    let inwards = walls.iter().map(|t| Triangle::new(t.vertices[0], t.vertices[2], t.vertices[1]));
    let (emitting, white): (Vec<_>, Vec<_>) =
        inwards.partition(|t| !one_wall_only || t.vertices.iter().all(|v| v.z == 1.5));
    let surface = |triangles, reflectance, radiance| Surface {
        triangles,
        bsdf: Bsdf::lambertian(Rgb::splat(reflectance), Rgb::ZERO),
        radiance,
        ..Surface::default()
    };
    scene.surfaces.push(surface(emitting, reflectance, Some(Rgb::splat(emitted).into())));
    scene.surfaces.push(surface(white, 1.0, None));
    scene.emitters.push(Emitter::Area { surface: 0 });
    scene
}

/// Every quarter of the image, too: radiance is uniform.
fn uniform(check: &mut Check, case: &str, scene: &Scene, spp: u32, expected: f64) {
    let pixels = check.render(scene, spp);
    check.mean(case, &pixels, expected);
    for quarter in 0..4 {
        let half = 16;
        let part: Vec<Rgb> = (0..half * half)
            .map(|i| pixels[(i / half + half * (quarter / 2)) * 2 * half + i % half + half * (quarter % 2)])
            .collect();
        check.mean(&format!("{case}, quarter {quarter}"), &part, expected);
    }
}

fn fill(scene: &mut Scene, albedo: f32, phase: Phase) -> MediumId {
    let fog = add_medium(scene, 0.8, albedo, phase);
    scene.sensor.medium = Some(fog);
    fog
}

/// A room that emits 1 − ρ and reflects ρ everywhere, filled with fog of albedo 1, has radiance 1: emission met by rays and sampled
/// from emitters add up.
#[test]
fn a_glowing_room_is_uniform() {
    for way in TRACED {
        let mut check = Check::by("white furnace, glowing room", way);
        for (reflectance, spp) in [(0.5, 64), (0.875, 64)] {
            for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.3 }] {
                let mut scene = room(1.0 - reflectance, reflectance, false);
                fill(&mut scene, 1.0, phase);
                uniform(&mut check, &format!("reflectance {reflectance}, {phase:?}"), &scene, spp, 1.0);
            }
        }
    }
}

/// A cavity: fog of albedo 1 between walls of reflectance 1, but for one black wall of radiance 1. Whatever is in it sees radiance 1.
#[test]
fn a_cavity_is_uniform() {
    for way in TRACED {
        let mut check = Check::by("white furnace, cavity", way);
        for phase in [Phase::Isotropic, Phase::HenyeyGreenstein { g: 0.8 }, Phase::HenyeyGreenstein { g: -0.5 }] {
            let mut scene = room(1.0, 0.0, true);
            // Roulette at a throughput of 1 is nothing but noise.
            scene.integrator.rr_depth = 40;
            fill(&mut scene, 1.0, phase);
            // The camera looks away from the black wall, then at it; a white body is in its way.
            let body = Surface {
                triangles: cuboid(vec3(-0.5, -0.6, -0.8), vec3(0.1, 0.2, -0.4)),
                bsdf: Bsdf::lambertian(Rgb::ONE, Rgb::ONE),
                radiance: None,
                ..Surface::default()
            };
            scene.surfaces.push(body);
            for (view, angle) in [("away", std::f64::consts::PI), ("towards", 0.0)] {
                scene.sensor.world_from_camera = DMat4::from_rotation_y(angle);
                uniform(&mut check, &format!("{phase:?}, {view}"), &scene, 64, 1.0);
            }
        }
    }
}

/// In vacuum each scattering event adds its term to a geometric series: (1 − ρⁿ)/(1 − ρ) with at most n of them, n for ρ = 1.
#[test]
fn a_room_without_fog_is_a_geometric_series() {
    for integrator in INTEGRATORS {
        let mut check = Check::new("geometric series, room without fog", integrator);
        for reflectance in [0.5_f32, 0.75, 1.0] {
            for n in [1, 2, 3, 6] {
                let mut scene = room(1.0, reflectance, false);
                scene.integrator = IntegratorSettings { max_depth: Some(n), rr_depth: 3 };
                let expected: f64 = (0..n).map(|k| f64::from(reflectance).powi(k.cast_signed())).sum();
                uniform(&mut check, &format!("reflectance {reflectance}, {n} events"), &scene, 16, expected);
            }
        }
        // And without a limit.
        let scene = room(1.0, 0.75, false);
        uniform(&mut check, "no limit", &scene, 16, 4.0);
    }
}

/// Fog that fills the half-space z > 1 as good as wholly, seen under the cosine `mu` to its normal, under a uniform sky.
fn half_space(albedo: f32, mu: f64) -> Scene {
    let mut scene = empty_scene(32, 1, 1e-9);
    scene.emitters.push(Emitter::Constant { radiance: Rgb::ONE });
    let fog = add_medium(&mut scene, 1.0, albedo, Phase::Isotropic);
    // Of the light that enters, less than e^(−0.5·60) is left at the other sides: [Chandrasekhar1960], the root of the
    // characteristic equation for albedo 0.9.
    add_fog(&mut scene, vec3(-300.0, -300.0, 1.0), vec3(300.0, 300.0, 61.0), fog);
    scene.sensor.world_from_camera = DMat4::from_rotation_x(mu.acos());
    scene
}

/// With absorption: a half-space of albedo ϖ reflects 1 − √(1 − ϖ) H(μ) and absorbs the rest, H being Chandrasekhar's function for
/// isotropic scattering [Chandrasekhar1960].
#[test]
fn a_half_space_absorbs_what_it_does_not_reflect() {
    for way in TRACED {
        let mut check = Check::by("energy balance, absorbing half-space", way);
        for albedo in [0.3_f32, 0.7, 0.9] {
            let h = HFunction::new(f64::from(albedo));
            for mu in [0.1, 0.5, 1.0] {
                let expected = 1.0 - (1.0 - f64::from(albedo)).sqrt() * h.at(mu);
                check.mean(&format!("albedo {albedo}, μ {mu}"), &check.render(&half_space(albedo, mu), 64), expected);
            }
        }
    }
}

/// Scattered once: ϖ/2 (1 − μ ln(1 + 1/μ)), the first order of the same.
#[test]
fn a_half_space_that_scatters_once() {
    for way in WAYS {
        let mut check = Check::by("single scattering, half-space under the sky", way);
        for mu in [0.1, 0.5, 1.0] {
            let mut scene = half_space(0.9, mu);
            scene.integrator.max_depth = Some(2);
            let expected = 0.5 * f64::from(0.9_f32) * (1.0 - mu * (1.0 / mu).ln_1p());
            check.mean(&format!("μ {mu}"), &check.render(&scene, if check.is(VOLPATH) { 64 } else { 4 }), expected);
        }
    }
}

/// H of Chandrasekhar for isotropic scattering, by iteration of 1/H(μ) = √(1 − ϖ) + ϖ/2 ∫₀¹ μ' H(μ')/(μ + μ') dμ' on Gauss–Legendre nodes.
struct HFunction {
    albedo: f64,
    /// Node, weight, value.
    nodes: Vec<[f64; 3]>,
}

impl HFunction {
    fn new(albedo: f64) -> Self {
        let mut h = Self { albedo, nodes: gauss_legendre(48).into_iter().map(|[x, w]| [x, w, 1.0]).collect() };
        for _ in 0..200 {
            let values: Vec<f64> = h.nodes.iter().map(|n| h.at(n[0])).collect();
            h.nodes.iter_mut().zip(values).for_each(|(n, value)| n[2] = value);
        }
        // ∫H = 2/ϖ (1 − √(1 − ϖ)).
        let integral: f64 = h.nodes.iter().map(|[_, w, value]| w * value).sum();
        let expected = 2.0 / albedo * (1.0 - (1.0 - albedo).sqrt());
        assert!((integral - expected).abs() < 1e-7, "∫H = {integral}, not {expected}");
        h
    }

    fn at(&self, mu: f64) -> f64 {
        let integral: f64 = self.nodes.iter().map(|[x, w, h]| w * x * h / (mu + x)).sum();
        1.0 / ((1.0 - self.albedo).sqrt() + 0.5 * self.albedo * integral)
    }
}

/// Nodes and weights of Gauss–Legendre quadrature on [0, 1], by Newton's method.
pub(crate) fn gauss_legendre(n: u32) -> Vec<[f64; 2]> {
    (0..n)
        .map(|i| {
            let mut x = (std::f64::consts::PI * (f64::from(i) + 0.75) / (f64::from(n) + 0.5)).cos();
            let mut slope = 0.0;
            for _ in 0..100 {
                let (mut p, mut before) = (1.0, 0.0);
                for k in 0..n {
                    let k = f64::from(k);
                    (p, before) = (((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0), p);
                }
                slope = f64::from(n) * (x * p - before) / (x * x - 1.0);
                x -= p / slope;
            }
            [0.5 * (1.0 - x), 1.0 / ((1.0 - x * x) * slope * slope)]
        })
        .collect()
}
