//! A ray through media, cut into stretches: parts in one medium, of one extinction or with its mean known.
//!
//! *Guarantee.* Optical depths are exact wherever they are asked for, in grids, too; so what arrives from a point of a stretch is what arrives.

use glam::DVec3;
use smallvec::SmallVec;
use vdf_scene::{MediumId, Phase, Rgb};

use crate::media::{Homogeneous, Media, MediumIntervals, Substance};

/// A part of a ray in one medium that scatters. Distances are in world units from the ray's start.
///
/// Where a medium changes in space, a ray through it is cut into several. Densities are those of their mean extinction; what arrives, and what is drawn by
/// optical depth, is exact.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stretch {
    /// Its number among the ray's medium intervals.
    pub(super) part: usize,
    /// The medium.
    pub(super) medium: MediumId,
    /// Where it begins and ends, as parameters along the ray's segment.
    pub(super) ends: [f64; 2],
    /// Where it begins.
    pub(super) begin: f64,
    /// Where it ends, not before it begins.
    pub(super) end: f64,
    /// The ray's optical depth where it begins.
    pub(super) depth: f64,
    /// Extinction coefficient, positive; its mean if it is not even.
    pub(super) sigma_t: f64,
    /// Single-scattering albedo; where it is not even, that of its middle.
    pub(super) albedo: Rgb,
    /// Phase function.
    pub(super) phase: Phase,
    /// Whether extinction and albedo are the same in all of it.
    pub(super) is_even: bool,
}

impl Stretch {
    /// The ray's optical depth at a distance in the stretch.
    #[inline]
    pub(super) fn depth_at(&self, distance: f64, intervals: &MediumIntervals<'_>) -> f64 {
        if self.is_even {
            return self.depth + self.sigma_t * (distance - self.begin);
        }
        self.depth + intervals.depth_in(self.medium, [self.begin, distance])
    }

    /// The distance up to which the stretch has this optical depth; its end if it has less.
    #[inline]
    pub(super) fn distance_of(&self, depth: f64, intervals: &MediumIntervals<'_>) -> f64 {
        if self.is_even {
            return (self.begin + depth / self.sigma_t).min(self.end);
        }
        intervals.distance_in(self.medium, [self.begin, self.end], depth)
    }

    /// σ_t exp(−τ) at a distance in the stretch.
    #[inline]
    pub(super) fn arrives(&self, distance: f64, intervals: &MediumIntervals<'_>) -> f64 {
        let sigma_t = if self.is_even { self.sigma_t } else { intervals.sigma_t_at(self.medium, distance) };
        sigma_t * (-self.depth_at(distance, intervals)).exp()
    }

    /// The albedo at a point of the stretch.
    #[inline]
    pub(super) fn albedo_at(&self, point: DVec3, intervals: &MediumIntervals<'_>) -> Rgb {
        if self.is_even { self.albedo } else { intervals.albedo_at(self.medium, point) }
    }

    /// The part between two distances; `None` if there is nothing in it.
    pub(super) fn cut(&self, begin: f64, end: f64, intervals: &MediumIntervals<'_>) -> Option<Self> {
        let depth = self.depth_at(begin, intervals);
        if self.is_even {
            return Some(Self { begin, end, depth, ..*self });
        }
        let sigma_t = (self.depth_at(end, intervals) - depth) / (end - begin);
        (sigma_t > 0.0).then_some(Self { begin, end, depth, sigma_t, ..*self })
    }
}

/// The parts of a ray in media that take something away.
pub(super) fn stretches(intervals: &MediumIntervals<'_>, media: &Media) -> SmallVec<[Stretch; 4]> {
    let length = intervals.length();
    let mut depth = 0.0;
    let mut stretches = SmallVec::new();
    for (part, i) in intervals.parts().enumerate() {
        let Some(medium) = i.medium else { continue };
        match media.substance(medium) {
            Substance::Homogeneous(m) => {
                if m.sigma_t > 0.0 {
                    let Homogeneous { sigma_t, albedo, phase } = *m;
                    stretches.push(Stretch {
                        part,
                        medium,
                        ends: [i.t0, i.t1],
                        begin: i.t0 * length,
                        end: i.t1 * length,
                        depth,
                        sigma_t,
                        albedo,
                        phase,
                        is_even: true,
                    });
                }
                depth += m.optical_depth((i.t1 - i.t0) * length);
            }
            Substance::Heterogeneous(m) => {
                let knots = m.knots(intervals.segment(), [i.t0, i.t1], length);
                for pair in knots.windows(2) {
                    let [from, to] = [pair[0], pair[1]];
                    let (begin, end) = (from.t * length, to.t * length);
                    let sigma_t = (to.depth - from.depth) / (end - begin);
                    if sigma_t > 0.0 && sigma_t.is_finite() {
                        let middle = intervals.segment().at(0.5 * (from.t + to.t));
                        let (albedo, phase) = media.scattering(medium, middle);
                        let depth = depth + from.depth;
                        stretches.push(Stretch {
                            part,
                            medium,
                            ends: [from.t, to.t],
                            begin,
                            end,
                            depth,
                            sigma_t,
                            albedo,
                            phase,
                            is_even: false,
                        });
                    }
                }
                depth += knots.last().map_or(0.0, |last| last.depth);
            }
        }
    }
    stretches
}

/// The stretch and the distance in it where the ray's optical depth is `depth`; rounding may place it at the very end.
#[inline]
pub(super) fn distance_at_depth(
    stretches: &[Stretch],
    depth: f64,
    intervals: &MediumIntervals<'_>,
) -> Option<(usize, f64)> {
    let i = stretches.partition_point(|s| s.depth <= depth).checked_sub(1)?;
    let s = &stretches[i];
    Some((i, s.distance_of(depth - s.depth, intervals)))
}
