//! Participating media along a segment: which medium where, optical depth, transmittance, free flight.
//!
//! The interface that integrators use, whatever the medium: [`Media::intervals`] cuts a segment at the medium boundaries
//! (`boundaries.rs`); optical depths and distances within an interval are the medium's own affair, one file a kind. [`Homogeneous`] is the
//! first kind.

mod boundaries;
mod homogeneous;
mod intervals;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;

use smallvec::SmallVec;
use vdf_geometry::Segment;
use vdf_scene::{Boundary, Medium, MediumId};

use self::{boundaries::Boundaries, intervals::DepthLeft};
pub use self::{
    homogeneous::Homogeneous,
    intervals::{MediumInterval, MediumIntervals},
};

/// The media of a scene and their boundaries, prepared for walks along segments.
#[derive(Debug)]
pub struct Media {
    media: Vec<Homogeneous>,
    boundaries: Boundaries,
}

/// What a free flight along a segment comes to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FreeFlight {
    /// A collision at parameter `t` in `medium`.
    Collision {
        /// Parameter along the segment, in [0, 1].
        t: f64,
        /// The medium there.
        medium: MediumId,
    },
    /// The end was reached, in this medium.
    Passed(Option<MediumId>),
}

impl Media {
    /// Prepares media and boundaries. Cost: that of a hierarchy over the triangles of the boundaries.
    #[must_use]
    pub fn new(media: &[Medium], boundaries: &[Boundary]) -> Self {
        Self { media: media.iter().map(Homogeneous::from).collect(), boundaries: Boundaries::new(boundaries) }
    }

    /// The medium with this number.
    #[inline]
    #[must_use]
    pub fn medium(&self, id: MediumId) -> &Homogeneous {
        &self.media[id.0 as usize]
    }

    /// exp(−∫σ_t) along the segment, which starts in medium `start` [Houska2013, Sec. 2.1].
    #[inline]
    #[must_use]
    pub fn transmittance(&self, segment: &Segment, start: Option<MediumId>) -> f64 {
        (-self.optical_depth(segment, start)).exp()
    }

    /// ∫σ_t along the segment, which starts in medium `start`.
    #[inline]
    #[must_use]
    pub fn optical_depth(&self, segment: &Segment, start: Option<MediumId>) -> f64 {
        let length = segment.length();
        let mut tau = 0.0;
        let _ = self.boundaries.walk(segment, start, |i| {
            tau += self.interval_depth(&i, length);
            ControlFlow::<()>::Continue(())
        });
        tau
    }

    /// The free flight of optical depth `tau` along the segment, which starts in medium `start`: a collision where the depth is reached,
    /// if it is. If `tau` is −ln(1 − ξ), that is where a photon collides first.
    #[inline]
    #[must_use]
    pub fn free_flight(&self, segment: &Segment, start: Option<MediumId>, tau: f64) -> FreeFlight {
        let length = segment.length();
        let mut left = DepthLeft { tau, last: start };
        match self.boundaries.walk(segment, start, |i| left.spend(self, &i, length)) {
            ControlFlow::Break(flight) => flight,
            ControlFlow::Continue(()) => FreeFlight::Passed(left.last),
        }
    }

    /// The intervals of the segment, which starts in medium `start`.
    #[inline]
    #[must_use]
    pub fn intervals(&self, segment: &Segment, start: Option<MediumId>) -> MediumIntervals<'_> {
        let mut intervals = SmallVec::new();
        let _ = self.boundaries.walk(segment, start, |i| {
            intervals.push(i);
            ControlFlow::<()>::Continue(())
        });
        MediumIntervals { media: self, length: segment.length(), start, intervals }
    }

    /// The path of a free flight of optical depth `tau` that starts in `medium`, if it ends in this medium before the segment does and
    /// crosses no boundary; found without a look at what lies beyond. `None` says nothing.
    #[inline]
    #[must_use]
    pub fn short_flight(&self, segment: &Segment, medium: MediumId, tau: f64) -> Option<Segment> {
        let t = self.medium(medium).distance_at_depth(tau, segment.length());
        // No extinction or no length gives infinity or NaN.
        if t >= 1.0 || t.is_nan() {
            return None;
        }
        let flight = Segment::new(segment.p, segment.at(t));
        self.boundaries.are_not_crossed(&flight).then_some(flight)
    }

    /// True only if a flight of optical depth `tau`, if no surface stops it, does not collide: it starts in `medium`, leaves it where it is
    /// shorter than that, and nothing comes behind. False says nothing.
    ///
    /// The segment must start in `medium`. *Why it is what [`Media::free_flight`] finds:* the boundary is one box, which is convex, with
    /// vacuum around it; where the flight would end in an endless medium lies outside of it by more than the crossing tolerance, and so by
    /// far more than all rounding of `free_flight`: 2⁻⁴⁰ of the largest coordinate beside some 2⁻⁴⁹.
    #[inline]
    #[must_use]
    pub fn leaves_for_good(&self, segment: &Segment, medium: MediumId, tau: f64) -> bool {
        let t = self.medium(medium).distance_at_depth(tau, segment.length());
        // NaN, too, becomes 1.
        self.boundaries.are_left_for_good(segment.p, segment.at(t.min(1.0)))
    }

    #[inline]
    fn interval_depth(&self, i: &MediumInterval, length: f64) -> f64 {
        i.medium.map_or(0.0, |m| self.medium(m).optical_depth((i.t1 - i.t0) * length))
    }
}
