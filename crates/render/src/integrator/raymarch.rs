//! `raymarch`: stratified single scattering on every ray, summed with the light of surfaces (Sec. 2.5 in \[Houska2013\]).
//!
//! Each ray is divided into strata of equal transmittance; in each, one sample gathers light from one emitter. The medium scatters once, emitted
//! light only; surfaces scatter any number of times. With T the transmittance of the ray, the k-th of n samples lies at the optical
//! depth −ln(1 − (k + ξ)(1 − T)/n) and is worth albedo·(1 − T)/n.
//!
//! That is the estimator `thesis`. `equiangular` draws distances by their angle at a light, too (`equiangular`). The emitter is drawn first, by what it can give to
//! the ray (`lights/choice.rs`), with a place on it; then the distance, with a share of ¾ towards that place and else in proportion to transmittance; the one is weighted
//! against the other by the balance heuristic in its one-sample form \[Veach1997\], with the density of the mixture. So a sample of one emitter is never
//! worth more than four times what it is by transmittance alone, in fog of any thickness, with a light in any place. One number in (k + ξ)/n
//! makes all these choices, so that each of them is stratified.
//!
//! *Deviation from the thesis:* it recovers σ_t as −ln(T)/D, which loses all digits in thin media and is undefined where T underflows. Here the
//! optical depth τ is known, and 1 − T = −expm1(−τ).

use glam::DVec3;
use vdf_geometry::Segment;
use vdf_scene::Rgb;
use vdf_visibility::{Counters, QueryKind, Recorder, ShadowQuery};

use super::{
    Aim, Path, PathRay, Tracer, Vertex, choose,
    equiangular::{Equiangular, LightPlace},
    fan::Fan,
    stretch::{Stretch, distance_at_depth, stretches},
    to_f32,
};
use crate::{
    Estimator, Sampler, SegmentSamples,
    media::{FreeFlight, MediumIntervals},
};

/// The share of the samples that are drawn towards the light, where it has a place.
const TOWARDS_LIGHT: f64 = 0.75;

/// Nodes of the density towards a light: many, for it is used for many samples.
const NODES: usize = 9;

/// A ray through fog, up to the first surface.
pub(super) struct Fog<'a> {
    pub(super) free: &'a Segment,
    pub(super) direction: DVec3,
    pub(super) intervals: &'a MediumIntervals<'a>,
    /// The optical depth of all of it, the largest of all colours, positive.
    pub(super) tau: f64,
    pub(super) samples: u32,
}

impl<R: Recorder> Tracer<'_, R> {
    /// Radiance along `ray` by ray marching with so many strata a segment.
    pub(crate) fn raymarch(
        &self,
        ray: PathRay,
        samples: SegmentSamples,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let lights = &self.world.lights;
        let mut path = Path::new(ray);
        while self.goes_on(&mut path, sampler) {
            let (surface, free) = self.cast(&path.ray, counters);
            let intervals = self.world.media.intervals(&free, &path.ray.regions);
            if self.world.media.is_chromatic() {
                let depths = intervals.optical_depths();
                let tau = depths.max_element();
                if tau > 0.0 && self.may_scatter(path.depth + 1) {
                    let samples = samples.of_share(f64::from(path.throughput.max_element()) * -(-tau).exp_m1());
                    let fog = Fog { free: &free, direction: path.ray.direction, intervals: &intervals, tau, samples };
                    let light = self.by_transmittances(&fog, depths, sampler, counters);
                    path.radiance += path.throughput * light;
                }
                path.throughput *= (-depths).exp().as_vec3();
                self.crosses_to(&mut path, intervals.end());
                if !self.arrive(&mut path, surface, intervals.end().clone(), sampler, counters) {
                    break;
                }
                continue;
            }
            let tau = intervals.optical_depth();
            if tau > 0.0 && self.may_scatter(path.depth + 1) {
                let samples = samples.of_share(f64::from(path.throughput.max_element()) * -(-tau).exp_m1());
                let fog = Fog { free: &free, direction: path.ray.direction, intervals: &intervals, tau, samples };
                let light = match self.estimator {
                    Estimator::Thesis => self.by_transmittance(&fog, self.fan(&fog).as_mut(), sampler, counters),
                    // Only of the opaque triangles is known where they leave a ray lit.
                    Estimator::Lit if self.world.others.is_none() => {
                        let stretches = stretches(&intervals, &self.world.media);
                        let mut light = Rgb::ZERO;
                        if !lights.points().is_empty() {
                            light += self.scattered_from_points(&fog, &stretches, sampler, counters);
                        }
                        if !lights.others().is_empty() {
                            light += self.towards_lights(&fog, &stretches, lights.others(), None, sampler, counters);
                        }
                        light
                    }
                    Estimator::Equiangular | Estimator::Lit => self.towards_lights(
                        &fog,
                        &stretches(&intervals, &self.world.media),
                        lights.all(),
                        self.fan(&fog).as_mut(),
                        sampler,
                        counters,
                    ),
                };
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

    /// Emitted light scattered once into the ray, from distances drawn by transmittance. With a fan the samples are taken together.
    #[inline]
    pub(super) fn by_transmittance(
        &self,
        fog: &Fog<'_>,
        mut fan: Option<&mut Fan<'_>>,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let &Fog { free, direction, intervals, tau, samples } = fog;
        let width = -(-tau).exp_m1() / f64::from(samples);
        let mut gathered = Gathered::default();
        for k in 0..samples {
            if self.stops_at(k) {
                break;
            }
            let depth = stratum_depth(k, width, sampler.next_1d());
            if let Some(fan) = &mut fan {
                if let Some(t) = fan.at_depth(depth) {
                    let emitter = fan.draw_emitter(sampler);
                    if fan.push(t, emitter, 1.0) {
                        self.ask_fan(fan, fog, &mut gathered.sum, counters);
                    }
                }
                continue;
            }
            // Rounding may place the last sample an ulp beyond the end; it is worth nothing there.
            if let FreeFlight::Collision { t, medium, regions } = intervals.free_flight(depth) {
                let point = free.at(t);
                let (albedo, phase) = self.world.media.scattering(medium, point);
                let vertex = Vertex::InMedium { phase, direction };
                let (light, flight) = self.draw_emitter(point, sampler);
                if let Some(light) = light {
                    let at = Aim { point, vertex: &vertex, regions: &regions, light: &light, flight };
                    self.gather(&mut gathered, &at, |value| albedo * value, counters);
                }
            }
        }
        self.ask_rest(&mut gathered, fan, fog, counters);
        gathered.sum * to_f32(width)
    }

    /// Light of these emitters scattered once into the ray, from distances drawn towards one of them or by transmittance. With a fan the samples are taken together.
    pub(super) fn towards_lights(
        &self,
        fog: &Fog<'_>,
        stretches: &[Stretch],
        emitters: &[usize],
        mut fan: Option<&mut Fan<'_>>,
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let lights = &self.world.lights;
        let scattered = -(-fog.tau).exp_m1();
        let strata = Strata::new(fog.samples, sampler);
        let u_place = if lights.numbers_of_place() > 0 { sampler.next_2d() } else { [0.0; 2] };
        let mut known: Option<(usize, Equiangular<NODES>)> = None;
        let mut gathered = Gathered::default();
        for k in 0..fog.samples {
            if self.stops_at(k) {
                break;
            }
            let u = strata.number(k, sampler);
            let flight = self.flight_to_emitter(sampler);
            // Of all by what they can give to the ray, else each alike; and what that is worth beside one of all, each alike, as its sample counts.
            let chosen = if emitters.len() == lights.count() {
                let drawn = lights.choose_along(fog.free.p, fog.direction, fog.intervals.length(), u);
                drawn.map(|d| (d.emitter, d.rest, 1.0 / (d.chance * lights.count() as f64)))
            } else {
                choose(u, emitters.len()).map(|(i, u)| (emitters[i], u, 1.0))
            };
            let Some((emitter, u, beside)) = chosen else { break };
            let Some(place) = lights.sample_point(emitter, evenly(u_place, k)) else { continue };
            let towards = match lights.position(&place) {
                None => None,
                Some((position, normal)) => {
                    if known.as_ref().is_none_or(|(of, _)| *of != emitter || lights.point_position(emitter).is_none()) {
                        let place = LightPlace { position, normal };
                        known = Some((emitter, Equiangular::new(fog.free.p, fog.direction, stretches, &place)));
                    }
                    known.as_ref().map(|(_, towards)| towards).filter(|towards| !towards.is_empty())
                }
            };
            let share = if towards.is_some() { TOWARDS_LIGHT } else { 0.0 };
            let drawn = match towards {
                Some(towards) if u < share => towards.sample(u / share),
                _ => {
                    let depth = -(-(u - share) / (1.0 - share) * scattered).ln_1p();
                    distance_at_depth(stretches, depth, fog.intervals)
                }
            };
            let Some((i, distance)) = drawn else { continue };
            let stretch = &stretches[i];
            let arrives = stretch.arrives(distance, fog.intervals);
            let pdf =
                share * towards.map_or(0.0, |towards| towards.pdf(i, distance)) + (1.0 - share) * arrives / scattered;
            // Nothing arrives from where exp(−τ) underflows.
            if !(arrives > 0.0 && pdf > 0.0) {
                continue;
            }
            let t = (distance / fog.intervals.length()).clamp(stretch.ends[0], stretch.ends[1]);
            let worth = to_f32(arrives / pdf * beside);
            if let Some(fan) = &mut fan {
                if fan.push(t, emitter, worth) {
                    self.ask_fan(fan, fog, &mut gathered.sum, counters);
                }
                continue;
            }
            let point = fog.free.at(t);
            if let Some(light) = lights.seen_from(point, &place) {
                let vertex = Vertex::InMedium { phase: stretch.phase, direction: fog.direction };
                let regions = fog.intervals.regions_in(stretch.part, t);
                let albedo = stretch.albedo_at(point, fog.intervals);
                let at = Aim { point, vertex: &vertex, regions: &regions, light: &light, flight };
                self.gather(&mut gathered, &at, |value| albedo * value * worth, counters);
            }
        }
        self.ask_rest(&mut gathered, fan, fog, counters);
        // An emitter's weight is for one of all.
        gathered.sum * (emitters.len() as f32 / lights.count() as f32) / fog.samples as f32
    }

    /// Gathers what arrives from a sample of an emitter, as the ray is worth `weighted` of it: once it is known that nothing is in the way, which is asked
    /// for several samples together.
    #[inline]
    fn gather(&self, gathered: &mut Gathered, at: &Aim<'_>, weighted: impl Fn(Rgb) -> Rgb, counters: &mut Counters) {
        // What lets light through has a say in what arrives.
        if self.world.others.is_some() {
            let &Aim { point, vertex, regions, light, flight } = at;
            if let Some(arriving) = self.connect(point, vertex, regions, light, flight, counters) {
                gathered.sum += weighted(arriving.value);
            }
            return;
        }
        let Some((query, value)) = self.aim(at) else { return };
        gathered.queries[gathered.waiting] = query;
        gathered.lights[gathered.waiting] = weighted(value);
        gathered.waiting += 1;
        if gathered.waiting == TOGETHER {
            self.ask_all(gathered, counters);
        }
    }

    /// Asks what waits at the end of a ray.
    fn ask_rest(&self, gathered: &mut Gathered, fan: Option<&mut Fan<'_>>, fog: &Fog<'_>, counters: &mut Counters) {
        match fan {
            Some(fan) => self.ask_fan(fan, fog, &mut gathered.sum, counters),
            None => self.ask_all(gathered, counters),
        }
    }

    /// Asks what waits, and adds what arrives, in the order of the samples.
    fn ask_all(&self, gathered: &mut Gathered, counters: &mut Counters) {
        let waiting = std::mem::take(&mut gathered.waiting);
        let mut unoccluded = [false; TOGETHER];
        self.visibility.all_unoccluded(&gathered.queries[..waiting], &mut unoccluded[..waiting], counters);
        for (light, _) in gathered.lights.iter().zip(unoccluded).filter(|(_, unoccluded)| *unoccluded) {
            gathered.sum += *light;
        }
    }
}

/// Where the samples of one ray lie in strata of equal size.
///
/// Even numbers are few, and only those of one group are even together: so one of them is for all strata, and the samples of a pixel fill pixel and ray as
/// one. Every other stratum takes it from its end, so that what rises and falls along the ray evens out. Independent numbers are one for each stratum.
pub(super) struct Strata {
    samples: f64,
    shared: Option<f64>,
}

impl Strata {
    pub(super) fn new(samples: u32, sampler: &mut Sampler) -> Self {
        Self { samples: f64::from(samples), shared: sampler.is_even().then(|| sampler.next_1d()) }
    }

    /// A number in the `k`-th stratum, uniform there.
    #[inline]
    pub(super) fn number(&self, k: u32, sampler: &mut Sampler) -> f64 {
        let u = match self.shared {
            None => sampler.next_1d(),
            Some(u) if k.is_multiple_of(2) => u,
            // Below 1, as all numbers.
            Some(u) => (1.0 - f64::EPSILON / 2.0) - u,
        };
        (f64::from(k) + u) / self.samples
    }
}

/// Queries of one ray that are asked together.
const TOGETHER: usize = 8;

/// Light of a ray's samples: what has arrived, and what does if nothing is in the way.
struct Gathered {
    sum: Rgb,
    waiting: usize,
    queries: [ShadowQuery; TOGETHER],
    lights: [Rgb; TOGETHER],
}

impl Default for Gathered {
    fn default() -> Self {
        let none = ShadowQuery { from: DVec3::ZERO, to: DVec3::ZERO, emitter: 0, kind: QueryKind::Spatial };
        Self { sum: Rgb::ZERO, waiting: 0, queries: [none; TOGETHER], lights: [Rgb::ZERO; TOGETHER] }
    }
}

/// The `k`-th of a sequence of points in the unit square, each uniform and together even: steps of the two-dimensional golden ratio
/// \[Roberts2018\] from `u` on.
#[inline]
pub(crate) fn evenly(u: [f64; 2], k: u32) -> [f64; 2] {
    let step = |u: f64, ratio: f64| {
        let x = u + f64::from(k) * ratio;
        (x - x.floor()).min(1.0 - f64::EPSILON / 2.0)
    };
    [step(u[0], 0.754_877_666_246_692_7), step(u[1], 0.569_840_290_998_053_2)]
}

/// The optical depth of a sample in stratum `k`, uniform in transmittance, where each stratum takes `width` of it.
#[inline]
fn stratum_depth(k: u32, width: f64, u: f64) -> f64 {
    -(-(f64::from(k) + u) * width).ln_1p()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SamplerKind, chi_squared::assert_drawn_from};

    /// Each number lies in its stratum and is uniform there, alone or from one that all share; χ² over 64 cells of 16 each.
    #[test]
    fn each_stratum_has_a_uniform_number() {
        for kind in SamplerKind::ALL {
            for samples in [1_u32, 2, 7] {
                for k in 0..samples {
                    let mut cells = [0; 64];
                    for i in 0..20_000 {
                        let mut sampler = Sampler::of_kind(kind, 5, i, k, 3);
                        let strata = Strata::new(samples, &mut sampler);
                        let u = strata.number(k, &mut sampler) * f64::from(samples) - f64::from(k);
                        assert!((-1e-15..1.0 + 1e-15).contains(&u), "{kind:?}, {k} of {samples}: {u}");
                        cells[((u * 64.0) as usize).min(63)] += 1;
                    }
                    assert_drawn_from(&format!("{kind:?}, {k} of {samples}"), &cells, &[1.0 / 64.0; 64]);
                }
            }
        }
    }

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
