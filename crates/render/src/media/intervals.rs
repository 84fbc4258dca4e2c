//! The parts of a segment that lie in one medium each.

use smallvec::SmallVec;
use vdf_geometry::Segment;
use vdf_scene::{MediumId, Rgb};

use super::{FreeFlight, Media, RegionSet, Substance};

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
        self.intervals.iter().fold(0.0, |tau, (i, _)| tau + self.media.interval_depth(i, &self.segment, self.length))
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

    /// The segment.
    #[inline]
    #[must_use]
    pub const fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Length of the segment in world units.
    #[inline]
    #[must_use]
    pub const fn length(&self) -> f64 {
        self.length
    }

    /// The optical depth between two distances, which lie in this medium.
    #[inline(never)]
    pub(crate) fn depth_in(&self, medium: MediumId, [begin, end]: [f64; 2]) -> f64 {
        let [t0, t1] = [begin, end].map(|d| d / self.length);
        self.media.interval_depth(&MediumInterval { medium: Some(medium), t0, t1 }, &self.segment, self.length)
    }

    /// The distance between two others, which lie in this medium, up to which the optical depth is `tau`; the second if it is less.
    #[inline(never)]
    pub(crate) fn distance_in(&self, medium: MediumId, [begin, end]: [f64; 2], tau: f64) -> f64 {
        let [t0, t1] = [begin, end].map(|d| d / self.length);
        let part = MediumInterval { medium: Some(medium), t0, t1 };
        let reached = DepthLeft { tau }.spend(self.media, &part, &self.segment, self.length);
        reached.map_or(end, |(t, _)| (t * self.length).clamp(begin, end))
    }

    /// The extinction coefficient at a distance, which lies in this medium.
    #[inline(never)]
    pub(crate) fn sigma_t_at(&self, medium: MediumId, distance: f64) -> f64 {
        match self.media.substance(medium) {
            Substance::Homogeneous(m) => m.sigma_t,
            Substance::Heterogeneous(m) => m.sigma_t(&self.segment, distance / self.length),
        }
    }

    /// The albedo at a point, which lies in this medium.
    #[inline(never)]
    pub(crate) fn albedo_at(&self, medium: MediumId, point: glam::DVec3) -> Rgb {
        self.media.scattering(medium, point).0
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
            if let Some((t, medium)) = left.spend(self.media, i, &self.segment, self.length) {
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
    pub(super) fn spend(
        &mut self,
        media: &Media,
        i: &MediumInterval,
        segment: &Segment,
        length: f64,
    ) -> Option<(f64, MediumId)> {
        let medium = i.medium?;
        match media.substance(medium) {
            Substance::Homogeneous(homogeneous) => {
                let depth = homogeneous.optical_depth((i.t1 - i.t0) * length);
                if self.tau < depth {
                    let t = i.t0 + homogeneous.distance_at_depth(self.tau, length);
                    return Some((t.min(i.t1), medium));
                }
                self.tau -= depth;
            }
            Substance::Heterogeneous(of) => match of.distance(segment, [i.t0, i.t1], length, self.tau) {
                Ok(t) => return Some((t, medium)),
                Err(depth) => self.tau -= depth,
            },
        }
        None
    }
}
