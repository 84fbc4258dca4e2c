//! A medium boundary that separates an inside from an outside.

use glam::DVec3;
use vdf_geometry::{Bounds, Triangle};

use super::super::document::Element;
use crate::{Boundary, MediumId};

/// At most this many points of a boundary are tested against another one.
const MAX_PROBES: usize = 16;
/// Points along each axis of the box in which two boundaries may overlap.
const GRID: u32 = 4;

/// How many triangles may still be looked at for the comparison of boundaries; some nanoseconds each.
#[derive(Debug)]
pub(super) struct Work {
    pub(super) left: u64,
}

impl Work {
    /// False if there is not enough left.
    fn spend(&mut self, triangles: usize) -> bool {
        let left = self.left.checked_sub(triangles as u64);
        self.left = left.unwrap_or(0);
        left.is_some()
    }
}

/// A closed boundary.
#[derive(Debug)]
pub(super) struct Closed<'a> {
    triangles: &'a [Triangle],
    pub(super) element: &'a Element,
    /// The medium inside, whichever way the normals point.
    pub(super) inner: Option<MediumId>,
    pub(super) outer: Option<MediumId>,
    pub(super) volume: f64,
    /// The normals point inward.
    pub(super) is_inverted: bool,
    pub(super) bounds: Bounds,
}

impl<'a> Closed<'a> {
    /// The boundary must be closed.
    pub(super) fn new(boundary: &'a Boundary, element: &'a Element) -> Self {
        let bounds = Bounds::of_triangles(&boundary.triangles);
        // Sum of the signed tetrahedra; the sign tells which way the normals point.
        let centre = (bounds.min + bounds.max) / 2.0;
        let volume: f64 =
            boundary.triangles.iter().map(|t| t.area_normal().dot(t.vertices_f64()[0] - centre) / 6.0).sum();
        let is_inverted = volume < 0.0;
        let (inner, outer) =
            if is_inverted { (boundary.exterior, boundary.interior) } else { (boundary.interior, boundary.exterior) };
        Self { triangles: &boundary.triangles, element, inner, outer, volume: volume.abs(), is_inverted, bounds }
    }

    /// `"fog" at scene.xml:3:1`, for messages.
    pub(super) fn name(&self) -> String {
        match self.element.attribute("id") {
            Some(id) => format!("\"{}\" at {}", id.value, self.element.at),
            None => format!("at {}", self.element.at),
        }
    }

    /// How often the surface winds around `p`: ±1 inside, 0 outside, the sum of the solid angles over 4π. Unlike the
    /// parity of the crossings of a ray it has no unlucky direction.
    pub(super) fn winding(&self, p: DVec3) -> f64 {
        if !self.bounds.contains(p) {
            return 0.0;
        }
        let total: f64 = self.triangles.iter().map(|t| half_solid_angle(t.vertices_f64().map(|v| v - p))).sum();
        total / (2.0 * std::f64::consts::PI)
    }

    /// A point of the surface.
    pub(super) fn a_point(&self) -> Option<DVec3> {
        self.triangles.first().map(centre)
    }

    /// True if `other` lies inside; `None` if the work is used up. Points on the surface itself, where two boundaries touch, decide nothing.
    pub(super) fn encloses(&self, other: &Self, work: &mut Work) -> Option<bool> {
        if other.volume >= self.volume {
            return Some(false);
        }
        let step = other.triangles.len().div_ceil(MAX_PROBES).max(1);
        let mut inside = false;
        for probe in other.triangles.iter().step_by(step).flat_map(probes) {
            if !work.spend(self.triangles.len()) {
                return None;
            }
            let winding = self.winding(probe).abs();
            if winding < 0.25 {
                return Some(false);
            }
            inside |= winding > 0.75;
        }
        Some(inside)
    }

    /// True if a part of each is inside the other, and a part of each is not, as far as a grid of points shows; `None` if the work is used up.
    pub(super) fn crosses(&self, other: &Self, work: &mut Work) -> Option<bool> {
        let (low, high) = (self.bounds.min.max(other.bounds.min), self.bounds.max.min(other.bounds.max));
        if !low.cmplt(high).all() {
            return Some(false);
        }
        let (mut shared, mut mine, mut theirs) =
            (false, self.reaches_beyond(low, high), other.reaches_beyond(low, high));
        for i in 0..GRID.pow(3) {
            if !work.spend(self.triangles.len() + other.triangles.len()) {
                return None;
            }
            let cell = DVec3::new(f64::from(i % GRID), f64::from(i / GRID % GRID), f64::from(i / GRID / GRID));
            let p = low + (high - low) * (cell + 0.5) / f64::from(GRID);
            match (self.winding(p).abs() > 0.5, other.winding(p).abs() > 0.5) {
                (true, true) => shared = true,
                (true, false) => mine = true,
                (false, true) => theirs = true,
                (false, false) => {}
            }
            if shared && mine && theirs {
                return Some(true);
            }
        }
        Some(false)
    }

    fn reaches_beyond(&self, low: DVec3, high: DVec3) -> bool {
        self.bounds.min.cmplt(low).any() || self.bounds.max.cmpgt(high).any()
    }
}

fn centre(triangle: &Triangle) -> DVec3 {
    let [a, b, c] = triangle.vertices_f64();
    (a + b + c) / 3.0
}

/// Points of a triangle: its centre, and close to its corners, but not on its border, where the winding of a touching surface is not defined.
fn probes(triangle: &Triangle) -> [DVec3; 4] {
    let middle = centre(triangle);
    let [a, b, c] = triangle.vertices_f64().map(|v| v.lerp(middle, 1.0 / 64.0));
    [middle, a, b, c]
}

/// Half the signed solid angle of a triangle seen from the origin (van Oosterom and Strackee 1983).
fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let denominator = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    a.dot(b.cross(c)).atan2(denominator)
}
