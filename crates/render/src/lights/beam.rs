//! Rays that leave a light: from a point, a spot or a projector into the cone that it shines into, uniformly; from a surface with the density of the cosine.

use std::f64::consts::{PI, TAU};

use glam::DVec3;
use vdf_scene::Rgb;

use super::Lights;
use crate::frame::{direction_about, sample_cosine_hemisphere};

/// An emitter that rays are sent from.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    /// The emitter's number.
    pub(crate) emitter: usize,
    /// A place of it.
    pub(crate) position: DVec3,
    directions: Directions,
}

/// Which directions rays leave in.
#[derive(Clone, Copy, Debug)]
enum Directions {
    Cone {
        /// Unit direction of the middle.
        axis: DVec3,
        /// 1 − cos of half the angle; 2 for all directions.
        below: f64,
    },
    /// About the normal of each point.
    Cosine { area: f64 },
}

/// A ray that leaves a light.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightRay {
    /// Where it starts: a little before a surface.
    pub(crate) origin: DVec3,
    /// Unit direction.
    pub(crate) direction: DVec3,
    /// The unit normal and the radiance there, if it is a surface.
    pub(crate) surface: Option<(DVec3, Rgb)>,
}

impl Beam {
    /// Into all directions.
    pub(super) const fn sphere(emitter: usize, position: DVec3) -> Self {
        Self { emitter, position, directions: Directions::Cone { axis: DVec3::Z, below: 2.0 } }
    }

    /// Into the directions at no more than this angle to `axis`; `None` if there are none.
    pub(super) fn cone(emitter: usize, position: DVec3, axis: DVec3, angle: f64) -> Option<Self> {
        let sin = (0.5 * angle).sin();
        let below = 2.0 * sin * sin;
        (below > 0.0).then_some(Self { emitter, position, directions: Directions::Cone { axis, below } })
    }

    /// From a surface of this area.
    pub(super) const fn surface(emitter: usize, position: DVec3, area: f64) -> Self {
        Self { emitter, position, directions: Directions::Cosine { area } }
    }

    /// A ray; `u` are for the place, where that is not one point, and for the direction.
    #[inline]
    pub(crate) fn sample(&self, lights: &Lights, u: [[f64; 2]; 2]) -> Option<LightRay> {
        match self.directions {
            Directions::Cone { axis, below } => {
                Some(LightRay { origin: self.position, direction: sample_cone(axis, below, u[1]), surface: None })
            }
            Directions::Cosine { .. } => {
                let (origin, normal, radiance) = lights.surface_point(self.emitter, u[0])?;
                let (direction, _) = sample_cosine_hemisphere(normal, u[1]);
                Some(LightRay { origin, direction, surface: Some((normal, radiance)) })
            }
        }
    }

    /// What leaves it for each unit of intensity, or of a surface's radiance: the solid angle of its cone, or π times the area.
    #[inline]
    pub(crate) fn throughput(&self) -> f64 {
        match self.directions {
            Directions::Cone { below, .. } => TAU * below,
            Directions::Cosine { area } => PI * area,
        }
    }

    /// The density per steradian of a ray to a point at this squared distance, over the density with which that point's own sample, of density `pdf` per steradian
    /// there, starts at the same place.
    #[inline]
    pub(super) fn density(&self, distance2: f64, pdf: f64) -> f64 {
        match self.directions {
            Directions::Cone { below, .. } => 1.0 / (TAU * below),
            // (cos θ/πA) / (pdf cos θ/d²)
            Directions::Cosine { area } => distance2 / (PI * area * pdf),
        }
    }

    /// Whether all rays start at one point.
    pub(crate) const fn is_point(&self) -> bool {
        matches!(self.directions, Directions::Cone { .. })
    }
}

/// A uniform direction of the cone about `axis` with this 1 − cos of half its angle.
#[inline]
fn sample_cone(axis: DVec3, below: f64, [u0, u1]: [f64; 2]) -> DVec3 {
    let below = below * u0;
    direction_about(axis, 1.0 - below, (below * (2.0 - below)).sqrt(), u1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Sampler, chi_squared::assert_drawn_from};

    /// χ² over 16 × 8 cells of equal solid angle, which are equally likely, and that the density is one over all of it.
    #[test]
    fn directions_are_uniform_in_the_cone() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        for (k, angle) in [PI, 1.2, 0.01].into_iter().enumerate() {
            let beam = Beam::cone(0, DVec3::ONE, axis, angle).expect("a cone");
            let Directions::Cone { below, .. } = beam.directions else { panic!("{beam:?}") };
            let (across, third) = axis.any_orthonormal_pair();
            let mut cells = [0_u64; 128];
            for i in 0..50_000 {
                let d = sample_cone(axis, below, Sampler::new(31, i, k as u32, 0).next_2d());
                let half = 0.5 * axis.cross(d).length().atan2(axis.dot(d));
                let azimuth = (d.dot(third).atan2(d.dot(across)) / TAU + 1.0).fract();
                let ring = (2.0 * half.sin() * half.sin() / below * 16.0) as usize;
                cells[ring.min(15) * 8 + ((azimuth * 8.0) as usize).min(7)] += 1;
            }
            assert_drawn_from(&format!("a cone of {angle}"), &cells, &[1.0 / 128.0; 128]);
            assert!((beam.density(3.0, 0.0) * TAU * below - 1.0).abs() < 1e-15);
        }
        assert_eq!(Beam::sphere(0, DVec3::ZERO).density(3.0, 0.0), 0.25 / PI);
        assert!(Beam::cone(0, DVec3::ZERO, axis, 0.0).is_none());
    }
}
