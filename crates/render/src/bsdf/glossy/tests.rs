use vdf_scene::{Microfacets, Roughness};

use super::*;
use crate::{Sampler, chi_squared::assert_drawn_from};

fn rough(alpha: f64, distribution: Microfacets) -> Option<Roughness> {
    Some(Roughness { alpha, distribution })
}

fn metal(roughness: Option<Roughness>) -> Glossy {
    let (eta, k) = (Rgb::new(0.2, 0.9, 0.0), Rgb::new(3.9, 2.5, 1.0));
    let metal = Conductor { eta, k, specular_reflectance: Rgb::ONE, roughness, two_sided: false };
    Glossy::new(&Bsdf::Conductor(metal)).unwrap()
}

fn glass(roughness: Option<Roughness>) -> Glossy {
    let white = Rgb::ONE;
    let glass = Dielectric { eta: 1.5, specular_reflectance: white, specular_transmittance: white, roughness };
    Glossy::new(&Bsdf::Dielectric(glass)).unwrap()
}

fn coat(ground: f32, nonlinear: bool) -> Glossy {
    Glossy::new(&Bsdf::Plastic(Plastic {
        eta: 1.49,
        diffuse_reflectance: Rgb::splat(ground),
        specular_reflectance: Rgb::ONE,
        nonlinear,
        two_sided: false,
    }))
    .unwrap()
}

fn side(cos: f64, is_front: bool) -> Side {
    let normal = DVec3::new(0.3, -0.8, 0.5).normalize();
    let (s, t) = normal.any_orthonormal_pair();
    let sin = (1.0 - cos * cos).sqrt();
    Side { normal, wo: s * (0.6 * sin) + t * (0.8 * sin) + normal * cos, is_front }
}

fn rough_kinds() -> Vec<(String, Glossy)> {
    let mut kinds = vec![("coat".to_owned(), coat(0.7, false))];
    for distribution in [Microfacets::Beckmann, Microfacets::Ggx] {
        for alpha in [0.15, 0.6] {
            let roughness = rough(alpha, distribution);
            kinds.push((format!("metal {distribution:?} {alpha}"), metal(roughness)));
            kinds.push((format!("glass {distribution:?} {alpha}"), glass(roughness)));
        }
    }
    kinds
}

/// BSDFs are reciprocal: f(o, i) = f(i, o), and through an interface f(o, i)/η² is, with the index on the side where light arrives.
#[test]
fn they_are_reciprocal() {
    for (name, glossy) in rough_kinds() {
        let mut compared = 0;
        for i in 0..4000 {
            let mut sampler = Sampler::new(1, i, 0, 0);
            let (a, u) = (sampler.next_1d(), sampler.next_2d());
            let there = side(0.02 + 0.98 * a, i % 2 == 0);
            let to = crate::frame::sample_uniform_sphere(u);
            let cos = to.dot(there.normal);
            let front = if cos > 0.0 { there.is_front } else { !there.is_front };
            let normal = if cos > 0.0 { there.normal } else { -there.normal };
            let back = Side { normal, wo: to, is_front: front };
            let f = glossy.eval(&there, to).0.as_dvec3() / cos.abs();
            let g = glossy.eval(&back, there.wo).0.as_dvec3() / there.wo.dot(there.normal);
            // Into glass from the front: radiance is compressed there, and spread on the way back.
            let eta2 = if cos > 0.0 {
                1.0
            } else if there.is_front {
                2.25
            } else {
                1.0 / 2.25
            };
            assert!((f * eta2 - g).abs().max_element() <= 1e-5 * (1.0 + g.max_element()), "{name}: {f} {g} {cos}");
            compared += usize::from(g.max_element() > 1e-6);
        }
        assert!(compared > 100, "{name}: {compared}");
    }
}

/// χ² over 16 × 8 cells of cosine and azimuth, and one for what is lost, against the density that `eval` gives, integrated over each cell;
/// and weights are value over density.
#[test]
fn directions_are_drawn_with_their_density() {
    const N: usize = 24;
    for (name, glossy) in rough_kinds() {
        for (cos, is_front) in [(0.9, true), (0.4, true), (0.7, false)] {
            if !is_front && !matches!(glossy, Glossy::Glass { .. }) {
                continue;
            }
            let side = side(cos, is_front);
            let (s, t) = side.normal.any_orthonormal_pair();
            let direction = |cos: f64, phi: f64| {
                let sin = (1.0 - cos * cos).max(0.0).sqrt();
                s * (sin * phi.cos()) + t * (sin * phi.sin()) + side.normal * cos
            };
            let mut expected = vec![0.0; 129];
            let fine = 16 * N;
            for i in 0..fine {
                let cos = 2.0 * (i as f64 + 0.5) / fine as f64 - 1.0;
                for j in 0..8 * N {
                    let phi = 2.0 * PI * (j as f64 + 0.5) / (8 * N) as f64;
                    let solid = 2.0 / fine as f64 * 2.0 * PI / (8 * N) as f64;
                    expected[i / N * 8 + j / N] += glossy.eval(&side, direction(cos, phi)).1 * solid;
                }
            }
            const SAMPLES: u64 = 30_000;
            let mut cells = vec![0_u64; 129];
            for i in 0..SAMPLES as u32 {
                let mut sampler = Sampler::new(2, i, 0, 0);
                let (choice, u) = (sampler.next_1d(), sampler.next_2d());
                let Some(drawn) = glossy.sample(&side, choice, u).filter(|d| d.pdf.is_some()) else {
                    cells[128] += 1;
                    continue;
                };
                let (value, pdf) = glossy.eval(&side, drawn.to);
                assert_eq!(drawn.pdf, Some(pdf));
                assert!((drawn.weight * to_f32(pdf) - value).abs().max_element() <= 1e-5 * value.max_element());
                let cos = drawn.to.dot(side.normal);
                let phi = (drawn.to.dot(t).atan2(drawn.to.dot(s)) / (2.0 * PI) + 1.0).fract();
                cells[((0.5 * (cos + 1.0) * 16.0) as usize).min(15) * 8 + ((phi * 8.0) as usize).min(7)] += 1;
            }
            expected[128] = 1.0 - expected.iter().sum::<f64>();
            // The midpoint rule is good to a thousandth; what is lost is known only as the rest.
            assert!(expected[128] > -3e-3, "{name}: {}", expected[128]);
            let most = (0..128).max_by(|&a, &b| expected[a].total_cmp(&expected[b])).unwrap();
            for i in (0..129).filter(|&i| i != most) {
                if expected[i] * (SAMPLES as f64) < 100.0 {
                    expected[most] += std::mem::take(&mut expected[i]);
                    cells[most] += std::mem::take(&mut cells[i]);
                }
            }
            let kept: Vec<_> = (0..129).filter(|&i| expected[i] > 0.0).collect();
            let counts: Vec<_> = kept.iter().map(|&i| cells[i]).collect();
            let expected: Vec<_> = kept.iter().map(|&i| expected[i]).collect();
            assert_drawn_from(&format!("{name} {cos} {is_front}"), &counts, &expected);
        }
    }
}

/// The mean of weight times η², which undoes the compression of radiance, is what is not absorbed: 1 for glass, for a mirror and for a coat over
/// white (the reflections inside make up for what does not come out), and nearly so where facets are smooth. Standard errors are below
/// 0.004; 0.02 are five of them.
#[test]
fn what_is_white_absorbs_nothing() {
    let ggx = rough(0.05, Microfacets::Ggx).unwrap();
    let kinds = [
        ("glass", glass(None)),
        ("mirror", metal(None)),
        ("coat", coat(1.0, false)),
        ("coat, nonlinear", coat(1.0, true)),
        ("rough glass", glass(Some(ggx))),
        ("rough mirror", metal(Some(ggx))),
    ];
    for (name, glossy) in kinds {
        for (cos, is_front) in [(1.0, true), (0.5, true), (0.3, false)] {
            let opaque = matches!(glossy, Glossy::Metal { .. } | Glossy::Coat { .. });
            let side = side(cos, is_front);
            let mut sum = 0.0;
            for i in 0..20_000 {
                let mut sampler = Sampler::new(4, i, 0, 0);
                let (choice, u) = (sampler.next_1d(), sampler.next_2d());
                if let Some(s) = glossy.sample(&side, choice, u) {
                    // The blue channel of the metal is the perfect mirror.
                    sum += f64::from(s.weight.z) * s.eta * s.eta;
                }
            }
            let expected = if opaque && !is_front { 0.0 } else { 1.0 };
            assert!((sum / 20_000.0 - expected).abs() < 0.02, "{name} {cos} {is_front}: {}", sum / 20_000.0);
        }
    }
}

/// Light is bent by the law of Snellius.
#[test]
fn glass_bends() {
    let side = side(0.6, true);
    let bent = glass(None).sample(&side, 0.999, [0.5, 0.5]).unwrap();
    let sin = bent.to.cross(side.normal).length();
    assert!((sin * 1.5 - 0.8).abs() < 1e-12 && bent.to.dot(side.normal) < 0.0 && bent.eta == 1.5);
    // In the plane of the normal and the way in.
    assert!(bent.to.dot(side.normal.cross(side.wo)).abs() < 1e-12);
}

/// At grazing angles, along the normal and with equal bodies nothing is NaN or negative.
#[test]
fn hard_directions_give_numbers() {
    let equal = Dielectric {
        eta: 1.0,
        specular_reflectance: Rgb::ONE,
        specular_transmittance: Rgb::ONE,
        roughness: rough(0.1, Microfacets::Beckmann),
    };
    let mut kinds = rough_kinds();
    kinds.push(("equal bodies".to_owned(), Glossy::new(&Bsdf::Dielectric(equal)).unwrap()));
    kinds.push(("very smooth".to_owned(), metal(rough(1e-4, Microfacets::Ggx))));
    kinds.push(("very rough".to_owned(), glass(rough(10.0, Microfacets::Ggx))));
    for (name, glossy) in kinds {
        for cos in [1.0, 1e-3, 1e-9, 1e-300, 0.0] {
            for is_front in [true, false] {
                let side = side(cos, is_front);
                for (choice, u) in [(0.0, [0.0, 0.0]), (0.999, [0.999, 0.5]), (0.5, [0.5, 0.0])] {
                    let Some(s) = glossy.sample(&side, choice, u) else { continue };
                    assert!(s.weight.is_finite() && s.weight.min_element() >= 0.0, "{name} {cos}: {s:?}");
                    assert!((s.to.length() - 1.0).abs() < 1e-9 && s.pdf.is_none_or(|p| p > 0.0), "{name} {cos}: {s:?}");
                    let (value, pdf) = glossy.eval(&side, s.to);
                    assert!(value.is_finite() && value.min_element() >= 0.0 && pdf >= 0.0, "{name}: {value} {pdf}");
                }
            }
        }
    }
}
