//! The integrators, and what they share: next-event estimation and multiple importance sampling.

mod bounce;
mod chromatic;
mod equiangular;
mod fan;
mod kind;
mod lit;
mod mixture;
mod raymarch;
mod stretch;
mod surfaces;
mod volpath;

use glam::DVec3;
use pulp::Arch;
use vdf_geometry::{Hit, Segment};
use vdf_scene::{IntegratorSettings, Phase, Rgb};
use vdf_visibility::{Counters, QueryKind, Recorder, ShadowQuery, Visibility};

pub(crate) use self::bounce::Connected;
use self::bounce::{LightPath, share_beside_bounce};
pub use self::kind::{Integrator, NoSegmentSamples, SegmentSamples, UnknownIntegrator};
pub(crate) use self::raymarch::evenly;
use crate::{
    CameraRay, Estimator, LightSample, PhaseFunction as _, Progress, RegionSet, Roulette, Sampler,
    TransmittanceEstimator,
    bsdf::{eval_diffuse, sample_diffuse},
    lights::{EmitterPoint, choose},
    world::{ShadingPoint, SurfacePoint, World},
};

/// What the integrators work with: a scene, and who answers its visibility queries.
pub(crate) struct Tracer<'a, R> {
    pub(crate) world: &'a World,
    pub(crate) visibility: Visibility<'a, R>,
    pub(crate) settings: IntegratorSettings,
    pub(crate) transmittance: TransmittanceEstimator,
    pub(crate) roulette: Roulette,
    pub(crate) estimator: Estimator,
    /// Whether paths are connected to paths of the lights.
    pub(crate) light_paths: Connected,
    /// The instruction set of vectors.
    pub(crate) arch: Arch,
    /// Whom a long path asks whether to stop.
    pub(crate) progress: &'a dyn Progress,
}

/// Events of one path, or samples of one segment, between two looks whether to stop.
const EVENTS_PER_LOOK: u32 = 4096;

/// A ray on its way: from where, whereto, in which medium it starts, and what its light is worth.
#[derive(Clone, Debug)]
pub(crate) struct PathRay {
    /// From the last event to the farthest point of interest.
    pub(crate) segment: Segment,
    /// Unit direction.
    pub(crate) direction: DVec3,
    /// The regions that it starts in.
    pub(crate) regions: RegionSet,
}

/// How the last event drew the ray's direction.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// The camera: no emitter sampling competes.
    Camera,
    /// A scattering event at `point` that drew the direction with density `pdf` and also sampled the emitters.
    Scattering {
        point: DVec3,
        pdf: f64,
        /// Whether it was connected to a light path, too.
        connected: bool,
        /// [`Tracer::density_of_arrival`] there.
        arrival: f64,
        /// The cosine of the ray's angle to the normal, or 1 in a medium.
        cosine: f64,
    },
    /// A mirror or a lens, which sends light in one direction only: no emitter sampling competes.
    Delta,
}

impl Origin {
    /// An event of a path without light paths.
    const fn scattering(point: DVec3, pdf: f64) -> Self {
        Self::Scattering { point, pdf, connected: false, arrival: f64::INFINITY, cosine: 1.0 }
    }
}

/// A path under way from the camera.
#[derive(Clone, Debug)]
struct Path {
    /// The ray that is followed.
    ray: PathRay,
    /// How its direction was drawn.
    origin: Origin,
    /// Whether it starts on an occluder, where nothing can be proved.
    on_surface: bool,
    /// Scattering events so far; passing a medium boundary is none.
    depth: u32,
    /// Rays that ended in other regions than they began in; counted for [`Roulette::Thesis`] only.
    crossings: u32,
    /// What light that arrives along the ray is worth at the camera.
    throughput: Rgb,
    /// The part of the throughput that is there only because the path was drawn from mixtures: small where light is expected. Roulette leaves it
    /// alone, or it would kill what was just aimed at the light.
    aim: f64,
    /// The square of the index of refraction that the path is in, over that where it began: so much less radiance is worth there. Roulette leaves it
    /// alone, or it would kill what goes into glass.
    compression: f32,
    /// A path of the light that its events are connected to.
    light_path: LightPath,
    /// What its free flights are worth in each channel; the mean is 1. All are 1 unless a medium is chromatic.
    worth: DVec3,
    /// Light gathered so far.
    radiance: Rgb,
}

impl Path {
    fn new(ray: PathRay) -> Self {
        Self {
            ray,
            origin: Origin::Camera,
            on_surface: false,
            depth: 0,
            crossings: 0,
            throughput: Rgb::ONE,
            aim: 1.0,
            compression: 1.0,
            light_path: LightPath::Never,
            worth: DVec3::ONE,
            radiance: Rgb::ZERO,
        }
    }
}

/// From where to which sample of an emitter.
struct Aim<'a> {
    point: DVec3,
    vertex: &'a Vertex<'a>,
    /// Those that the point is in.
    regions: &'a RegionSet,
    light: &'a LightSample,
    /// Of [`Tracer::flight_to_emitter`].
    flight: Option<f64>,
}

/// Light that arrives at an event from a sample of an emitter.
struct Arriving {
    /// Scattered at the event, over the density of the sample.
    value: Rgb,
    /// The density with which the event's own sampling draws this direction.
    pdf: f64,
    /// Whether nothing that lets light through is on the way.
    is_straight: bool,
}

/// The end of a path so far, where light may be gathered.
#[derive(Clone, Copy, Debug)]
enum Vertex<'a> {
    InMedium {
        phase: Phase,
        direction: DVec3,
    },
    /// A plain Lambertian surface.
    OnSurface(SurfacePoint),
    /// Any other one.
    OnMaterial(&'a SurfacePoint, &'a ShadingPoint),
}

impl<R: Recorder> Tracer<'_, R> {
    /// Radiance along `ray` by `integrator`.
    #[inline]
    pub(crate) fn radiance(
        &self,
        integrator: Integrator,
        ray: PathRay,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        match integrator {
            Integrator::Volpath => match self.estimator {
                Estimator::Equiangular | Estimator::Lit if !self.world.media.is_chromatic() => {
                    self.volpath_by_mixture(ray, sampler, counters)
                }
                _ => self.volpath(ray, sampler, counters),
            },
            Integrator::Raymarch(samples) => self.raymarch(ray, samples, sampler, counters),
        }
    }

    /// The ray of a camera at `centre`. A far plane ends it only in the medium in which it starts: as in Mitsuba 3, a ray that has passed a medium boundary goes
    /// on to infinity.
    #[inline]
    pub(crate) fn camera_ray(&self, centre: DVec3, &CameraRay { origin, segment, direction }: &CameraRay) -> PathRay {
        let media = &self.world.media;
        let mut regions = media.at_end(&Segment::new(origin, segment.p), media.at_camera());
        if origin != centre {
            let at_origin = media.at_end(&Segment::new(centre, origin), media.at_camera());
            regions = media.at_end(&Segment::new(origin, segment.p), &at_origin);
        }
        let segment = if self.world.far_plane_clips && !media.crosses_nothing(&segment) {
            Segment::new(segment.p, segment.p + direction * self.world.lights.reach())
        } else {
            segment
        };
        PathRay { segment, direction, regions }
    }

    /// True if a vertex at `depth` scattering events before it may still be followed.
    #[inline]
    fn may_scatter(&self, depth: u32) -> bool {
        self.settings.max_depth.is_none_or(|m| depth < m)
    }

    /// True if the path goes on along its ray: it is not too long, worth something, survives Russian roulette, and nobody wants to stop.
    #[inline]
    fn goes_on(&self, path: &mut Path, sampler: &mut Sampler) -> bool {
        self.may_scatter(path.depth)
            && path.throughput != Rgb::ZERO
            && survives(path, self.roulette, self.settings.rr_depth, sampler)
            && !self.stops_at(path.depth)
    }

    /// The path's ray ends in these regions.
    #[inline]
    fn crosses_to(&self, path: &mut Path, end: &RegionSet) {
        if self.roulette == Roulette::Thesis && path.ray.regions != *end {
            path.crossings += 1;
        }
    }

    /// Whether to stop, asked once in many events.
    #[inline]
    fn stops_at(&self, event: u32) -> bool {
        event != 0 && event.is_multiple_of(EVENTS_PER_LOOK) && self.progress.cancelled()
    }

    /// The first occluder on the ray, and the part of the ray before it. That ends at the very point from which the next ray starts.
    #[inline]
    fn cast(&self, ray: &PathRay, counters: &mut Counters) -> (Option<SurfacePoint>, Segment) {
        let hit = self.visibility.intersect(&ray.segment, counters);
        match self.surface_met(hit, &ray.segment, ray.direction) {
            Some(surface) => (Some(surface), Segment::new(ray.segment.p, surface.point)),
            None => (None, ray.segment),
        }
    }

    /// The first surface on a segment in this direction, of whose opaque triangles `hit` is the first.
    #[inline]
    pub(crate) fn surface_met(&self, hit: Option<Hit>, segment: &Segment, direction: DVec3) -> Option<SurfacePoint> {
        match &self.world.others {
            None => hit.map(|hit| self.world.surface_point(&hit, direction)),
            Some(others) => self.first_of_all(others, hit, segment, direction),
        }
    }

    /// The event at the end of a ray that was not stopped by a medium: light of the background or the surface is gathered, and the
    /// path scatters. False if it ends here.
    #[inline]
    fn arrive(
        &self,
        path: &mut Path,
        surface: Option<SurfacePoint>,
        regions: RegionSet,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> bool {
        if let Some(surface) = surface.as_ref().filter(|s| s.place.is_some()) {
            return self.arrive_at_material(path, surface, regions, sampler, counters);
        }
        let Some(surface) = self.light_at_end(path, surface) else { return false };
        let vertex = Vertex::OnSurface(surface);
        let direct = self.direct_light(surface.point, &vertex, &regions, f64::INFINITY, None, sampler, counters);
        path.radiance += path.throughput * direct;
        let (direction, pdf) = sample_diffuse(surface.normal, sampler.next_2d());
        path.throughput *= surface.reflectance;
        path.origin = Origin::scattering(surface.point, pdf);
        path.on_surface = true;
        path.ray = self.ray(surface.point, direction, regions);
        true
    }

    /// Light of the background, or of the surface at the end of a ray, is gathered. The surface, if the path may scatter there.
    #[inline]
    fn light_at_end(&self, path: &mut Path, surface: Option<SurfacePoint>) -> Option<SurfacePoint> {
        let Some(surface) = surface else {
            path.radiance += path.throughput * self.background(path.ray.direction, &path.origin);
            return None;
        };
        path.radiance += path.throughput * self.emitted(&surface, path.ray.direction, &path.origin);
        path.depth += 1;
        self.may_scatter(path.depth).then_some(surface)
    }

    /// Next-event estimation where direction sampling may find the same light, weighted by the power heuristic, or a light path may bring it. `arrival` is
    /// [`Tracer::density_of_arrival`] at the event; `place` a place on an emitter if one is drawn already.
    #[inline]
    #[allow(clippy::too_many_arguments, reason = "what an event has and what a path has")]
    fn direct_light(
        &self,
        point: DVec3,
        vertex: &Vertex,
        regions: &RegionSet,
        arrival: f64,
        place: Option<&EmitterPoint>,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let (light, flight) = match place {
            None => self.draw_emitter(point, sampler),
            Some(place) => (self.world.lights.seen_from(point, place), self.flight_to_emitter(sampler)),
        };
        let Some(light) = light else { return Rgb::ZERO };
        let Some(arriving) = self.connect(point, vertex, regions, &light, flight, counters) else { return Rgb::ZERO };
        // A point emitter is found by no scattered ray.
        let mut weight = if light.pdf > 0.0 { power_heuristic(light.pdf, arriving.pdf) } else { 1.0 };
        if arriving.is_straight && arrival.is_finite() {
            weight *= self.weight_beside_bounce(arrival, point, vertex, &light);
        }
        arriving.value * to_f32(weight)
    }

    /// A sample of an emitter, as seen from `point`, and what [`Tracer::flight_to_emitter`] draws. Takes as many numbers whichever it is.
    #[inline]
    fn draw_emitter(&self, point: DVec3, sampler: &mut Sampler) -> (Option<LightSample>, Option<f64>) {
        let lights = &self.world.lights;
        let u = sampler.next_1d();
        let chosen = match self.estimator {
            Estimator::Thesis => choose(u, lights.count()).map(|(emitter, _)| (emitter, lights.count() as f64)),
            Estimator::Equiangular | Estimator::Lit => {
                lights.choose_at(point, u).map(|drawn| (drawn.emitter, 1.0 / drawn.chance))
            }
        };
        let place = chosen
            .and_then(|(emitter, choices)| self.draw_place(emitter, sampler).map(|place| place.of_choices(choices)));
        // Drawn even if no one will ask for it: how many numbers an event takes depends on nothing.
        let flight = self.flight_to_emitter(sampler);
        (place.and_then(|place| lights.seen_from(point, &place)), flight)
    }

    /// One over the probability with which an event at `point` asks this emitter.
    #[inline]
    fn choices(&self, emitter: usize, point: DVec3) -> f64 {
        let lights = &self.world.lights;
        match self.estimator {
            Estimator::Thesis => lights.count() as f64,
            Estimator::Equiangular | Estimator::Lit => lights.choices_at(emitter, point),
        }
    }

    /// A place on this emitter. Takes as many numbers whichever it is.
    #[inline]
    fn draw_place(&self, emitter: usize, sampler: &mut Sampler) -> Option<EmitterPoint> {
        let lights = &self.world.lights;
        let needs_numbers = lights.numbers_of_place() > 0 && lights.point_position(emitter).is_none();
        let numbers = if needs_numbers {
            sampler.next_2d()
        } else {
            sampler.skip(lights.numbers_of_place());
            [0.0; 2]
        };
        lights.sample_point(emitter, numbers)
    }

    /// The query that a sample of an emitter depends on, and the light that arrives if it is unoccluded; `None` if that is nothing anyway. For vertices in a medium, with
    /// nothing that light passes through.
    #[inline]
    fn aim(&self, at: &Aim<'_>) -> Option<(ShadowQuery, Rgb)> {
        let &Aim { point, vertex, regions, light, flight } = at;
        let value = vertex.eval(self.world, light.direction).0 * light.weight;
        if value.max_element() <= 0.0 {
            return None;
        }
        let query =
            ShadowQuery { from: point, to: light.point, emitter: light.emitter, kind: vertex.query_kind(light) };
        Some((query, value * self.transmittance_to(point, light, regions, flight)))
    }

    /// The optical depth that the way to an emitter must not exceed, for the analog estimate of transmittance.
    #[inline]
    fn flight_to_emitter(&self, sampler: &mut Sampler) -> Option<f64> {
        match self.transmittance {
            TransmittanceEstimator::Analytic => None,
            TransmittanceEstimator::Analog => Some(sample_free_flight(sampler)),
        }
    }

    /// The light that arrives from a sample of an emitter, if any does.
    #[inline]
    fn connect(
        &self,
        from: DVec3,
        vertex: &Vertex,
        regions: &RegionSet,
        light: &LightSample,
        flight: Option<f64>,
        counters: &mut Counters,
    ) -> Option<Arriving> {
        let (value, pdf) = vertex.eval(self.world, light.direction);
        let value = value * light.weight;
        if value.max_element() <= 0.0 {
            return None;
        }
        let through;
        let (point, regions) = match self.side_towards(light.direction, vertex, regions) {
            None => (from, regions),
            Some(behind) => {
                through = behind.1;
                (behind.0, &through)
            }
        };
        let query =
            ShadowQuery { from: point, to: light.point, emitter: light.emitter, kind: vertex.query_kind(light) };
        if !self.visibility.unoccluded(&query, counters) {
            return None;
        }
        let (passed, is_straight) = match &self.world.others {
            None => (Rgb::ONE, true),
            Some(others) => self.passes(others, &Segment::new(point, light.point), light.direction)?,
        };
        let value = value * passed * self.transmittance_to(point, light, regions, flight);
        Some(Arriving { value, pdf, is_straight })
    }

    /// Where a segment in this direction starts, and in which regions, if it leaves the surface on the side that is not seen.
    #[inline]
    fn side_towards(&self, direction: DVec3, vertex: &Vertex, regions: &RegionSet) -> Option<(DVec3, RegionSet)> {
        match vertex {
            Vertex::OnMaterial(s, shading) if direction.dot(s.normal) < 0.0 => Some(self.behind(s, shading, regions)),
            _ => None,
        }
    }

    /// Whether an event with so many scattering events up to it is connected to a light path: one more has to be allowed.
    #[inline]
    fn connects(&self, light_path: &mut LightPath, depth: u32, sampler: &mut Sampler) -> bool {
        match light_path {
            LightPath::Never => false,
            LightPath::PassedOver => {
                if self.may_scatter(depth + 1) {
                    sampler.skip(self.numbers_of_bounce());
                    *light_path = LightPath::Never;
                }
                false
            }
            LightPath::NotYet | LightPath::Drawn(_) => self.may_scatter(depth + 1),
        }
    }

    /// The estimate of the transmittance from a point in these regions to an emitter.
    #[inline]
    fn transmittance_to(&self, point: DVec3, light: &LightSample, regions: &RegionSet, flight: Option<f64>) -> Rgb {
        let (media, segment) = (&self.world.media, Segment::new(point, light.point));
        if media.are_nowhere() {
            return Rgb::ONE;
        }
        let through = |tau: f64| match flight {
            None => to_f32((-tau).exp()),
            Some(flight) => f32::from(flight >= tau),
        };
        if media.is_chromatic() {
            Rgb::from_array(media.optical_depths(&segment, regions).to_array().map(through))
        } else {
            Rgb::splat(through(media.optical_depth(&segment, regions)))
        }
    }

    /// Light of the background that a ray meets when it leaves the scene, weighted against emitter sampling.
    #[inline]
    fn background(&self, direction: DVec3, origin: &Origin) -> Rgb {
        let radiance = self.world.lights.background(direction);
        match (origin, self.world.lights.a_far_one()) {
            (Origin::Scattering { pdf, point, .. }, Some(emitter)) if radiance != Rgb::ZERO => {
                let choices = self.choices(emitter, *point);
                radiance * to_f32(power_heuristic(*pdf, self.world.lights.pdf_background(direction, choices)))
            }
            _ => radiance,
        }
    }

    /// Light emitted by a surface that a ray meets, weighted against emitter sampling.
    #[inline]
    fn emitted(&self, surface: &SurfacePoint, direction: DVec3, origin: &Origin) -> Rgb {
        match (origin, surface.emitter) {
            (Origin::Scattering { point, pdf, arrival, cosine, .. }, Some(emitter)) if surface.emitted != Rgb::ZERO => {
                let lights = &self.world.lights;
                let (distance, cos_theta) = (point.distance(surface.point), -direction.dot(surface.normal));
                let (choices, distance2) = (self.choices(emitter, *point), distance * distance);
                let light_pdf = lights.pdf_area(emitter, distance, cos_theta, choices);
                let weight = power_heuristic(*pdf, light_pdf);
                let of_beam = lights.density_of_beam(emitter, distance2, light_pdf, choices);
                let by_bounce = of_beam * cosine.max(0.0) / distance2;
                surface.emitted * to_f32(weight * share_beside_bounce(*arrival, by_bounce))
            }
            _ => surface.emitted,
        }
    }

    /// The ray from `point` along `direction`, to beyond the scene.
    #[inline]
    fn ray(&self, point: DVec3, direction: DVec3, regions: RegionSet) -> PathRay {
        let segment = Segment::new(point, point + direction * self.world.lights.reach());
        PathRay { segment, direction, regions }
    }
}

impl Vertex<'_> {
    /// The cosine of a unit direction's angle to the normal, at least 0; 1 in a medium, which has none.
    #[inline]
    fn cosine_to(&self, direction: DVec3) -> f64 {
        match self {
            Self::InMedium { .. } => 1.0,
            Self::OnSurface(s) => s.normal.dot(direction).max(0.0),
            Self::OnMaterial(s, _) => s.normal.dot(direction).max(0.0),
        }
    }

    /// Which ends of a query towards an emitter lie on an occluder.
    #[inline]
    const fn query_kind(&self, light: &LightSample) -> QueryKind {
        match self {
            Self::InMedium { .. } if light.on_surface => QueryKind::OnLight,
            Self::InMedium { .. } => QueryKind::Spatial,
            Self::OnSurface(_) | Self::OnMaterial(..) => QueryKind::Superficial,
        }
    }

    /// Phase function, or BSDF times cosine, towards `to`; and the density with which direction sampling would draw it.
    #[inline]
    fn eval(&self, world: &World, to: DVec3) -> (Rgb, f64) {
        match self {
            Self::InMedium { phase, direction } => {
                let p = phase.pdf_direction(*direction, to);
                (Rgb::splat(to_f32(p)), p)
            }
            Self::OnSurface(s) => eval_diffuse(s.normal, s.reflectance, to),
            Self::OnMaterial(_, shading) => surfaces::eval(world, shading, to),
        }
    }
}

/// The optical depth of a free flight: it reaches τ with probability exp(−τ).
#[inline]
fn sample_free_flight(sampler: &mut Sampler) -> f64 {
    // −ln(1 − ξ); ξ < 1, so it is finite.
    -(-sampler.next_1d()).ln_1p()
}

/// The weight of a sample drawn with density `pdf` where another strategy has density `other` (power heuristic, β = 2 \[Veach1997\]).
#[inline]
fn power_heuristic(pdf: f64, other: f64) -> f64 {
    // As a ratio, so that large densities do not overflow; both zero is worth nothing.
    if pdf == 0.0 {
        return 0.0;
    }
    let r = other / pdf;
    1.0 / (1.0 + r * r)
}

#[inline]
#[allow(clippy::cast_possible_truncation, reason = "radiance is single precision")]
fn to_f32(x: f64) -> f32 {
    x as f32
}

/// The survival probability of a path is at most this where it might never end.
const MAX_SURVIVAL: f32 = 0.95;

/// So many events are more than all but a few paths take through bounded fog of optical depth 1000.
const MANY_EVENTS: u32 = 1 << 16;

/// Russian roulette: beyond `rr_depth` a path survives with the probability of its largest throughput.
///
/// *Departure from Mitsuba 3*, where that is at most 0.95 everywhere: in dense white fog, where a path loses nothing in thousands of
/// collisions, that would kill it where it is worth 1, and what survives would be worth 0.95⁻ⁿ: infinite variance, and a furnace that looks
/// too dark. A path in bounded fog leaves it, so there the bound is not needed; between white walls, and in fog without an end, it is.
/// [`Roulette::Thesis`] has the bound, begins one event earlier, and counts crossings as events.
#[inline]
fn survives(path: &mut Path, roulette: Roulette, rr_depth: u32, sampler: &mut Sampler) -> bool {
    let thesis = roulette == Roulette::Thesis;
    let spared =
        if thesis { path.depth == 0 || path.depth + path.crossings < rr_depth } else { path.depth <= rr_depth };
    if spared {
        return true;
    }
    let endless = thesis || path.on_surface || path.depth > MANY_EVENTS || path.ray.regions.is_empty();
    let worth = path.throughput.max_element() * path.compression / to_f32(path.aim);
    let q = worth.min(if endless { MAX_SURVIVAL } else { 1.0 });
    if sampler.next_1d() >= f64::from(q) {
        return false;
    }
    path.throughput /= q;
    true
}

#[cfg(test)]
impl<'a> Tracer<'a, vdf_visibility::NoRecorder> {
    /// For tests: who follows the paths of a scene by default, but for light paths.
    fn of(prepared: &'a crate::PreparedScene, light_paths: Connected, arch: Arch) -> Self {
        Self {
            light_paths,
            world: prepared.world(),
            visibility: prepared.visibility(),
            settings: prepared.scene().integrator,
            transmittance: TransmittanceEstimator::Analytic,
            roulette: Roulette::default(),
            estimator: Estimator::Equiangular,
            arch,
            progress: &crate::Quiet,
        }
    }
}
