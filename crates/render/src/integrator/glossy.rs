//! Scattering on metals, glass and coats, for all integrators and estimators.

use vdf_geometry::Segment;
use vdf_scene::Rgb;
use vdf_visibility::{Counters, QueryKind, Recorder};

use super::{Origin, Path, Tracer, power_heuristic, to_f32};
use crate::{
    RegionSet, Sampler,
    bsdf::{Glossy, Side},
    world::SurfacePoint,
};

impl<R: Recorder> Tracer<'_, R> {
    /// Light is gathered where a path meets such a surface, in these regions, and the path scatters. False if it ends here.
    ///
    /// What passes starts behind the surface, beyond the boundary of the body's own region, if it has any: the way through is
    /// crossed like any other.
    pub(super) fn scatter_glossily(
        &self,
        path: &mut Path,
        surface: &SurfacePoint,
        (number, is_front): (u32, bool),
        regions: RegionSet,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> bool {
        let glossy = self.world.glossy(number);
        let side = Side { normal: surface.normal, wo: -path.ray.direction, is_front };
        if glossy.has_density() {
            let light = self.light_on_glossy(glossy, &side, surface, &regions, sampler, counters);
            path.radiance += path.throughput * light;
        }
        let (choice, u) = (sampler.next_1d(), sampler.next_2d());
        let Some(scattered) = glossy.sample(&side, choice, u) else { return false };
        let passes = scattered.to.dot(surface.normal) < 0.0;
        let (point, regions) =
            if passes { (surface.behind(), self.regions_behind(surface, &regions)) } else { (surface.point, regions) };
        path.throughput *= scattered.weight;
        path.eta2 *= to_f32(scattered.eta * scattered.eta);
        path.origin = scattered.pdf.map_or(Origin::Certain, |pdf| Origin::Scattering { point, pdf });
        path.on_surface = true;
        path.ray = self.ray(point, scattered.to, regions);
        true
    }

    /// Next-event estimation by the power heuristic against the surface's own sampling.
    fn light_on_glossy(
        &self,
        glossy: &Glossy,
        side: &Side,
        surface: &SurfacePoint,
        regions: &RegionSet,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let (u_emitter, u) = (sampler.next_1d(), sampler.next_2d());
        let flight = self.flight_to_emitter(sampler);
        let Some(light) = self.world.lights.sample(surface.point, u_emitter, u) else { return Rgb::ZERO };
        let value = glossy.eval(side, light.direction);
        let kind = QueryKind::Superficial;
        let connected = if light.direction.dot(surface.normal) < 0.0 {
            let behind = self.regions_behind(surface, regions);
            self.connect_as(kind, surface.behind(), value, &behind, &light, flight, counters)
        } else {
            self.connect_as(kind, surface.point, value, regions, &light, flight, counters)
        };
        match connected {
            Some((value, light_pdf, pdf)) if light_pdf > 0.0 => value * to_f32(power_heuristic(light_pdf, pdf)),
            // A point emitter is found by no scattered ray.
            Some((value, ..)) => value,
            None => Rgb::ZERO,
        }
    }

    /// The regions on the other side of a surface.
    fn regions_behind(&self, surface: &SurfacePoint, regions: &RegionSet) -> RegionSet {
        self.world.media.at_end(&Segment::new(surface.point, surface.behind()), regions)
    }
}
