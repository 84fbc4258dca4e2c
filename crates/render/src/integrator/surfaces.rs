//! Surfaces that are no plain Lambertian ones, curved shapes and veils: what the integrators do where they meet them.
//!
//! *Sides.* A material is evaluated in the frame of the shading normal; on which side a ray goes on is decided by the surface itself, and so are the
//! regions: a direction that leads to the other side starts there, after the crossing of whatever boundaries lie on the surface.
//!
//! *Shadow rays* go straight through veils, weakened, and through nothing else: glass that refracts blocks them, as in Mitsuba 3.

use glam::DVec3;
use vdf_geometry::{Hit, Segment};
use vdf_scene::Rgb;
use vdf_visibility::{Counters, Recorder};

use super::{Origin, Path, Tracer, Vertex};
use crate::{
    RegionSet, Sampler,
    bsdf::Lobe,
    others::OtherShapes,
    world::{ShadingPoint, SurfacePoint, World},
};

impl<R: Recorder> Tracer<'_, R> {
    /// The first surface on a segment, of whose opaque triangles `hit` is the first.
    #[inline(never)]
    pub(super) fn first_of_all(
        &self,
        others: &OtherShapes,
        hit: Option<Hit>,
        segment: &Segment,
        direction: DVec3,
    ) -> Option<SurfacePoint> {
        others.first(segment, hit).map(|met| self.world.surface_at(&met, segment, direction))
    }

    /// What of light passes the other shapes on a segment that no opaque triangle meets, and whether it met none of them; `None` if nothing passes.
    #[inline(never)]
    pub(super) fn passes(&self, others: &OtherShapes, segment: &Segment, direction: DVec3) -> Option<(Rgb, bool)> {
        if others.occlude(segment) {
            return None;
        }
        let mut is_straight = true;
        let passed = others.pass(segment, |met| {
            is_straight = false;
            self.world.passes(&met, segment, direction)
        });
        (passed.max_element() > 0.0).then_some((passed, is_straight))
    }

    /// Where a ray starts that leaves a surface on the side that is not seen, and in which regions.
    pub(super) fn behind(
        &self,
        surface: &SurfacePoint,
        shading: &ShadingPoint,
        regions: &RegionSet,
    ) -> (DVec3, RegionSet) {
        let point = surface.behind(shading);
        (point, self.world.media.at_end(&Segment::new(surface.point, point), regions))
    }

    /// The event on such a surface: light is gathered, and the path goes on. False if it ends here.
    #[inline(never)]
    pub(super) fn arrive_at_material(
        &self,
        path: &mut Path,
        surface: &SurfacePoint,
        regions: RegionSet,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> bool {
        let Some(shading) = &self.world.shading(surface, path.ray.direction) else { return false };
        path.radiance += path.throughput * self.emitted(surface, path.ray.direction, &path.origin);
        let material = &self.world.materials[shading.material as usize].material;
        let may_scatter = self.may_scatter(path.depth + 1);
        let (mut connected, mut arrival) = (false, f64::INFINITY);
        if may_scatter && material.has_smooth_lobes() {
            let vertex = Vertex::OnMaterial(surface, shading);
            arrival = self.density_of_arrival(&path.origin, surface.point, &vertex);
            let mut light = self.direct_light(surface.point, &vertex, &regions, arrival, None, sampler, counters);
            connected = self.connects(&mut path.light_path, path.depth + 1, sampler);
            if connected {
                light += self.light_by_bounce(path, surface.point, &vertex, &regions, sampler, counters);
            }
            path.radiance += path.throughput * light;
        }
        let (choice, u) = (sampler.next_1d(), sampler.next_2d());
        let Some(sample) = material.sample(shading.wi, &shading.at, choice, u) else { return false };
        let direction = match sample.lobe {
            Lobe::Null => path.ray.direction,
            Lobe::Smooth | Lobe::Delta => shading.world(sample.wo),
        };
        let (point, regions) = if direction.dot(surface.normal) < 0.0 {
            self.behind(surface, shading, &regions)
        } else {
            (surface.point, regions)
        };
        path.throughput *= sample.weight;
        path.compression *= (sample.eta * sample.eta) as f32;
        match sample.lobe {
            // Nothing has happened: what draws the direction, and how deep the path is, stays.
            Lobe::Null => {
                // But no light path gets through.
                if let Origin::Scattering { arrival, .. } = &mut path.origin {
                    *arrival = f64::INFINITY;
                }
            }
            Lobe::Smooth | Lobe::Delta => {
                path.depth += 1;
                if !may_scatter {
                    return false;
                }
                path.origin = match sample.lobe {
                    Lobe::Smooth => Origin::Scattering {
                        point: surface.point,
                        pdf: sample.pdf,
                        connected,
                        arrival,
                        cosine: direction.dot(surface.normal),
                    },
                    _ => Origin::Delta,
                };
            }
        }
        path.on_surface = true;
        path.ray = self.ray(point, direction, regions);
        true
    }
}

/// BSDF times cosine towards `to`, and the density with which [`Tracer::arrive_at_material`] would draw it.
#[inline(never)]
pub(super) fn eval(world: &World, shading: &ShadingPoint, to: DVec3) -> (Rgb, f64) {
    let material = &world.materials[shading.material as usize].material;
    material.eval(shading.wi, shading.local(to), &shading.at)
}
