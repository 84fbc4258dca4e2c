//! Depths and free flights for red, green and blue at once, where a medium takes more of one colour than of another.

use std::ops::ControlFlow;

use glam::DVec3;
use vdf_geometry::Segment;

use super::{FreeFlight, Media, MediumInterval, MediumIntervals, RegionSet, Substance, grid::Reached, heterogeneous};

/// What a free flight of one channel comes to, with what the others have there.
#[derive(Clone, Debug)]
pub(crate) struct ChromaticFlight {
    pub(crate) end: FreeFlight,
    /// The optical depths up to its end.
    pub(crate) depths: DVec3,
    /// The extinction coefficients where it collides.
    pub(crate) sigma_t: DVec3,
}

impl ChromaticFlight {
    /// The densities with which the channels' own flights would end there, but for a common factor, so that they do not underflow together: σ_t·exp(−τ) at a collision, and
    /// exp(−τ) at the end of the segment.
    #[inline]
    pub(crate) fn densities(&self) -> DVec3 {
        let through = (DVec3::splat(self.depths.min_element()) - self.depths).exp();
        match self.end {
            FreeFlight::Collision { .. } => self.sigma_t * through,
            FreeFlight::Passed(_) => through,
        }
    }
}

impl Media {
    /// True if some medium takes more of one colour than of another.
    #[inline]
    #[must_use]
    pub const fn is_chromatic(&self) -> bool {
        self.is_chromatic
    }

    /// As [`Media::optical_depth`], for red, green and blue.
    #[must_use]
    pub fn optical_depths(&self, segment: &Segment, start: &RegionSet) -> DVec3 {
        let length = segment.length();
        let mut depths = DVec3::ZERO;
        let _ = self.regions.walk(segment, start, |i, _| {
            depths += self.interval_depths(&i, segment, length);
            ControlFlow::<()>::Continue(())
        });
        depths
    }

    fn interval_depths(&self, i: &MediumInterval, segment: &Segment, length: f64) -> DVec3 {
        i.medium.map_or(DVec3::ZERO, |m| match self.substance(m) {
            Substance::Homogeneous(m) => DVec3::splat(m.optical_depth((i.t1 - i.t0) * length)),
            Substance::Heterogeneous(m) => m.optical_depths(segment, [i.t0, i.t1], length),
        })
    }

    /// Where a channel has the depth `tau` in an interval, or else the depths of all of it.
    fn distance_in(
        &self,
        i: &MediumInterval,
        segment: &Segment,
        length: f64,
        tau: f64,
        channel: usize,
    ) -> Result<Reached<3>, DVec3> {
        let Some(medium) = i.medium else { return Err(DVec3::ZERO) };
        match self.substance(medium) {
            Substance::Homogeneous(m) => {
                heterogeneous::constant(DVec3::splat(m.sigma_t), [i.t0, i.t1], length, tau, channel)
            }
            Substance::Heterogeneous(m) => m.distance_of(segment, [i.t0, i.t1], length, tau, channel),
        }
    }
}

impl MediumIntervals<'_> {
    /// As [`MediumIntervals::optical_depth`], for red, green and blue.
    #[must_use]
    pub fn optical_depths(&self) -> DVec3 {
        self.intervals
            .iter()
            .fold(DVec3::ZERO, |depths, (i, _)| depths + self.media.interval_depths(i, &self.segment, self.length))
    }

    /// The free flight of optical depth `tau` of one channel.
    pub(crate) fn chromatic_flight(&self, channel: usize, tau: f64) -> ChromaticFlight {
        let mut depths = DVec3::ZERO;
        for (i, regions) in &self.intervals {
            match self.media.distance_in(i, &self.segment, self.length, tau - depths[channel], channel) {
                Ok(Reached { t, depth, sigma_t }) => {
                    let regions = self.media.regions_near(&self.segment, &self.start, t, i, regions);
                    let end = match i.medium {
                        Some(medium) => FreeFlight::Collision { t, medium, regions },
                        None => FreeFlight::Passed(self.end.clone()),
                    };
                    return ChromaticFlight { end, depths: depths + DVec3::from(depth), sigma_t: sigma_t.into() };
                }
                Err(all) => depths += all,
            }
        }
        ChromaticFlight { end: FreeFlight::Passed(self.end.clone()), depths, sigma_t: DVec3::ZERO }
    }
}
