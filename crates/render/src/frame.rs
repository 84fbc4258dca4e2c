//! Directions: an orthonormal frame about a direction, and uniform and cosine-weighted sampling.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

/// The unit direction with polar angle cosine `cos_theta` to the unit vector `axis` and azimuth `phi`.
#[inline]
pub(crate) fn direction_about(axis: DVec3, cos_theta: f64, phi: f64) -> DVec3 {
    let sin_theta = (1.0 - cos_theta * cos_theta).max(0.0).sqrt();
    let (s, t) = axis.any_orthonormal_pair();
    let (sin_phi, cos_phi) = phi.sin_cos();
    (s * (sin_theta * cos_phi) + t * (sin_theta * sin_phi) + axis * cos_theta).normalize()
}

/// A direction of the hemisphere about `normal` with density cos θ/π, and that density.
#[inline]
pub(crate) fn sample_cosine_hemisphere(normal: DVec3, [u0, u1]: [f64; 2]) -> (DVec3, f64) {
    let cos_theta = (1.0 - u0).sqrt();
    (direction_about(normal, cos_theta, TAU * u1), cos_theta / PI)
}

/// A uniform direction of the sphere; its density is 1/4π.
#[inline]
pub(crate) fn sample_uniform_sphere([u0, u1]: [f64; 2]) -> DVec3 {
    direction_about(DVec3::Z, 1.0 - 2.0 * u0, TAU * u1)
}
