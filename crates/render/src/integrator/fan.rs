//! Samples of a ray through fog that gather light from points: a fan of them at once, in vectors.
//!
//! *Idea.* This is the usual case of ray marching: the ray meets one homogeneous medium, all lights are points, and both lie in a box in which no boundary is met.
//! Then a sample is some thirty multiplications, the same ones for each, and all that is left to ask is visibility. So samples are held field
//! by field; places, directions, phase function and weights are computed by loops that the compiler makes vectors of, as wide as the machine has
//! them, and queries are asked together.
//!
//! *Guarantee.* The same bits, queries and random numbers as sample by sample (`raymarch.rs`), whatever the instruction set: the same operations, each rounded by itself. A sample
//! that lies so near to a boundary that its regions are in doubt, or at the light itself, is taken by itself.

use glam::DVec3;
use pulp::{Simd, WithSimd};
use vdf_geometry::{Bounds, Segment};
use vdf_scene::{Phase, Rgb};
use vdf_visibility::{Counters, QueryKind, Recorder, ShadowQuery};

use super::{Aim, Tracer, Vertex, raymarch::Fog, to_f32};
use crate::{
    PhaseFunction as _, Sampler, TransmittanceEstimator,
    lights::{Lights, choose},
    media::{Homogeneous, Substance},
    phase::pdf_lobe,
};

/// So many samples are taken together.
const LANES: usize = 16;

/// Fewer samples of a ray are not worth the trouble.
const FEWEST: u32 = 3;

/// The samples of a ray that are taken together.
pub(super) struct Fan<'a> {
    ray: &'a Segment,
    direction: DVec3,
    medium: &'a Homogeneous,
    lights: &'a Lights,
    /// A box in which no boundary is met, and all lights lie.
    clear: Bounds,
    /// The part of the ray in fog: its number, where it begins and ends, and its optical depth.
    part: usize,
    ends: [f64; 2],
    depth: f64,
    /// Nearer to the part's ends the regions of a sample are those of its rounded place.
    doubt: f64,
    /// Length of the ray.
    length: f64,
    waiting: usize,
    lanes: Lanes,
}

/// Samples, field by field.
// Each array in cache lines of its own, so that a number is not read from a vector that was written across two lines.
#[repr(align(64))]
struct Lanes {
    /// Parameters along the ray.
    t: [f64; LANES],
    emitter: [usize; LANES],
    /// The place of the light, and its intensity.
    to: [[f64; LANES]; 3],
    intensity: [[f32; LANES]; 3],
    /// What the sample is worth beside what it scatters.
    factor: [f32; LANES],
    /// The place of the sample.
    from: [[f64; LANES]; 3],
    /// Optical depth from there to the light.
    depth: [f64; LANES],
    /// What the light sends there, times the phase function.
    value: [[f32; LANES]; 3],
    /// Whether these are right.
    plain: [bool; LANES],
    queries: [ShadowQuery; LANES],
    arriving: [Rgb; LANES],
}

impl Lanes {
    fn new() -> Self {
        let none = ShadowQuery { from: DVec3::ZERO, to: DVec3::ZERO, emitter: 0, kind: QueryKind::Spatial };
        Self {
            t: [0.0; LANES],
            emitter: [0; LANES],
            to: [[0.0; LANES]; 3],
            intensity: [[0.0; LANES]; 3],
            factor: [0.0; LANES],
            from: [[0.0; LANES]; 3],
            depth: [0.0; LANES],
            value: [[0.0; LANES]; 3],
            plain: [false; LANES],
            queries: [none; LANES],
            arriving: [Rgb::ZERO; LANES],
        }
    }
}

impl<'a> Fan<'a> {
    /// The parameter along the ray where its optical depth is `tau`; `None` beyond its end. As `MediumIntervals::free_flight`.
    #[inline]
    pub(super) fn at_depth(&self, tau: f64) -> Option<f64> {
        let [t0, t1] = self.ends;
        (tau < self.depth).then(|| (t0 + self.medium.distance_at_depth(tau, self.length)).min(t1))
    }

    /// An emitter, each equally likely. Takes as many numbers as an emitter and a place on it.
    #[inline]
    pub(super) fn draw_emitter(&self, sampler: &mut Sampler) -> usize {
        if self.lights.count() == 1 {
            sampler.skip(1 + self.lights.numbers_of_place());
            return 0;
        }
        let chosen = choose(sampler.next_1d(), self.lights.count());
        sampler.skip(self.lights.numbers_of_place());
        chosen.map_or(0, |(emitter, _)| emitter)
    }

    /// Adds a sample; true if no more have room.
    #[inline]
    pub(super) fn push(&mut self, t: f64, emitter: usize, factor: f32) -> bool {
        let (_, position, intensity) = self.lights.points()[emitter];
        let (lanes, i) = (&mut self.lanes, self.waiting % LANES);
        lanes.t[i] = t;
        lanes.emitter[i] = emitter;
        lanes.factor[i] = factor;
        for (axis, (x, color)) in position.to_array().into_iter().zip(intensity.to_array()).enumerate() {
            lanes.to[axis][i] = x;
            lanes.intensity[axis][i] = color;
        }
        self.waiting += 1;
        self.waiting == LANES
    }

    /// Places, values and depths of all samples that wait.
    #[inline(always)]
    fn compute(&mut self) {
        match self.medium.phase {
            Phase::Isotropic => self.compute_with(|_| 0.25 / std::f64::consts::PI),
            Phase::HenyeyGreenstein { g } => {
                let direction = self.direction;
                self.compute_with(|to| pdf_lobe(g, direction, to));
            }
            phase => {
                let direction = self.direction;
                self.compute_with(|to| phase.pdf_direction(direction, to));
            }
        }
    }

    #[inline(always)]
    fn compute_with(&mut self, pdf: impl Fn(DVec3) -> f64) {
        let Lanes { t, to, intensity, from, depth, value, plain, .. } = &mut self.lanes;
        let (p, along) = (self.ray.p, self.ray.q - self.ray.p);
        let Bounds { min, max } = self.clear;
        let ([t0, t1], doubt, sigma_t) = (self.ends, self.doubt, self.medium.sigma_t);
        let choices = self.lights.count() as f64;
        // Lanes that nobody waits in hold anything.
        let n = (self.waiting.min(LANES) + 3) & !3;
        for i in 0..n {
            let point = p + along * t[i];
            let d = DVec3::new(to[0][i], to[1][i], to[2][i]) - point;
            let distance2 = d.length_squared();
            let distance = distance2.sqrt();
            let phase = to_f32(pdf(d / distance));
            let weight = to_f32(choices / distance2);
            for axis in 0..3 {
                from[axis][i] = point[axis];
                value[axis][i] = phase * (intensity[axis][i] * weight);
            }
            depth[i] = sigma_t * distance;
            let inside = (point.x > min.x) & (point.y > min.y) & (point.z > min.z);
            let inside = inside & (point.x < max.x) & (point.y < max.y) & (point.z < max.z);
            plain[i] = inside & (t[i] - t0 > doubt) & (t1 - t[i] > doubt) & (distance2 > 0.0);
        }
    }
}

/// The work of one instruction set.
struct Compute<'a, 'b>(&'a mut Fan<'b>);

impl WithSimd for Compute<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.compute();
    }
}

impl<R: Recorder> Tracer<'_, R> {
    /// Room for the samples of a ray, if they can be taken together.
    #[inline]
    pub(super) fn fan<'a>(&'a self, fog: &Fog<'a>) -> Option<Fan<'a>> {
        let clear = *self.world.clear.as_ref()?;
        if fog.samples < FEWEST || self.transmittance != TransmittanceEstimator::Analytic {
            return None;
        }
        let mut parts = fog.intervals.parts().enumerate().filter_map(|(part, i)| Some((part, i, i.medium?)));
        let (Some((part, interval, medium)), None) = (parts.next(), parts.next()) else { return None };
        let Substance::Homogeneous(medium) = self.world.media.substance(medium) else { return None };
        let length = fog.intervals.length();
        Some(Fan {
            ray: fog.free,
            direction: fog.direction,
            medium,
            lights: &self.world.lights,
            clear,
            part,
            ends: [interval.t0, interval.t1],
            depth: medium.optical_depth((interval.t1 - interval.t0) * length),
            doubt: self.world.media.doubt(fog.free),
            length,
            waiting: 0,
            lanes: Lanes::new(),
        })
    }

    /// Asks for the samples that wait, and adds what arrives, in their order.
    pub(super) fn ask_fan(&self, fan: &mut Fan<'_>, fog: &Fog<'_>, sum: &mut Rgb, counters: &mut Counters) {
        self.arch.dispatch(Compute(fan));
        let Homogeneous { albedo, phase, .. } = *fan.medium;
        let waiting = std::mem::take(&mut fan.waiting);
        let (part, lights, lanes) = (fan.part, fan.lights, &mut fan.lanes);
        let mut asked = 0;
        for i in 0..waiting.min(LANES) {
            let point = DVec3::new(lanes.from[0][i], lanes.from[1][i], lanes.from[2][i]);
            let emitter = lanes.emitter[i];
            let value = if lanes.plain[i] {
                let value = Rgb::new(lanes.value[0][i], lanes.value[1][i], lanes.value[2][i]);
                if value.max_element() <= 0.0 {
                    continue;
                }
                let to = DVec3::new(lanes.to[0][i], lanes.to[1][i], lanes.to[2][i]);
                lanes.queries[asked] = ShadowQuery { from: point, to, emitter, kind: QueryKind::Spatial };
                value * to_f32((-lanes.depth[i]).exp())
            } else {
                let light = lights.sample_point(emitter, [0.0; 2]).and_then(|place| lights.seen_from(point, &place));
                let Some(light) = light else { continue };
                let regions = fog.intervals.regions_in(part, lanes.t[i]);
                let vertex = Vertex::InMedium { phase, direction: fog.direction };
                let aim = Aim { point, vertex: &vertex, regions: &regions, light: &light, flight: None };
                let Some((query, value)) = self.aim(&aim) else { continue };
                lanes.queries[asked] = query;
                value
            };
            lanes.arriving[asked] = albedo * value * lanes.factor[i];
            asked += 1;
        }
        let mut unoccluded = [false; LANES];
        self.visibility.all_unoccluded(&lanes.queries[..asked], &mut unoccluded[..asked], counters);
        for (light, _) in lanes.arriving.iter().zip(unoccluded).filter(|(_, unoccluded)| *unoccluded) {
            *sum += *light;
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::dvec3;
    use pulp::Arch;
    use vdf_scene::{Emitter, LoadOptions, Scene};
    use vdf_visibility::Method;

    use super::*;
    use crate::{
        Estimator, PrepareOptions, PreparedScene, Quiet, SamplerKind,
        integrator::{Connected, stretch::stretches},
    };

    fn scene(name: &str, phase: Phase, lights: &[DVec3]) -> Scene {
        let source = vdf_scenes::builtin(name).expect("a built-in scene");
        let mut scene = Scene::from_source(&source, &LoadOptions::default()).expect("it loads");
        scene.media.iter_mut().for_each(|m| m.phase = phase);
        let point = |&position: &DVec3| Emitter::Point { position, intensity: Rgb::new(1e5, 2e4, 0.0) };
        scene.emitters.extend(lights.iter().map(point));
        scene
    }

    /// A ray from anywhere in or about the box: along its faces, out of it, at a light, along an axis, of no length.
    fn ray(bounds: &Bounds, light: DVec3, sampler: &mut Sampler) -> Segment {
        let mut point = || {
            let u = DVec3::from_array([(); 3].map(|()| sampler.next_1d()));
            let mut p = bounds.min + (bounds.max - bounds.min) * (u * 1.2 - 0.1);
            match (sampler.next_1d() * 8.0) as u32 {
                0 => p.x = bounds.min.x,
                1 => p.y = bounds.max.y.next_down(),
                2 => p.z = bounds.min.z + 1e-9,
                3 => p = light,
                _ => {}
            }
            p
        };
        let (p, mut q) = (point(), point());
        match (sampler.next_1d() * 8.0) as u32 {
            0 => q = dvec3(q.x, p.y, p.z),
            1 => q = p + (q - p) * 1e-13,
            2 => q = light + (light - p),
            _ => {}
        }
        Segment::new(p, q)
    }

    /// Sums, counters and the random numbers that come next: the same bits as sample by sample, for phase functions, numbers of lights and of samples,
    /// both samplers, and all instruction sets.
    #[test]
    fn a_fan_is_what_its_samples_are_one_by_one() {
        let another = dvec3(200.0, 100.0, 100.0);
        let cases = [
            ("cbox_vol2", Phase::Isotropic, &[][..]),
            ("cbox_vol2", Phase::HenyeyGreenstein { g: 0.8 }, &[another]),
            ("cbox_vol4", Phase::HenyeyGreenstein { g: -0.3 }, &[]),
            ("cbox_vol6", Phase::Rayleigh, &[another, another, dvec3(50.0, 500.0, 500.0)]),
            ("cbox_vol4", Phase::TwoLobes { weight: 0.3, g: [0.7, -0.2] }, &[]),
        ];
        let mut lit = 0;
        for (name, phase, lights) in cases {
            let options = PrepareOptions::with_method(Method::NONE);
            let prepared = PreparedScene::new(scene(name, phase, lights), &options, &Quiet).expect("it is prepared");
            let world = prepared.world();
            let light = world.lights.points()[0].1;
            let fog_bounds = world.clear.expect("one box, with all lights in it");
            for arch in [Arch::new(), Arch::Scalar] {
                let mut tracer = Tracer::of(&prepared, Connected::Never, arch);
                for i in 0..1500 {
                    let sampler = &mut Sampler::new(17, i, 0, 0);
                    let free = ray(&fog_bounds, light, sampler);
                    let intervals = world.media.intervals(&free, &world.media.regions_at(free.p));
                    let tau = intervals.optical_depth();
                    let direction = (free.q - free.p).normalize_or_zero();
                    if tau <= 0.0 || direction == DVec3::ZERO {
                        continue;
                    }
                    let samples = [3, 4, 7, 15, 16, 17, 49][(i % 7) as usize];
                    let fog = Fog { free: &free, direction, intervals: &intervals, tau, samples };
                    let parts = stretches(&intervals, &world.media);
                    for towards in [false, true] {
                        // By transmittance is what `thesis` does.
                        tracer.estimator = if towards { Estimator::Equiangular } else { Estimator::Thesis };
                        let [together, apart] = [true, false].map(|together| {
                            let mut fan = tracer.fan(&fog).filter(|_| together);
                            assert_eq!(fan.is_some(), together, "{name}");
                            let mut sampler = Sampler::of_kind(SamplerKind::ALL[(i % 2) as usize], 3, i, 5, 9);
                            let mut counters = Counters::default();
                            let (s, c) = (&mut sampler, &mut counters);
                            let sum = if towards {
                                tracer.towards_lights(&fog, &parts, world.lights.all(), fan.as_mut(), s, c)
                            } else {
                                tracer.by_transmittance(&fog, fan.as_mut(), s, c)
                            };
                            (sum.to_array().map(f32::to_bits), counters, sampler.next_2d())
                        });
                        assert_eq!(
                            together, apart,
                            "{name}, {phase:?}, {arch:?}: ray {i}, {free:?}, {samples} samples"
                        );
                        lit += u32::from(together.0 != [0; 3]);
                    }
                }
            }
        }
        assert!(lit > 5000, "{lit}");
    }

    /// A sample that lies beside the box in which no boundary is met, though the ray does not touch it: the light is in denser fog of its own.
    #[test]
    fn light_from_another_medium_is_taken_by_itself() {
        let mut scene = scene("cbox_vol2", Phase::Isotropic, &[]);
        let light = scene.emitters.iter().find_map(Emitter::position).expect("a point").as_vec3();
        let (mut medium, mut boundary) = (scene.media[0].clone(), scene.boundaries[0].clone());
        medium.sigma_t = vdf_scene::Extinction::Constant(DVec3::splat(0.02));
        boundary.triangles.iter_mut().for_each(|t| t.vertices = t.vertices.map(|v| light + (v - light) * 0.1));
        boundary.interior = Some(vdf_scene::MediumId(1));
        scene.media.push(medium);
        scene.boundaries.push(boundary);
        let prepared =
            PreparedScene::new(scene, &PrepareOptions::with_method(Method::NONE), &Quiet).expect("it is prepared");
        let (world, tracer) = (prepared.world(), Tracer::of(&prepared, Connected::Never, Arch::new()));
        let free = Segment::new(dvec3(400.0, 100.0, 100.0), dvec3(450.0, 400.0, 300.0));
        let intervals = world.media.intervals(&free, &world.media.regions_at(free.p));
        let (tau, direction) = (intervals.optical_depth(), (free.q - free.p).normalize());
        let fog = Fog { free: &free, direction, intervals: &intervals, tau, samples: 20 };
        let [together, apart] = [true, false].map(|together| {
            let mut fan = tracer.fan(&fog).filter(|_| together);
            assert_eq!(fan.is_some(), together);
            let mut counters = Counters::default();
            tracer.by_transmittance(&fog, fan.as_mut(), &mut Sampler::new(3, 1, 2, 4), &mut counters)
        });
        assert!(apart.max_element() > 0.0);
        assert_eq!(together, apart);
    }

    /// A ray from fog into a hole in it, where the light is: the rounded place of a sample at the end of the fog may be in the hole, where nothing takes light away.
    #[test]
    fn a_sample_at_a_boundary_is_where_its_place_is() {
        let mut scene = scene("cbox_vol2", Phase::Isotropic, &[]);
        let light = scene.emitters.iter().find_map(Emitter::position).expect("a point").as_vec3();
        scene.media[0].sigma_t = vdf_scene::Extinction::Constant(DVec3::splat(0.02));
        let mut hole = scene.boundaries[0].clone();
        hole.triangles.iter_mut().for_each(|t| t.vertices = t.vertices.map(|v| light + (v - light) * 0.3));
        (hole.interior, hole.exterior) = (None, Some(vdf_scene::MediumId(0)));
        scene.boundaries.push(hole);
        let prepared =
            PreparedScene::new(scene, &PrepareOptions::with_method(Method::NONE), &Quiet).expect("it is prepared");
        let (world, tracer) = (prepared.world(), Tracer::of(&prepared, Connected::Never, Arch::new()));
        let clear = world.clear.expect("the hole");
        let mut crossed = 0;
        for i in 0..4000 {
            let s = &mut Sampler::new(29, i, 0, 0);
            let mut inside = || clear.min + (clear.max - clear.min) * DVec3::from_array([(); 3].map(|()| s.next_1d()));
            let (q, r) = (inside(), inside());
            let free = Segment::new(q + (q - r).normalize_or_zero() * 300.0, q);
            let start = world.media.regions_at(free.p);
            if start == world.media.regions_at(q) {
                continue;
            }
            let intervals = world.media.intervals(&free, &start);
            let (tau, direction) = (intervals.optical_depth(), (free.q - free.p).normalize());
            let fog = Fog { free: &free, direction, intervals: &intervals, tau, samples: 3 };
            let Some(mut fan) = tracer.fan(&fog) else { continue };
            let t = fan.ends[1].next_down();
            let point = free.at(t);
            crossed += u32::from(point.cmpgt(clear.min).all() && point.cmplt(clear.max).all());
            fan.push(t, 0, 1.0);
            let (mut sum, counters) = (Rgb::ZERO, &mut Counters::default());
            tracer.ask_fan(&mut fan, &fog, &mut sum, counters);
            let place = world.lights.sample_point(0, [0.0; 2]).expect("a point");
            let sample = world.lights.seen_from(point, &place).expect("it shines there");
            let (phase, regions) = (Phase::Isotropic, intervals.regions_in(fan.part, t));
            let vertex = Vertex::InMedium { phase, direction };
            let aim = Aim { point, vertex: &vertex, regions: &regions, light: &sample, flight: None };
            let (query, value) = tracer.aim(&aim).expect("it is lit if nothing is in the way");
            let expected =
                if tracer.visibility.unoccluded(&query, counters) { fan.medium.albedo * value } else { Rgb::ZERO };
            assert_eq!(sum, expected, "ray {i}, {free:?}");
        }
        assert!(crossed > 20, "{crossed}");
    }

    /// No fan where light passes a boundary, or is no point.
    #[test]
    fn a_fan_is_for_the_usual_case() {
        let outside = scene("cbox_vol2", Phase::Isotropic, &[dvec3(200.0, 1000.0, 200.0)]);
        let area = scene("cbox_light", Phase::Isotropic, &[]);
        for scene in [outside, area] {
            let options = PrepareOptions::with_method(Method::NONE);
            let prepared = PreparedScene::new(scene, &options, &Quiet).expect("it is prepared");
            assert!(prepared.world().clear.is_none());
        }
    }
}
