//! `volpath`: unidirectional volumetric path tracing (Sec. 2.3 in \[Houska2013\]; depth rules of Mitsuba 3 `volpath`).
//!
//! On each ray a free-flight distance is drawn. If it ends before the first surface the path scatters in the medium, else on the surface.
//! Light is gathered at each event from one emitter sample and, by multiple importance sampling, from the scattered ray.
//! *Deviation from Mitsuba 3:* transmittance towards emitters is analytic, exp(−τ), not a 0/1 estimate; equal in the mean, less noisy.

use super::{Integrator, Origin, PathRay, Vertex, survives};
use crate::{
    Rgb, Sampler,
    frame::sample_cosine_hemisphere,
    geometry::Segment,
    media::Flight,
    visibility::{Counters, Proofs},
};

impl<P: Proofs> Integrator<'_, P> {
    /// Radiance along `ray` by volumetric path tracing.
    pub(crate) fn volpath(&self, ray: PathRay, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let mut radiance = Rgb::ZERO;
        let mut throughput = Rgb::ONE;
        let mut ray = ray;
        let mut origin = Origin::Camera;
        // Scattering events so far; passing a medium boundary is none.
        let mut depth = 0;
        while self.may_scatter(depth) && throughput != Rgb::ZERO {
            if !survives(&mut throughput, depth, self.settings.rr_depth, sampler) {
                break;
            }
            let hit = self.visibility.intersect(&ray.segment);
            let free = match &hit {
                Some(hit) => Segment::new(ray.segment.p, ray.segment.at(hit.t)),
                None => ray.segment,
            };
            // −ln(1 − ξ) is the optical depth of a free flight; ξ < 1, so it is finite.
            let tau = -(-sampler.next_1d()).ln_1p();
            match self.world.media.fly(&free, ray.medium, tau) {
                Flight::Collision { t, medium } => {
                    depth += 1;
                    if !self.may_scatter(depth) {
                        break;
                    }
                    let m = self.world.media.medium(medium);
                    throughput *= m.albedo;
                    let point = free.at(t);
                    let vertex = Vertex::InMedium { phase: m.phase, direction: ray.direction };
                    radiance += throughput * self.direct_light(point, &vertex, Some(medium), sampler, counters);
                    let direction = m.phase.sample_direction(ray.direction, sampler.next_2d());
                    origin = Origin::Scattering { point, pdf: m.phase.pdf_direction(ray.direction, direction) };
                    ray = self.ray(point, direction, Some(medium));
                }
                Flight::Passed(medium) => {
                    let Some(hit) = hit else {
                        radiance += throughput * self.background(&origin);
                        break;
                    };
                    let surface = self.world.surface_point(&hit, ray.direction);
                    radiance += throughput * self.emitted(&surface, ray.direction, &origin);
                    depth += 1;
                    if !self.may_scatter(depth) {
                        break;
                    }
                    let vertex = Vertex::OnSurface(surface);
                    radiance += throughput * self.direct_light(surface.point, &vertex, medium, sampler, counters);
                    let (direction, pdf) = sample_cosine_hemisphere(surface.normal, sampler.next_2d());
                    throughput *= surface.reflectance;
                    origin = Origin::Scattering { point: surface.point, pdf };
                    ray = self.ray(surface.point, direction, medium);
                }
            }
        }
        radiance
    }
}
