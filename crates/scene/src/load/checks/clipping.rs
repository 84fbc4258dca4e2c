//! What the clip planes of the camera cut away.

use glam::DVec3;
use vdf_geometry::{Bounds, CurvedShape, Segment, Triangle, intersect_exact};

use super::super::Loader;
use super::super::document::Place;
use crate::{FilmSettings, Sensor};

/// Rays along each side of the picture that are followed from the camera to the near plane.
const RAYS: u32 = 5;

/// Warns if a medium boundary is between the camera and the near plane, or nothing is between the clip planes.
pub(super) fn warn(loader: &Loader<'_>, sensor: &Sensor, film: &FilmSettings, at: &Place) {
    nothing_to_see(loader, sensor, at);
    let aspect = f64::from(film.width) / f64::from(film.height);
    let rays: Vec<_> = (0..RAYS * RAYS)
        .map(|i| {
            // Not quite to the border: a boundary may begin just where the picture ends.
            let along = |i: u32| (f64::from(i) + 0.5) / f64::from(RAYS) * 2.0 - 1.0;
            let (start, slope) = sensor.ray(along(i % RAYS), along(i / RAYS), aspect);
            let [start, near] =
                [start, start + slope * sensor.near_clip].map(|p| sensor.world_from_camera.transform_point3(p));
            Segment::new(start, near)
        })
        .collect();
    let reach = Bounds::of_points(rays.iter().flat_map(|ray| [ray.p, ray.q]));
    let jumped = loader.boundaries.iter().zip(&loader.boundary_elements).find(|(boundary, _)| {
        let near = |t: &&Triangle| Bounds::of_triangles([*t]).touches(&reach);
        let is_sphere_met = boundary.curved.is_some_and(|c| rays.iter().any(|ray| c.meets(ray)));
        is_sphere_met
            || boundary.triangles.iter().filter(near).any(|t| rays.iter().any(|ray| intersect_exact(ray, t).is_some()))
    });
    if let Some((_, element)) = jumped {
        loader.warn(
            at,
            &format!(
                "near_clip {} jumps over the medium boundary at {}: rays begin behind it, in the medium of the sensor; make near_clip smaller",
                sensor.near_clip, element.at
            ),
        );
    }
}

fn nothing_to_see(loader: &Loader<'_>, sensor: &Sensor, at: &Place) {
    let all = || {
        let surfaces = loader.surfaces.iter().map(|s| (&s.triangles, s.curved));
        surfaces.chain(loader.boundaries.iter().map(|b| (&b.triangles, b.curved)))
    };
    let shapes = || all().filter(|(triangles, curved)| !triangles.is_empty() || curved.is_some());
    let (camera, forward) = (sensor.world_from_camera.w_axis.truncate(), sensor.world_from_camera.z_axis.truncate());
    let is_seen = |(triangles, curved): (&Vec<Triangle>, Option<CurvedShape>)| {
        let corners = curved.map(|c| {
            let Bounds { min, max } = *c.bounds();
            (0..8).map(move |i| DVec3::select(glam::BVec3::new(i & 1 == 0, i & 2 == 0, i & 4 == 0), min, max))
        });
        let vertices = triangles.iter().flat_map(Triangle::vertices_f64);
        let depths = vertices.chain(corners.into_iter().flatten()).map(|v| (v - camera).dot(forward));
        let (low, high) = depths.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), d| (low.min(d), high.max(d)));
        high >= sensor.near_clip && low <= sensor.far_clip
    };
    if shapes().next().is_some() && !shapes().any(is_seen) {
        let message = format!(
            "nothing of the scene lies between near_clip ({}) and far_clip ({}) in front of the camera",
            sensor.near_clip, sensor.far_clip
        );
        loader.warn(at, &message);
    }
}
