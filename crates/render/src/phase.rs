//! Phase functions: isotropic, Henyey–Greenstein \[Henyey1941\], mixtures of two of these, and Rayleigh's.
//!
//! `wo` is the direction of propagation before the event, `wi` the direction after it; both are unit vectors. (Mitsuba's
//! `wi` points back along the ray, hence the other sign of the cosine there.)

use std::f64::consts::PI;

use glam::DVec3;

use vdf_scene::Phase;

use crate::frame::{direction_about, sample_uniform_sphere};

/// What a phase function does in a render.
pub trait PhaseFunction {
    /// The density per steradian of scattering from propagation direction `from` into `to`; also the density with which
    /// [`PhaseFunction::sample_direction`] draws `to`. Both are unit vectors up to rounding.
    ///
    /// Relative error: below 40·2⁻⁵³ for every g and angle, as `docs/numerics.md` derives.
    fn pdf_direction(&self, from: DVec3, to: DVec3) -> f64;

    /// A direction drawn with [`PhaseFunction::pdf_direction`] from two uniform numbers in [0, 1).
    fn sample_direction(&self, from: DVec3, u: [f64; 2]) -> DVec3;
}

impl PhaseFunction for Phase {
    #[inline]
    fn pdf_direction(&self, from: DVec3, to: DVec3) -> f64 {
        match *self {
            Self::Isotropic => 0.25 / PI,
            Self::HenyeyGreenstein { g } => pdf_lobe(g, from, to),
            Self::Rayleigh => {
                let cos_theta = from.dot(to);
                3.0 / (16.0 * PI) * (1.0 + cos_theta * cos_theta)
            }
            Self::TwoLobes { weight, g } => {
                (1.0 - weight) * pdf_lobe(g[0], from, to) + weight * pdf_lobe(g[1], from, to)
            }
        }
    }

    #[inline]
    fn sample_direction(&self, from: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
        match *self {
            Self::Isotropic => sample_uniform_sphere([u0, u1]),
            Self::HenyeyGreenstein { g } => sample_lobe(g, from, [u0, u1]),
            Self::Rayleigh => {
                // The root of cos³ θ + 3 cos θ = 8u − 4, by Cardano's formula. Its two terms have opposite signs, and their product is −1: from the larger
                // one the other follows without cancelling.
                let half = 4.0 * u0 - 2.0;
                let large = (half.abs() + (half * half + 1.0).sqrt()).cbrt();
                let cos_theta = ((large - large.recip()) * half.signum()).clamp(-1.0, 1.0);
                direction_about(from, cos_theta, ((1.0 - cos_theta) * (1.0 + cos_theta)).sqrt(), u1)
            }
            Self::TwoLobes { weight, g } => {
                // What is left of the number that chose the lobe is uniform again; rounding must not make it 1.
                let (g, u0) = if u0 < weight { (g[1], u0 / weight) } else { (g[0], (u0 - weight) / (1.0 - weight)) };
                sample_lobe(g, from, [u0.min(1.0 - f64::EPSILON), u1])
            }
        }
    }
}

/// The density of Henyey–Greenstein with mean cosine `g`.
#[inline(always)]
pub(crate) fn pdf_lobe(g: f64, from: DVec3, to: DVec3) -> f64 {
    // 1 + g² − 2g cos θ = (1 − g)² + 2g(1 − cos θ) = (1 − g)² + g|to − from|²; for g < 0 mirrored. Nothing cancels: 1 − cos θ would,
    // at a peak as narrow as 1 − |g|.
    let (a, apart) = if g >= 0.0 { (g, to - from) } else { (-g, to + from) };
    let d = (1.0 - a) * (1.0 - a) + a * apart.length_squared();
    0.25 / PI * (1.0 - a) * (1.0 + a) / (d * d.sqrt())
}

/// A direction drawn with [`pdf_lobe`].
#[inline]
fn sample_lobe(g: f64, from: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
    let a = g.abs();
    // From the back of the peak to its middle, so that both signs of g go the same way about the sphere.
    let v = if g >= 0.0 { u0 } else { 1.0 - u0 };
    // The textbook inversion, solved for the distances of the cosine from the peak and from its back. All
    // terms are positive, so that nothing cancels, neither for small |g| nor for |g| near 1.
    let e = (1.0 - a) + 2.0 * a * v;
    let (narrow, wide) = ((1.0 - a) / e, (1.0 + a) / e);
    let near = 2.0 * narrow * narrow * ((1.0 - v) * (1.0 + a * v));
    let far = 2.0 * wide * wide * (v * ((1.0 - a) + a * v));
    let cos_theta = if g >= 0.0 { 1.0 - near } else { near - 1.0 };
    direction_about(from, cos_theta, (near * far).sqrt(), u1)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    const G: [f64; 9] = [-0.95, -0.5, -1e-4, 0.0, 1e-9, 1e-3, 0.3, 0.8, 0.99];

    /// The density's mean and mean cosine by the midpoint rule in cos θ, graded towards the peak.
    fn moments(phase: Phase) -> (f64, f64) {
        let n = 200_000;
        let (mut sum, mut mean) = (0.0, 0.0);
        for i in 0..n {
            // cos θ = ±(1 − 2x³) puts most points at the peak; the Jacobian is 6x².
            let x = (f64::from(i) + 0.5) / f64::from(n);
            let peak = if matches!(phase, Phase::HenyeyGreenstein { g } if g < 0.0) { -1.0 } else { 1.0 };
            let cos_theta = peak * (1.0 - 2.0 * x * x * x);
            let to = DVec3::new((1.0 - cos_theta * cos_theta).max(0.0).sqrt(), 0.0, cos_theta);
            let p = TAU * phase.pdf_direction(DVec3::Z, to) * 6.0 * x * x / f64::from(n);
            sum += p;
            mean += p * cos_theta;
        }
        (sum, mean)
    }

    #[test]
    fn integrates_to_one_with_mean_cosine_g() {
        for g in G {
            let (sum, mean) = moments(Phase::HenyeyGreenstein { g });
            assert!((sum - 1.0).abs() < 1e-6, "g = {g}: ∫p = {sum}");
            assert!((mean - g).abs() < 1e-6, "g = {g}: mean cosine {mean}");
        }
        for phase in [Phase::Isotropic, Phase::Rayleigh] {
            let (sum, mean) = moments(phase);
            assert!((sum - 1.0).abs() < 1e-6 && mean.abs() < 1e-6);
        }
        let (sum, mean) = moments(Phase::TwoLobes { weight: 0.3, g: [-0.2, 0.7] });
        assert!((sum - 1.0).abs() < 1e-6 && (mean - 0.07).abs() < 1e-6, "{sum} {mean}");
    }

    /// χ² over 40 intervals of the cosine, whose probabilities are integrals of the density by the midpoint rule; false alarm 10⁻⁶ each.
    #[test]
    fn samples_follow_the_density() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        let across = axis.cross(DVec3::X).normalize();
        let mixture = |weight, g| Phase::TwoLobes { weight, g };
        for phase in [Phase::Rayleigh, mixture(0.3, [-0.4, 0.8]), mixture(1.0, [0.9, 0.1]), mixture(0.0, [0.2, 0.9])] {
            const CELLS: usize = 40;
            let fine = 200;
            let mut shares = [0.0; CELLS];
            for i in 0..CELLS * fine {
                let cos = (i as f64 + 0.5) / (CELLS * fine) as f64 * 2.0 - 1.0;
                let to = axis * cos + across * (1.0 - cos * cos).sqrt();
                shares[i / fine] += phase.pdf_direction(axis, to) * TAU * 2.0 / (CELLS * fine) as f64;
            }
            // The rule is good to 10⁻⁵, and the test wants a sum of 1.
            let total: f64 = shares.iter().sum();
            assert!((total - 1.0).abs() < 1e-5, "{phase:?}: {total}");
            shares.iter_mut().for_each(|share| *share /= total);
            let mut counts = [0_u64; CELLS];
            for i in 0..40_000 {
                let to = phase.sample_direction(axis, Sampler::new(9, i, 0, 0).next_2d());
                counts[(((axis.dot(to) + 1.0) * 0.5 * CELLS as f64) as usize).min(CELLS - 1)] += 1;
            }
            assert_drawn_from(&format!("{phase:?}"), &counts, &shares);
        }
    }

    /// The mean cosine of 10⁵ samples lies within 6 standard errors of g (false alarm below 2·10⁻⁹ a case; seed fixed).
    #[test]
    fn samples_have_mean_cosine_g_about_any_axis() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        for g in G {
            let phase = Phase::HenyeyGreenstein { g };
            let n = 100_000;
            let (mut sum, mut sum2) = (0.0, 0.0);
            for i in 0..n {
                let to = phase.sample_direction(axis, Sampler::new(3, i, 0, 0).next_2d());
                assert!((to.length() - 1.0).abs() < 1e-12);
                let c = axis.dot(to);
                sum += c;
                sum2 += c * c;
            }
            let mean = sum / f64::from(n);
            let error = ((sum2 / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
            assert!((mean - g).abs() < 6.0 * error, "g = {g}: {mean} ± {error}");
        }
    }
}
