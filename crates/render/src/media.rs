//! Homogeneous media along a segment: which medium where, transmittance, free flight, strata.
//!
//! Medium boundaries never block; they only change the medium. A segment is cut at the boundaries it crosses into intervals of
//! one medium each, found exactly (see [`crate::geometry`]). At a crossing the medium becomes the boundary's exterior if the
//! segment leaves along the normal, else its interior. Where several boundaries are crossed at one place, exits come before
//! entries, so that two media that touch need no reference to each other; places closer than the rounding of a hit are one.
//! A boundary that is entered and left at one place is only touched there, or so thin that it does not count: the medium stays what it was.

use std::ops::ControlFlow;

use glam::DVec3;
use smallvec::SmallVec;

use crate::{
    Triangle,
    geometry::{Bvh, Segment},
    scene::{Boundary, Medium, MediumId},
};

/// The media of a scene and their boundaries, prepared for walks along segments.
#[derive(Debug)]
pub struct Media {
    media: Vec<Medium>,
    /// Interior and exterior of each boundary.
    sides: Vec<[Option<MediumId>; 2]>,
    /// Where each boundary is.
    bounds: Vec<Bounds>,
    /// The only boundary, if that is a shut box in vacuum: who leaves it never meets a medium again.
    only: Option<(DVec3, DVec3)>,
    /// Over the triangles of all boundaries.
    bvh: Bvh,
    /// For each of these triangles: the boundary it belongs to and its normal (of any length).
    faces: Vec<(usize, DVec3)>,
    /// Crossings closer than this are at one place, in world units: 2⁻⁴⁰ of the largest coordinate, far more than the rounding of `t`
    /// and far less than the step of single precision there.
    one_place: f64,
}

/// Where a boundary is, and what that says without a look at its triangles.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    min: DVec3,
    max: DVec3,
    /// Whether all of it lies in the faces of its bounds, so that inside them nothing of it is met.
    hollow: bool,
    /// Whether it is just the faces of its bounds, two triangles each, all of one orientation.
    shut: bool,
}

impl Bounds {
    fn of(triangles: &[Triangle]) -> Self {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for v in triangles.iter().flat_map(Triangle::vertices_f64) {
            min = min.min(v);
            max = max.max(v);
        }
        // A triangle lies in a face of the bounds if its vertices share an extreme coordinate.
        let in_a_face = |t: &Triangle| {
            let [a, b, c] = t.vertices_f64();
            (0..3).any(|k| a[k] == b[k] && b[k] == c[k] && (a[k] == min[k] || a[k] == max[k]))
        };
        Self { min, max, hollow: triangles.iter().all(in_a_face), shut: is_shut_box(triangles, min, max) }
    }

    /// True only if the segment starts inside the box and ends outside. Then it meets the boundary, and where it does it leaves: all faces
    /// there have their normals on the same side of it, so that it is more than a touch.
    #[inline]
    fn is_left(&self, segment: &Segment) -> bool {
        let Segment { p, q } = *segment;
        self.shut
            && p.cmpgt(self.min).all()
            && p.cmplt(self.max).all()
            && (q.cmplt(self.min).any() || q.cmpgt(self.max).any())
    }
}

/// True if the triangles are the six faces of the box, each cut along a diagonal, with all normals outwards or all inwards.
fn is_shut_box(triangles: &[Triangle], min: DVec3, max: DVec3) -> bool {
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

/// A part of a segment inside one medium (or in vacuum).
#[derive(Clone, Copy, Debug)]
struct Interval {
    medium: Option<MediumId>,
    t0: f64,
    t1: f64,
}

/// What a free flight along a segment comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Flight {
    /// A collision at parameter `t` in `medium`.
    Collision {
        /// Parameter along the segment.
        t: f64,
        /// The medium there.
        medium: MediumId,
    },
    /// The end was reached, in this medium.
    Passed(Option<MediumId>),
}

impl Media {
    /// Prepares media and boundaries.
    #[must_use]
    pub fn new(media: &[Medium], boundaries: &[Boundary]) -> Self {
        let bounds: Vec<_> = boundaries.iter().map(|b| Bounds::of(&b.triangles)).collect();
        let only = match (boundaries, bounds.as_slice()) {
            ([Boundary { exterior: None, .. }], [Bounds { min, max, shut: true, .. }]) => Some((*min, *max)),
            _ => None,
        };
        let triangles: Vec<_> = boundaries.iter().flat_map(|b| b.triangles.iter().copied()).collect();
        let bvh = Bvh::new(&triangles);
        let largest = bvh.bounds().map_or(0.0, |(min, max)| min.abs().max(max.abs()).max_element());
        let faces =
            boundaries.iter().enumerate().flat_map(|(i, b)| b.triangles.iter().map(move |t| (i, t.area_normal())));
        Self {
            media: media.to_vec(),
            sides: boundaries.iter().map(|b| [b.interior, b.exterior]).collect(),
            bounds,
            only,
            bvh,
            faces: faces.collect(),
            one_place: largest / (1_u64 << 40) as f64,
        }
    }

    /// The medium with this number.
    #[inline]
    #[must_use]
    pub fn medium(&self, id: MediumId) -> &Medium {
        &self.media[id.0 as usize]
    }

    /// exp(−∫σ_t) along the segment, which starts in medium `start` [Houska2013, Sec. 2.1].
    #[inline]
    #[must_use]
    pub fn transmittance(&self, segment: &Segment, start: Option<MediumId>) -> f64 {
        (-self.optical_depth(segment, start)).exp()
    }

    /// ∫σ_t along the segment.
    #[inline]
    #[must_use]
    pub fn optical_depth(&self, segment: &Segment, start: Option<MediumId>) -> f64 {
        let length = segment.length();
        let mut tau = 0.0;
        let _ = self.walk(segment, start, |i| {
            tau += self.depth_of(&i, length);
            ControlFlow::<()>::Continue(())
        });
        tau
    }

    /// The free flight to optical depth `tau` along the segment: a collision where the depth is reached, if it is.
    #[inline]
    #[must_use]
    pub fn fly(&self, segment: &Segment, start: Option<MediumId>, tau: f64) -> Flight {
        let length = segment.length();
        let mut flying = Flying { left: tau, last: start };
        match self.walk(segment, start, |i| flying.through(self, &i, length)) {
            ControlFlow::Break(flight) => flight,
            ControlFlow::Continue(()) => Flight::Passed(flying.last),
        }
    }

    /// The way along the segment, for many flights: its boundaries are looked for once.
    #[inline]
    #[must_use]
    pub fn way(&self, segment: &Segment, start: Option<MediumId>) -> Way<'_> {
        let mut intervals = SmallVec::new();
        let _ = self.walk(segment, start, |i| {
            intervals.push(i);
            ControlFlow::<()>::Continue(())
        });
        Way { media: self, length: segment.length(), start, intervals }
    }

    /// The way of a free flight to optical depth `tau` that starts in `medium`, if it ends in this medium before the segment does and meets
    /// no boundary; found without a look at what lies beyond. `None` says nothing.
    #[inline]
    #[must_use]
    pub fn short_flight(&self, segment: &Segment, medium: MediumId, tau: f64) -> Option<Segment> {
        let t = tau / (self.medium(medium).sigma_t * segment.length());
        // No extinction or no length gives infinity or NaN.
        if t >= 1.0 || t.is_nan() {
            return None;
        }
        let flight = Segment::new(segment.p, segment.at(t));
        if self.bounds.iter().any(|b| b.is_left(&flight)) {
            return None;
        }
        (self.crosses_nothing(&flight) || self.crossings(&flight).is_empty()).then_some(flight)
    }

    /// True only if a flight to optical depth `tau`, if no surface stops it, does not collide: it starts in `medium`, leaves it where it is
    /// shorter than that, and nothing comes behind. False says nothing.
    ///
    /// The segment must start in `medium`. *Why it is what [`Media::fly`] finds:* the boundary is one box, which is convex, with vacuum around it; where the flight
    /// would end in an endless medium lies outside of it by more than a place, and so by far more than all rounding of
    /// `fly`: 2⁻⁴⁰ of the largest coordinate beside some 2⁻⁴⁹.
    #[inline]
    #[must_use]
    pub fn leaves_for_good(&self, segment: &Segment, medium: MediumId, tau: f64) -> bool {
        let Some((min, max)) = self.only else { return false };
        let t = tau / (self.medium(medium).sigma_t * segment.length());
        // NaN, too, becomes 1.
        let q = segment.at(t.min(1.0));
        let p = segment.p;
        p.cmpgt(min).all()
            && p.cmplt(max).all()
            && (q.cmplt(min - self.one_place).any() || q.cmpgt(max + self.one_place).any())
    }

    #[inline]
    fn depth_of(&self, i: &Interval, length: f64) -> f64 {
        i.medium.map_or(0.0, |m| self.medium(m).sigma_t * ((i.t1 - i.t0) * length))
    }

    /// Visits the intervals of the segment in order, until the visitor breaks.
    #[inline]
    fn walk<B>(
        &self,
        segment: &Segment,
        start: Option<MediumId>,
        mut visit: impl FnMut(Interval) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        if self.crosses_nothing(segment) {
            return visit(Interval { medium: start, t0: 0.0, t1: 1.0 });
        }
        let (mut medium, mut t0) = (start, 0.0);
        for crossing in self.crossings(segment) {
            visit(Interval { medium, t0, t1: crossing.t })?;
            let [interior, exterior] = self.sides[crossing.boundary];
            medium = if crossing.enters { interior } else { exterior };
            t0 = crossing.t;
        }
        visit(Interval { medium, t0, t1: 1.0 })
    }

    /// True only if no boundary is met: the cheap proof for the usual case of a path inside one box of fog.
    #[inline]
    fn crosses_nothing(&self, segment: &Segment) -> bool {
        let (low, high) = (segment.p.min(segment.q), segment.p.max(segment.q));
        self.bounds.iter().all(|b| {
            (b.hollow && low.cmpgt(b.min).all() && high.cmplt(b.max).all())
                || low.cmpgt(b.max).any()
                || high.cmplt(b.min).any()
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
        let one_place = self.one_place / d.length();
        for place in crossings.chunk_by_mut(|a, b| b.t - a.t <= one_place) {
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

/// The intervals of a segment; see [`Media::way`].
#[derive(Debug)]
pub struct Way<'a> {
    media: &'a Media,
    length: f64,
    start: Option<MediumId>,
    intervals: SmallVec<[Interval; 4]>,
}

impl Way<'_> {
    /// As [`Media::optical_depth`].
    #[inline]
    #[must_use]
    pub fn optical_depth(&self) -> f64 {
        self.intervals.iter().fold(0.0, |tau, i| tau + self.media.depth_of(i, self.length))
    }

    /// As [`Media::fly`].
    #[inline]
    #[must_use]
    pub fn fly(&self, tau: f64) -> Flight {
        let mut flying = Flying { left: tau, last: self.start };
        match self.intervals.iter().try_for_each(|i| flying.through(self.media, i, self.length)) {
            ControlFlow::Break(flight) => flight,
            ControlFlow::Continue(()) => Flight::Passed(flying.last),
        }
    }

    /// The medium at the end.
    #[inline]
    #[must_use]
    pub fn end(&self) -> Option<MediumId> {
        self.intervals.last().map_or(self.start, |i| i.medium)
    }
}

/// A free flight under way.
#[derive(Clone, Copy, Debug)]
struct Flying {
    /// Optical depth that is left to fly.
    left: f64,
    /// The medium of the last interval.
    last: Option<MediumId>,
}

impl Flying {
    #[inline]
    fn through(&mut self, media: &Media, i: &Interval, length: f64) -> ControlFlow<Flight> {
        self.last = i.medium;
        let depth = media.depth_of(i, length);
        if let Some(medium) = i.medium
            && self.left < depth
        {
            let t = i.t0 + self.left / (media.medium(medium).sigma_t * length);
            return ControlFlow::Break(Flight::Collision { t: t.min(i.t1), medium });
        }
        self.left -= depth;
        ControlFlow::Continue(())
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

#[cfg(test)]
mod tests;
