//! A medium boundary that separates an inside from an outside.

use std::borrow::Cow;

use glam::DVec3;
use robust::{Coord3D, orient3d};
use vdf_geometry::{Bounds, CurvedShape, Triangle};

use super::super::document::Element;
use crate::{Boundary, MediumId};

/// At most this many points of a boundary are tested against another one.
const MAX_PROBES: usize = 16;
/// Points along each axis of the box in which two boundaries may overlap.
const GRID: u32 = 4;
/// So many pairs of an edge and a face are looked at for two boundaries, some milliseconds.
const MOST_PAIRS: usize = 1_000_000;
/// What reaches through a face by less than this share of the larger boundary only touches it: single precision has moved it.
const TOUCHING: f64 = 1e-5;

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
    /// Of a sphere some that lie near it: places to look at, no more.
    triangles: Cow<'a, [Triangle]>,
    sphere: Option<CurvedShape>,
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
        if let Some(sphere) = boundary.curved {
            let (inner, outer) = (boundary.interior, boundary.exterior);
            let volume = sphere.placement().0.determinant().abs() * (4.0 / 3.0 * std::f64::consts::PI);
            let triangles = Cow::Owned(near_sphere(&sphere));
            let bounds = *sphere.bounds();
            return Self { triangles, sphere: Some(sphere), element, inner, outer, volume, is_inverted: false, bounds };
        }
        let bounds = Bounds::of_triangles(&boundary.triangles);
        // Sum of the signed tetrahedra; the sign tells which way the normals point.
        let centre = (bounds.min + bounds.max) / 2.0;
        let volume: f64 =
            boundary.triangles.iter().map(|t| t.area_normal().dot(t.vertices_f64()[0] - centre) / 6.0).sum();
        let is_inverted = volume < 0.0;
        let (inner, outer) =
            if is_inverted { (boundary.exterior, boundary.interior) } else { (boundary.interior, boundary.exterior) };
        let triangles = Cow::Borrowed(boundary.triangles.as_slice());
        Self { triangles, sphere: None, element, inner, outer, volume: volume.abs(), is_inverted, bounds }
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
        if let Some(sphere) = &self.sphere {
            return if sphere.side(p).is_lt() { 1.0 } else { 0.0 };
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

    /// True if a part of each is inside the other, and a part of each is not; `None` if the work is used up. A grid of points shows it where much is
    /// shared. Where that shows nothing, an edge of one that goes through a face of the other does, if there are no more than
    /// [`MOST_PAIRS`] of edges and faces where their boxes overlap. What overlaps by less than rounding only touches.
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
            // A point on a surface, where the winding is a half, is neither in nor out.
            let (of_mine, of_theirs) = (self.winding(p).abs(), other.winding(p).abs());
            shared |= of_mine > 0.75 && of_theirs > 0.75;
            mine |= of_mine > 0.75 && of_theirs < 0.25;
            theirs |= of_mine < 0.25 && of_theirs > 0.75;
            if shared && mine && theirs {
                return Some(true);
            }
        }
        self.pierces(other, low, high, work)
    }

    /// True if an edge of one goes through a face of the other between these corners.
    fn pierces(&self, other: &Self, low: DVec3, high: DVec3, work: &mut Work) -> Option<bool> {
        let within = |corners: &[DVec3]| {
            let bounds = Bounds::of_points(corners.iter().copied());
            bounds.min.cmple(high).all() && bounds.max.cmpge(low).all()
        };
        let faces = |closed: &Self| -> Vec<[DVec3; 3]> {
            closed.triangles.iter().map(Triangle::vertices_f64).filter(|face| within(face)).collect()
        };
        let edges = |faces: &[[DVec3; 3]]| -> Vec<[DVec3; 2]> {
            // Each edge has two faces and comes once from each, the other way round.
            let of_face = |&[a, b, c]: &[DVec3; 3]| [[a, b], [b, c], [c, a]];
            let is_first = |[a, b]: &[DVec3; 2]| a.to_array() < b.to_array();
            faces.iter().flat_map(of_face).filter(|edge| is_first(edge) && within(edge)).collect()
        };
        let (mine, theirs) = (faces(self), faces(other));
        let (my_edges, their_edges) = (edges(&mine), edges(&theirs));
        let pairs = my_edges.len() * theirs.len() + their_edges.len() * mine.len();
        if pairs > MOST_PAIRS {
            return Some(false);
        }
        if !work.spend(pairs) {
            return None;
        }
        let touching = TOUCHING * self.bounds.extent().max(other.bounds.extent()).max_element();
        let any = |edges: &[[DVec3; 2]], faces: &[[DVec3; 3]]| {
            edges.iter().any(|edge| faces.iter().any(|face| goes_through(edge, face, touching)))
        };
        Some(any(&my_edges, &theirs) || any(&their_edges, &mine))
    }

    fn reaches_beyond(&self, low: DVec3, high: DVec3) -> bool {
        self.bounds.min.cmplt(low).any() || self.bounds.max.cmpgt(high).any()
    }
}

/// True if the edge has its ends on both sides of the face and meets it inside of its border, all that by more than `touching`.
fn goes_through(&[a, b]: &[DVec3; 2], &[p, q, r]: &[DVec3; 3], touching: f64) -> bool {
    let side = |p: DVec3, q: DVec3, r: DVec3, s: DVec3| {
        let coord = |v: DVec3| Coord3D { x: v.x, y: v.y, z: v.z };
        orient3d(coord(p), coord(q), coord(r), coord(s))
    };
    let (of_a, of_b) = (side(p, q, r, a), side(p, q, r, b));
    // Six times a volume: the height over twice the area.
    let least = touching * (q - p).cross(r - p).length();
    if of_a.abs().min(of_b.abs()) <= least || (of_a > 0.0) == (of_b > 0.0) {
        return false;
    }
    // The volume between two lines: their distance times the product of their directions.
    let around = [[p, q], [q, r], [r, p]].map(|[p, q]| (side(a, b, p, q), touching * (b - a).cross(q - p).length()));
    around.iter().all(|&(side, least)| side > least) || around.iter().all(|&(side, least)| side < -least)
}

/// An octahedron whose faces are divided twice, a little inside of the sphere.
fn near_sphere(sphere: &CurvedShape) -> Vec<Triangle> {
    let mut faces: Vec<[DVec3; 3]> = Vec::new();
    for signs in 0..8_u32 {
        let sign = |bit: u32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
        faces.push([DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)]);
    }
    for _ in 0..2 {
        let divided = |&[a, b, c]: &[DVec3; 3]| {
            let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
            [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
        };
        faces = faces.iter().flat_map(divided).collect();
    }
    let inside = 1.0 - TOUCHING;
    faces.iter().map(|f| Triangle { vertices: f.map(|p| sphere.to_world(p * inside).as_vec3()) }).collect()
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
