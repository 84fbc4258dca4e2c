//! Traps: scenes that are legal in Mitsuba but whose fog is not where the author thinks.

use std::collections::HashMap;

use glam::{DVec3, Vec3};
use vdf_geometry::Triangle;

use super::Loader;
use super::document::Place;
use crate::SceneError;
use crate::{Boundary, MediumId, PerspectiveSensor};

/// At most this many points of a boundary are tested against another one.
const MAX_PROBES: usize = 16;

/// A boundary that separates an inside from an outside.
struct Closed<'a> {
    triangles: &'a [Triangle],
    at: &'a Place,
    /// The medium inside, whichever way the normals point.
    inner: Option<MediumId>,
    outer: Option<MediumId>,
    volume: f64,
    low: DVec3,
    high: DVec3,
}

/// The medium that the sensor and each boundary claim to be in must be the one around them.
pub(super) fn media_are_consistent(
    loader: &Loader<'_>,
    sensor: &PerspectiveSensor,
    sensor_at: &Place,
    constant_at: Option<&Place>,
) -> Result<(), SceneError> {
    let mut closed = Vec::new();
    for (boundary, at) in loader.boundaries.iter().zip(&loader.boundary_places) {
        match Closed::new(boundary, at) {
            Some(c) => closed.push(c),
            None => loader.warn(at, "the medium boundary is not a closed surface with consistent normals: where its medium ends is not checked"),
        }
    }
    let camera = sensor.world_from_camera.w_axis.truncate();
    let around_camera = innermost(closed.iter().filter(|c| c.winding(camera).abs() > 0.5));
    if let Some(around) = around_camera {
        if around.inner != sensor.medium {
            let (message, help) = match (around.inner, sensor.medium) {
                (Some(_), None) => (
                    format!(
                        "the camera is inside the medium of the shape at {}, but the sensor has no medium",
                        around.at
                    ),
                    "put a <ref id=\"…\"/> to that medium into the sensor".to_owned(),
                ),
                _ => (
                    "the sensor's medium is not the one that is around the camera".to_owned(),
                    format!("the camera is inside the shape at {}: give the sensor that shape's medium", around.at),
                ),
            };
            return Err(sensor_at.error(message, help));
        }
    } else if let (Some(_), Some(constant_at)) = (sensor.medium, constant_at) {
        return Err(constant_at.error(
            "unbounded fog together with an infinite emitter: no light comes through an infinite medium",
            format!("put a closed null shape with the medium as interior around the camera (sensor at {sensor_at}), or use point or area emitters"),
        ));
    }
    let everywhere = if around_camera.is_none() { sensor.medium } else { None };
    for (index, boundary) in closed.iter().enumerate() {
        let others = closed.iter().enumerate().filter(|(i, _)| *i != index).map(|(_, c)| c);
        let around = innermost(others.filter(|c| c.encloses(boundary)));
        let surrounding = around.map_or(everywhere, |c| c.inner);
        if boundary.outer.is_none() && surrounding.is_some() {
            let place = around.map_or(sensor_at, |c| c.at);
            return Err(boundary.at.error(
                "the medium outside this boundary is missing: the fog around it would vanish behind it",
                format!("the fog around it comes from {place}: refer to it here as the outer side too, with name=\"exterior\" (or \"interior\" if the normals point inward)"),
            ));
        }
    }
    Ok(())
}

fn innermost<'b, 'a: 'b>(boundaries: impl Iterator<Item = &'b Closed<'a>>) -> Option<&'b Closed<'a>> {
    boundaries.min_by(|a, b| a.volume.total_cmp(&b.volume))
}

impl<'a> Closed<'a> {
    fn new(boundary: &'a Boundary, at: &'a Place) -> Option<Self> {
        if !is_closed(&boundary.triangles) {
            return None;
        }
        let vertices = || boundary.triangles.iter().flat_map(Triangle::vertices_f64);
        let low = vertices().fold(DVec3::INFINITY, DVec3::min);
        let high = vertices().fold(DVec3::NEG_INFINITY, DVec3::max);
        // Sum of the signed tetrahedra; the sign tells which way the normals point.
        let centre = (low + high) / 2.0;
        let volume: f64 =
            boundary.triangles.iter().map(|t| t.area_normal().dot(t.vertices_f64()[0] - centre) / 6.0).sum();
        let (inner, outer) =
            if volume >= 0.0 { (boundary.interior, boundary.exterior) } else { (boundary.exterior, boundary.interior) };
        Some(Self { triangles: &boundary.triangles, at, inner, outer, volume: volume.abs(), low, high })
    }

    /// How often the surface winds around `p`: ±1 inside, 0 outside, the sum of the solid angles over 4π. Unlike the
    /// parity of the crossings of a ray it has no unlucky direction.
    fn winding(&self, p: DVec3) -> f64 {
        if p.cmplt(self.low).any() || p.cmpgt(self.high).any() {
            return 0.0;
        }
        let total: f64 = self.triangles.iter().map(|t| half_solid_angle(t.vertices_f64().map(|v| v - p))).sum();
        total / (2.0 * std::f64::consts::PI)
    }

    /// True if `other` lies inside. Points on the surface itself, where two boundaries touch, decide nothing.
    fn encloses(&self, other: &Self) -> bool {
        if other.volume >= self.volume {
            return false;
        }
        let step = other.triangles.len().div_ceil(MAX_PROBES).max(1);
        let mut inside = false;
        for triangle in other.triangles.iter().step_by(step) {
            let [a, b, c] = triangle.vertices_f64();
            let winding = self.winding((a + b + c) / 3.0).abs();
            if winding < 0.25 {
                return false;
            }
            inside |= winding > 0.75;
        }
        inside
    }
}

/// Half the signed solid angle of a triangle seen from the origin (van Oosterom and Strackee 1983).
fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    a.dot(b.cross(c)).atan2(denominator)
}

/// True if each edge is used as often one way as the other, so that the surface has no border.
fn is_closed(triangles: &[Triangle]) -> bool {
    // −0 and 0 are one place.
    let key = |v: Vec3| (v + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut balance: HashMap<_, i64> = HashMap::new();
    for triangle in triangles {
        let [a, b, c] = triangle.vertices.map(key);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from < to {
                *balance.entry((from, to)).or_default() += 1;
            } else if to < from {
                *balance.entry((to, from)).or_default() -= 1;
            }
        }
    }
    balance.values().all(|&n| n == 0)
}
