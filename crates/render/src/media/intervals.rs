//! The parts of a segment that lie in one medium each.

use smallvec::SmallVec;
use vdf_geometry::Segment;
use vdf_scene::MediumId;

use super::{FreeFlight, Media, RegionSet};

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
    pub(super) segment: Segment,
    /// Length of the segment in world units.
    pub(super) length: f64,
    pub(super) start: RegionSet,
    pub(super) intervals: SmallVec<[(MediumInterval, RegionSet); 4]>,
    pub(super) end: RegionSet,
}

impl MediumIntervals<'_> {
    /// As [`Media::optical_depth`].
    #[inline]
    #[must_use]
    pub fn optical_depth(&self) -> f64 {
        self.intervals.iter().fold(0.0, |tau, (i, _)| tau + self.media.interval_depth(i, self.length))
    }

    /// The parts, from the start on.
    pub fn parts(&self) -> impl Iterator<Item = &MediumInterval> {
        self.intervals.iter().map(|(i, _)| i)
    }

    /// The part with this number.
    #[inline]
    #[must_use]
    pub fn part(&self, part: usize) -> &MediumInterval {
        &self.intervals[part].0
    }

    /// Length of the segment in world units.
    #[inline]
    #[must_use]
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// The regions at parameter `t` of part number `part`, which must have a medium.
    #[inline]
    #[must_use]
    pub fn regions_in(&self, part: usize, t: f64) -> RegionSet {
        let (interval, regions) = &self.intervals[part];
        self.media.regions_near(&self.segment, &self.start, t, interval, regions)
    }

    /// As [`Media::free_flight`].
    #[inline]
    #[must_use]
    pub fn free_flight(&self, tau: f64) -> FreeFlight {
        let mut left = DepthLeft { tau };
        for (i, regions) in &self.intervals {
            if let Some((t, medium)) = left.spend(self.media, i, self.length) {
                let regions = self.media.regions_near(&self.segment, &self.start, t, i, regions);
                return FreeFlight::Collision { t, medium, regions };
            }
        }
        FreeFlight::Passed(self.end.clone())
    }

    /// The regions at the end.
    #[inline]
    #[must_use]
    pub const fn end(&self) -> &RegionSet {
        &self.end
    }
}

/// What is left of a free flight's optical depth on its way through the intervals.
#[derive(Clone, Copy, Debug)]
pub(super) struct DepthLeft {
    /// Optical depth.
    pub(super) tau: f64,
}

impl DepthLeft {
    /// Goes through one interval (`None`), or ends in it: where, and in which medium.
    #[inline]
    pub(super) fn spend(&mut self, media: &Media, i: &MediumInterval, length: f64) -> Option<(f64, MediumId)> {
        let depth = media.interval_depth(i, length);
        if let Some(medium) = i.medium
            && self.tau < depth
        {
            let t = i.t0 + media.medium(medium).distance_at_depth(self.tau, length);
            return Some((t.min(i.t1), medium));
        }
        self.tau -= depth;
        None
    }
}
