//! Directions: an orthonormal frame about a direction, and uniform and cosine-weighted sampling.
//!
//! Cosine and sine of the polar angle are both computed from the random number. √(1 − cos²θ) would lose half the digits
//! of a small angle.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::DVec3;

/// The sine and the cosine of 2πu, u in [0, 1].
///
/// By Taylor polynomials on an eighth of a turn to either side of a quarter, where what they leave out is below 2⁻⁵⁴; with rounding the error is below 2⁻⁵².
/// A third of the time that a library takes, which has to reduce any angle, and the same bits on all machines.
#[inline]
#[allow(clippy::cast_possible_truncation, reason = "0 to 4")]
pub(crate) fn sin_cos_of_turn(u: f64) -> (f64, f64) {
    /// 1/3!, 1/5!, … with their signs; and 1/2!, 1/4!, …
    const SIN: [f64; 7] = [
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
        1.0 / 6_227_020_800.0,
        -1.0 / 1_307_674_368_000.0,
    ];
    const COS: [f64; 8] = [
        -0.5,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
        -1.0 / 87_178_291_200.0,
        1.0 / 20_922_789_888_000.0,
    ];
    let quarters = 4.0 * u;
    let nearest = (quarters + 0.5) as i32;
    // The difference is exact.
    let x = (quarters - f64::from(nearest)) * FRAC_PI_2;
    let xx = x * x;
    let series = |c: &[f64]| c.iter().rev().fold(0.0, |sum, c| sum * xx + c);
    let (sin, cos) = (x + x * (xx * series(&SIN)), 1.0 + xx * series(&COS));
    let (sin, cos) = if nearest & 1 == 0 { (sin, cos) } else { (cos, -sin) };
    if nearest & 2 == 0 { (sin, cos) } else { (-sin, -cos) }
}

/// The unit direction at the polar angle with these cosine and sine to the unit vector `axis`, with azimuth 2π`turn`.
#[inline]
pub(crate) fn direction_about(axis: DVec3, cos_theta: f64, sin_theta: f64, turn: f64) -> DVec3 {
    let (s, t) = axis.any_orthonormal_pair();
    let (sin_phi, cos_phi) = sin_cos_of_turn(turn);
    (s * (sin_theta * cos_phi) + t * (sin_theta * sin_phi) + axis * cos_theta).normalize()
}

/// A direction of the hemisphere about `normal` with density cos θ/π, and that density.
#[inline]
pub(crate) fn sample_cosine_hemisphere(normal: DVec3, [u0, u1]: [f64; 2]) -> (DVec3, f64) {
    let cos_theta = (1.0 - u0).sqrt();
    (direction_about(normal, cos_theta, u0.sqrt(), u1), cos_theta / PI)
}

/// A uniform direction of the sphere; its density is 1/4π.
#[inline]
pub(crate) fn sample_uniform_sphere([u0, u1]: [f64; 2]) -> DVec3 {
    let sin_theta = 2.0 * (u0 * (1.0 - u0)).sqrt();
    let (sin_phi, cos_phi) = sin_cos_of_turn(u1);
    DVec3::new(sin_theta * cos_phi, sin_theta * sin_phi, 2.0 * u0 - 1.0)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    /// Beside the library, over the turn and close to its quarters. The angle that the library gets is rounded itself, by 2⁻⁵¹ at most.
    #[test]
    fn sines_and_cosines_are_those_of_the_library() {
        let near = |x: f64| [x.next_down(), x, x.next_up(), x + 1e-9];
        let quarters = (0..=8).flat_map(|i| near(f64::from(i) / 8.0)).filter(|u| (0.0..=1.0).contains(u));
        for u in (0..100_000).map(|i| (f64::from(i) + 0.3) / 1e5).chain(quarters) {
            let (sin, cos) = sin_cos_of_turn(u);
            let (s, c) = (TAU * u).sin_cos();
            assert!((sin - s).abs() < 8e-16 && (cos - c).abs() < 8e-16, "{u}: {sin} {s}, {cos} {c}");
            assert!((sin.hypot(cos) - 1.0).abs() < 4e-16, "{u}");
        }
        assert_eq!(sin_cos_of_turn(0.0), (0.0, 1.0));
        assert_eq!(sin_cos_of_turn(0.5).1, -1.0);
    }

    const LAST: f64 = 1.0 - f64::EPSILON / 2.0;

    /// χ² over 16 × 8 cells of equal probability by an independent measure: cos²θ of the cosine-weighted hemisphere is uniform
    /// because ∫cos θ/π dω = sin²θ; the azimuth is measured in another frame.
    #[test]
    fn the_hemisphere_is_drawn_with_its_density() {
        for (k, normal) in [DVec3::Z, -DVec3::Z, DVec3::new(0.3, -0.8, 0.5).normalize()].into_iter().enumerate() {
            let across = normal.any_orthogonal_vector().normalize();
            let third = normal.cross(across);
            let mut cells = [0_u64; 128];
            for i in 0..100_000 {
                let (d, pdf) = sample_cosine_hemisphere(normal, Sampler::new(11, i, k as u32, 0).next_2d());
                let c = d.dot(normal);
                assert!(c > 0.0 && (d.length() - 1.0).abs() < 1e-15 && (pdf - c / PI).abs() < 1e-15, "{d} {pdf}");
                let azimuth = (d.dot(third).atan2(d.dot(across)) / TAU + 1.0).fract();
                cells[((c * c * 16.0) as usize).min(15) * 8 + ((azimuth * 8.0) as usize).min(7)] += 1;
            }
            assert_drawn_from(&format!("hemisphere about {normal}"), &cells, &[1.0 / 128.0; 128]);
        }
    }

    /// ∫cos θ/π over the hemisphere is 1: by the midpoint rule in cos θ, for which it is exact.
    #[test]
    fn the_density_of_the_hemisphere_integrates_to_one() {
        let n = 1000;
        let sum: f64 = (0..n)
            .map(|i| {
                let u0 = 1.0 - ((f64::from(i) + 0.5) / f64::from(n)).powi(2);
                sample_cosine_hemisphere(DVec3::Y, [u0, 0.1]).1 * TAU / f64::from(n)
            })
            .sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum}");
    }

    /// The least and the greatest random numbers give unit directions on the right side of the surface.
    #[test]
    fn the_ends_of_the_unit_square_are_directions() {
        for u0 in [0.0, f64::EPSILON / 2.0, 0.5, LAST] {
            for u1 in [0.0, 0.25, LAST] {
                for axis in [DVec3::Z, -DVec3::Z, DVec3::X, DVec3::new(1.0, 1e-200, -1.0).normalize()] {
                    let (d, pdf) = sample_cosine_hemisphere(axis, [u0, u1]);
                    assert!(d.is_normalized() && pdf > 0.0 && d.dot(axis) > 0.0, "{u0} {u1} {axis}");
                }
                let uniform = sample_uniform_sphere([u0, u1]).length();
                assert!((uniform - 1.0).abs() < 1e-15, "{u0} {u1}: {uniform}");
            }
        }
    }
}
