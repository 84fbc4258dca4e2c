//! Diffuse reflection: a Lambertian surface scatters reflectance/π of what arrives into every direction of its side.

use std::f64::consts::PI;

use glam::DVec3;
use vdf_scene::Rgb;

use crate::frame::sample_cosine_hemisphere;

/// BSDF times cosine towards `to` for a surface with this unit normal and reflectance; and the density with which [`sample_diffuse`] draws
/// `to`.
#[inline]
pub(crate) fn eval_diffuse(normal: DVec3, reflectance: Rgb, to: DVec3) -> (Rgb, f64) {
    let pdf = normal.dot(to).max(0.0) / PI;
    #[allow(clippy::cast_possible_truncation, reason = "radiance is single precision")]
    let value = reflectance * pdf as f32;
    (value, pdf)
}

/// A direction drawn in proportion to BSDF times cosine, and its density; a path that takes it is worth the reflectance.
#[inline]
pub(crate) fn sample_diffuse(normal: DVec3, u: [f64; 2]) -> (DVec3, f64) {
    sample_cosine_hemisphere(normal, u)
}
