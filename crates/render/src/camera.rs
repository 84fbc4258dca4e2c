//! The camera: a pinhole or a thin lens.

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

    /// Whether it has a lens, on which [`Camera::ray_through`] wants a point.
    #[inline]
    #[must_use]
    pub fn has_lens(&self) -> bool {
        self.sensor.lens.is_some()
    }

    /// As [`Camera::ray`], through a point of the lens drawn by two uniform numbers; and that point. Same geometry as Mitsuba 3 `thinlens`: the rays of one
    /// film position meet in the plane of focus.
    #[must_use]
    pub fn ray_through(&self, x: f64, y: f64, reach: f64, [u0, u1]: [f64; 2]) -> (DVec3, Segment, DVec3) {
        let s = &self.sensor;
        let Some(lens) = &s.lens else {
            let (segment, direction) = self.ray(x, y, reach);
            return (self.position(), segment, direction);
        };
        let [width, height] = self.size;
        let t = s.tan_half_fov_x;
        let through = dvec3((1.0 - 2.0 * x / width) * t, (1.0 - 2.0 * y / height) * t * height / width, 1.0);
        let (radius, (sin, cos)) = (lens.radius * u0.sqrt(), (std::f64::consts::TAU * u1).sin_cos());
        let on_lens = dvec3(radius * cos, radius * sin, 0.0);
        let local = (through * lens.focus_distance - on_lens) / lens.focus_distance;
        let at = |depth: f64| s.world_from_camera.transform_point3(on_lens + local * depth);
        let p = at(s.near_clip);
        let direction = s.world_from_camera.transform_vector3(local).normalize();
        let q = if s.far_clip < reach { at(s.far_clip) } else { p + direction * reach };
        (at(0.0), Segment::new(p, q), direction)
    }

    /// Where all rays come from; with a lens its middle.
    #[inline]
    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.sensor.world_from_camera.w_axis.truncate()
    }
}
