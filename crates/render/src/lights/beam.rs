//! Rays that leave a light: uniform directions in the cone that a point, a spot or a projector shines into.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::frame::direction_about;

/// The cone that light leaves a point in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Beam {
    /// The emitter's number.
    pub(crate) emitter: usize,
    pub(crate) position: DVec3,
    /// Unit direction of the middle.
    axis: DVec3,
    /// 1 − cos of half the angle; 2 for all directions.
    below: f64,
    /// The density of a direction per steradian.
    pub(crate) density: f64,
}

impl Beam {
    /// All directions.
    pub(super) fn sphere(emitter: usize, position: DVec3) -> Self {
        Self { emitter, position, axis: DVec3::Z, below: 2.0, density: 0.25 / PI }
    }

    /// The directions at no more than this angle to `axis`; `None` if there are none.
    pub(super) fn cone(emitter: usize, position: DVec3, axis: DVec3, angle: f64) -> Option<Self> {
        let sin = (0.5 * angle).sin();
        let below = 2.0 * sin * sin;
        (below > 0.0).then(|| Self { emitter, position, axis, below, density: 1.0 / (TAU * below) })
    }

    /// A uniform direction.
    #[inline]
    pub(crate) fn sample_direction(&self, [u0, u1]: [f64; 2]) -> DVec3 {
        let below = self.below * u0;
        direction_about(self.axis, 1.0 - below, (below * (2.0 - below)).sqrt(), u1)
    }
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
            let beam = Beam::cone(0, DVec3::ZERO, axis, angle).expect("a cone");
            let (across, third) = axis.any_orthonormal_pair();
            let mut cells = [0_u64; 128];
            for i in 0..50_000 {
                let d = beam.sample_direction(Sampler::new(31, i, k as u32, 0).next_2d());
                let half = 0.5 * axis.cross(d).length().atan2(axis.dot(d));
                let below = 2.0 * half.sin() * half.sin();
                let azimuth = (d.dot(third).atan2(d.dot(across)) / TAU + 1.0).fract();
                cells[((below / beam.below * 16.0) as usize).min(15) * 8 + ((azimuth * 8.0) as usize).min(7)] += 1;
            }
            assert_drawn_from(&format!("a cone of {angle}"), &cells, &[1.0 / 128.0; 128]);
            assert!((beam.density * TAU * beam.below - 1.0).abs() < 1e-15);
        }
        assert_eq!(Beam::sphere(0, DVec3::ZERO).density, Beam::cone(0, DVec3::ZERO, axis, PI).expect("all").density);
        assert!(Beam::cone(0, DVec3::ZERO, axis, 0.0).is_none());
    }
}
