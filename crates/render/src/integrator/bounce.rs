//! Light that comes to a path from a point by way of one more place: a path of the light, one event long, that the events of a camera path are connected to.
//!
//! *Idea.* What a scattered ray finds is seldom bright: near a point light a wall, or fog, is worth hundreds of times what it is elsewhere, and few rays get
//! there. A ray from the light gets there just as often as light does. So for each camera path a ray is sent from a light, y the place where it
//! is scattered first, and every event x of the camera path is lit by it.
//!
//! *Definition.* The light that is scattered at y and then at x is estimated twice: by the ray that leaves x, if its next event is at y and asks for the light
//! there, and by the connection of x with y. With d the distance from x to y, r that from y to the light, θ and θ' the angles at y to x and to the light, p the density of the
//! direction at x and q that of the direction at the light, their densities at y are, but for transmittances, p cos θ/d² and q cos θ'/r²; in fog without the cosines. Each is
//! weighted by its share in the sum of both (balance heuristic \[Veach1997\]). So the squares of both distances cancel, and no estimate is large where y is
//! close to x or to the light.
//!
//! *Why it is unbiased.* The weights of a path add up to 1, whatever densities they are made of. A ray of the light ends at the first shape that it meets, and y has to
//! see the light by the very query that an event asks. Through a veil, or from the other side of a surface, a light's ray never gets to y: then the
//! other estimate has all the weight.
//!
//! *Cost.* A ray for each camera path, and a query of the hierarchy for each event: a fifth to a third of the time.

use glam::DVec3;
use vdf_geometry::Segment;
use vdf_scene::{Phase, Rgb};
use vdf_visibility::{Counters, QueryKind, Recorder, ShadowQuery};

use super::{Origin, Path, Tracer, Vertex, to_f32, volpath::Event};
use crate::{LightSample, PhaseFunction as _, RegionSet, Sampler, lights::LightRay, world::SurfacePoint};

/// A connection that brings less than this share of the light that the path has gathered is made as seldom as it brings less, and is then worth as much more.
const LITTLE: f32 = 0.05;

/// Whether the events of paths are connected to light paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Connected {
    /// They are not.
    Never,
    /// They are not, but the numbers of light paths are passed over: so the paths are those of `Always`.
    PassedOver,
    /// They are.
    Always,
}

/// What a path has of its light path.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "one for each path, on the stack")]
pub(super) enum LightPath {
    /// It is to have none.
    Never,
    /// It is to have none, but its numbers are passed over with the first event that would need it.
    PassedOver,
    /// It is drawn with the first event that needs it.
    NotYet,
    /// It was drawn; `None` if it ended nowhere.
    Drawn(Option<Bounce>),
}

/// Where a ray from a light is scattered first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounce {
    place: Place,
    /// What an event there gets from the light, over its density but for that of [`Bounce::density`].
    light: LightSample,
    /// q cos θ'/r²
    density: f64,
}

#[derive(Clone, Copy, Debug)]
enum Place {
    InMedium { point: DVec3, albedo: Rgb, phase: Phase },
    OnSurface(SurfacePoint),
}

impl<R: Recorder> Tracer<'_, R> {
    /// A place where light is scattered first. Takes as many numbers whichever emitter it comes from.
    #[inline(never)]
    fn draw_bounce(&self, sampler: &mut Sampler, counters: &mut Counters) -> Option<Bounce> {
        let lights = &self.world.lights;
        let (i, u) = lights.choose_beam(sampler.next_1d())?;
        let beam = &lights.beams()[i];
        let of_place = if lights.numbers_of_origin() > 0 { sampler.next_2d() } else { [0.0; 2] };
        let from_light = beam.sample(lights, [of_place, sampler.next_2d()])?;
        let LightRay { origin, direction, .. } = from_light;
        let mut regions = self.world.beam_regions[i].clone();
        if origin != beam.position {
            regions = self.world.media.at_end(&Segment::new(beam.position, origin), &regions);
        }
        let ray = self.ray(origin, direction, regions);
        let mut path = Path::new(ray);
        path.on_surface = !beam.is_point();
        let (place, point, cosine, kind) = match self.first_event(&mut path, -(-u).ln_1p(), counters) {
            Event::Collision { point, medium, .. } => {
                let (albedo, phase) = self.world.media.scattering(medium, point);
                (Place::InMedium { point, albedo, phase }, point, 1.0, QueryKind::Spatial)
            }
            Event::Arrival { surface: Some(s), .. } => {
                (Place::OnSurface(s), s.point, -direction.dot(s.normal), QueryKind::Superficial)
            }
            Event::Arrival { surface: None, .. } => return None,
        };
        let choices = self.choices(beam.emitter, point);
        let light = self.light_of_ray(i, &from_light, point, choices)?;
        let distance2 = point.distance_squared(light.point);
        let density = lights.density_of_beam(beam.emitter, distance2, light.pdf, choices) * cosine / distance2;
        let kind = if light.on_surface && kind == QueryKind::Spatial { QueryKind::OnLight } else { kind };
        let query = ShadowQuery { from: point, to: light.point, emitter: beam.emitter, kind };
        let is_lit = density > 0.0 && density.is_finite() && self.visibility.unoccluded(&query, counters);
        is_lit.then_some(Bounce { place, light, density })
    }

    /// So many numbers [`Tracer::draw_bounce`] takes.
    pub(super) fn numbers_of_bounce(&self) -> u32 {
        3 + self.world.lights.numbers_of_origin()
    }

    /// What a ray of a beam, which starts there, brings to `point`, where its emitter is one of so many; its weight is what is scattered at the point over the cosine there and the
    /// density of the ray.
    #[inline]
    fn light_of_ray(&self, beam: usize, ray: &LightRay, point: DVec3, choices: f64) -> Option<LightSample> {
        let lights = &self.world.lights;
        let beams = 1.0 / lights.beam_chance(beam);
        let beam = &lights.beams()[beam];
        let Some((normal, radiance)) = ray.surface else {
            let place = lights.sample_point(beam.emitter, [0.0; 2])?.of_choices(choices);
            let light = lights.seen_from(point, &place)?;
            let distance2 = point.distance_squared(light.point);
            let density = lights.density_of_beam(beam.emitter, distance2, light.pdf, choices);
            return Some(LightSample { weight: light.weight * to_f32(distance2 / density), ..light });
        };
        let d = ray.origin - point;
        let distance = d.length();
        let direction = d / distance;
        let cosine = -normal.dot(direction);
        Some(LightSample {
            emitter: beam.emitter,
            point: ray.origin,
            direction,
            weight: radiance * to_f32(beam.throughput() * beams),
            pdf: lights.pdf_area(beam.emitter, distance, cosine, choices),
            on_surface: true,
            choices,
        })
    }

    /// The light that comes to an event by way of the path's light path.
    pub(super) fn light_by_bounce(
        &self,
        path: &mut Path,
        point: DVec3,
        vertex: &Vertex,
        regions: &RegionSet,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        if let LightPath::NotYet = path.light_path {
            path.light_path = LightPath::Drawn(self.draw_bounce(sampler, counters));
        }
        let LightPath::Drawn(Some(bounce)) = &path.light_path else { return Rgb::ZERO };
        let there = match &bounce.place {
            Place::InMedium { point, .. } => *point,
            Place::OnSurface(surface) => surface.point,
        };
        let (to, distance2) = (there - point, there.distance_squared(point));
        if distance2 == 0.0 {
            return Rgb::ZERO;
        }
        let to = to / distance2.sqrt();
        let (value, pdf) = vertex.eval(self.world, to);
        let (scattered, cosine) = self.scattered_at(bounce, to);
        let value = value * scattered * bounce.light.weight;
        if value.max_element() <= 0.0 {
            return Rgb::ZERO;
        }
        let through;
        let (from, regions) = match self.side_towards(to, vertex, regions) {
            None => (point, regions),
            Some(behind) => {
                through = behind.1;
                (behind.0, &through)
            }
        };
        let segment = Segment::new(from, there);
        // The weight over d².
        let share = bounce.density / (pdf * cosine + bounce.density * distance2);
        let transmittance = self.world.media.transmittance(&segment, regions);
        let value = value * to_f32(transmittance * share);
        let worth = (path.throughput * value).max_element();
        let Some(factor) = by_chance(worth, LITTLE * path.radiance.max_element(), sampler.aside()) else {
            return Rgb::ZERO;
        };
        if !self.visibility.connected(&segment, counters) {
            return Rgb::ZERO;
        }
        let passed = match &self.world.others {
            None => Rgb::ONE,
            Some(others) => self.passes(others, &segment, to).map_or(Rgb::ZERO, |(passed, _)| passed),
        };
        value * passed * factor
    }

    /// What of the light is scattered against `to`, over cos θ', with what it has of cos θ; and cos θ.
    #[inline]
    fn scattered_at(&self, bounce: &Bounce, to: DVec3) -> (Rgb, f64) {
        let to_light = bounce.light.direction;
        match &bounce.place {
            Place::InMedium { albedo, phase, .. } => (*albedo * to_f32(phase.pdf_direction(to, to_light)), 1.0),
            Place::OnSurface(surface) => {
                let (cosine, cosine_to_light) = (-surface.normal.dot(to), surface.normal.dot(to_light));
                if cosine <= 0.0 || cosine_to_light <= 0.0 {
                    return (Rgb::ZERO, cosine);
                }
                let shading;
                let vertex = match surface.place {
                    None => Vertex::OnSurface(*surface),
                    Some(_) => {
                        let Some(there) = self.world.shading(surface, to) else { return (Rgb::ZERO, cosine) };
                        shading = there;
                        Vertex::OnMaterial(surface, &shading)
                    }
                };
                (vertex.eval(self.world, to_light).0 * to_f32(cosine / cosine_to_light), cosine)
            }
        }
    }

    /// p cos θ/d² at an event that a path comes to from this origin; infinite where no light path could be at the event.
    #[inline]
    pub(super) fn density_of_arrival(&self, origin: &Origin, point: DVec3, vertex: &Vertex) -> f64 {
        let &Origin::Scattering { point: before, pdf, connected: true, .. } = origin else { return f64::INFINITY };
        let (back, distance2) = (before - point, before.distance_squared(point));
        pdf * vertex.cosine_to(back / distance2.sqrt()) / distance2
    }

    /// The weight of what an event with this density of arrival gets straight from `light`.
    #[inline]
    pub(super) fn weight_beside_bounce(&self, arrival: f64, point: DVec3, vertex: &Vertex, light: &LightSample) -> f64 {
        let cosine = vertex.cosine_to(light.direction);
        let distance2 = light.point.distance_squared(point);
        let of_direction = self.world.lights.density_of_beam(light.emitter, distance2, light.pdf, light.choices);
        share_beside_bounce(arrival, of_direction * cosine / distance2)
    }
}

/// The share of an estimate with density `arrival` beside that of a light path.
#[inline]
pub(super) fn share_beside_bounce(arrival: f64, by_bounce: f64) -> f64 {
    // Where no light path can be, all of it; and where neither has a density nothing was connected.
    if arrival.is_finite() && by_bounce > 0.0 { arrival / (arrival + by_bounce) } else { 1.0 }
}

/// So many times its worth is what brings less than `little`, if it is taken by a uniform number.
#[inline]
fn by_chance(worth: f32, little: f32, u: f64) -> Option<f32> {
    if worth >= little {
        return Some(1.0);
    }
    (u * f64::from(little) < f64::from(worth)).then(|| little / worth)
}

#[cfg(test)]
mod tests {
    use pulp::Arch;
    use vdf_scene::{LoadOptions, Scene};

    use super::*;
    use crate::{PrepareOptions, PreparedScene, Quiet, SamplerKind};

    /// As many numbers are passed over as are drawn, from a point and from an area, whatever becomes of the light path.
    #[test]
    fn paths_without_light_paths_may_have_the_same_numbers() {
        for (name, numbers) in [("cbox_vol2", 3), ("cbox_light", 5)] {
            let source = vdf_scenes::builtin(name).expect("a built-in scene");
            let scene = Scene::from_source(&source, &LoadOptions::default()).expect("it loads");
            let prepared = PreparedScene::new(scene, &PrepareOptions::default(), &Quiet).expect("it is prepared");
            let tracer = Tracer::of(&prepared, Connected::Always, Arch::new());
            assert_eq!(tracer.numbers_of_bounce(), numbers);
            for i in 0..200 {
                let mut drawn = Sampler::of_kind(SamplerKind::Sobol, 1, i, 0, i);
                let mut passed = drawn.clone();
                tracer.draw_bounce(&mut drawn, &mut Counters::default());
                passed.skip(tracer.numbers_of_bounce());
                assert_eq!(drawn.next_1d(), passed.next_1d(), "{name}");
            }
        }
    }

    /// By evenly spaced numbers, for which the mean is exact but for one of them.
    #[test]
    fn what_is_taken_by_chance_has_its_mean() {
        for (worth, little) in
            [(0.03_f32, 0.2), (0.2, 0.2), (1.0, 0.2), (1e-3, 0.2), (0.5, 0.0), (0.0, 0.0), (0.0, 0.2)]
        {
            let n = 10_000;
            let taken = (0..n).filter_map(|i| by_chance(worth, little, f64::from(i) / f64::from(n)));
            let mean = taken.map(|factor| f64::from(factor * worth)).sum::<f64>() / f64::from(n);
            assert!((mean - f64::from(worth)).abs() <= 1.1e-4 * f64::from(little) + 1e-7, "{worth}, {little}: {mean}");
        }
    }
}
