//! The pinhole camera.

use glam::{DVec3, dvec3};
use vdf_geometry::Segment;
use vdf_scene::{FilmSettings, PerspectiveSensor};

/// A camera and its film, prepared for rays.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    sensor: PerspectiveSensor,
    /// Width and height of the full film in pixels.
    size: [f64; 2],
}

impl Camera {
    /// The camera of a sensor with this film.
    #[must_use]
    pub fn new(sensor: &PerspectiveSensor, film: &FilmSettings) -> Self {
        Self { sensor: *sensor, size: [film.width.into(), film.height.into()] }
    }

    /// The camera ray through film position (`x`, `y`) in pixels from the top left corner of the full film: a segment from
    /// the near to the far plane, but no longer than `reach` world units, and its unit direction. Same geometry as Mitsuba 3 `perspective`.
    #[inline]
    #[must_use]
    pub fn ray(&self, x: f64, y: f64, reach: f64) -> (Segment, DVec3) {
        let [width, height] = self.size;
        let s = &self.sensor;
        let t = s.tan_half_fov_x;
        let local = dvec3((1.0 - 2.0 * x / width) * t, (1.0 - 2.0 * y / height) * t * height / width, 1.0);
        let p = s.world_from_camera.transform_point3(local * s.near_clip);
        let direction = s.world_from_camera.transform_vector3(local).normalize();
        // A plane beyond all of the scene clips nothing; squares of its distance would overflow.
        let q = if s.far_clip < reach {
            s.world_from_camera.transform_point3(local * s.far_clip)
        } else {
            p + direction * reach
        };
        (Segment::new(p, q), direction)
    }

    /// Where all rays come from.
    #[inline]
    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.sensor.world_from_camera.w_axis.truncate()
    }
}
