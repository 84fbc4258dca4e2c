//! Every material: its samples follow its density, its values are reciprocal, and it makes no light.

use std::{f64::consts::TAU, sync::Arc};

use glam::{DVec3, dvec3, vec2};
use vdf_scene::{
    Bsdf, Microfacets, Perturbation, Pixels, Principled, PrincipledThin, Rgb, Roughness, Texture, TextureFilter,
    TexturePoint, UvTransform, Wrap,
};

use super::{
    material::{Lobe, Material, MaterialPoint},
    prepared::Prepared,
};
use crate::{Sampler, chi_squared::assert_drawn_from};

/// Where u and v neither grow as fast nor at right angles, on a slope under the shading normal.
fn point() -> MaterialPoint {
    MaterialPoint {
        texture: TexturePoint { uv: vec2(0.3, 0.6), triangle: 1, barycentric: [0.2, 0.3] },
        tangents: [dvec3(0.9, 0.2, 0.1), dvec3(-0.3, 1.4, -0.2)],
        normal: dvec3(-0.1, 0.1, 1.0).normalize(),
    }
}

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

fn perturbed(by: Perturbation, of: Bsdf) -> Bsdf {
    Bsdf::Perturbed { by, flip_invalid_normals: true, shadowing: true, of: Box::new(of) }
}

/// Normals that lean by 23°.
fn leaning() -> Perturbation {
    Perturbation::Normals(Texture::Constant(Rgb::new(0.65, 0.38, 0.96)))
}

/// Four pixels that rise along u and v: at [`point`] the normal leans by 25°.
fn rising(scale: f64) -> Perturbation {
    let rgb = [0.0, 0.4, 0.1, 0.7].map(Rgb::splat).to_vec();
    let image = Arc::new(Pixels { width: 2, height: 2, rgb });
    let (filter, wrap, to_uv) = (TextureFilter::Bilinear, Wrap::Clamp, UvTransform::default());
    Perturbation::Heights { texture: Texture::Bitmap { image, filter, wrap, to_uv }, scale }
}

/// Mitsuba's defaults, changed.
fn principled(change: impl Fn(&mut Principled)) -> Bsdf {
    let none = || Texture::grey(0.0);
    let mut p = Principled {
        base_color: Texture::Constant(Rgb::new(0.8, 0.5, 0.2)),
        roughness: Texture::grey(0.5),
        anisotropic: none(),
        metallic: none(),
        spec_trans: none(),
        eta: 1.5,
        spec_tint: none(),
        sheen: none(),
        sheen_tint: none(),
        flatness: none(),
        clearcoat: none(),
        clearcoat_gloss: none(),
        sampling_rates: [1.0; 3],
    };
    change(&mut p);
    Bsdf::Principled(Box::new(p))
}

fn thin(change: impl Fn(&mut PrincipledThin)) -> Bsdf {
    let none = || Texture::grey(0.0);
    let mut p = PrincipledThin {
        base_color: Texture::Constant(Rgb::new(0.8, 0.5, 0.2)),
        roughness: Texture::grey(0.5),
        anisotropic: none(),
        spec_trans: none(),
        eta: Texture::grey(1.5),
        spec_tint: none(),
        sheen: none(),
        sheen_tint: none(),
        flatness: none(),
        diff_trans: none(),
        sampling_rates: [1.0; 4],
    };
    change(&mut p);
    Bsdf::PrincipledThin(Box::new(p))
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
        (
            "polarized plastic",
            Bsdf::PolarizedPlastic {
                eta: 1.49,
                diffuse: Texture::Constant(Rgb::new(0.9, 0.5, 0.1)),
                specular: WHITE,
                roughness: Roughness { distribution: ggx, alpha_u: Texture::grey(0.15), alpha_v: Texture::grey(0.5) },
            },
        ),
        ("polarizer", Bsdf::Filter { transmittance: Texture::grey(0.9), share: 0.5 }),
        ("two-sided", Bsdf::TwoSided(Box::new([plastic(rough(ggx, 0.3, 0.3), false), white.clone()]))),
        (
            "blend",
            Bsdf::Blend { weight: Texture::grey(0.3), of: Box::new([white.clone(), metal(rough(ggx, 0.3, 0.3))]) },
        ),
        ("mask", Bsdf::Mask { opacity: Texture::grey(0.6), of: Box::new(white.clone()) }),
        ("principled", principled(|_| {})),
        ("principled metal", principled(|p| (p.metallic, p.anisotropic) = (Texture::grey(0.7), Texture::grey(0.8)))),
        (
            "principled cloth",
            principled(|p| {
                p.base_color = Texture::Constant(Rgb::new(0.3, 0.1, 0.2));
                (p.sheen, p.sheen_tint, p.flatness) = (Texture::grey(0.6), Texture::grey(0.5), Texture::grey(0.4));
            }),
        ),
        (
            "principled coat",
            principled(|p| {
                (p.clearcoat, p.clearcoat_gloss, p.spec_tint) =
                    (Texture::grey(0.9), Texture::grey(0.1), Texture::grey(0.5));
                p.sampling_rates = [0.7, 1.0, 2.0];
            }),
        ),
        ("principled glass", principled(|p| (p.spec_trans, p.metallic) = (Texture::grey(0.8), Texture::grey(0.1)))),
        ("thin", thin(|p| (p.sheen, p.flatness) = (Texture::grey(0.2), Texture::grey(0.5)))),
        ("thin leaf", thin(|p| (p.diff_trans, p.spec_trans) = (Texture::grey(1.2), Texture::grey(0.2)))),
        (
            "thin pane",
            thin(|p| {
                (p.spec_trans, p.spec_tint, p.anisotropic) =
                    (Texture::grey(0.9), Texture::grey(0.4), Texture::grey(0.6));
                p.sampling_rates = [1.0, 0.5, 1.0, 2.0];
            }),
        ),
        ("normal map", perturbed(leaning(), metal(rough(ggx, 0.15, 0.5)))),
        ("normal map on glass", perturbed(leaning(), glass(1.5, rough(beckmann, 0.35, 0.35)))),
        ("bumps", perturbed(rising(0.8), white.clone())),
        (
            "bumps that are masked",
            perturbed(rising(0.8), Bsdf::Mask { opacity: Texture::grey(0.6), of: Box::new(white) }),
        ),
        ("bumps under bumps", perturbed(leaning(), perturbed(rising(-0.5), plastic(rough(ggx, 0.3, 0.3), true)))),
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
        let material = Material::new(&bsdf, &mut Prepared::default());
        for (k, wi) in directions().into_iter().enumerate() {
            let n = 12_000;
            let mut cells = vec![0_u64; RINGS * SECTORS + 1];
            let mut ended = 0;
            for i in 0..n {
                let mut s = Sampler::new(17, i, k as u32, 0);
                let (choice, u) = (s.next_1d(), s.next_2d());
                let Some(sample) = material.sample(wi, &point(), choice, u) else {
                    ended += 1;
                    continue;
                };
                assert!((sample.wo.length() - 1.0).abs() < 1e-6, "{name}");
                if sample.lobe != Lobe::Smooth {
                    cells[RINGS * SECTORS] += 1;
                    continue;
                }
                let (value, pdf) = material.eval(wi, sample.wo, &point());
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
                        let pdf = material.eval(wi, dvec3(sin * c, sin * s, cos), &point()).1;
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
        let material = Material::new(&bsdf, &mut Prepared::default());
        for (k, wi) in directions().into_iter().enumerate() {
            let n = 4000;
            let mut sum = 0.0;
            for i in 0..n {
                let mut s = Sampler::new(23, i, k as u32, 0);
                let (choice, u) = (s.next_1d(), s.next_2d());
                if let Some(sample) = material.sample(wi, &point(), choice, u) {
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

/// f(wi, wo) = f(wo, wi), and across a boundary f(wi, wo)·η² of the other side, for radiance. Turned normals are not reciprocal: a test of their own
/// compares them with what is turned.
#[test]
fn materials_are_reciprocal() {
    for (name, bsdf) in all().into_iter().filter(|(_, bsdf)| !matches!(bsdf, Bsdf::Perturbed { .. })) {
        let material = Material::new(&bsdf, &mut Prepared::default());
        for wi in directions() {
            for wo in directions() {
                // Which facets a thin sheet lets light through at depends on the side that it comes from, as in Mitsuba.
                if matches!(bsdf, Bsdf::PrincipledThin(_)) && wi.z * wo.z < 0.0 {
                    continue;
                }
                let f = |a: DVec3, b: DVec3| material.eval(a, b, &point()).0 / b.z.abs() as f32;
                let eta = match &bsdf {
                    Bsdf::Dielectric { eta, .. } => *eta as f32,
                    Bsdf::Principled(p) => p.eta as f32,
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

/// In the frame of the turned normal it is the nested material, dimmed by what \[Estevez2019\] says; nothing is where the two normals see different sides, and a
/// normal that is not seen is mirrored. Frames are those that Mitsuba 3.9.1 gives for the same numbers.
#[test]
fn a_turned_material_is_the_nested_one() {
    let n = dvec3(0.3, -0.24, 0.92).normalize();
    let (s, at) = ((DVec3::X - n * n.x).normalize(), point());
    let t = n.cross(s);
    let inner = |w: DVec3| dvec3(s.dot(w), t.dot(w), n.dot(w));
    let nested = metal(rough(Microfacets::Ggx, 0.15, 0.5));
    let plain = Material::new(&nested, &mut Prepared::default());
    let by = |flip_invalid_normals, shadowing| {
        let of = Box::new(nested.clone());
        Material::new(&Bsdf::Perturbed { by: leaning(), flip_invalid_normals, shadowing, of }, &mut Prepared::default())
    };
    let mut compared = 0;
    for wi in directions() {
        for wo in directions() {
            let (value, pdf) = by(false, false).eval(wi, wo, &at);
            let expected = plain.eval(inner(wi), inner(wo), &at);
            if inner(wo).z * wo.z > 0.0 {
                assert!((value - expected.0).abs().max_element() <= 1e-5 * expected.0.max_element(), "{wi} {wo}");
                assert!((pdf - expected.1).abs() <= 1e-6 * pdf, "{wi} {wo}");
                compared += usize::from(pdf > 0.0);
                let tan2 = |w: DVec3| (1.0 - w.z * w.z) / (w.z * w.z);
                let dimmed = 2.0 / (1.0 + (1.0 + tan2(n) / 8.0 * tan2(wo)).sqrt());
                let shadowed = by(false, true).eval(wi, wo, &at).0;
                assert!((shadowed - value * dimmed as f32).abs().max_element() <= 1e-5 * value.max_element());
            } else {
                assert_eq!((value, pdf), (Rgb::ZERO, 0.0), "{wi} {wo}");
            }
        }
    }
    assert!(compared > 4, "{compared}");
    // Seen from where the normal leans away from.
    let wi = dvec3(-0.93, 0.3, 0.2).normalize();
    let wo = dvec3(-0.5, 0.2, 0.8).normalize();
    assert!(wi.dot(n) < 0.0 && by(false, false).eval(wi, wo, &at).1 == 0.0);
    assert!(by(true, false).eval(wi, wo, &at).1 > 0.0);
}

/// The normal of bumps is that of the surface that they make: p(u, v) + h(u, v) n.
#[test]
fn bumps_lean_as_the_surface_that_they_make() {
    let at = point();
    let scale = 0.25;
    // Between the four middles the heights are bilinear.
    let height = |u: f64, v: f64| {
        let (x, y) = (2.0 * u - 0.5, 2.0 * v - 0.5);
        scale * ((1.0 - y) * 0.4 * x + y * (0.1 * (1.0 - x) + 0.7 * x))
    };
    let (u, v, h) = (0.3, 0.6, 1e-4);
    let [du, dv] = at.tangents;
    // The shading normal is z; what of the tangents is along it counts for nothing.
    let place = |a: f64, b: f64| {
        let p = du * a + dv * b;
        dvec3(p.x, p.y, height(u + a, v + b))
    };
    let normal = (place(h, 0.0) - place(-h, 0.0)).cross(place(0.0, h) - place(0.0, -h)).normalize();
    let normal = if normal.z < 0.0 { -normal } else { normal };
    // A mirror shows it.
    let mirror = Material::new(&perturbed(rising(scale), metal(None)), &mut Prepared::default());
    let wi = dvec3(0.2, -0.1, 1.0).normalize();
    let sample = mirror.sample(wi, &at, 0.5, [0.5; 2]).expect("it is seen");
    let half = (wi + sample.wo).normalize();
    assert!(normal.z < 0.97 && half.distance(normal) < 1e-6, "{half} {normal}");
}
