//! Phase functions: isotropic and Henyey–Greenstein \[Henyey1941\].
//!
//! `wo` is the direction of propagation before the event, `wi` the direction after it; both are unit vectors. (Mitsuba's
//! `wi` points back along the ray, hence the other sign of the cosine there.)

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use vdf_scene::Phase;

use crate::frame::{direction_about, sample_sphere_about};

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
            Self::HenyeyGreenstein { g } => {
                // 1 + g² − 2g cos θ = (1 − g)² + 2g(1 − cos θ) = (1 − g)² + g|to − from|²; for g < 0 mirrored. Nothing cancels: 1 − cos θ would,
                // at a peak as narrow as 1 − |g|.
                let (a, apart) = if g >= 0.0 { (g, to - from) } else { (-g, to + from) };
                let d = (1.0 - a) * (1.0 - a) + a * apart.length_squared();
                0.25 / PI * (1.0 - a) * (1.0 + a) / (d * d.sqrt())
            }
        }
    }

    #[inline]
    fn sample_direction(&self, from: DVec3, [u0, u1]: [f64; 2]) -> DVec3 {
        match *self {
            Self::Isotropic => sample_sphere_about(from, [u0, u1]),
            Self::HenyeyGreenstein { g } => {
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
                direction_about(from, cos_theta, (near * far).sqrt(), TAU * u1)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Sampler;

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
        let (sum, mean) = moments(Phase::Isotropic);
        assert!((sum - 1.0).abs() < 1e-6 && mean.abs() < 1e-6);
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
