//! `raymarch`: stratified single scattering on every ray, summed with the light of surfaces (Sec. 2.5 in \[Houska2013\]).
//!
//! Each ray is divided into strata of equal transmittance; in each, one sample gathers light from one emitter. The medium scatters once, emitted
//! light only; surfaces scatter any number of times. With T the transmittance of the ray, the k-th of n samples lies at the optical
//! depth −ln(1 − (k + ξ)(1 − T)/n) and is worth albedo·(1 − T)/n.
//!
//! *Deviation from the thesis:* it recovers σ_t as −ln(T)/D, which loses all digits in thin media and is undefined where T underflows. Here the
//! optical depth τ is known, and 1 − T = −expm1(−τ).

use super::{Integrator, Origin, PathRay, Vertex, survives, to_f32};
use crate::{
    Rgb, Sampler,
    frame::sample_cosine_hemisphere,
    geometry::Segment,
    media::Flight,
    visibility::{Counters, Proofs},
};

impl<P: Proofs> Integrator<'_, P> {
    /// Radiance along `ray` by ray marching with `samples` strata a segment (at least 1).
    pub(crate) fn raymarch(&self, ray: PathRay, samples: u32, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let mut radiance = Rgb::ZERO;
        let mut throughput = Rgb::ONE;
        let mut ray = ray;
        let mut origin = Origin::Camera;
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
            let tau = self.world.media.optical_depth(&free, ray.medium);
            if tau > 0.0 && self.may_scatter(depth + 1) {
                radiance += throughput * self.in_scattered(&free, &ray, tau, samples, sampler, counters);
            }
            let medium = match self.world.media.fly(&free, ray.medium, f64::INFINITY) {
                Flight::Passed(medium) => medium,
                Flight::Collision { medium, .. } => Some(medium),
            };
            throughput *= to_f32((-tau).exp());
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
        radiance
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
