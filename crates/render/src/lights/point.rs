//! Point emitters: intensity over squared distance from one place. No scattered ray can meet one.

use glam::DVec3;
use vdf_scene::Rgb;

use super::LightSample;

/// The one sample there is. `choices` is the number of emitters of which this one was drawn.
#[inline]
pub(super) fn sample(
    emitter: usize,
    position: DVec3,
    intensity: Rgb,
    from: DVec3,
    choices: f64,
) -> Option<LightSample> {
    let d = position - from;
    let distance2 = d.length_squared();
    // At the light itself the intensity has no limit; no event of positive probability happens there.
    (distance2 > 0.0).then(|| LightSample {
        emitter,
        point: position,
        direction: d / distance2.sqrt(),
        weight: intensity * (choices / distance2) as f32,
        pdf: 0.0,
        on_surface: false,
        choices,
    })
}
