//! `volpath` with the estimator `equiangular`: the paths of `volpath.rs`, drawn so that they come near the lights.
//!
//! *Distances.* A ray that passes a point light within a mean free path of the thinnest medium, and a tenth of the scene's diagonal, is drawn by a mixture: a share of
//! β(1 − T) of such rays, T their transmittance, ends in a collision whose distance is drawn by its angle at the light
//! (`equiangular`); the others fly freely. The density of a collision is that of the mixture, so its weight is at most
//! 1/(1 − β); a ray that arrives at its end is worth 1/(1 − β(1 − T)). Rays that come no nearer fly freely: r² hardly changes along
//! their flights. Next-event estimation asks for the same emitter. Area lights have no such peak, and gained nothing (`performance.md`).
//!
//! *Directions.* In fog, what comes from a direction at the angle θ to a point light grows like 1/sin θ. So a share c of the
//! directions is drawn with the density 1/(2π² sin θ), the others by phase function or cosine; again the weight is that of the mixture and
//! at most 1/(1 − c). Without it the variance beside a point light is infinite. The share is the smaller the more fog there is before the
//! light, and from a surface also the less there is, for then light comes from other surfaces.
//!
//! *The last ray* of a path that may not scatter again flies nowhere: it arrives, and is worth its transmittance. Where no ray can meet a light it is not cast.
//!
//! *Why it is unbiased.* Both mixtures are one-sample estimates with the balance heuristic \[Veach1997\], given emitter and place, which are drawn before
//! and independently. The emitter that directions go to is drawn apart from that of next-event estimation: where the two
//! compete for light, each is weighted with the same densities, given the former.
//!
//! *Cost.* A ray that passes near a light is cast to its end, where `thesis` casts only as far as it flies.

use std::f64::consts::PI;

use glam::DVec3;
use vdf_scene::Rgb;
use vdf_visibility::{Counters, Recorder};

use super::{
    Origin, Path, PathRay, Tracer, Vertex, choose,
    equiangular::{Equiangular, LightPlace},
    power_heuristic,
    stretch::{distance_at_depth, stretches},
    to_f32,
    volpath::Event,
};
use crate::{
    PhaseFunction as _, RegionSet, Sampler, bsdf::sample_diffuse, frame::direction_about, lights::EmitterPoint,
};

/// Rays that pass a light at more than this share of the scene's diagonal fly freely: what they would gain does not make up for its time (`docs/performance.md`).
const NEAR: f64 = 0.1;

/// β, of the rays that collide the share whose distances are drawn towards a light.
const DISTANCES: f64 = 0.3;

/// The share of directions drawn towards a point light, times 1/(1 + τ) at a collision, and times τ/(1 + τ)² on a surface in fog; τ is the
/// distance to the light in mean free paths.
const IN_MEDIUM: f64 = 0.5;
const ON_SURFACE: f64 = 0.25;

/// Nodes of the density of distances: few, for each ray has its own.
const NODES: usize = 3;

/// A mixture of directions: towards a point light, and otherwise.
#[derive(Clone, Copy, Debug)]
struct Mixture {
    /// Unit direction to the light.
    axis: DVec3,
    /// Share of the directions that are drawn about it; may be 0.
    share: f64,
    /// What is left of the number that chose the light: uniform.
    u: f64,
}

impl<R: Recorder> Tracer<'_, R> {
    /// Radiance along `ray` by volumetric path tracing with mixtures.
    pub(crate) fn volpath_by_mixture(&self, ray: PathRay, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let (media, lights) = (&self.world.media, &self.world.lights);
        let mean_free_path = media.least_sigma_t().recip();
        let near_enough = mean_free_path.min(NEAR * self.world.bounds.extent().length());
        let mut path = Path::new(ray);
        while self.goes_on(&mut path, sampler) {
            let is_last = !self.may_scatter(path.depth + 1);
            if is_last && !lights.may_be_met() {
                break;
            }
            let direction = path.ray.direction;
            let (place, u) = self.draw_place(sampler);
            let towards = place.and_then(|place| lights.point_position(place.emitter()));
            let towards = towards.map(|position| LightPlace { position, normal: None });
            let near = |light: &LightPlace| light.passed_at(path.ray.segment.p, direction) < near_enough;
            let event = match towards.filter(near) {
                _ if is_last => self.arrival(&mut path, counters),
                Some(light) => self.event_near_light(&mut path, &light, u, counters),
                None => self.first_event(&mut path, -(-u).ln_1p(), counters),
            };
            match event {
                Event::Collision { point, medium, regions } => {
                    path.depth += 1;
                    let (albedo, phase) = media.scattering(medium, point);
                    path.throughput *= albedo;
                    let vertex = Vertex::InMedium { phase, direction };
                    let mixture = self.mixture(point, &vertex, mean_free_path, sampler.next_1d());
                    path.radiance += path.throughput
                        * self.light_from(point, &vertex, &regions, place.as_ref(), &mixture, sampler, counters);
                    let u = sampler.next_2d();
                    let to = mixture.sample(u).unwrap_or_else(|| phase.sample_direction(direction, u));
                    let value = phase.pdf_direction(direction, to);
                    let pdf = mixture.pdf(to, value);
                    path.reweight(value / pdf);
                    path.origin = Origin::Scattering { point, pdf };
                    path.on_surface = false;
                    path.ray = self.ray(point, to, regions);
                }
                Event::Arrival { surface: Some(surface), regions } if surface.place.is_some() => {
                    if !self.arrive(&mut path, Some(surface), regions, sampler, counters) {
                        break;
                    }
                }
                Event::Arrival { surface, regions } => {
                    let Some(surface) = self.light_at_end(&mut path, surface) else { break };
                    let vertex = Vertex::OnSurface(surface);
                    let u = sampler.next_1d();
                    let mixture = match media.medium_in(&regions) {
                        Some(_) => self.mixture(surface.point, &vertex, mean_free_path, u),
                        None => Mixture::NONE,
                    };
                    let (place, _) = self.draw_place(sampler);
                    path.radiance += path.throughput
                        * self.light_from(
                            surface.point,
                            &vertex,
                            &regions,
                            place.as_ref(),
                            &mixture,
                            sampler,
                            counters,
                        );
                    let u = sampler.next_2d();
                    let to = mixture.sample(u).unwrap_or_else(|| sample_diffuse(surface.normal, u).0);
                    let (_, cosine) = vertex.eval(self.world, to);
                    let pdf = mixture.pdf(to, cosine);
                    if pdf <= 0.0 {
                        break;
                    }
                    path.throughput *= surface.reflectance;
                    path.reweight(cosine / pdf);
                    path.origin = Origin::Scattering { point: surface.point, pdf };
                    path.on_surface = true;
                    path.ray = self.ray(surface.point, to, regions);
                }
            }
        }
        path.radiance
    }

    /// The arrival at the end of the path's ray; the path is worth what passes the media before it.
    fn arrival(&self, path: &mut Path, counters: &mut Counters) -> Event {
        let media = &self.world.media;
        let (surface, free) = self.cast(&path.ray, counters);
        path.throughput *= to_f32((-media.optical_depth(&free, &path.ray.regions)).exp());
        let regions = media.at_end(&free, &path.ray.regions);
        self.crosses_to(path, &regions);
        Event::Arrival { surface, regions }
    }

    /// The event on the path's ray by the mixture of distances, from a uniform number; the path gets its weight.
    fn event_near_light(&self, path: &mut Path, light: &LightPlace, u: f64, counters: &mut Counters) -> Event {
        let media = &self.world.media;
        let (surface, free) = self.cast(&path.ray, counters);
        let intervals = media.intervals(&free, &path.ray.regions);
        let tau = intervals.optical_depth();
        let share = DISTANCES * -(-tau).exp_m1();
        let depth = -(-(u - share) / (1.0 - share)).ln_1p();
        if u >= share && depth >= tau {
            path.reweight(1.0 / (1.0 - share));
            self.crosses_to(path, intervals.end());
            return Event::Arrival { surface, regions: intervals.end().clone() };
        }
        let stretches = stretches(&intervals, media);
        let towards = Equiangular::<NODES>::new(free.p, path.ray.direction, &stretches, light);
        let drawn =
            if u < share { towards.sample(u / share) } else { distance_at_depth(&stretches, depth, &intervals) };
        // Where no distance can be drawn that share of the rays is worth nothing, and the others are worth as much more.
        let Some((i, distance)) = drawn else {
            path.reweight(0.0);
            return Event::Arrival { surface: None, regions: RegionSet::default() };
        };
        let stretch = &stretches[i];
        let flight = stretch.arrives(distance, &intervals);
        let pdf = share * towards.pdf(i, distance) + (1.0 - share) * flight;
        // Nothing comes from where exp(−τ) underflows.
        path.reweight(if flight > 0.0 { flight / pdf } else { 0.0 });
        let t = (distance / intervals.length()).clamp(stretch.ends[0], stretch.ends[1]);
        let regions = intervals.regions_in(stretch.part, t);
        self.crosses_to(path, &regions);
        Event::Collision { point: free.at(t), medium: stretch.medium, regions }
    }

    /// Next-event estimation to this place, by the power heuristic against directions that are drawn from `mixture`.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "what an event has and what a path has")]
    fn light_from(
        &self,
        point: DVec3,
        vertex: &Vertex,
        regions: &RegionSet,
        place: Option<&EmitterPoint>,
        mixture: &Mixture,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let flight = self.flight_to_emitter(sampler);
        let Some(light) = place.and_then(|place| self.world.lights.seen_from(point, place)) else { return Rgb::ZERO };
        match self.connect(point, vertex, regions, &light, flight, counters) {
            Some((value, light_pdf, pdf)) if light_pdf > 0.0 => {
                value * to_f32(power_heuristic(light_pdf, mixture.pdf(light.direction, pdf)))
            }
            // A point emitter is found by no scattered ray.
            Some((value, ..)) => value,
            None => Rgb::ZERO,
        }
    }

    /// A mixture with directions from `point` towards an emitter drawn by `u`, if that is a point.
    #[inline]
    fn mixture(&self, point: DVec3, vertex: &Vertex, mean_free_path: f64, u: f64) -> Mixture {
        let lights = &self.world.lights;
        let Some((emitter, u)) = choose(u, lights.count()) else { return Mixture::NONE };
        let to_light = lights.point_position(emitter).map(|p| p - point);
        let Some((to_light, axis)) = to_light.and_then(|d| Some((d, d.try_normalize()?))) else { return Mixture::NONE };
        let depth = to_light.length() / mean_free_path;
        let share = match vertex {
            Vertex::InMedium { .. } => IN_MEDIUM / (1.0 + depth),
            Vertex::OnSurface(_) | Vertex::OnMaterial(..) => ON_SURFACE * depth / ((1.0 + depth) * (1.0 + depth)),
        };
        Mixture { axis, share, u }
    }
}

impl Path {
    /// The path was drawn from a mixture; this is its weight.
    #[inline]
    fn reweight(&mut self, weight: f64) {
        self.throughput *= to_f32(weight);
        self.aim *= weight;
    }
}

impl Mixture {
    /// Nothing is drawn towards a light.
    const NONE: Self = Self { axis: DVec3::Z, share: 0.0, u: 0.0 };

    /// A direction about the light, if this is the turn of one.
    #[inline]
    fn sample(&self, u: [f64; 2]) -> Option<DVec3> {
        (self.u < self.share).then(|| {
            let (sin, cos) = (PI * u[0]).sin_cos();
            direction_about(self.axis, cos, sin, 2.0 * PI * u[1])
        })
    }

    /// The density per steradian of a direction, where that of the other part is `other`.
    #[inline]
    fn pdf(&self, to: DVec3, other: f64) -> f64 {
        if self.share == 0.0 {
            return other;
        }
        // Straight at the light it is infinite, and a sample is worth nothing.
        let about = 1.0 / (2.0 * PI * PI * self.axis.cross(to).length());
        self.share * about + (1.0 - self.share) * other
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_squared::assert_drawn_from;

    /// Directions about an axis: χ² over 16 × 8 cells of equal angle and azimuth, each of the same probability by the density 1/(2π² sin θ), which
    /// `pdf` has to be; and that integrates to 1, by the midpoint rule in the angle, for which it is exact.
    #[test]
    fn directions_are_drawn_about_the_light() {
        let axis = DVec3::new(0.3, -0.8, 0.5).normalize();
        let mixture = Mixture { axis, share: 1.0, u: 0.0 };
        let (across, third) = (axis.any_orthonormal_pair().0, axis.any_orthonormal_pair().1);
        let mut cells = [0_u64; 128];
        for i in 0..100_000 {
            let d = mixture.sample(Sampler::new(23, i, 0, 0).next_2d()).expect("its turn");
            let theta = axis.cross(d).length().atan2(axis.dot(d));
            assert!((mixture.pdf(d, 7.0) * 2.0 * PI * PI * theta.sin() - 1.0).abs() < 1e-9, "{theta}");
            let azimuth = (d.dot(third).atan2(d.dot(across)) / (2.0 * PI) + 1.0).fract();
            cells[((theta / PI * 16.0) as usize).min(15) * 8 + ((azimuth * 8.0) as usize).min(7)] += 1;
        }
        assert_drawn_from("about the light", &cells, &[1.0 / 128.0; 128]);
    }

    /// Straight at the light, away from it and by chance: no density is NaN, and a sample straight at it is worth nothing.
    #[test]
    fn the_density_has_no_holes() {
        let mixture = Mixture { axis: DVec3::Z, share: 0.5, u: 0.7 };
        assert_eq!(mixture.sample([0.5, 0.5]), None);
        for to in [DVec3::Z, -DVec3::Z] {
            assert_eq!(1.0 / mixture.pdf(to, 1.0), 0.0);
        }
        assert_eq!(Mixture { share: 0.0, ..mixture }.pdf(DVec3::Z, 0.25), 0.25);
    }
}
