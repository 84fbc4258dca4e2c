//! `volpath`: unidirectional volumetric path tracing (Sec. 2.3 in \[Houska2013\]; depth rules of Mitsuba 3 `volpath`).
//!
//! On each ray a free-flight distance is drawn. If it ends before the first surface the path scatters in the medium, else on the surface.
//! Light is gathered at each event from one emitter sample and, by multiple importance sampling, from the scattered ray.
//! The distance is drawn *before* a ray is cast (2.3, 2.4): if the flight is proved free no ray is cast at all, else one that is no longer
//! than the flight. The events are the same either way.
//! *Deviation from Mitsuba 3:* transmittance towards emitters is analytic, exp(−τ), unless [`crate::TransmittanceEstimator::Analog`] asks for the
//! peer's 0/1 estimate; equal in the mean, less noisy.

use glam::DVec3;
use vdf_geometry::Segment;
use vdf_scene::{MediumId, Rgb};
use vdf_visibility::{Counters, Recorder};

use super::{Origin, Path, PathRay, Tracer, Vertex, sample_free_flight};
use crate::{
    PhaseFunction as _, RegionSet, Sampler,
    media::{FreeFlight, ShortFlight},
    world::SurfacePoint,
};

/// What a ray comes to.
pub(super) enum Event {
    /// A collision with the medium.
    Collision { point: DVec3, medium: MediumId, regions: RegionSet },
    /// The first surface, or none; reached in these regions.
    Arrival { surface: Option<SurfacePoint>, regions: RegionSet },
}

impl<R: Recorder> Tracer<'_, R> {
    /// Radiance along `ray` by volumetric path tracing.
    pub(crate) fn volpath(&self, ray: PathRay, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let mut path = Path::new(ray);
        while self.goes_on(&mut path, sampler) {
            let event = if self.world.media.is_chromatic() {
                self.chromatic_event(&mut path, sampler.next_1d(), counters)
            } else {
                let tau = sample_free_flight(sampler);
                self.first_event(&mut path, tau, counters)
            };
            match event {
                Event::Collision { point, medium, regions } => {
                    path.depth += 1;
                    if !self.may_scatter(path.depth) {
                        break;
                    }
                    let (albedo, phase) = self.world.media.scattering(medium, point);
                    path.throughput *= albedo;
                    let vertex = Vertex::InMedium { phase, direction: path.ray.direction };
                    let direct = self.direct_light(point, &vertex, &regions, f64::INFINITY, None, sampler, counters);
                    path.radiance += path.throughput * direct;
                    let direction = phase.sample_direction(path.ray.direction, sampler.next_2d());
                    let pdf = phase.pdf_direction(path.ray.direction, direction);
                    path.origin = Origin::scattering(point, pdf);
                    path.on_surface = false;
                    path.ray = self.ray(point, direction, regions);
                }
                Event::Arrival { surface, regions } => {
                    if !self.arrive(&mut path, surface, regions, sampler, counters) {
                        break;
                    }
                }
            }
        }
        path.radiance
    }

    /// The first event on the path's ray, for a free flight of optical depth `tau`.
    #[inline]
    pub(super) fn first_event(&self, path: &mut Path, tau: f64, counters: &mut Counters) -> Event {
        let on_surface = path.on_surface;
        let ray = &mut path.ray;
        let media = &self.world.media;
        let start = media.medium_in(&ray.regions);
        if let Some(medium) = start {
            match media.short_flight(&ray.segment, medium, tau) {
                ShortFlight::Collides(flight) => {
                    let hit = self.visibility.intersect_flight(&flight, !on_surface, counters);
                    return match self.surface_met(hit, &flight, ray.direction) {
                        // The next ray takes them over.
                        None => Event::Collision { point: flight.q, medium, regions: std::mem::take(&mut ray.regions) },
                        Some(surface) => {
                            // The way to the surface is a part of the flight, but where a ray starts from a surface is beside that.
                            let regions = media.at_end(&Segment::new(flight.p, surface.point), &ray.regions);
                            self.crosses_to(path, &regions);
                            Event::Arrival { surface: Some(surface), regions }
                        }
                    };
                }
                ShortFlight::Passes => {
                    let (surface, free) = self.cast(ray, counters);
                    let regions = media.at_end(&free, &ray.regions);
                    self.crosses_to(path, &regions);
                    return Event::Arrival { surface, regions };
                }
                ShortFlight::Unknown => {}
            }
        }
        let (surface, free) = self.cast(ray, counters);
        if let (None, Some(medium)) = (surface, start)
            && media.leaves_for_good(&ray.segment, medium, tau)
        {
            return Event::Arrival { surface: None, regions: RegionSet::default() };
        }
        let flight = media.free_flight(&free, &ray.regions, tau);
        self.end_of_flight(path, flight, &free, surface)
    }

    /// What a free flight through the way from the path's ray to what it meets ends with.
    #[inline]
    pub(super) fn end_of_flight(
        &self,
        path: &mut Path,
        flight: FreeFlight,
        free: &Segment,
        surface: Option<SurfacePoint>,
    ) -> Event {
        match flight {
            FreeFlight::Collision { t, medium, regions } => {
                self.crosses_to(path, &regions);
                Event::Collision { point: free.at(t), medium, regions }
            }
            FreeFlight::Passed(regions) => {
                self.crosses_to(path, &regions);
                Event::Arrival { surface, regions }
            }
        }
    }
}
