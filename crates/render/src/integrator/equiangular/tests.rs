use glam::dvec3;

use vdf_scene::{MediumId, Rgb};

use super::*;
use crate::{Sampler, chi_squared::assert_drawn_from};

const PHASES: [Phase; 4] = [
    Phase::Isotropic,
    Phase::HenyeyGreenstein { g: 0.8 },
    Phase::HenyeyGreenstein { g: 0.999 },
    Phase::HenyeyGreenstein { g: -0.999 },
];

fn stretch(begin: f64, end: f64, tau: f64, phase: Phase) -> Stretch {
    Stretch {
        part: 0,
        medium: MediumId(0),
        ends: [0.0, 1.0],
        begin,
        end,
        depth: 0.0,
        sigma_t: tau / (end - begin),
        albedo: Rgb::ONE,
        phase,
        is_even: true,
    }
}

/// A light so far from the ray, its foot at a distance from the ray's start.
fn light(foot: f64, gap: f64, normal: Option<DVec3>) -> LightPlace {
    LightPlace { position: dvec3(0.0, gap, foot), normal }
}

/// The share of each cell between the borders: the integral of the density, by the midpoint rule in the angle at the light, in which the
/// density is a polygon. So many steps lie in each of its cells that the rule errs by less than 10⁻⁴ of a cell.
fn shares<const NODES: usize>(
    towards: &Equiangular<NODES>,
    stretches: &[Stretch],
    borders: &[(usize, f64)],
) -> Vec<f64> {
    let angle = |s: f64| (s - towards.foot).atan2(towards.gap);
    borders
        .windows(2)
        .map(|w| {
            let [(i, a), (j, b)] = [w[0], w[1]];
            assert_eq!(i, j, "{stretches:?}");
            let (from, to) = (angle(a), angle(b));
            let n = 2000;
            let step = (to - from) / f64::from(n);
            (0..n)
                .map(|k| {
                    let theta = from + (f64::from(k) + 0.5) * step;
                    // dφ = D/r² ds.
                    let s = towards.gap * theta.tan();
                    towards.pdf(i, s + towards.foot) * (towards.gap * towards.gap + s * s) / towards.gap * step
                })
                .sum()
        })
        .collect()
}

/// The density integrates to 1, and samples are drawn with it: χ² over cells of equal angle. Lights beside, before and behind the stretch,
/// from 10⁻⁶ to 10⁶ of its length away; thin and opaque; peaks of the phase function; lights of one side.
#[test]
fn distances_are_drawn_with_their_density() {
    density_is_sampled::<2>();
    density_is_sampled::<3>();
    density_is_sampled::<9>();
}

fn density_is_sampled<const NODES: usize>() {
    const CELLS: usize = 24;
    let mut cases = 0;
    for phase in PHASES {
        for tau in [1e-12, 1.0, 50.0, 1e4] {
            for gap in [1e-6, 0.01, 1.0, 1e6] {
                for foot in [-3.0, 0.0, 0.7, 1.0, 2.5] {
                    for normal in [None, Some(dvec3(0.0, -0.6, 0.8))] {
                        let stretches = [stretch(0.0, 1.0, tau, phase)];
                        let towards =
                            Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light(foot, gap, normal));
                        if towards.is_empty() {
                            continue;
                        }
                        let (first, last) = ((0.0 - foot).atan2(towards.gap), (1.0 - foot).atan2(towards.gap));
                        let border = |i: usize| {
                            let theta = first + (last - first) * i as f64 / CELLS as f64;
                            (0, (foot + towards.gap * theta.tan()).clamp(0.0, 1.0))
                        };
                        let borders: Vec<_> = (0..=CELLS).map(border).collect();
                        // A far light sees the ray under an angle in which tan and atan keep but ten digits.
                        let exact = gap < 1e3 && (last - first) > 1e-3;
                        let shares = shares(&towards, &stretches, &borders);
                        let sum: f64 = shares.iter().sum();
                        let tolerance = if exact { 1e-4 } else { 1e-2 };
                        let case = format!("{phase:?}, τ {tau}, gap {gap}, foot {foot}, {normal:?}");
                        assert!((sum - 1.0).abs() < tolerance, "{case}: ∫p = {sum}");
                        if !exact {
                            continue;
                        }
                        cases += 1;
                        let n = 4000;
                        let mut counts = [0_u64; CELLS];
                        for k in 0..n {
                            let u = Sampler::new(17, k, cases, 0).next_1d();
                            let (i, s) = towards.sample(u).expect("not empty");
                            assert!(i == 0 && (0.0..=1.0).contains(&s), "{case}: {s}");
                            counts[borders.partition_point(|&(_, b)| b <= s).clamp(1, CELLS) - 1] += 1;
                        }
                        let mut cells: Vec<(u64, f64)> = Vec::new();
                        for (&count, share) in counts.iter().zip(&shares) {
                            match cells.last_mut() {
                                Some(last) if last.1 * f64::from(n) < 5.0 => {
                                    last.0 += count;
                                    last.1 += share / sum;
                                }
                                _ => cells.push((count, share / sum)),
                            }
                        }
                        while cells.len() > 1 && cells.last().is_some_and(|c| c.1 * f64::from(n) < 5.0) {
                            let last = cells.pop().expect("more than one");
                            let before = cells.last_mut().expect("another");
                            before.0 += last.0;
                            before.1 += last.1;
                        }
                        if cells.len() > 1 {
                            let (counts, shares): (Vec<_>, Vec<_>) = cells.into_iter().unzip();
                            assert_drawn_from(&case, &counts, &shares);
                        }
                    }
                }
            }
        }
    }
    assert!(cases > 200, "{cases}");
}

/// Several stretches with gaps and without, among them empty ones and one of an ulp: each gets its share, and every sample a density.
#[test]
fn stretches_get_their_shares() {
    let ulp = 2.0_f64.next_up();
    let at = |begin, end, depth, sigma_t| Stretch {
        part: 0,
        medium: MediumId(0),
        ends: [0.0, 1.0],
        begin,
        end,
        depth,
        sigma_t,
        albedo: Rgb::ONE,
        phase: Phase::Isotropic,
        is_even: true,
    };
    let stretches = [
        at(0.0, 0.0, 0.0, 1.0),
        at(0.0, 1.0, 0.0, 1.0),
        at(1.0, 2.0, 1.0, 0.1),
        at(2.0, ulp, 1.1, 5.0),
        at(ulp, ulp, 1.1, 5.0),
        at(3.0, 5.0, 1.1, 0.5),
    ];
    for gap in [1e-12, 1e-3, 0.5, 1e3] {
        for foot in [-1.0, 0.0, 1.5, 2.0, 4.0, 7.0] {
            let towards = Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light(foot, gap, None));
            let areas: Vec<f64> = towards.arcs.iter().map(|arc| arc.area() / towards.total).collect();
            let n = 20_000;
            let mut counts = vec![0_u64; stretches.len()];
            for k in 0..n {
                let u = (f64::from(k) + Sampler::new(3, k, 0, 0).next_1d()) / f64::from(n);
                let (i, s) = towards.sample(u).expect("not empty");
                assert!((stretches[i].begin..=stretches[i].end).contains(&s), "{gap} {foot}: {s} in {i}");
                assert!(towards.pdf(i, s) > 0.0, "{gap} {foot}: {s} in {i}");
                counts[i] += 1;
            }
            for (arc, area) in towards.arcs.iter().zip(areas) {
                // One sample a stratum: a share is met within two of them.
                let error = (counts[arc.stretch] as f64 - area * f64::from(n)).abs();
                assert!(error <= 2.0, "{gap} {foot}: {} of {n} in {}, not {area}", counts[arc.stretch], arc.stretch);
            }
        }
    }
}

/// Nothing to draw: no stretch, no length, a light that shines the other way.
#[test]
fn nothing_is_drawn_where_nothing_is() {
    let light_behind = light(0.5, 1.0, Some(DVec3::Y));
    for (stretches, light) in [
        (vec![], light(0.5, 1.0, None)),
        (vec![stretch(0.0, 1.0, 1.0, Phase::Isotropic)], light_behind),
        (vec![Stretch { end: 0.0, ..stretch(0.0, 1.0, 1.0, Phase::Isotropic) }], light(0.5, 1.0, None)),
    ] {
        let towards = Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light);
        assert!(towards.is_empty(), "{stretches:?}");
    }
}

/// In thin fog with an isotropic phase function the density is that of the angle alone, whatever the distance: so sampled, 1/r² times
/// anything is the integral without any variance. The closed form is the angle over the gap.
#[test]
fn inverse_squares_have_no_variance() {
    for gap in [1e-12, 1e-9, 1e-3, 1.0, 1e3, 1e6] {
        for foot in [-10.0, -1e-3, 0.0, 0.3, 1.0, 5.0] {
            let stretches = [stretch(0.0, 1.0, 1e-12, Phase::Isotropic)];
            let towards = Equiangular::<9>::new(DVec3::ZERO, DVec3::Z, &stretches, &light(foot, gap, None));
            let integral = gap.atan2(gap * gap + foot * (foot - 1.0)) / gap;
            for k in 0..100 {
                let (i, s) = towards.sample(Sampler::new(9, k, 0, 0).next_1d()).expect("not empty");
                let estimate = 1.0 / (gap * gap + (s - foot).powi(2)) / towards.pdf(i, s);
                // The distances of near feet are rounded, and so is the angle that the light is nearest at.
                assert!((estimate / integral - 1.0).abs() < 1e-9, "{gap} {foot} {s}: {estimate} for {integral}");
            }
        }
    }
}
