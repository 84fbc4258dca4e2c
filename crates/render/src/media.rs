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
    geometry::{Bvh, Segment},
    scene::{Boundary, Medium, MediumId},
};

/// The media of a scene and their boundaries, prepared for walks along segments.
#[derive(Debug)]
pub struct Media {
    media: Vec<Medium>,
    /// Interior and exterior of each boundary.
    sides: Vec<[Option<MediumId>; 2]>,
    /// For each boundary: its bounds, and whether it is an axis-aligned box, inside which nothing of it is met.
    bounds: Vec<(DVec3, DVec3, bool)>,
    /// Over the triangles of all boundaries.
    bvh: Bvh,
    /// For each of these triangles: the boundary it belongs to and its normal (of any length).
    faces: Vec<(usize, DVec3)>,
    /// Crossings closer than this are at one place, in world units: 2⁻⁴⁰ of the largest coordinate, far more than the rounding of `t`
    /// and far less than the step of single precision there.
    one_place: f64,
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
        let bounds = boundaries
            .iter()
            .map(|b| {
                let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
                for v in b.triangles.iter().flat_map(crate::Triangle::vertices_f64) {
                    min = min.min(v);
                    max = max.max(v);
                }
                // A triangle lies in a face of the bounds if its vertices share an extreme coordinate.
                let in_a_face = |t: &crate::Triangle| {
                    let [a, b, c] = t.vertices_f64();
                    (0..3).any(|k| a[k] == b[k] && b[k] == c[k] && (a[k] == min[k] || a[k] == max[k]))
                };
                (min, max, b.triangles.iter().all(in_a_face))
            })
            .collect();
        let triangles: Vec<_> = boundaries.iter().flat_map(|b| b.triangles.iter().copied()).collect();
        let bvh = Bvh::new(&triangles);
        let largest = bvh.bounds().map_or(0.0, |(min, max)| min.abs().max(max.abs()).max_element());
        let faces =
            boundaries.iter().enumerate().flat_map(|(i, b)| b.triangles.iter().map(move |t| (i, t.area_normal())));
        Self {
            media: media.to_vec(),
            sides: boundaries.iter().map(|b| [b.interior, b.exterior]).collect(),
            bounds,
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
        let mut left = tau;
        let mut last = start;
        let found = self.walk(segment, start, |i| {
            last = i.medium;
            let depth = self.depth_of(&i, length);
            if let Some(medium) = i.medium
                && left < depth
            {
                let t = i.t0 + left / (self.medium(medium).sigma_t * length);
                return ControlFlow::Break(Flight::Collision { t: t.min(i.t1), medium });
            }
            left -= depth;
            ControlFlow::Continue(())
        });
        match found {
            ControlFlow::Break(flight) => flight,
            ControlFlow::Continue(()) => Flight::Passed(last),
        }
    }

    /// The way of a free flight to optical depth `tau` that starts in `medium`, if it ends in this medium before the segment does and meets
    /// no boundary; found without a look at what lies beyond. `None` says nothing.
    #[inline]
    #[must_use]
    pub fn short_flight(&self, segment: &Segment, medium: MediumId, tau: f64) -> Option<Segment> {
        let t = tau / (self.medium(medium).sigma_t * segment.length());
        // NaN: no extinction, no length.
        if t.is_nan() || t >= 1.0 {
            return None;
        }
        let flight = Segment::new(segment.p, segment.at(t));
        (self.crosses_nothing(&flight) || self.crossings(&flight).is_empty()).then_some(flight)
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
        self.bounds.iter().all(|&(min, max, is_box)| {
            (is_box && low.cmpgt(min).all() && high.cmplt(max).all()) || low.cmpgt(max).any() || high.cmplt(min).any()
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
