//! Projectors: points that throw a picture.
//!
//! *Definition.* The irradiance of a plane at right angles to the light's axis, one unit away, is π times the picture, as in Mitsuba: the radiant intensity towards a
//! direction at the angle θ to the axis is that over cos³θ. There is no light beyond the picture.

use std::f64::consts::PI;

use glam::{DVec2, DVec3, dvec2};
use vdf_scene::{Rgb, Slide};

use super::{LightSample, point};

/// A projector, prepared for sampling.
#[derive(Clone, Debug)]
pub(super) struct ProjectorLight {
    pub(super) position: DVec3,
    pub(super) direction: DVec3,
    pub(super) slide: Slide,
}

/// Where on a slide a direction from the light leads through, if it is in front of the light.
pub(super) fn uv(slide: &Slide, axis: DVec3, direction: DVec3) -> DVec2 {
    let [a, b] = slide.axes;
    dvec2(a.dot(direction), b.dot(direction)) * (0.5 / axis.dot(direction)) + 0.5
}

impl ProjectorLight {
    /// Half the angle of a cone about the picture.
    pub(super) fn angle(&self) -> f64 {
        self.slide.axes.map(|a| a.length_squared().recip()).into_iter().sum::<f64>().sqrt().atan()
    }

    /// The one sample there is; `None` beyond the picture.
    pub(super) fn sample(&self, emitter: usize, from: DVec3, choices: f64) -> Option<LightSample> {
        let mut sample = point::sample(emitter, self.position, Rgb::ONE, from, choices)?;
        let cos = -self.direction.dot(sample.direction);
        if cos <= 0.0 {
            return None;
        }
        let uv = uv(&self.slide, self.direction, -sample.direction);
        if !(0.0..=1.0).contains(&uv.x) || !(0.0..=1.0).contains(&uv.y) {
            return None;
        }
        sample.weight *=
            self.slide.texture.at(&uv.as_vec2().into()) * (PI * f64::from(self.slide.scale) / cos.powi(3)) as f32;
        Some(sample)
    }
}

#[cfg(test)]
mod tests {
    use vdf_scene::Texture;

    use super::*;

    /// A plane is lit evenly, within the picture, upside down as through a lens; and as \[Mitsuba 3.9.1\] says for the same numbers.
    #[test]
    fn a_plane_is_lit_as_the_picture_says() {
        let to_uv = vdf_scene::UvTransform::default();
        let board = |first, second| Texture::Checkerboard {
            first: Box::new(Texture::Constant(first)),
            second: Box::new(Texture::Constant(second)),
            to_uv,
        };
        let axes = [-DVec3::X / 0.5, -DVec3::Y / 0.25];
        let slide = Slide { texture: board(Rgb::X, Rgb::Y), scale: 2.0, axes };
        let light = ProjectorLight { position: DVec3::ZERO, direction: DVec3::Z, slide };
        for z in [1.0, 3.0] {
            for (x, y, color) in [(0.2, 0.1, Rgb::X), (-0.4, 0.2, Rgb::Y), (-0.3, -0.1, Rgb::X)] {
                let from = DVec3::new(x, y, 1.0) * z;
                let sample = light.sample(0, from, 1.0).expect("it is lit");
                let irradiance = sample.weight * sample.direction.dot(-DVec3::Z) as f32;
                let expected = color * (2.0 * PI / (z * z)) as f32;
                assert!(irradiance.distance(expected) < 1e-5, "{from}: {irradiance}");
            }
            for (x, y) in [(0.51, 0.0), (0.0, -0.26)] {
                assert!(light.sample(0, DVec3::new(x, y, 1.0) * z, 1.0).is_none());
            }
        }
        assert!(light.sample(0, -DVec3::Z, 1.0).is_none() && light.sample(0, DVec3::ZERO, 1.0).is_none());
    }
}
