//! Homogeneous media: σ_t is the same everywhere, so that everything along a ray has a closed form.
//!
//! *Definition.* Over a distance d the optical depth is σ_t·d and the transmittance exp(−σ_t·d) [Houska2013, Sec. 2.1]; a free flight
//! ends at the distance where the depth is −ln(1 − ξ), with density σ_t·exp(−σ_t·d).
//!
//! *Cost.* A product or a division.

use vdf_scene::{Albedo, Medium, Phase, Rgb};

/// A homogeneous medium, prepared for rendering.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Homogeneous {
    /// Extinction coefficient in 1/world unit; finite and at least 0.
    pub sigma_t: f64,
    /// Single-scattering albedo σ_s/σ_t, each channel in [0, 1].
    pub albedo: Rgb,
    /// Phase function.
    pub phase: Phase,
}

impl Homogeneous {
    /// The optical depth over `distance` world units.
    #[inline]
    #[must_use]
    pub fn optical_depth(&self, distance: f64) -> f64 {
        self.sigma_t * distance
    }

    /// The distance at which the optical depth is `tau`, in multiples of `unit` world units: infinite or NaN without extinction.
    #[inline]
    #[must_use]
    pub fn distance_at_depth(&self, tau: f64, unit: f64) -> f64 {
        tau / (self.sigma_t * unit)
    }

    /// The density per world unit with which a free flight ends at `distance`: σ_t·exp(−σ_t·d).
    #[inline]
    #[must_use]
    pub fn pdf_distance(&self, distance: f64) -> f64 {
        self.sigma_t * (-self.optical_depth(distance)).exp()
    }
}

impl Homogeneous {
    /// The medium, if it is homogeneous, of one extinction for all colours.
    pub(super) fn of(medium: &Medium) -> Option<Self> {
        let Albedo::Constant(albedo) = medium.albedo else { return None };
        medium.sigma_t.grey().map(|sigma_t| Self { sigma_t, albedo, phase: medium.phase })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The density integrates to 1 − T, by the midpoint rule with 10⁴ steps: its error is below 10⁻⁸ here.
    #[test]
    fn the_density_of_a_distance_is_the_loss_of_transmittance() {
        let medium = Homogeneous { sigma_t: 0.7, albedo: Rgb::ONE, phase: Phase::Isotropic };
        let (end, n) = (3.0, 10_000);
        let step = end / f64::from(n);
        let integral: f64 = (0..n).map(|i| medium.pdf_distance((f64::from(i) + 0.5) * step) * step).sum();
        assert!((integral + (-medium.optical_depth(end)).exp_m1()).abs() < 1e-8, "{integral}");
        let distance = medium.distance_at_depth(0.35, 2.0) * 2.0;
        assert!((medium.optical_depth(distance) - 0.35).abs() < 1e-15);
    }
}
