//! `volpath`: unidirectional volumetric path tracing (Sec. 2.3 in \[Houska2013\]; depth rules of Mitsuba 3 `volpath`).
//!
//! On each ray a free-flight distance is drawn. If it ends before the first surface the path scatters in the medium, else on the surface.
//! Light is gathered at each event from one emitter sample and, by multiple importance sampling, from the scattered ray.
//! *Deviation from Mitsuba 3:* transmittance towards emitters is analytic, exp(−τ), not a 0/1 estimate; equal in the mean, less noisy.

use super::{Integrator, Origin, Path, PathRay, Vertex};
use crate::{
    Rgb, Sampler,
    media::Flight,
    visibility::{Counters, Proofs},
};

impl<P: Proofs> Integrator<'_, P> {
    /// Radiance along `ray` by volumetric path tracing.
    pub(crate) fn volpath(&self, ray: PathRay, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let mut path = Path::new(ray);
        while self.goes_on(&mut path, sampler) {
            let (hit, free) = self.cast(&path.ray);
            // −ln(1 − ξ) is the optical depth of a free flight; ξ < 1, so it is finite.
            let tau = -(-sampler.next_1d()).ln_1p();
            match self.world.media.fly(&free, path.ray.medium, tau) {
                Flight::Collision { t, medium } => {
                    path.depth += 1;
                    if !self.may_scatter(path.depth) {
                        break;
                    }
                    let m = self.world.media.medium(medium);
                    path.throughput *= m.albedo;
                    let point = free.at(t);
                    let vertex = Vertex::InMedium { phase: m.phase, direction: path.ray.direction };
                    path.radiance +=
                        path.throughput * self.direct_light(point, &vertex, Some(medium), sampler, counters);
                    let direction = m.phase.sample_direction(path.ray.direction, sampler.next_2d());
                    let pdf = m.phase.pdf_direction(path.ray.direction, direction);
                    path.origin = Origin::Scattering { point, pdf };
                    path.ray = self.ray(point, direction, Some(medium));
                }
                Flight::Passed(medium) => {
                    if !self.arrive(&mut path, hit, medium, sampler, counters) {
                        break;
                    }
                }
            }
        }
        path.radiance
    }
}
