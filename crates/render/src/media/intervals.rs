//! The parts of a segment that lie in one medium each.

use std::ops::ControlFlow;

use smallvec::SmallVec;
use vdf_scene::MediumId;

use super::{FreeFlight, Media};

/// A part of a segment inside one medium (or in vacuum).
#[derive(Clone, Copy, Debug)]
pub struct MediumInterval {
    /// The medium; `None` is vacuum.
    pub medium: Option<MediumId>,
    /// Where it begins, as a parameter along the segment in [0, 1].
    pub t0: f64,
    /// Where it ends.
    pub t1: f64,
}

/// The intervals of a segment in order, for many samples: its boundaries are looked for once. See [`Media::intervals`].
#[derive(Debug)]
pub struct MediumIntervals<'a> {
    pub(super) media: &'a Media,
    /// Length of the segment in world units.
    pub(super) length: f64,
    pub(super) start: Option<MediumId>,
    pub(super) intervals: SmallVec<[MediumInterval; 4]>,
}

impl MediumIntervals<'_> {
    /// As [`Media::optical_depth`].
    #[inline]
    #[must_use]
    pub fn optical_depth(&self) -> f64 {
        self.intervals.iter().fold(0.0, |tau, i| tau + self.media.interval_depth(i, self.length))
    }

    /// As [`Media::free_flight`].
    #[inline]
    #[must_use]
    pub fn free_flight(&self, tau: f64) -> FreeFlight {
        let mut left = DepthLeft { tau, last: self.start };
        match self.intervals.iter().try_for_each(|i| left.spend(self.media, i, self.length)) {
            ControlFlow::Break(flight) => flight,
            ControlFlow::Continue(()) => FreeFlight::Passed(left.last),
        }
    }

    /// The medium at the end.
    #[inline]
    #[must_use]
    pub fn end(&self) -> Option<MediumId> {
        self.intervals.last().map_or(self.start, |i| i.medium)
    }
}

/// What is left of a free flight's optical depth on its way through the intervals.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthLeft {
    /// Optical depth.
    pub(super) tau: f64,
    /// The medium of the last interval.
    pub(super) last: Option<MediumId>,
}

impl DepthLeft {
    /// Goes through one interval, or ends in it.
    #[inline]
    pub(super) fn spend(&mut self, media: &Media, i: &MediumInterval, length: f64) -> ControlFlow<FreeFlight> {
        self.last = i.medium;
        let depth = media.interval_depth(i, length);
        if let Some(medium) = i.medium
            && self.tau < depth
        {
            let t = i.t0 + media.medium(medium).distance_at_depth(self.tau, length);
            return ControlFlow::Break(FreeFlight::Collision { t: t.min(i.t1), medium });
        }
        self.tau -= depth;
        ControlFlow::Continue(())
    }
}
