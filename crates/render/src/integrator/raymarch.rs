//! `raymarch`: stratified single scattering on every ray, summed with the light of surfaces (Sec. 2.5 in \[Houska2013\]).
//!
//! Each ray is divided into strata of equal transmittance; in each, one sample gathers light from one emitter. The medium scatters once, emitted
//! light only; surfaces scatter any number of times. With T the transmittance of the ray, the k-th of n samples lies at the optical
//! depth −ln(1 − (k + ξ)(1 − T)/n) and is worth albedo·(1 − T)/n.
//!
//! *Deviation from the thesis:* it recovers σ_t as −ln(T)/D, which loses all digits in thin media and is undefined where T underflows. Here the
//! optical depth τ is known, and 1 − T = −expm1(−τ).

use glam::DVec3;
use vdf_geometry::Segment;
use vdf_scene::Rgb;
use vdf_visibility::{Counters, Recorder};

use super::{Path, PathRay, Tracer, Vertex, to_f32};
use crate::{
    Sampler,
    media::{FreeFlight, MediumIntervals},
};

impl<R: Recorder> Tracer<'_, R> {
    /// Radiance along `ray` by ray marching with `samples` strata a segment (at least 1).
    pub(crate) fn raymarch(&self, ray: PathRay, samples: u32, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let mut path = Path::new(ray);
        while self.goes_on(&mut path, sampler) {
            let (surface, free) = self.cast(&path.ray, counters);
            let intervals = self.world.media.intervals(&free, &path.ray.regions);
            let tau = intervals.optical_depth();
            if tau > 0.0 && self.may_scatter(path.depth + 1) {
                let light = self.in_scattered(&free, &intervals, path.ray.direction, tau, samples, sampler, counters);
                path.radiance += path.throughput * light;
            }
            path.throughput *= to_f32((-tau).exp());
            self.crosses_to(&mut path, intervals.end());
            if !self.arrive(&mut path, surface, intervals.end().clone(), sampler, counters) {
                break;
            }
        }
        path.radiance
    }

    /// Emitted light scattered once into the ray along `free`, which has these intervals and the optical depth `tau`.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "what a ray has and what a path has")]
    fn in_scattered(
        &self,
        free: &Segment,
        intervals: &MediumIntervals<'_>,
        direction: DVec3,
        tau: f64,
        samples: u32,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let width = -(-tau).exp_m1() / f64::from(samples);
        let mut sum = Rgb::ZERO;
        for k in 0..samples {
            if self.stops_at(k) {
                break;
            }
            let depth = stratum_depth(k, width, sampler.next_1d());
            // Rounding may place the last sample an ulp beyond the end; it is worth nothing there.
            if let FreeFlight::Collision { t, medium, regions } = intervals.free_flight(depth) {
                let m = self.world.media.medium(medium);
                let vertex = Vertex::InMedium { phase: m.phase, direction };
                sum += m.albedo * self.direct_light_alone(free.at(t), &vertex, &regions, sampler, counters);
            }
        }
        sum * to_f32(width)
    }
}

/// The optical depth of a sample in stratum `k`, uniform in transmittance, where each stratum takes `width` of it.
#[inline]
fn stratum_depth(k: u32, width: f64, u: f64) -> f64 {
    -(-(f64::from(k) + u) * width).ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_squared::assert_drawn_from;

    /// In each stratum, for any optical depth, the density of the samples is that of exp(−τ): χ² over 32 cells whose borders lie at equal
    /// steps of *depth*, so that the inversion is not tested with itself. Where exp(−τ) leaves single cells nearly empty the
    /// borders are those of 1 − exp(−τ).
    #[test]
    fn strata_are_drawn_with_the_transmittance() {
        const CELLS: usize = 32;
        for tau in [1e-12, 1e-6, 0.1, 1.0, 3.0, 30.0, 1e4_f64] {
            for n in [1_u32, 2, 7] {
                let width = -(-tau).exp_m1() / f64::from(n);
                for k in 0..n {
                    let share = |depth: f64| -(-depth).exp_m1() / width - f64::from(k);
                    let (first, last) = (stratum_depth(k, width, 0.0), stratum_depth(k, width, 1.0).min(tau));
                    let even: Vec<_> = (0..=CELLS).map(|i| first + (last - first) * i as f64 / CELLS as f64).collect();
                    let of_share = (0..=CELLS).map(|i| -(-(f64::from(k) + i as f64 / CELLS as f64) * width).ln_1p());
                    let borders = if last - first < 4.0 { even } else { of_share.collect() };
                    let mut probabilities: Vec<_> = borders.windows(2).map(|b| share(b[1]) - share(b[0])).collect();
                    // Rounding of `share` for thin media; the relative error of each is far below that of 10⁵ samples.
                    let sum: f64 = probabilities.iter().sum();
                    assert!((sum - 1.0).abs() < 1e-9, "τ = {tau}, n = {n}, k = {k}: {sum}");
                    probabilities.iter_mut().for_each(|p| *p /= sum);
                    let mut cells = [0; CELLS];
                    for i in 0..20_000 {
                        let depth = stratum_depth(k, width, Sampler::new(5, i, k, n).next_1d());
                        assert!((0.0..=tau * (1.0 + 1e-15)).contains(&depth), "τ = {tau}, n = {n}, k = {k}: {depth}");
                        cells[borders.partition_point(|&b| b <= depth).clamp(1, CELLS) - 1] += 1;
                    }
                    assert_drawn_from(&format!("τ = {tau}, n = {n}, k = {k}"), &cells, &probabilities);
                }
            }
        }
    }
}
