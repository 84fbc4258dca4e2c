//! `volpath` with the estimator `equiangular`: the paths of `volpath.rs`, drawn so that they come near the lights, and connected to paths of the lights.
//!
//! *Distances.* A ray that passes a point light within a mean free path of the thinnest medium, and a tenth of the scene's diagonal, is drawn by a mixture: a share of
//! β(1 − T) of such rays, T their transmittance, ends in a collision whose distance is drawn by its angle at the light
//! (`equiangular`); the others fly freely. The density of a collision is that of the mixture, so its weight is at most
//! 1/(1 − β); a ray that arrives at its end is worth 1/(1 − β(1 − T)). Rays that come no nearer fly freely: r² hardly changes along
//! their flights. Of several emitters any may be the one; the event asks another, that can give it much (`lights/choice.rs`). Area lights have no such peak, and gained
//! nothing (`performance.md`).
//!
//! *Light paths.* Every event is connected to the first event of a ray from a light (`bounce.rs`).
//!
//! *The last ray* of a path that may not scatter again flies nowhere: it arrives, and is worth its transmittance. Where no ray can meet a light it is not cast.
//!
//! *Why it is unbiased.* The mixture is a one-sample estimate with the balance heuristic \[Veach1997\], given the emitter that the distance is drawn towards, which is drawn before
//! and independently. The only emitter's place is drawn then, too, and serves the event as well.
//!
//! *Cost.* A ray that passes near a light is cast to its end, where `thesis` casts only as far as it flies.

use vdf_scene::Rgb;
use vdf_visibility::{Counters, Recorder};

use super::{
    Origin, Path, PathRay, Tracer, Vertex,
    bounce::{Connected, LightPath},
    choose,
    equiangular::{Equiangular, LightPlace},
    stretch::{distance_at_depth, stretches},
    to_f32,
    volpath::Event,
};
use crate::{PhaseFunction as _, RegionSet, Sampler, bsdf::sample_diffuse};

/// Rays that pass a light at more than this share of the scene's diagonal fly freely: what they would gain does not make up for its time (`docs/performance.md`).
const NEAR: f64 = 0.1;

/// β, of the rays that collide the share whose distances are drawn towards a light.
const DISTANCES: f64 = 0.3;

/// Nodes of the density of distances: few, for each ray has its own.
const NODES: usize = 3;

impl<R: Recorder> Tracer<'_, R> {
    /// Radiance along `ray` by volumetric path tracing with mixtures and light paths.
    pub(crate) fn volpath_by_mixture(&self, ray: PathRay, sampler: &mut Sampler, counters: &mut Counters) -> Rgb {
        let (media, lights) = (&self.world.media, &self.world.lights);
        // Without media no distance is drawn.
        let nowhere = media.are_nowhere();
        let near_enough = media.least_sigma_t().recip().min(NEAR * self.world.bounds.extent().length());
        let mut path = Path::new(ray);
        path.light_path = match self.light_paths {
            Connected::Never => LightPath::Never,
            Connected::PassedOver => LightPath::PassedOver,
            Connected::Always => LightPath::NotYet,
        };
        while self.goes_on(&mut path, sampler) {
            let is_last = !self.may_scatter(path.depth + 1);
            if is_last && !lights.may_be_met() {
                break;
            }
            let direction = path.ray.direction;
            let u = sampler.next_1d();
            // The only emitter's place serves the distance and the event; of several one is drawn for each, for an event knows better.
            let origin = path.ray.segment.p;
            let chosen = choose(u, lights.count());
            let u = chosen.map_or(u, |(_, rest)| rest);
            let place = if lights.count() == 1 { self.draw_place(0, sampler) } else { None };
            let towards = chosen.and_then(|(emitter, _)| lights.point_position(emitter));
            let towards = towards.map(|position| LightPlace { position, normal: None });
            let near = |light: &LightPlace| !nowhere && light.passed_at(origin, direction) < near_enough;
            let event = match towards.filter(near) {
                _ if is_last => self.arrival(&mut path, counters),
                Some(light) => self.event_near_light(&mut path, &light, u, counters),
                None if nowhere => self.first_event(&mut path, f64::INFINITY, counters),
                None => self.first_event(&mut path, -(-u).ln_1p(), counters),
            };
            let (vertex, point, regions) = match event {
                Event::Collision { point, medium, regions } => {
                    path.depth += 1;
                    let (albedo, phase) = media.scattering(medium, point);
                    path.throughput *= albedo;
                    (Vertex::InMedium { phase, direction }, point, regions)
                }
                Event::Arrival { surface: Some(surface), regions } if surface.place.is_some() => {
                    if self.arrive_at_material(&mut path, &surface, regions, sampler, counters) {
                        continue;
                    }
                    break;
                }
                Event::Arrival { surface, regions } => {
                    let Some(surface) = self.light_at_end(&mut path, surface) else { break };
                    (Vertex::OnSurface(surface), surface.point, regions)
                }
            };
            let arrival = self.density_of_arrival(&path.origin, point, &vertex);
            let mut light = self.direct_light(point, &vertex, &regions, arrival, place.as_ref(), sampler, counters);
            let connected = self.connects(&mut path.light_path, path.depth, sampler);
            if connected {
                light += self.light_by_bounce(&mut path, point, &vertex, &regions, sampler, counters);
            }
            path.radiance += path.throughput * light;
            let u = sampler.next_2d();
            let (to, pdf, cosine) = match &vertex {
                Vertex::InMedium { phase, .. } => {
                    path.on_surface = false;
                    let to = phase.sample_direction(direction, u);
                    (to, phase.pdf_direction(direction, to), 1.0)
                }
                Vertex::OnSurface(surface) => {
                    path.on_surface = true;
                    path.throughput *= surface.reflectance;
                    let (to, pdf) = sample_diffuse(surface.normal, u);
                    (to, pdf, surface.normal.dot(to))
                }
                Vertex::OnMaterial(..) => break,
            };
            path.origin = Origin::Scattering { point, pdf, connected, arrival, cosine };
            path.ray = self.ray(point, to, regions);
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
}

impl Path {
    /// The path was drawn from a mixture; this is its weight.
    #[inline]
    fn reweight(&mut self, weight: f64) {
        self.throughput *= to_f32(weight);
        self.aim *= weight;
    }
}
