//! The pinhole camera and where on the film a sample falls.

use glam::{DVec3, dvec3};

use crate::{
    Sampler,
    geometry::Segment,
    scene::{FilmSettings, PerspectiveSensor, ReconstructionFilter},
};

impl PerspectiveSensor {
    /// The camera ray through film position (`x`, `y`) in pixels from the top left corner of the full film: a segment from
    /// the near to the far plane, and its unit direction. Same geometry as Mitsuba 3 `perspective`.
    #[inline]
    #[must_use]
    pub fn ray(&self, film: &FilmSettings, x: f64, y: f64) -> (Segment, DVec3) {
        let (width, height) = (f64::from(film.width), f64::from(film.height));
        let t = self.tan_half_fov_x;
        let local = dvec3((1.0 - 2.0 * x / width) * t, (1.0 - 2.0 * y / height) * t * height / width, 1.0);
        let p = self.world_from_camera.transform_point3(local * self.near_clip);
        let q = self.world_from_camera.transform_point3(local * self.far_clip);
        (Segment::new(p, q), self.world_from_camera.transform_vector3(local).normalize())
    }
}

impl ReconstructionFilter {
    /// An offset from the pixel's corner (0, 0) drawn from the filter centred at (0.5, 0.5).
    ///
    /// The filter is sampled instead of being used as a weight, as in pbrt-v4: each pixel is the plain mean of its own samples, so that
    /// pixels, tiles and crops are independent. The expected image is that of the weighted sum; at the edge of
    /// the image samples fall outside it, where the peer renormalizes.
    #[inline]
    pub fn sample(&self, sampler: &mut Sampler) -> [f64; 2] {
        match *self {
            Self::Box => sampler.next_2d(),
            Self::Gaussian { stddev } => [0, 1].map(|_| 0.5 + sample_truncated_gaussian(stddev, sampler)),
        }
    }
}

/// Draws x with density proportional to max(0, exp(−x²/2σ²) − exp(−r²/2σ²)), r = 4σ, by rejection (31 % are accepted).
fn sample_truncated_gaussian(stddev: f64, sampler: &mut Sampler) -> f64 {
    let floor = (-8.0_f64).exp();
    loop {
        let z = 8.0 * sampler.next_1d() - 4.0;
        if sampler.next_1d() * (1.0 - floor) < (-0.5 * z * z).exp() - floor {
            return z * stddev;
        }
    }
}
