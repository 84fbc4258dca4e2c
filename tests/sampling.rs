//! What is sampled has the density that is claimed for it, and every density integrates to one.
//!
//! Densities are integrated numerically over cells, samples are counted in the same cells, and χ² compares them. The cosine-weighted hemisphere
//! and the strata of `raymarch` are private and tested next to their code; the random numbers themselves in `random_numbers.rs`.
//! False-alarm rates are those of `common/statistics.rs`.

mod common;

use std::f64::consts::{PI, TAU};

use common::{
    add_fog, add_medium, cuboid, empty_scene, integrate,
    statistics::{ALARM, assert_drawn_from, normal_tails},
};
use glam::{DVec3, Vec3, dvec3, vec3};
use vdf::{
    geometry::{Segment, Triangle},
    render::{FreeFlight, Lights, Media, PhaseFunction as _, PixelFilter, Sampler},
    scene::{Bsdf, Emitter, Phase, ReconstructionFilter, Rgb, Scene, Surface},
};

/// The whole range of mean cosines, with both ends, zero and its surroundings.
const G: [f64; 19] = [
    -0.999_999, -0.99, -0.9, -0.5, -0.1, -1e-3, -1e-6, -1e-12, -1e-300, 0.0, 1e-12, 1e-6, 9e-4, 1e-3, 0.3, 0.8, 0.95,
    0.999, 0.999_999,
];

/// All phase functions, with the mean cosine of each.
fn phases() -> impl Iterator<Item = (Phase, f64)> {
    G.into_iter().map(|g| (Phase::HenyeyGreenstein { g }, g)).chain([(Phase::Isotropic, 0.0)])
}

/// ∫ pdf · f(1 − |cos θ| at the peak) over the directions at distances `w0` to `w1` from the peak, where w = |to − peak| = 2 sin(θ/2):
/// dω = w dw dφ, and nothing cancels at a narrow peak.
fn around_peak(phase: Phase, g: f64, f: &dyn Fn(f64) -> f64, w0: f64, w1: f64) -> f64 {
    let peak = if g < 0.0 { -DVec3::Z } else { DVec3::Z };
    let at = |w: f64| dvec3(w * (1.0 - 0.25 * w * w).max(0.0).sqrt(), 0.0, peak.z * (1.0 - 0.5 * w * w));
    integrate(&|w| TAU * w * phase.pdf_direction(DVec3::Z, at(w)) * f(0.5 * w * w), w0, w1)
}

/// Cells in geometric progression, finer than the peak is wide, to the opposite direction at w = 2.
fn borders(g: f64) -> Vec<f64> {
    const CELLS: i32 = 40;
    let least = 0.1 * (1.0 - g.abs());
    let ratio = (2.0 / least).powf(1.0 / f64::from(CELLS - 1));
    let mut borders: Vec<_> = (0..CELLS).map(|i| least * ratio.powi(i)).collect();
    borders.insert(0, 0.0);
    borders[CELLS as usize] = 2.0;
    borders
}

/// ∫ p dω = 1 and ∫ p cos θ dω = g, to 10⁻⁹ of 1 − |g| where that is small.
#[test]
fn phase_functions_integrate_to_one_with_mean_cosine_g() {
    for (phase, g) in phases() {
        let total =
            |f: &dyn Fn(f64) -> f64| borders(g).windows(2).map(|b| around_peak(phase, g, f, b[0], b[1])).sum::<f64>();
        let (sum, from_peak) = (total(&|_| 1.0), total(&|x| x));
        assert!((sum - 1.0).abs() < 1e-9, "{phase:?}: ∫p = {sum}");
        let expected = 1.0 - g.abs();
        assert!((from_peak - expected).abs() < 1e-9 * expected, "{phase:?}: mean of 1 − cos θ {from_peak}");
    }
}

/// χ² over 40 distances from the peak times 8 azimuths, about several axes.
#[test]
fn phase_functions_are_drawn_with_their_density() {
    let axes = [DVec3::Z, -DVec3::Z, DVec3::X, dvec3(0.3, -0.8, 0.5).normalize()];
    for (k, (phase, g)) in phases().enumerate() {
        let axis = axes[k % axes.len()];
        let peak = if g < 0.0 { -axis } else { axis };
        let across = axis.any_orthogonal_vector().normalize();
        let third = axis.cross(across);
        let borders = borders(g);
        let rings = borders.windows(2).map(|b| around_peak(phase, g, &|_| 1.0, b[0], b[1]));
        let probabilities: Vec<_> = rings.flat_map(|p| [p / 8.0; 8]).collect();
        let mut counts = vec![0; probabilities.len()];
        for i in 0..100_000 {
            let to = phase.sample_direction(axis, Sampler::new(21, i, k as u32, 0).next_2d());
            assert!((to.length() - 1.0).abs() < 1e-15 * 4.0, "{phase:?}: {to}");
            let ring = borders.partition_point(|&b| b <= peak.distance(to)).clamp(1, borders.len() - 1) - 1;
            let azimuth = (to.dot(third).atan2(to.dot(across)) / TAU + 1.0).fract();
            counts[ring * 8 + ((azimuth * 8.0) as usize).min(7)] += 1;
        }
        assert_drawn_from(&format!("{phase:?} about {axis}"), &counts, &probabilities);
    }
}

/// The least and the greatest random numbers: unit directions at the ends of the range.
#[test]
fn the_ends_of_the_unit_interval_are_directions() {
    let last = 1.0 - f64::EPSILON / 2.0;
    let just_below_one = 1.0_f64.next_down();
    let extreme = [just_below_one, -just_below_one, f64::MIN_POSITIVE, -5e-324, -0.0];
    for phase in G.into_iter().chain(extreme).map(|g| Phase::HenyeyGreenstein { g }).chain([Phase::Isotropic]) {
        for u0 in [0.0, 1.0 - last, 1e-9, 0.5, last] {
            for u1 in [0.0, 0.5, last] {
                let to = phase.sample_direction(DVec3::Y, [u0, u1]);
                assert!(to.is_normalized(), "{phase:?} {u0} {u1}: {to}");
                let pdf = phase.pdf_direction(DVec3::Y, to);
                assert!(pdf.is_finite() && pdf > 0.0, "{phase:?} {u0} {u1}: {pdf}");
            }
        }
        // Where the width of the peak is that of a random number's last bit, the ends are not reached.
        if !matches!(phase, Phase::HenyeyGreenstein { g } if g.abs() == just_below_one) {
            // A uniform direction is drawn about z, wherever the path comes from.
            let axis = if phase == Phase::Isotropic { DVec3::Z } else { DVec3::Y };
            let [back, front] = [0.0, last].map(|u0| phase.sample_direction(axis, [u0, 0.3]).dot(axis));
            assert!((back + 1.0).abs() < 1e-6 && (front - 1.0).abs() < 1e-6, "{phase:?}: {back} {front}");
        }
    }
}

/// Slabs of several media along z from 0 to 12, one of them empty, the last two overlapping in a plane.
fn slabs() -> Scene {
    let mut scene = empty_scene(1, 1, 1.0);
    for (z, sigma_t) in [(1.0, 0.4), (3.0, 0.0), (5.0, 2.0), (6.0, 0.05)] {
        let medium = add_medium(&mut scene, sigma_t, 0.5, Phase::Isotropic);
        let depth = if z == 5.0 { 1.0 } else { 2.0 };
        add_fog(&mut scene, vec3(-9.0, -9.0, z), vec3(9.0, 9.0, z + depth), medium);
    }
    scene
}

/// Collisions along a segment through slabs: in each of 48 cells as many as the transmittance falls by; the rest pass.
#[test]
fn free_flights_are_drawn_with_the_transmittance() {
    const CELLS: usize = 48;
    let scene = slabs();
    let media = Media::of_scene(&scene);
    for (k, (p, q)) in [
        (dvec3(0.1, 0.2, 0.0), dvec3(0.3, -0.1, 12.0)),
        (dvec3(0.1, 0.2, 12.0), dvec3(-3.0, 1.0, 0.0)),
        // Far away: the whole medium is a small part of the segment.
        (dvec3(0.1, 0.2, 0.0), dvec3(0.3, -0.1, 1e9)),
    ]
    .into_iter()
    .enumerate()
    {
        let segment = Segment::new(p, q);
        let last = if k == 2 { 12e-9 } else { 1.0 };
        let border = |i: usize| last * i as f64 / CELLS as f64;
        let t = |i: usize| media.transmittance(&Segment::new(p, segment.at(border(i))), &media.regions_at(p));
        let mut probabilities: Vec<_> = (0..CELLS).map(|i| t(i) - t(i + 1)).collect();
        probabilities.push(media.transmittance(&segment, &media.regions_at(segment.p)));
        let mut counts = vec![0; CELLS + 1];
        for i in 0..200_000 {
            let tau = -(-Sampler::new(31, i, k as u32, 0).next_1d()).ln_1p();
            let cell = match media.free_flight(&segment, &media.regions_at(segment.p), tau) {
                FreeFlight::Collision { t, medium, .. } => {
                    assert!(
                        scene.media[medium.0 as usize].sigma_t.grey() > Some(0.0),
                        "a collision in an empty medium"
                    );
                    ((t / last * CELLS as f64) as usize).min(CELLS - 1)
                }
                FreeFlight::Passed(regions) => {
                    assert_eq!(media.medium_in(&regions), None, "outside again");
                    CELLS
                }
            };
            counts[cell] += 1;
        }
        assert_drawn_from(&format!("{p} to {q}"), &counts, &probabilities);
    }
}

/// A flight that is found short is the flight that [`Media::fly`] finds: it ends before a boundary and before the segment.
#[test]
fn short_flights_are_flights() {
    let scene = slabs();
    let media = Media::of_scene(&scene);
    let medium = scene.boundaries[0].interior.expect("fog");
    let mut found = 0;
    for i in 0..20_000 {
        let mut u = Sampler::new(32, i, 0, 0);
        let p = dvec3(u.next_1d(), u.next_1d(), 1.0 + 2.0 * u.next_1d());
        let to = Phase::Isotropic.sample_direction(DVec3::Z, u.next_2d());
        let segment = Segment::new(p, p + to * if i % 4 == 0 { 0.25 } else { 100.0 });
        let tau = -(-u.next_1d()).ln_1p();
        if let Some(flight) = media.short_flight(&segment, medium, tau).collision() {
            found += 1;
            let FreeFlight::Collision { t, medium: there, .. } =
                media.free_flight(&segment, &media.regions_at(segment.p), tau)
            else {
                panic!("{segment:?}: no collision")
            };
            assert_eq!(there, medium);
            assert!(segment.at(t).distance(flight.q) < 1e-13, "{segment:?}: {} and {}", segment.at(t), flight.q);
        }
    }
    assert!(found > 3000, "only {found} short flights");
}

/// Two points, two area emitters (of unequal, partly degenerate triangles that all face +Z) and a sky.
fn lit() -> Scene {
    let mut scene = empty_scene(1, 1, 1.0);
    let t = |a: [f32; 2], b: [f32; 2], c: [f32; 2], z: f32| {
        let [a, b, c] = [a, b, c].map(|[x, y]| vec3(x, y, z));
        Triangle::new(a, b, c)
    };
    let area = |triangles, radiance| Surface {
        triangles,
        bsdf: Bsdf::lambertian(Rgb::ZERO, Rgb::ZERO),
        radiance: Some(Rgb::splat(radiance).into()),
        ..Surface::default()
    };
    scene.surfaces.push(area(
        vec![
            t([0.0, 0.0], [1.0, 0.0], [0.0, 1.0], 0.0),
            t([5.0, 5.0], [5.0, 5.0], [5.0, 5.0], 0.0),
            t([2.0, 0.0], [5.0, 0.5], [2.5, 4.0], 0.0),
            t([0.0, -2.0], [4.0, -2.0], [4.0, -1.99], 0.0),
            t([-3.0, 0.0], [-2.0, 1.0], [-1.0, 2.0], 0.0),
            t([-3.0, 0.0], [-2.5, 0.0], [-2.0, 2.0], 0.0),
        ],
        2.0,
    ));
    scene.surfaces.push(area(vec![t([9.0, 9.0], [10.0, 9.0], [9.0, 9.5], 1.0)], 3.0));
    scene.emitters = vec![
        Emitter::Point { position: dvec3(1.0, 2.0, 3.0), intensity: Rgb::splat(5.0) },
        Emitter::Area { surface: 0 },
        Emitter::Constant { radiance: Rgb::splat(0.5) },
        Emitter::Area { surface: 1 },
        Emitter::Point { position: dvec3(-1.0, 2.0, 30.0), intensity: Rgb::ONE },
    ];
    scene
}

const FROM: DVec3 = dvec3(0.5, 0.25, 2.0);
const REACH: f64 = 1e3;

fn light_samples(n: u32, salt: u32) -> impl Iterator<Item = vdf::render::LightSample> {
    let lights = Lights::new(&lit(), REACH);
    (0..n).map(move |i| {
        let mut u = Sampler::new(41, i, salt, 0);
        lights.sample(FROM, u.next_1d(), u.next_2d()).expect("all emitters face that point")
    })
}

/// Each emitter is as likely as the others, and the constant one draws all directions alike.
#[test]
fn emitters_and_the_sky_are_drawn_evenly() {
    let lights = Lights::new(&lit(), REACH);
    assert!(
        (lights.pdf_background(DVec3::X, 5.0) * 4.0 * PI * 5.0 - 1.0).abs() < 1e-15,
        "the density integrates to 1/5"
    );
    let mut emitters = [0; 5];
    let mut sky = [0; 128];
    for s in light_samples(300_000, 0) {
        emitters[s.emitter] += 1;
        assert!(s.direction.is_normalized());
        match s.emitter {
            2 => {
                assert!(s.pdf == lights.pdf_background(s.direction, 5.0) && !s.on_surface);
                assert!((s.point - FROM - s.direction * REACH).length() < 1e-9 * REACH);
                assert!((f64::from(s.weight.x) * s.pdf / 0.5 - 1.0).abs() < 1e-6);
                let azimuth = (s.direction.x.atan2(s.direction.z) / TAU + 1.0).fract();
                let cell =
                    ((0.5 + 0.5 * s.direction.y) * 16.0).min(15.0) as usize * 8 + ((azimuth * 8.0) as usize).min(7);
                sky[cell] += 1;
            }
            0 | 4 => {
                let (position, intensity) =
                    if s.emitter == 0 { (dvec3(1.0, 2.0, 3.0), 5.0) } else { (dvec3(-1.0, 2.0, 30.0), 1.0) };
                assert!(s.pdf == 0.0 && s.point == position && !s.on_surface);
                let expected = 5.0 * intensity / position.distance_squared(FROM);
                assert!((f64::from(s.weight.x) / expected - 1.0).abs() < 1e-6);
            }
            _ => assert!(s.on_surface && s.pdf > 0.0),
        }
    }
    assert_drawn_from("emitters", &emitters, &[0.2; 5]);
    assert_drawn_from("sky", &sky, &[1.0 / 128.0; 128]);
}

/// In which of the 16 congruent parts of a triangle a point lies, if in any.
fn part(triangle: &Triangle, p: DVec3) -> Option<usize> {
    let [a, b, c] = triangle.vertices_f64();
    let normal = triangle.area_normal();
    let area = normal.length_squared();
    if area == 0.0 {
        return None;
    }
    let weight_c = (b - a).cross(p - a).dot(normal) / area;
    let weight_b = (p - a).cross(c - a).dot(normal) / area;
    if weight_b < 0.0 || weight_c < 0.0 || weight_b + weight_c > 1.0 {
        return None;
    }
    let (x, y) = (4.0 * weight_b, 4.0 * weight_c);
    let upper = usize::from(x.fract() + y.fract() > 1.0);
    // In row y there are 7 − 2y parts.
    let row = (y as usize).min(3);
    Some((row * (8 - row) + 2 * (x as usize) + upper).min(15))
}

/// Points on an area emitter: each triangle as its area, each of its 16 congruent parts alike, degenerate ones never.
#[test]
fn points_of_area_emitters_are_uniform() {
    let scene = lit();
    let triangles = &scene.surfaces[0].triangles;
    let areas: Vec<_> = triangles.iter().map(|t| 0.5 * t.area_normal().length()).collect();
    let total: f64 = areas.iter().sum();
    let probabilities: Vec<_> = areas.iter().flat_map(|a| [a / total / 16.0; 16]).collect();
    let mut counts = vec![0; probabilities.len()];
    for s in light_samples(600_000, 1).filter(|s| s.emitter == 1) {
        // The triangles lie in a plane and do not overlap, so a point on a border is in one or the other by rounding.
        let found = triangles.iter().enumerate().find_map(|(i, t)| part(t, s.point).map(|k| i * 16 + k));
        counts[found.expect("on the emitter")] += 1;
    }
    assert_drawn_from("area emitter", &counts, &probabilities);
}

/// The solid angle of a triangle [Oosterom1983].
fn solid_angle(triangle: &Triangle, from: DVec3) -> f64 {
    let [a, b, c] = triangle.vertices_f64().map(|v| (v - from).normalize());
    2.0 * a.dot(b.cross(c)).abs().atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a))
}

/// The mean of 1/pdf is the solid angle that an emitter fills, and `pdf_area`, which weighs rays that meet it, is the same density.
#[test]
fn area_emitters_fill_their_solid_angle() {
    let scene = lit();
    let lights = Lights::new(&scene, REACH);
    for (emitter, surface, radiance) in [(1, 0, 2.0), (3, 1, 3.0)] {
        let triangles = &scene.surfaces[surface].triangles;
        let expected: f64 =
            triangles.iter().filter(|t| t.area_normal() != DVec3::ZERO).map(|t| solid_angle(t, FROM)).sum();
        let (mut n, mut sum, mut sum2) = (0.0, 0.0, 0.0);
        for s in light_samples(300_000, 2).filter(|s| s.emitter == emitter) {
            let distance = s.point.distance(FROM);
            let pdf = lights.pdf_area(emitter, distance, -s.direction.z, 5.0);
            // The sampled point is lifted by 2⁻³² of its triangle's largest coordinate, here at most 4; the distance is at least 1 and squared.
            assert!((pdf / s.pdf - 1.0).abs() < 8.0 / 4_294_967_296.0, "{pdf} {}", s.pdf);
            assert!((f64::from(s.weight.x) * s.pdf / radiance - 1.0).abs() < 1e-6);
            // The choice among five emitters is part of the density.
            let filled = 1.0 / (5.0 * s.pdf);
            n += 1.0;
            sum += filled;
            sum2 += filled * filled;
        }
        let mean = sum / n;
        let error = ((sum2 / n - mean * mean) / n).sqrt();
        let p = normal_tails((mean - expected) / error);
        assert!(p > ALARM, "emitter {emitter}: {mean} ± {error}, expected {expected}, p = {p}");
    }
}

/// Film positions: the box is uniform, the gaussian has the density of its definition, and x and y are independent.
#[test]
fn filters_are_drawn_with_their_density() {
    const CELLS: usize = 16;
    for filter in [
        ReconstructionFilter::Box,
        ReconstructionFilter::Gaussian { stddev: 0.5 },
        ReconstructionFilter::Gaussian { stddev: 3.0 },
        ReconstructionFilter::Tent { radius: 1.5 },
    ] {
        let (low, high, density): (f64, f64, Box<dyn Fn(f64) -> f64>) = match filter {
            ReconstructionFilter::Box => (0.0, 1.0, Box::new(|_| 1.0)),
            ReconstructionFilter::Gaussian { stddev } => {
                let f =
                    move |x: f64| ((-(x - 0.5).powi(2) / (2.0 * stddev * stddev)).exp() - (-8.0_f64).exp()).max(0.0);
                (0.5 - 4.0 * stddev, 0.5 + 4.0 * stddev, Box::new(f))
            }
            ReconstructionFilter::Tent { radius } => {
                let f = move |x: f64| (1.0 - (x - 0.5).abs() / radius).max(0.0);
                (0.5 - radius, 0.5 + radius, Box::new(f))
            }
            _ => unreachable!("their weights have a test of their own"),
        };
        let prepared = PixelFilter::new(&filter);
        let width = (high - low) / CELLS as f64;
        let cells: Vec<_> =
            (0..CELLS).map(|i| integrate(&density, low + width * i as f64, low + width * (i + 1) as f64)).collect();
        let total: f64 = cells.iter().sum();
        let probabilities: Vec<_> =
            cells.iter().flat_map(|y| cells.iter().map(move |x| x * y / total / total)).collect();
        let mut counts = vec![0; probabilities.len()];
        for i in 0..200_000 {
            let [x, y] = prepared.sample(&mut Sampler::new(51, i, 0, 0)).offset.map(|x| (x - low) / width);
            assert!((0.0..=CELLS as f64).contains(&x) && (0.0..=CELLS as f64).contains(&y), "{filter:?}: outside");
            counts[(y as usize).min(CELLS - 1) * CELLS + (x as usize).min(CELLS - 1)] += 1;
        }
        assert_drawn_from(&format!("{filter:?}"), &counts, &probabilities);
        // By one coordinate, with more samples: what the tails lack is seen only so.
        let mut counts = vec![0; CELLS];
        for i in 0..1_000_000 {
            for x in prepared.sample(&mut Sampler::new(52, i, 0, 0)).offset {
                counts[(((x - low) / width) as usize).min(CELLS - 1)] += 1;
            }
        }
        let probabilities: Vec<_> = cells.iter().map(|x| x / total).collect();
        assert_drawn_from(&format!("{filter:?}, one coordinate"), &counts, &probabilities);
    }
}

/// The parts of a triangle are numbered without a gap: their centres have all numbers.
#[test]
fn sixteen_parts() {
    let t = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
    let mut seen = [0; 16];
    for i in 0..64 {
        for j in 0..64 - i {
            let p = dvec3((f64::from(i) + 0.3) / 64.0, (f64::from(j) + 0.3) / 64.0, 0.0);
            seen[part(&t, p).expect("inside")] += 1;
        }
    }
    assert!(seen.iter().all(|&n| n >= 120), "{seen:?}");
    assert_eq!(cuboid(Vec3::ZERO, Vec3::ONE).iter().filter_map(|t| part(t, dvec3(2.0, 2.0, 2.0))).count(), 0);
}
