//! The camera: a pinhole, a thin lens, or parallel rays.

use glam::{DVec3, dvec3};
use vdf_geometry::Segment;
use vdf_scene::{FilmSettings, Lens, Projection, Sensor};

use crate::frame::sin_cos_of_turn;

/// A camera and its film, prepared for rays.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    sensor: Sensor,
    /// Width and height of the full film in pixels.
    size: [f64; 2],
}

/// A camera ray.
#[derive(Clone, Copy, Debug)]
pub struct CameraRay {
    /// Where it comes from: the camera, a point of its lens or, if rays are parallel, of its plane.
    pub origin: DVec3,
    /// The part of it from the near to the far plane.
    pub segment: Segment,
    /// Unit direction.
    pub direction: DVec3,
}

impl Camera {
    /// The camera of a sensor with this film.
    #[must_use]
    pub fn new(sensor: &Sensor, film: &FilmSettings) -> Self {
        Self { sensor: *sensor, size: [film.width.into(), film.height.into()] }
    }

    /// The camera ray through film position (`x`, `y`) in pixels from the top left corner of the full film, no longer than `reach` world units; of a lens that
    /// through its middle. Same geometry as Mitsuba 3 `perspective` and `orthographic`.
    #[inline]
    #[must_use]
    pub fn ray(&self, x: f64, y: f64, reach: f64) -> CameraRay {
        let (start, slope) = self.through(x, y);
        self.between_planes(start, slope, reach)
    }

    /// [`Sensor::ray`] of a film position in pixels.
    #[inline]
    fn through(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        let [width, height] = self.size;
        self.sensor.ray(1.0 - 2.0 * x / width, 1.0 - 2.0 * y / height, width / height)
    }

    /// The lens, if there is one, on which [`Camera::ray_through`] wants a point.
    #[inline]
    #[must_use]
    pub const fn lens(&self) -> Option<Lens> {
        match self.sensor.projection {
            Projection::Perspective { lens, .. } => lens,
            Projection::Orthographic { .. } => None,
        }
    }

    /// As [`Camera::ray`], through a point of the lens drawn by two uniform numbers. Same geometry as Mitsuba 3 `thinlens`: the rays of one film position meet in
    /// the plane of focus.
    #[must_use]
    pub fn ray_through(&self, lens: &Lens, x: f64, y: f64, reach: f64, [u0, u1]: [f64; 2]) -> CameraRay {
        let (_, through) = self.through(x, y);
        let (radius, (sin, cos)) = (lens.radius * u0.sqrt(), sin_cos_of_turn(u1));
        let on_lens = dvec3(radius * cos, radius * sin, 0.0);
        self.between_planes(on_lens, (through * lens.focus_distance - on_lens) / lens.focus_distance, reach)
    }

    /// The ray from a point of the camera's plane, in its space, that goes on by `slope` for each unit of depth.
    #[inline]
    fn between_planes(&self, start: DVec3, slope: DVec3, reach: f64) -> CameraRay {
        let s = &self.sensor;
        let at = |depth: f64| s.world_from_camera.transform_point3(start + slope * depth);
        let p = at(s.near_clip);
        let direction = s.world_from_camera.transform_vector3(slope).normalize();
        // A plane beyond all of the scene clips nothing; squares of its distance would overflow.
        let q = if s.far_clip < reach { at(s.far_clip) } else { p + direction * reach };
        CameraRay { origin: s.world_from_camera.transform_point3(start), segment: Segment::new(p, q), direction }
    }

    /// Where the camera is: where all rays come from, the middle of the lens, or the middle of the plane that parallel rays come from.
    #[inline]
    #[must_use]
    pub fn position(&self) -> DVec3 {
        self.sensor.world_from_camera.w_axis.truncate()
    }

    /// How far a point is from where its ray comes from; from the middle of a lens.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        match self.sensor.projection {
            Projection::Perspective { .. } => point.distance(self.position()),
            Projection::Orthographic { .. } => {
                (point - self.position()).dot(self.sensor.world_from_camera.z_axis.truncate())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat4;
    use vdf_scene::{ComponentFormat, PixelRect, ReconstructionFilter};

    use super::*;

    fn film() -> FilmSettings {
        FilmSettings {
            width: 200,
            height: 120,
            crop: PixelRect { x0: 0, y0: 0, x1: 200, y1: 120 },
            filter: ReconstructionFilter::Box,
            component_format: ComponentFormat::Float32,
        }
    }

    fn sensor(projection: Projection) -> Sensor {
        Sensor { world_from_camera: DMat4::IDENTITY, projection, near_clip: 3.0, far_clip: 9.0, medium: None }
    }

    /// Slopes that Mitsuba 3.9.1 prints for the corner and the middle of a film of 200 × 120 pixels, fov 60 and offsets of 0.25 and −0.125.
    #[test]
    fn the_axis_meets_the_film_where_mitsuba_has_it() {
        let tan_half_fov_x = 30_f64.to_radians().tan();
        let perspective = Projection::Perspective { tan_half_fov_x, lens: None, principal_point: [0.25, -0.125] };
        let sensor = sensor(perspective);
        let camera = Camera::new(&sensor, &film());
        for (x, y, expected) in [(0.0, 0.0, [0.28867516, 0.43301272]), (100.0, 60.0, [-0.288675, 0.08660255])] {
            let d = camera.ray(x, y, 1e9).direction;
            assert!((d.x / d.z - expected[0]).abs() < 1e-6 && (d.y / d.z - expected[1]).abs() < 1e-6, "{d}");
        }
    }

    /// Numbers that Mitsuba 3.9.1 prints for the corner of a film of 200 × 120 pixels, a camera that is scaled by (1.5, 2, 3) and turned, and clip planes at 1 and 7.
    #[test]
    fn parallel_rays_are_those_of_mitsuba() {
        // Forward is +X, up +Z, so that left is +Y.
        let axes = [DVec3::Y, DVec3::Z, DVec3::X].map(|a| a.extend(0.0));
        let sensor = Sensor {
            world_from_camera: DMat4::from_cols(axes[0], axes[1], axes[2], dvec3(-5.0, 0.5, 3.0).extend(1.0)),
            ..sensor(Projection::Orthographic { half_width: 1.5, half_height: 1.2 })
        };
        let film = film();
        let ray = Camera::new(&sensor, &film).ray(0.0, 0.0, 1e9);
        assert_eq!((ray.segment.p, ray.segment.q), (dvec3(-2.0, 2.0, 4.2), dvec3(4.0, 2.0, 4.2)));
        assert_eq!((ray.direction, ray.origin), (DVec3::X, dvec3(-5.0, 2.0, 4.2)));
        let camera = Camera::new(&sensor, &film);
        assert_eq!(camera.distance(dvec3(1.0, 7.0, 7.0)), 6.0);
        assert_eq!(camera.ray(150.0, 30.0, 1e9).origin, dvec3(-5.0, 0.5 - 0.75, 3.6));
    }
}
