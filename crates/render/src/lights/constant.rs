//! Constant emitters: the same radiance from every direction. A direction is drawn uniformly from the sphere.

use glam::DVec3;
use vdf_scene::Rgb;

use super::{LightSample, pdf_constant};
use crate::frame::sample_uniform_sphere;

/// A sample of an emitter of this radiance, one of `choices`, whose directions are followed for `reach` world units.
#[inline]
pub(super) fn sample(emitter: usize, from: DVec3, u: [f64; 2], radiance: Rgb, choices: f64, reach: f64) -> LightSample {
    let direction = sample_uniform_sphere(u);
    let pdf = pdf_constant(choices);
    LightSample {
        emitter,
        point: from + direction * reach,
        direction,
        weight: radiance * (1.0 / pdf) as f32,
        pdf,
        on_surface: false,
        choices,
    }
}
