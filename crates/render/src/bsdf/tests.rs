//! Every material: its samples follow its density, its values are reciprocal, and it makes no light.

use std::f64::consts::TAU;

use glam::{DVec3, Vec2, dvec3};
use vdf_scene::{Bsdf, Microfacets, Rgb, Roughness, Texture};

use super::material::{Lobe, Material};
use crate::{Sampler, chi_squared::assert_drawn_from};

const UV: Vec2 = Vec2::ZERO;
const WHITE: Texture = Texture::grey(1.0);

fn rough(distribution: Microfacets, u: f32, v: f32) -> Option<Roughness> {
    Some(Roughness { distribution, alpha_u: Texture::grey(u), alpha_v: Texture::grey(v) })
}

fn glass(eta: f64, roughness: Option<Roughness>) -> Bsdf {
    Bsdf::Dielectric { eta, reflectance: WHITE, transmittance: WHITE, roughness }
}

fn metal(roughness: Option<Roughness>) -> Bsdf {
    Bsdf::Conductor { eta: Rgb::splat(0.2), k: Rgb::new(3.9, 2.4, 2.1), specular: WHITE, roughness }
}

fn plastic(roughness: Option<Roughness>, nonlinear: bool) -> Bsdf {
    let diffuse = Texture::Constant(Rgb::new(0.9, 0.5, 0.1));
    Bsdf::Plastic { eta: 1.49, diffuse, specular: WHITE, nonlinear, roughness }
}

/// All models, with and without their options.
fn all() -> Vec<(&'static str, Bsdf)> {
    let (beckmann, ggx) = (Microfacets::Beckmann, Microfacets::Ggx);
    let white = Bsdf::lambertian(Rgb::ONE, Rgb::splat(0.5));
    vec![
        ("diffuse", white.clone()),
        ("mirror", metal(None)),
        ("metal", metal(rough(beckmann, 0.3, 0.3))),
        ("brushed metal", metal(rough(ggx, 0.15, 0.5))),
        ("glass", glass(1.5, None)),
        ("frosted glass", glass(1.5, rough(beckmann, 0.35, 0.35))),
        ("frosted bubble", glass(0.7, rough(ggx, 0.4, 0.4))),
        ("sheet", Bsdf::ThinDielectric { eta: 1.5, reflectance: WHITE, transmittance: WHITE }),
        ("plastic", plastic(None, false)),
        ("matte plastic", plastic(rough(beckmann, 0.25, 0.25), true)),
        ("two-sided", Bsdf::TwoSided(Box::new([plastic(rough(ggx, 0.3, 0.3), false), white.clone()]))),
        (
            "blend",
            Bsdf::Blend { weight: Texture::grey(0.3), of: Box::new([white.clone(), metal(rough(ggx, 0.3, 0.3))]) },
        ),
        ("mask", Bsdf::Mask { opacity: Texture::grey(0.6), of: Box::new(white) }),
        ("null", Bsdf::Null),
    ]
}

fn directions() -> [DVec3; 5] {
    [dvec3(0.1, 0.05, 1.0), dvec3(0.7, -0.3, 0.6), dvec3(0.5, 0.8, 0.25), dvec3(0.2, 0.4, -0.9), dvec3(-0.8, 0.1, -0.4)]
        .map(DVec3::normalize)
}

/// χ² over 16 × 8 cells of the whole sphere, even in cosine and azimuth; what the lobes without a density get is one cell more. And each sample is worth what
/// it is evaluated as.
#[test]
fn samples_follow_the_density() {
    const RINGS: usize = 16;
    const SECTORS: usize = 8;
    const FINE: usize = 12;
    for (name, bsdf) in all() {
        let material = Material::from(&bsdf);
        for (k, wi) in directions().into_iter().enumerate() {
            let n = 12_000;
            let mut cells = vec![0_u64; RINGS * SECTORS + 1];
            let mut ended = 0;
            for i in 0..n {
                let mut s = Sampler::new(17, i, k as u32, 0);
                let (choice, u) = (s.next_1d(), s.next_2d());
                let Some(sample) = material.sample(wi, UV, choice, u) else {
                    ended += 1;
                    continue;
                };
                assert!((sample.wo.length() - 1.0).abs() < 1e-6, "{name}");
                if sample.lobe != Lobe::Smooth {
                    cells[RINGS * SECTORS] += 1;
                    continue;
                }
                let (value, pdf) = material.eval(wi, sample.wo, UV);
                assert!((pdf / sample.pdf - 1.0).abs() < 1e-9, "{name}");
                let worth = sample.weight * pdf as f32;
                assert!((worth - value).abs().max_element() <= 1e-4 * value.max_element().max(1e-6), "{name}");
                let ring = ((sample.wo.z * 0.5 + 0.5) * RINGS as f64) as usize;
                let sector = (sample.wo.y.atan2(sample.wo.x) / TAU).rem_euclid(1.0) * SECTORS as f64;
                cells[ring.min(RINGS - 1) * SECTORS + (sector as usize).min(SECTORS - 1)] += 1;
            }
            let mut expected = vec![0.0; RINGS * SECTORS + 1];
            for ring in 0..RINGS {
                // Even in the angle within a ring: lobes about a pole are narrow there.
                let ends = [ring, ring + 1].map(|r| (r as f64 / RINGS as f64 * 2.0 - 1.0).acos());
                let step = (ends[0] - ends[1]) / FINE as f64;
                for a in 0..FINE {
                    let (sin, cos) = (ends[1] + (a as f64 + 0.5) * step).sin_cos();
                    for b in 0..SECTORS * FINE {
                        let (s, c) = ((b as f64 + 0.5) / (SECTORS * FINE) as f64 * TAU).sin_cos();
                        let pdf = material.eval(wi, dvec3(sin * c, sin * s, cos), UV).1;
                        expected[ring * SECTORS + b / FINE] += pdf * sin * step * TAU / (SECTORS * FINE) as f64;
                    }
                }
            }
            // Facets that mirror below the surface end a path; lobes without a density take what is left.
            let smooth: f64 = expected.iter().sum();
            let rest = 1.0 - smooth;
            assert!(rest > -0.01, "{name} {k}: {smooth}");
            expected[RINGS * SECTORS] = rest.max(0.0);
            cells[RINGS * SECTORS] += ended;
            // Cells that expect little are one.
            let (mut counts, mut shares) = (vec![0], vec![0.0]);
            for (count, share) in cells.iter().zip(&expected) {
                if share * f64::from(n) < 12.0 {
                    counts[0] += count;
                    shares[0] += share;
                } else {
                    counts.push(*count);
                    shares.push(*share);
                }
            }
            if shares[0] * f64::from(n) < 12.0 {
                assert!(counts[0] < 60, "{name} {k}: {} where {} are expected", counts[0], shares[0] * f64::from(n));
                if shares.len() > 1 {
                    let (share, count) = (shares.remove(0), counts.remove(0));
                    shares[0] += share;
                    counts[0] += count;
                }
            }
            let total: f64 = shares.iter().sum();
            shares.iter_mut().for_each(|s| *s /= total);
            if shares.len() > 1 {
                assert_drawn_from(&format!("{name} from {k}"), &counts, &shares);
            }
        }
    }
}

/// No more light goes out than came in, in any direction; a path that ends in a denser material carries it compressed. A smooth mirror of a metal that does not
/// absorb, glass and a sheet lose nothing at all.
#[test]
fn no_material_makes_light() {
    for (name, bsdf) in all() {
        let material = Material::from(&bsdf);
        for (k, wi) in directions().into_iter().enumerate() {
            let n = 4000;
            let mut sum = 0.0;
            for i in 0..n {
                let mut s = Sampler::new(23, i, k as u32, 0);
                let (choice, u) = (s.next_1d(), s.next_2d());
                if let Some(sample) = material.sample(wi, UV, choice, u) {
                    sum += f64::from(sample.weight.max_element()) * sample.eta * sample.eta;
                }
            }
            let albedo = sum / f64::from(n);
            assert!(albedo < 1.03, "{name} {k}: {albedo}");
            if matches!(name, "glass" | "sheet" | "null") {
                assert!((albedo - 1.0).abs() < 1e-6, "{name} {k}: {albedo}");
            }
        }
    }
}

/// f(wi, wo) = f(wo, wi), and across a boundary f(wi, wo)·η² of the other side, for radiance.
#[test]
fn materials_are_reciprocal() {
    for (name, bsdf) in all() {
        let material = Material::from(&bsdf);
        for wi in directions() {
            for wo in directions() {
                let f = |a: DVec3, b: DVec3| material.eval(a, b, UV).0 / b.z.abs() as f32;
                let eta = match &bsdf {
                    Bsdf::Dielectric { eta, .. } => *eta as f32,
                    _ => 1.0,
                };
                // What f is multiplied with where wo is behind the normal and wi before it, and the other way.
                let scale = match (wi.z > 0.0, wo.z > 0.0) {
                    (true, false) => eta * eta,
                    (false, true) => 1.0 / (eta * eta),
                    _ => 1.0,
                };
                let (a, b) = (f(wi, wo) * scale, f(wo, wi));
                assert!((a - b).abs().max_element() <= 2e-4 * a.max_element().max(1e-4), "{name} {wi} {wo}: {a} {b}");
            }
        }
    }
}
