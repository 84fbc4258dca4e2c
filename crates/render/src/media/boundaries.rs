//! Medium boundaries: where a segment crosses them, and what medium lies between.
//!
//! Boundaries never block; they only change the medium. A segment is cut at the boundaries that it crosses, which are found exactly
//! (`vdf-geometry`). At a crossing the medium becomes the boundary's exterior if the segment leaves along the normal, else its interior.
//! Where several boundaries are crossed at one place, exits come before entries, so that two media that touch need no reference to each
//! other; crossings closer than the rounding of a hit are at one place. A boundary that is entered and left at one place is only touched
//! there, or so thin that it does not count: the medium stays what it was.

use std::ops::ControlFlow;

use glam::DVec3;
use smallvec::SmallVec;
use vdf_geometry::{Bounds, Bvh, Segment, Triangle};
use vdf_scene::{Boundary, MediumId};

use super::MediumInterval;

/// The boundaries of a scene, prepared for walks along segments.
#[derive(Debug)]
pub(super) struct Boundaries {
    /// Interior and exterior of each boundary.
    sides: Vec<[Option<MediumId>; 2]>,
    /// Where each boundary is.
    extents: Vec<Extent>,
    /// The only boundary, if that is a closed box in vacuum: a ray that leaves it meets no medium again.
    only: Option<Bounds>,
    /// Over the triangles of all boundaries.
    bvh: Bvh,
    /// For each of these triangles: the boundary it belongs to and its normal (of any length).
    faces: Vec<(usize, DVec3)>,
    /// Crossings closer than this are at one place, in world units: 2⁻⁴⁰ of the largest coordinate, far more than the rounding of `t`
    /// and far less than the step of single precision there.
    crossing_tolerance: f64,
}

/// Where a boundary is, and what that says without a look at its triangles.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    bounds: Bounds,
    /// Whether all of it lies in the faces of its bounds, so that inside them nothing of it is met.
    pub(super) shell: bool,
    /// Whether it is just the faces of its bounds, two triangles each, all of one orientation.
    pub(super) closed_box: bool,
}

impl Extent {
    pub(super) fn of(triangles: &[Triangle]) -> Self {
        let bounds = Bounds::of_triangles(triangles);
        let Bounds { min, max } = bounds;
        // A triangle lies in a face of the bounds if its vertices share an extreme coordinate.
        let in_a_face = |t: &Triangle| {
            let [a, b, c] = t.vertices_f64();
            (0..3).any(|k| a[k] == b[k] && b[k] == c[k] && (a[k] == min[k] || a[k] == max[k]))
        };
        Self { bounds, shell: triangles.iter().all(in_a_face), closed_box: is_closed_box(triangles, bounds) }
    }

    /// True only if the segment starts inside the box and ends outside. Then it meets the boundary, and where it does it leaves: all faces
    /// there have their normals on the same side of it, so that it is more than a touch.
    #[inline]
    pub(super) fn is_left(&self, segment: &Segment) -> bool {
        let (Segment { p, q }, Bounds { min, max }) = (*segment, self.bounds);
        self.closed_box && p.cmpgt(min).all() && p.cmplt(max).all() && (q.cmplt(min).any() || q.cmpgt(max).any())
    }
}

/// True if the triangles are the six faces of the box, each cut along a diagonal, with all normals outwards or all inwards.
fn is_closed_box(triangles: &[Triangle], Bounds { min, max }: Bounds) -> bool {
    let mut covered = [[0_u32; 2]; 6];
    let mut outwards = 0;
    for t in triangles {
        let vertices = t.vertices_f64();
        let corner = |v: DVec3| {
            let is_max = v.cmpeq(max).bitmask() as usize;
            (is_max | v.cmpeq(min).bitmask() as usize == 7).then_some(is_max)
        };
        let [Some(a), Some(b), Some(c)] = vertices.map(corner) else { return false };
        let (fixed_low, fixed_high) = (!(a | b | c) & 7, a & b & c);
        // Three corners of one face have just one coordinate in common.
        let (fixed, high) = (fixed_low | fixed_high, usize::from(fixed_high != 0));
        let area = t.area_normal();
        let axis = match fixed {
            1 => 0,
            2 => 1,
            4 => 2,
            _ => return false,
        };
        if area[axis] == 0.0 {
            return false;
        }
        outwards += usize::from((area[axis] > 0.0) == (high == 1));
        // The corner that a triangle leaves out; the other triangle of its face leaves out the opposite one.
        let left_out = a ^ b ^ c;
        let Some(slot) = covered[2 * axis + high].iter_mut().find(|slot| **slot == 0) else { return false };
        *slot = 1 + left_out as u32;
        let [first, second] = covered[2 * axis + high];
        if second != 0 && (first - 1) ^ (second - 1) != (7 & !fixed) as u32 {
            return false;
        }
    }
    triangles.len() == 12 && min.cmplt(max).all() && (outwards == 0 || outwards == 12)
}

impl Boundaries {
    pub(super) fn new(boundaries: &[Boundary]) -> Self {
        let extents: Vec<_> = boundaries.iter().map(|b| Extent::of(&b.triangles)).collect();
        let only = match (boundaries, extents.as_slice()) {
            ([Boundary { exterior: None, .. }], [Extent { bounds, closed_box: true, .. }]) => Some(*bounds),
            _ => None,
        };
        let triangles: Vec<_> = boundaries.iter().flat_map(|b| b.triangles.iter().copied()).collect();
        let bvh = Bvh::new(&triangles);
        let crossing_tolerance = bvh.bounds().largest_coordinate() / (1_u64 << 40) as f64;
        let faces =
            boundaries.iter().enumerate().flat_map(|(i, b)| b.triangles.iter().map(move |t| (i, t.area_normal())));
        Self {
            sides: boundaries.iter().map(|b| [b.interior, b.exterior]).collect(),
            extents,
            only,
            faces: faces.collect(),
            bvh,
            crossing_tolerance,
        }
    }

    #[cfg(test)]
    pub(super) fn extent(&self, boundary: usize) -> &Extent {
        &self.extents[boundary]
    }

    #[cfg(test)]
    pub(super) fn is_one_box(&self) -> bool {
        self.only.is_some()
    }

    /// True if the segment crosses no boundary, so that it stays in the medium in which it starts.
    #[inline]
    pub(super) fn are_not_crossed(&self, segment: &Segment) -> bool {
        !self.extents.iter().any(|e| e.is_left(segment))
            && (self.crosses_nothing(segment) || self.crossings(segment).is_empty())
    }

    /// True only if a segment from `p` to `q` starts in the only boundary, a closed box in vacuum, and ends outside of it by more than
    /// the crossing tolerance. False says nothing.
    #[inline]
    pub(super) fn are_left_for_good(&self, p: DVec3, q: DVec3) -> bool {
        let Some(Bounds { min, max }) = self.only else { return false };
        p.cmpgt(min).all()
            && p.cmplt(max).all()
            && (q.cmplt(min - self.crossing_tolerance).any() || q.cmpgt(max + self.crossing_tolerance).any())
    }

    /// Visits the intervals of the segment in order, until the visitor breaks.
    #[inline]
    pub(super) fn walk<B>(
        &self,
        segment: &Segment,
        start: Option<MediumId>,
        mut visit: impl FnMut(MediumInterval) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        if self.crosses_nothing(segment) {
            return visit(MediumInterval { medium: start, t0: 0.0, t1: 1.0 });
        }
        let (mut medium, mut t0) = (start, 0.0);
        for crossing in self.crossings(segment) {
            visit(MediumInterval { medium, t0, t1: crossing.t })?;
            let [interior, exterior] = self.sides[crossing.boundary];
            medium = if crossing.enters { interior } else { exterior };
            t0 = crossing.t;
        }
        visit(MediumInterval { medium, t0, t1: 1.0 })
    }

    /// True only if no boundary is met: the cheap proof for the usual case of a path inside one box of fog.
    #[inline]
    pub(super) fn crosses_nothing(&self, segment: &Segment) -> bool {
        let (low, high) = (segment.p.min(segment.q), segment.p.max(segment.q));
        self.extents.iter().all(|e| {
            let Bounds { min, max } = e.bounds;
            (e.shell && low.cmpgt(min).all() && high.cmplt(max).all()) || low.cmpgt(max).any() || high.cmplt(min).any()
        })
    }

    /// All crossings in the order in which they take effect.
    fn crossings(&self, segment: &Segment) -> Crossings {
        let d = segment.q - segment.p;
        let mut crossings = Crossings::new();
        self.bvh.visit_hits(segment, |hit| {
            let (boundary, normal) = self.faces[hit.triangle as usize];
            crossings.push(Crossing { t: hit.t, enters: normal.dot(d) < 0.0, boundary, touched: false });
        });
        crossings.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.boundary.cmp(&b.boundary)));
        let tolerance = self.crossing_tolerance / d.length();
        for place in crossings.chunk_by_mut(|a, b| b.t - a.t <= tolerance) {
            // Within a place the order is what counts; a common `t` keeps the intervals in order.
            let t = place[0].t;
            place.sort_unstable_by_key(|c| (c.boundary, c.enters));
            for of_one in place.chunk_by_mut(|a, b| a.boundary == b.boundary) {
                let touched = of_one.first().map(|c| c.enters) != of_one.last().map(|c| c.enters);
                of_one.iter_mut().for_each(|c| (c.t, c.touched) = (t, touched));
            }
            place.sort_unstable_by_key(|c| (c.enters, c.boundary));
        }
        crossings.retain(|c| !c.touched);
        crossings
    }
}

/// Where a segment crosses a boundary. Two triangles of one boundary that are met on their common edge give two crossings of the same
/// effect, which is that of one.
#[derive(Clone, Copy, Debug)]
struct Crossing {
    t: f64,
    enters: bool,
    boundary: usize,
    /// Whether its boundary is both entered and left at this place.
    touched: bool,
}

/// On the stack for all but pathological segments: no allocation in the loops of the integrators.
type Crossings = SmallVec<[Crossing; 16]>;
