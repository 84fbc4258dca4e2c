//! Participating media along a segment: which medium where, optical depth, transmittance, free flight.
//!
//! The interface that integrators use, whatever the medium: a path carries the [`RegionSet`] of where it is, [`Media::intervals`] cuts a
//! segment at the boundaries of regions (`regions.rs`), and optical depths and distances within an interval are the medium's own affair,
//! one file a kind: [`Homogeneous`], and `heterogeneous.rs` for those that change in space (`grid/`).

mod chromatic;
mod extent;
mod grid;
mod heterogeneous;
mod homogeneous;
mod intervals;
mod region_set;
mod regions;
mod shells;
#[cfg(test)]
mod tests;

use std::ops::ControlFlow;

use glam::DVec3;
use smallvec::SmallVec;
use vdf_geometry::{Bounds, Segment};
use vdf_scene::{Boundary, Medium, MediumId, Phase, Rgb, Scene};

pub use self::{
    homogeneous::Homogeneous,
    intervals::{MediumInterval, MediumIntervals},
    region_set::RegionSet,
};

use self::{heterogeneous::Heterogeneous, intervals::DepthLeft, regions::Regions};

/// The media of a scene and the regions that they fill, prepared for walks along segments.
#[derive(Debug)]
pub struct Media {
    media: Vec<Substance>,
    is_chromatic: bool,
    least_sigma_t: f64,
    regions: Regions,
    /// The regions that the camera is inside of.
    at_camera: RegionSet,
}

/// What a medium is made of.
#[derive(Debug)]
pub(crate) enum Substance {
    Homogeneous(Homogeneous),
    Heterogeneous(Box<Heterogeneous>),
}

/// What a free flight along a segment comes to.
#[derive(Clone, Debug, PartialEq)]
pub enum FreeFlight {
    /// A collision at parameter `t` in `medium`.
    Collision {
        /// Parameter along the segment, in [0, 1].
        t: f64,
        /// The medium there.
        medium: MediumId,
        /// The regions there.
        regions: RegionSet,
    },
    /// The end was reached, in these regions.
    Passed(RegionSet),
}

/// What is known of a free flight without a look at what lies beyond its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShortFlight {
    /// It is this, ends in the medium in which it starts before the segment does, and crosses no boundary.
    Collides(Segment),
    /// There is no collision on the segment, whatever lies on it.
    Passes,
    /// Nothing.
    Unknown,
}

impl ShortFlight {
    /// The way to the collision, if there is one.
    #[must_use]
    pub const fn collision(self) -> Option<Segment> {
        match self {
            Self::Collides(flight) => Some(flight),
            Self::Passes | Self::Unknown => None,
        }
    }
}

impl Media {
    /// Prepares media and boundaries, which have to be closed, each alone or together; `ambient` is the medium outside of all boundaries. Cost: that of a hierarchy
    /// over the triangles of the boundaries.
    #[must_use]
    pub fn new(media: &[Medium], boundaries: &[Boundary], ambient: Option<MediumId>) -> Self {
        let regions = Regions::new(media, boundaries, ambient);
        let media: Vec<_> = media.iter().map(Substance::new).collect();
        let is_chromatic = media.iter().any(|m| matches!(m, Substance::Heterogeneous(m) if m.is_chromatic()));
        // Once, for a grid takes a look at all of its values.
        let typical = |m: &Substance| match m {
            Substance::Homogeneous(m) => m.sigma_t,
            Substance::Heterogeneous(m) => m.typical(),
        };
        let least_sigma_t = media.iter().map(typical).filter(|&s| s > 0.0).fold(f64::INFINITY, f64::min);
        Self { media, is_chromatic, least_sigma_t, regions, at_camera: RegionSet::default() }
    }

    /// Prepares the media of a scene. The ambient medium is the sensor's if the camera is outside of all boundaries, else what the outermost
    /// boundary around the camera names for its outer side.
    #[must_use]
    pub fn of_scene(scene: &Scene) -> Self {
        let mut media = Self::new(&scene.media, &scene.boundaries, None);
        let at_camera = media.regions.at(scene.sensor.world_from_camera.w_axis.truncate());
        let outside = at_camera == RegionSet::default();
        media.regions.set_ambient(if outside { scene.sensor.medium } else { media.regions.around(&at_camera) });
        Self { at_camera, ..media }
    }

    /// The medium with this number.
    #[inline]
    pub(crate) fn substance(&self, id: MediumId) -> &Substance {
        &self.media[id.0 as usize]
    }

    /// The albedo of a medium at a point, and its phase function.
    #[inline]
    #[must_use]
    pub fn scattering(&self, id: MediumId, point: DVec3) -> (Rgb, Phase) {
        match self.substance(id) {
            Substance::Homogeneous(m) => (m.albedo, m.phase),
            Substance::Heterogeneous(m) => (m.albedo(point), m.phase),
        }
    }

    /// The least extinction coefficient of a medium that takes something away, of one that changes in space a typical one; infinite if none does.
    #[inline]
    #[must_use]
    pub const fn least_sigma_t(&self) -> f64 {
        self.least_sigma_t
    }

    /// The medium of a point in these regions, that of the innermost; `None` is vacuum.
    #[inline]
    #[must_use]
    pub fn medium_in(&self, regions: &RegionSet) -> Option<MediumId> {
        self.regions.medium(regions)
    }

    /// The regions that `point` is inside of. Cost: in proportion to the triangles of the boundaries around it.
    #[must_use]
    pub fn regions_at(&self, point: DVec3) -> RegionSet {
        self.regions.at(point)
    }

    /// The regions that the camera is inside of.
    #[inline]
    #[must_use]
    pub const fn at_camera(&self) -> &RegionSet {
        &self.at_camera
    }

    /// The regions at the end of the segment, which starts in `start`.
    #[inline]
    #[must_use]
    pub fn at_end(&self, segment: &Segment, start: &RegionSet) -> RegionSet {
        if self.are_nowhere() {
            return start.clone();
        }
        self.regions.at_end(segment, start)
    }

    /// Where the medium outside of all boundaries ends; empty if there is none, or it has no end.
    #[must_use]
    pub(crate) fn ambient_bounds(&self) -> Bounds {
        let ambient = self.regions.medium(&RegionSet::default()).map(|id| self.substance(id));
        match ambient {
            Some(Substance::Heterogeneous(m)) => m.bounds().unwrap_or(Bounds::EMPTY),
            _ => Bounds::EMPTY,
        }
    }

    /// Whether there is no boundary and no medium outside: nothing is anywhere.
    #[inline]
    #[must_use]
    pub(crate) fn are_nowhere(&self) -> bool {
        self.regions.are_none()
    }

    /// True if the segment crosses no boundary of a medium.
    #[inline]
    #[must_use]
    pub fn crosses_nothing(&self, segment: &Segment) -> bool {
        self.regions.are_not_crossed(segment)
    }

    /// A box in whose inside no boundary is met; empty where none is known.
    #[must_use]
    pub(crate) fn clear(&self) -> Bounds {
        self.regions.clear()
    }

    /// How near to a boundary a place on the segment, as a parameter along it, may have rounded to the other side.
    #[inline]
    #[must_use]
    pub(crate) fn doubt(&self, segment: &Segment) -> f64 {
        self.regions.tolerance(segment)
    }

    /// exp(−∫σ_t) along the segment, which starts in `start` [Houska2013, Sec. 2.1].
    #[inline]
    #[must_use]
    pub fn transmittance(&self, segment: &Segment, start: &RegionSet) -> f64 {
        (-self.optical_depth(segment, start)).exp()
    }

    /// ∫σ_t along the segment, which starts in `start`. Where a medium is chromatic it is that of red; see [`Media::optical_depths`].
    #[inline]
    #[must_use]
    pub fn optical_depth(&self, segment: &Segment, start: &RegionSet) -> f64 {
        if self.are_nowhere() {
            return 0.0;
        }
        let length = segment.length();
        let mut tau = 0.0;
        let _ = self.regions.walk(segment, start, |i, _| {
            tau += self.interval_depth(&i, segment, length);
            ControlFlow::<()>::Continue(())
        });
        tau
    }

    /// The free flight of optical depth `tau` along the segment, which starts in `start`: a collision where the depth is reached, if it is.
    /// If `tau` is −ln(1 − ξ), that is where a photon collides first.
    #[inline]
    #[must_use]
    pub fn free_flight(&self, segment: &Segment, start: &RegionSet, tau: f64) -> FreeFlight {
        if self.are_nowhere() {
            return FreeFlight::Passed(start.clone());
        }
        let length = segment.length();
        let mut left = DepthLeft { tau };
        let spend = |i: MediumInterval, regions: &RegionSet| match left.spend(self, &i, segment, length) {
            Some((t, medium)) => ControlFlow::Break((t, medium, i, regions.clone())),
            None => ControlFlow::Continue(()),
        };
        match self.regions.walk(segment, start, spend) {
            ControlFlow::Break((t, medium, i, regions)) => {
                FreeFlight::Collision { t, medium, regions: self.regions_near(segment, start, t, &i, &regions) }
            }
            ControlFlow::Continue(regions) => FreeFlight::Passed(regions.unwrap_or_else(|| start.clone())),
        }
    }

    /// The regions at `t` in an interval that lies in `regions`. So close to the interval's ends that the rounded point may lie on the other
    /// side of a boundary, they are those of the point.
    #[inline]
    fn regions_near(
        &self,
        segment: &Segment,
        start: &RegionSet,
        t: f64,
        i: &MediumInterval,
        regions: &RegionSet,
    ) -> RegionSet {
        let tolerance = self.regions.tolerance(segment);
        if t - i.t0 <= tolerance || i.t1 - t <= tolerance {
            self.regions.at_end(&Segment::new(segment.p, segment.at(t)), start)
        } else {
            regions.clone()
        }
    }

    /// The intervals of the segment, which starts in `start`.
    #[inline]
    #[must_use]
    pub fn intervals(&self, segment: &Segment, start: &RegionSet) -> MediumIntervals<'_> {
        let mut intervals = SmallVec::new();
        let walked = self.regions.walk(segment, start, |i, regions| {
            intervals.push((i, regions.clone()));
            ControlFlow::<std::convert::Infallible>::Continue(())
        });
        let end = match walked {
            ControlFlow::Continue(regions) => regions.unwrap_or_else(|| start.clone()),
            ControlFlow::Break(never) => match never {},
        };
        MediumIntervals {
            media: self,
            segment: *segment,
            length: segment.length(),
            start: start.clone(),
            intervals,
            end,
        }
    }

    /// What can be said of a free flight of optical depth `tau` that starts in `medium` without a look at what lies beyond its end.
    #[inline]
    #[must_use]
    pub fn short_flight(&self, segment: &Segment, medium: MediumId, tau: f64) -> ShortFlight {
        let t = match self.substance(medium) {
            Substance::Homogeneous(m) => m.distance_at_depth(tau, segment.length()),
            Substance::Heterogeneous(m) => match m.distance(segment, [0.0, 1.0], segment.length(), tau) {
                Ok(t) => t,
                // The medium is in a part of the segment, and there is no other.
                Err(_) if self.media.len() == 1 => return ShortFlight::Passes,
                Err(_) => return ShortFlight::Unknown,
            },
        };
        // No extinction or no length gives infinity or NaN.
        if t >= 1.0 || t.is_nan() {
            return ShortFlight::Unknown;
        }
        let flight = Segment::new(segment.p, segment.at(t));
        if self.regions.are_not_crossed(&flight) { ShortFlight::Collides(flight) } else { ShortFlight::Unknown }
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
        let Substance::Homogeneous(m) = self.substance(medium) else { return false };
        let t = m.distance_at_depth(tau, segment.length());
        // NaN, too, becomes 1.
        self.regions.are_left_for_good(segment.p, segment.at(t.min(1.0)))
    }

    #[inline]
    fn interval_depth(&self, i: &MediumInterval, segment: &Segment, length: f64) -> f64 {
        i.medium.map_or(0.0, |m| match self.substance(m) {
            Substance::Homogeneous(m) => m.optical_depth((i.t1 - i.t0) * length),
            Substance::Heterogeneous(m) => m.optical_depth(segment, [i.t0, i.t1], length),
        })
    }
}

impl Substance {
    fn new(medium: &Medium) -> Self {
        match Homogeneous::of(medium) {
            Some(homogeneous) => Self::Homogeneous(homogeneous),
            None => Self::Heterogeneous(Box::new(Heterogeneous::new(medium))),
        }
    }
}
