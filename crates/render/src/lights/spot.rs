//! Spots: points that radiate into a cone.

use glam::DVec3;
use vdf_scene::{Rgb, Slide};

use super::{LightSample, point, projector};

/// A spot, prepared for sampling.
#[derive(Clone, Debug)]
pub(super) struct SpotLight {
    pub(super) position: DVec3,
    pub(super) direction: DVec3,
    pub(super) intensity: Rgb,
    /// Half the angles of the full beam and of the cone.
    pub(super) beam: f64,
    pub(super) cutoff: f64,
    pub(super) slide: Option<Box<Slide>>,
}

impl SpotLight {
    /// The one sample there is; `None` outside of the cone.
    pub(super) fn sample(&self, emitter: usize, from: DVec3, choices: f64) -> Option<LightSample> {
        let mut sample = point::sample(emitter, self.position, self.intensity, from, choices)?;
        let falloff = self.falloff(-sample.direction);
        if falloff <= 0.0 {
            return None;
        }
        sample.weight *= falloff as f32;
        if let Some(slide) = &self.slide {
            let uv = projector::uv(slide, self.direction, -sample.direction);
            sample.weight *= slide.texture.at(&uv.as_vec2().into()) * slide.scale;
        }
        Some(sample)
    }

    /// 1 in the beam, 0 outside of the cone, linear in the angle between.
    fn falloff(&self, direction: DVec3) -> f64 {
        let angle = self.direction.cross(direction).length().atan2(self.direction.dot(direction));
        if angle <= self.beam {
            1.0
        } else if angle >= self.cutoff {
            0.0
        } else {
            (self.cutoff - angle) / (self.cutoff - self.beam)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_edge_falls_off_linearly_in_the_angle() {
        let spot = SpotLight {
            position: DVec3::ZERO,
            direction: DVec3::Z,
            intensity: Rgb::ONE,
            beam: 0.3,
            cutoff: 0.4,
            slide: None,
        };
        let at = |angle: f64| spot.falloff(DVec3::new(angle.sin(), 0.0, angle.cos()));
        assert_eq!([at(0.0), at(0.29), at(0.41), at(3.0)], [1.0, 1.0, 0.0, 0.0]);
        assert!((at(0.35) - 0.5).abs() < 1e-12);
        let sample = spot.sample(0, DVec3::Z * 2.0, 1.0).expect("in the beam");
        assert_eq!((sample.weight, sample.pdf), (Rgb::splat(0.25), 0.0));
        assert!(spot.sample(0, DVec3::X, 1.0).is_none());
        let sharp = SpotLight { beam: 0.4, ..spot.clone() };
        assert_eq!(sharp.falloff(DVec3::new(0.41_f64.sin(), 0.0, 0.41_f64.cos())), 0.0);
    }
}
