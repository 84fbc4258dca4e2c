//! `raymarch`: stratified single scattering on every ray, summed with the light of surfaces (Sec. 2.5 in \[Houska2013\]).
//!
//! Each ray is divided into strata of equal transmittance; in each, one sample gathers light from one emitter. The medium scatters once, emitted
//! light only; surfaces scatter any number of times. With T the transmittance of the ray, the k-th of n samples lies at the optical
//! depth −ln(1 − (k + ξ)(1 − T)/n) and is worth albedo·(1 − T)/n.
//!
//! *Deviation from the thesis:* it recovers σ_t as −ln(T)/D, which loses all digits in thin media and is undefined where T underflows. Here the
//! optical depth τ is known, and 1 − T = −expm1(−τ).

use super::{Integrator, Path, PathRay, Vertex, to_f32};
use crate::{
    Rgb, Sampler,
    geometry::Segment,
    media::Flight,
    visibility::{Counters, Proofs, Recorder},
};

impl<P: Proofs, R: Recorder> Integrator<'_, P, R> {
    /// Radiance along `ray` by ray marching with `samples` strata a segment (at least 1).
    pub(crate) fn raymarch(&self, ray: PathRay, samples: u32, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let mut path = Path::new(ray);
        while self.goes_on(&mut path, sampler) {
            let (hit, free) = self.cast(&path.ray, counters);
            let tau = self.world.media.optical_depth(&free, path.ray.medium);
            if tau > 0.0 && self.may_scatter(path.depth + 1) {
                path.radiance += path.throughput * self.in_scattered(&free, &path.ray, tau, samples, sampler, counters);
            }
            let medium = match self.world.media.fly(&free, path.ray.medium, f64::INFINITY) {
                Flight::Passed(medium) => medium,
                Flight::Collision { medium, .. } => Some(medium),
            };
            path.throughput *= to_f32((-tau).exp());
            if !self.arrive(&mut path, hit, medium, sampler, counters) {
                break;
            }
        }
        path.radiance
    }

    /// Emitted light scattered once into the ray along `free`, whose optical depth is `tau`.
    #[inline]
    fn in_scattered(
        &self,
        free: &Segment,
        ray: &PathRay,
        tau: f64,
        samples: u32,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let width = -(-tau).exp_m1() / f64::from(samples);
        let mut sum = Rgb::ZERO;
        for k in 0..samples {
            let depth = -(-(f64::from(k) + sampler.next_1d()) * width).ln_1p();
            // Rounding may place the last sample an ulp beyond the end; it is worth nothing there.
            if let Flight::Collision { t, medium } = self.world.media.fly(free, ray.medium, depth) {
                let m = self.world.media.medium(medium);
                let vertex = Vertex::InMedium { phase: m.phase, direction: ray.direction };
                sum += m.albedo * self.direct_light_alone(free.at(t), &vertex, medium, sampler, counters);
            }
        }
        sum * to_f32(width)
    }
}
