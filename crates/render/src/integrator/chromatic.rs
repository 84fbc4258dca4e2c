//! What the integrators do where a medium takes more of one colour than of another.
//!
//! *Idea.* A free flight is drawn by the optical depth of one channel, which serves the others badly: where they would fly farther or nearer a sample is worth much. So the channel is
//! chosen at random, and a sample is weighted with the mean of the densities of all channels, which are known in closed form: the balance heuristic in its one-sample form \[Veach1997\] over
//! colours, as of wavelengths \[Wilkie2014\].
//!
//! *Definition.* Let r_c be what the flights so far are worth in channel c; their mean is 1. A channel is drawn with probability r_c/3. If the flight ends with the densities q_c, of
//! which the mean weighted with r is m, the path's throughput and r are multiplied with q_c/m. Densities are those of a collision, σ_t·exp(−τ), or of none, exp(−τ).
//!
//! *Why it is unbiased, and bounded.* To draw a channel anew with r_c/3 is to draw it once for the path: r_c/3 is the probability of c given the flights. So a sample is worth f/(mean of the
//! densities of its path), and r_c is never more than 3, however long the path is. Directions and emitters are drawn without a look at the channel.
//!
//! *Cost.* Each ray is cast to its end, where grey media cast only as far as it flies. `raymarch` and `volpath` look for light as the estimator `thesis` does, whichever is asked for.

use glam::DVec3;
use vdf_scene::Rgb;
use vdf_visibility::{Counters, Recorder};

use super::{Path, Tracer, Vertex, raymarch::Fog, volpath::Event};
use crate::{Sampler, media::FreeFlight};

impl<R: Recorder> Tracer<'_, R> {
    /// The first event on the path's ray, whose channel and free flight are drawn by a uniform number; the path gets its weight.
    pub(super) fn chromatic_event(&self, path: &mut Path, u: f64, counters: &mut Counters) -> Event {
        let (channel, u) = draw_channel(path.worth, u);
        let (surface, free) = self.cast(&path.ray, counters);
        let intervals = self.world.media.intervals(&free, &path.ray.regions);
        let flight = intervals.chromatic_flight(channel, -(-u).ln_1p());
        let densities = flight.densities();
        let mean = path.worth.dot(densities) / 3.0;
        // Of what has no density in the channel that was drawn, rounding knows; it is worth nothing.
        let gain = if mean > 0.0 { densities / mean } else { DVec3::ZERO };
        path.throughput *= gain.as_vec3();
        path.worth *= gain;
        self.end_of_flight(path, flight.end, &free, surface)
    }

    /// Emitted light scattered once into a ray of these optical depths, from distances drawn by the transmittance of all channels: one of them with a probability in proportion to
    /// what it scatters.
    pub(super) fn by_transmittances(
        &self,
        fog: &Fog<'_>,
        depths: DVec3,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let &Fog { free, direction, intervals, samples, .. } = fog;
        let scattered = (-depths).to_array().map(|d| -d.exp_m1());
        let all: f64 = scattered.iter().sum();
        let mut sum = Rgb::ZERO;
        for k in 0..samples {
            if self.stops_at(k) {
                break;
            }
            let mut left = (f64::from(k) + sampler.next_1d()) / f64::from(samples) * all;
            let channel = (0..2).find(|&c| {
                let is_here = left < scattered[c];
                if !is_here {
                    left -= scattered[c];
                }
                is_here
            });
            let event = intervals.chromatic_flight(channel.unwrap_or(2), -(-left.min(1.0)).ln_1p());
            // Rounding may place the last sample an ulp beyond the end; it is worth nothing there.
            let FreeFlight::Collision { t, medium, regions } = &event.end else { continue };
            let densities = event.sigma_t * (-event.depths).exp();
            let mean = densities.element_sum() / all;
            if mean <= 0.0 || mean.is_nan() {
                continue;
            }
            let point = free.at(*t);
            let (albedo, phase) = self.world.media.scattering(*medium, point);
            let vertex = Vertex::InMedium { phase, direction };
            let (light, flight) = self.draw_emitter(point, sampler);
            let Some(light) = light else { continue };
            if let Some(arriving) = self.connect(point, &vertex, regions, &light, flight, counters) {
                sum += albedo * (densities / mean).as_vec3() * arriving.value;
            }
        }
        sum / samples as f32
    }
}

/// A channel with a probability in proportion to its worth, of which the mean is 1; and what is left of the number: uniform.
#[inline]
fn draw_channel(worth: DVec3, u: f64) -> (usize, f64) {
    let mut left = u * worth.element_sum();
    for channel in 0..2 {
        if left < worth[channel] {
            return (channel, left / worth[channel]);
        }
        left -= worth[channel];
    }
    let rest = if worth.z > 0.0 { left / worth.z } else { 0.0 };
    (2, rest.clamp(0.0, 1.0 - f64::EPSILON / 2.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In proportion to their worth, and what is left is uniform: in each of four parts as often.
    #[test]
    fn channels_are_drawn_by_their_worth() {
        for worth in [DVec3::ONE, glam::dvec3(0.0, 2.5, 0.5), glam::dvec3(3.0, 0.0, 0.0), glam::dvec3(0.0, 0.0, 3.0)] {
            let mut counts = [[0_u32; 4]; 3];
            for k in 0..12_000 {
                let (channel, left) = draw_channel(worth, (f64::from(k) + 0.5) / 12_000.0);
                assert!((0.0..1.0).contains(&left));
                counts[channel][(left * 4.0) as usize] += 1;
            }
            for (channel, parts) in counts.iter().enumerate() {
                assert!(
                    parts.iter().all(|&n| (f64::from(n) - 1000.0 * worth[channel]).abs() <= 2.0),
                    "{worth} {counts:?}"
                );
            }
        }
    }
}
