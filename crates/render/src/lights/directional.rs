//! Directional emitters: parallel light from infinitely far away. No scattered ray can meet one.

use glam::DVec3;
use vdf_scene::Rgb;

use super::LightSample;

/// The one sample there is of light that travels in `direction`; the way to it is followed for `reach` world units.
#[inline]
pub(super) fn sample(
    emitter: usize,
    from: DVec3,
    direction: DVec3,
    irradiance: Rgb,
    choices: f64,
    reach: f64,
) -> LightSample {
    LightSample {
        emitter,
        point: from - direction * reach,
        direction: -direction,
        weight: irradiance * choices as f32,
        pdf: 0.0,
        on_surface: false,
        choices,
    }
}
