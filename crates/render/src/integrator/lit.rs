//! Single scattering of point lights from the parts of a ray that they see, and from nowhere else.
//!
//! *Idea.* [`LitIntervals`] say where a ray is lit. Distances are drawn only there, by their angle at the light and by what comes through
//! (`equiangular`). So in thin fog a sample is worth what the whole line is worth, whatever number it is drawn with, and it asks no query.
//!
//! *Definition.* The pieces of a ray are its stretches of fog but for what is dark. With g the polygon of `equiangular` over them, a distance
//! is drawn with the density p₁ ∝ g D/r². Where g may be far from what it stands for, a share of [`DEFENSIVE`] is drawn by transmittance instead,
//! p₂ ∝ σ_t exp(−τ) over the same pieces, and weighted by the balance heuristic in its one-sample form \[Veach1997\]. g is close if between any two of its
//! nodes what it stands for changes by no more than [`CLOSE`] times: transmittance and phase function are monotone along a ray, so the
//! nodes bound them. Other media on the way to the light are not looked at by g, so it is also not close where its own fog takes
//! much of the light.
//!
//! *Several lights.* One is drawn for each sample, by what it would contribute if it saw all of the ray, and with a share of
//! [`BY_CHANCE`] any; the stratified samples visit them in order.
//!
//! *Why it is unbiased.* Where a ray is not certainly lit or dark, a query is asked. So every point of positive contribution has its density,
//! and what is found there does not depend on how it was found.

use smallvec::SmallVec;
use vdf_scene::Rgb;
use vdf_visibility::{Answer, Counters, LitIntervals, QueryKind, Recorder, ShadowQuery};

use super::{
    Tracer, Vertex,
    equiangular::{Equiangular, LightPlace},
    raymarch::{Fog, Strata},
    stretch::Stretch,
    to_f32,
};
use crate::Sampler;

/// The share of the samples that are drawn by transmittance where the density towards the light may be far off.
const DEFENSIVE: f64 = 1.0 / 32.0;

/// So many times the density towards a light may be off where there is no such share.
const CLOSE: f64 = 4.0;

/// The share of the samples whose light is drawn with equal probability.
const BY_CHANCE: f64 = 0.1;

/// Lights that are compared; of more, any is drawn.
const COMPARED: usize = 16;

/// Nodes of the density on each piece.
const NODES: usize = 9;

/// A point light to be drawn.
#[derive(Clone, Copy, Debug)]
struct Choice {
    emitter: usize,
    place: LightPlace,
    /// With what probability it is drawn.
    probability: f64,
}

/// A part of a ray that a light may see.
#[derive(Clone, Copy, Debug)]
struct Piece {
    /// Parameters along the ray's segment.
    ends: [f64; 2],
    /// What arrives of all that is scattered there, by transmittance.
    mass: f64,
}

/// What one light sees of a ray.
#[derive(Debug)]
struct Lit {
    intervals: LitIntervals,
    pieces: SmallVec<[Piece; 4]>,
    stretches: SmallVec<[Stretch; 4]>,
    towards: Equiangular<NODES>,
    /// Share of the samples drawn towards the light.
    share: f64,
    mass: f64,
}

impl<R: Recorder> Tracer<'_, R> {
    /// Light of all point emitters scattered once into the ray.
    pub(super) fn scattered_from_points(
        &self,
        fog: &Fog<'_>,
        stretches: &[Stretch],
        sampler: &mut Sampler,
        counters: &mut Counters,
    ) -> Rgb {
        let choices = self.likely_points(fog, stretches);
        let strata = Strata::new(fog.samples, sampler);
        let mut sum = Rgb::ZERO;
        let mut known: Option<(usize, Lit)> = None;
        for k in 0..fog.samples {
            if self.stops_at(k) {
                break;
            }
            let u = strata.number(k, sampler);
            let flight = self.flight_to_emitter(sampler);
            let Some((choice, u)) = self.draw_point(&choices, u) else { break };
            if known.as_ref().is_none_or(|(of, _)| *of != choice.emitter) {
                known = Some((choice.emitter, self.lit(fog, stretches, &choice.place, counters)));
            }
            let Some((_, lit)) = &known else { break };
            let Some((i, distance)) = lit.sample(u, fog) else { continue };
            let piece = &lit.pieces[i];
            let stretch = &lit.stretches[i];
            let arrives = stretch.arrives(distance, fog.intervals);
            let pdf = lit.pdf(i, distance, arrives) * choice.probability;
            if !(arrives > 0.0 && pdf > 0.0) {
                continue;
            }
            let t = (distance / fog.intervals.length()).clamp(piece.ends[0], piece.ends[1]);
            let point = fog.free.at(t);
            let lights = &self.world.lights;
            let place = lights.sample_point(choice.emitter, [0.0; 2]);
            let Some(light) = place.and_then(|place| lights.seen_from(point, &place)) else { continue };
            let vertex = Vertex::InMedium { phase: stretch.phase, direction: fog.direction };
            let (value, _) = vertex.eval(self.world, light.direction);
            let value = value * light.weight * stretch.albedo_at(point, fog.intervals);
            if value.max_element() <= 0.0 {
                continue;
            }
            let arrives_there = match lit.intervals.answer(t) {
                Answer::Unoccluded => true,
                Answer::Occluded => false,
                Answer::Unknown => {
                    let query =
                        ShadowQuery { from: point, to: light.point, emitter: light.emitter, kind: QueryKind::Spatial };
                    self.visibility.unoccluded(&query, counters)
                }
            };
            if arrives_there {
                let regions = fog.intervals.regions_in(stretch.part, t);
                let transmittance = self.transmittance_to(point, &light, &regions, flight);
                sum += value * (transmittance * to_f32(arrives / (pdf * lights.count() as f64)));
            }
        }
        sum / fog.samples as f32
    }

    /// A point emitter, and what is left of the number that draws it: one of these choices, or any if there were too many to compare.
    #[inline]
    fn draw_point(&self, choices: &[Choice], u: f64) -> Option<(Choice, f64)> {
        let points = self.world.lights.points();
        if points.len() <= COMPARED {
            return choose(choices, u).map(|(choice, u)| (*choice, u));
        }
        let (i, u) = super::choose(u, points.len())?;
        let (emitter, position, _) = points[i];
        let probability = 1.0 / points.len() as f64;
        Some((Choice { emitter, place: LightPlace { position, normal: None }, probability }, u))
    }

    /// The point emitters, and how likely each is drawn; none if there are too many to compare.
    fn likely_points(&self, fog: &Fog<'_>, stretches: &[Stretch]) -> SmallVec<[Choice; COMPARED]> {
        let points = self.world.lights.points();
        let n = points.len();
        let choice = |&(emitter, position, _): &(usize, glam::DVec3, Rgb), probability: f64| Choice {
            emitter,
            place: LightPlace { position, normal: None },
            probability,
        };
        let mut choices: SmallVec<[Choice; COMPARED]> = SmallVec::new();
        if n > COMPARED {
            return choices;
        }
        let mut sum = 0.0;
        for point in points {
            let mut choice = choice(point, 1.0);
            if n > 1 {
                let towards = Equiangular::<2>::new(fog.free.p, fog.direction, stretches, &choice.place);
                choice.probability = towards.worth() * f64::from(point.2.element_sum());
                sum += choice.probability;
            }
            choices.push(choice);
        }
        if n > 1 {
            let even = 1.0 / n as f64;
            for choice in &mut choices {
                let share = if sum > 0.0 && sum.is_finite() { choice.probability / sum } else { even };
                choice.probability = BY_CHANCE * even + (1.0 - BY_CHANCE) * share;
            }
        }
        choices
    }

    /// What this light sees of the ray.
    fn lit(&self, fog: &Fog<'_>, stretches: &[Stretch], place: &LightPlace, counters: &mut Counters) -> Lit {
        let intervals = self.visibility.lit_intervals(place.position, fog.free, counters);
        let length = fog.intervals.length();
        let mut pieces: SmallVec<[Piece; 4]> = SmallVec::new();
        let mut cut: SmallVec<[Stretch; 4]> = SmallVec::new();
        for stretch in stretches {
            for [begin, end] in intervals.open() {
                let ends = [begin.max(stretch.ends[0]), end.min(stretch.ends[1])];
                if ends[0] >= ends[1] {
                    continue;
                }
                let [begin, end] = [ends[0] * length, ends[1] * length];
                let Some(of_piece) = stretch.cut(begin, end, fog.intervals) else { continue };
                let through = -(of_piece.sigma_t * (begin - end)).exp_m1();
                pieces.push(Piece { ends, mass: (-of_piece.depth).exp() * through });
                cut.push(of_piece);
            }
        }
        let towards = Equiangular::new(fog.free.p, fog.direction, &cut, place);
        let share = if towards.is_empty() {
            0.0
        } else if towards.contrast() <= CLOSE {
            1.0
        } else {
            1.0 - DEFENSIVE
        };
        let mass = pieces.iter().map(|piece| piece.mass).sum();
        Lit { intervals, pieces, stretches: cut, towards, share, mass }
    }
}

impl Lit {
    /// A distance, and the index of its piece, from a uniform number; `None` if nothing can be drawn.
    #[inline]
    fn sample(&self, u: f64, fog: &Fog<'_>) -> Option<(usize, f64)> {
        if u < self.share {
            return self.towards.sample(u / self.share);
        }
        let mut left = (u - self.share) / (1.0 - self.share) * self.mass;
        let last = self.pieces.len().checked_sub(1)?;
        for (i, (piece, stretch)) in self.pieces.iter().zip(&self.stretches).enumerate() {
            if left < piece.mass || i == last {
                let through = -(stretch.sigma_t * (stretch.begin - stretch.end)).exp_m1();
                let share = (left / piece.mass).clamp(0.0, 1.0);
                return Some((i, stretch.distance_of(-(-share * through).ln_1p(), fog.intervals)));
            }
            left -= piece.mass;
        }
        None
    }

    /// The density per world unit at a distance in the piece with this index, where `arrives` is σ_t exp(−τ).
    #[inline]
    fn pdf(&self, piece: usize, distance: f64, arrives: f64) -> f64 {
        let towards = self.share * self.towards.pdf(piece, distance);
        if self.share == 1.0 { towards } else { towards + (1.0 - self.share) * arrives / self.mass }
    }
}

/// The light that a uniform number draws, and what is left of the number: uniform again.
#[inline]
fn choose(choices: &[Choice], u: f64) -> Option<(&Choice, f64)> {
    let mut left = u;
    let last = choices.len().checked_sub(1)?;
    for choice in &choices[..last] {
        if left < choice.probability {
            return Some((choice, left / choice.probability));
        }
        left -= choice.probability;
    }
    let choice = &choices[last];
    Some((choice, (left / choice.probability).clamp(0.0, 1.0 - f64::EPSILON / 2.0)))
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, dvec3};
    use vdf_scene::{Emitter, IntegratorSettings, LoadOptions, Scene};
    use vdf_visibility::{Counters, Method};

    use super::*;
    use crate::{Estimator, Integrator, PrepareOptions, PreparedScene, Quiet, RenderOptions};

    /// A built-in scene with these point lights beside its own; light is scattered once in the medium.
    fn scene(name: &str, lights: &[(DVec3, f32)]) -> Scene {
        let source = vdf_scenes::builtin(name).expect("a built-in scene");
        let defines = ["width", "height"].map(|n| (n.to_owned(), "16".to_owned())).to_vec();
        let mut scene =
            Scene::from_source(&source, &LoadOptions { defines, ..LoadOptions::default() }).expect("it loads");
        let point = |&(position, intensity)| Emitter::Point { position, intensity: Rgb::splat(intensity) };
        scene.emitters.extend(lights.iter().map(point));
        scene.integrator = IntegratorSettings { max_depth: Some(2), ..scene.integrator };
        scene
    }

    /// The pixels, each a mean of `spp` samples; and what was counted.
    fn image(
        prepared: &PreparedScene,
        estimator: Estimator,
        samples: u32,
        spp: u32,
        seed: u64,
    ) -> (Vec<f64>, Counters) {
        let options = RenderOptions {
            integrator: Integrator::raymarch(samples),
            estimator,
            spp: Some(spp),
            seed: Some(seed),
            ..RenderOptions::default()
        };
        let job = prepared.job(&options).expect("sound options");
        let tracer = job.tracer(&Quiet);
        let [width, height] = job.size();
        let mut counters = Counters::default();
        let mut pixels = Vec::new();
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let sum: f64 = (0..spp)
                .map(|sample| {
                    let (radiance, weight) = tracer.sample(x, y, sample, &mut counters);
                    f64::from(radiance.element_sum()) * weight
                })
                .sum();
            pixels.push(sum / f64::from(spp));
        }
        (pixels, counters)
    }

    /// Light of one point and of several, bright, faint, near a wall and shut in: the mean of the differences to `equiangular`, which asks queries,
    /// over the image and over its rows by fours; 5 standard errors are a false alarm of 6·10⁻⁷ each, 2·10⁻⁵ for all. Next to no query
    /// is asked from fog.
    #[test]
    fn what_is_lit_is_what_queries_say() {
        let several = [
            (dvec3(100.0, 300.0, 300.0), 1e5),
            (dvec3(500.0, 100.0, 100.0), 3e4),
            (dvec3(400.0, 500.0, 400.0), 1e2),
            // In the tall block, if there is one.
            (dvec3(370.0, 100.0, 350.0), 1e6),
        ];
        // More than are compared.
        let many = [(); COMPARED + 1].map(|()| (dvec3(250.0, 400.0, 250.0), 1e6));
        let cases =
            [("cbox_vol2", &[][..]), ("cbox_vol4", &several), ("cbox_light", &several[..1]), ("cbox_vol2", &many)];
        for (name, lights) in cases {
            let options = PrepareOptions::with_method(Method::NONE);
            let prepared = PreparedScene::new(scene(name, lights), &options, &Quiet).expect("it is prepared");
            let (asked, of_queries) = image(&prepared, Estimator::Equiangular, 4, 48, 5);
            let (lit, of_intervals) = image(&prepared, Estimator::Lit, 2, 48, 3);
            // Where a light is in the picture a pixel is bright and noisy: differences are weighted by a third image, which knows nothing of them.
            let (guide, _) = image(&prepared, Estimator::Equiangular, 4, 8, 7);
            if name != "cbox_light" {
                assert!(of_intervals.spatial * 100 < of_queries.spatial, "{name}: {of_intervals:?} {of_queries:?}");
            }
            let level = asked.iter().sum::<f64>() / asked.len() as f64;
            for part in 0..5 {
                let kept = (0..asked.len()).filter(|i| part == 4 || i / 64 == part);
                let differences: Vec<f64> = kept.map(|i| (asked[i] - lit[i]) / (0.2 * level + guide[i])).collect();
                let n = differences.len() as f64;
                let mean = differences.iter().sum::<f64>() / n;
                let error = (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / (n - 1.0) / n).sqrt();
                println!("{name}, part {part}: {mean:.1e} ± {error:.1e}");
                assert!(mean.abs() < 5.0 * error, "{name}, part {part}: {mean} ± {error}");
                // What an area light adds is noisy with both.
                assert!(error < 0.05 || name == "cbox_light", "{name}, part {part}: too noisy, {error}");
            }
        }
    }

    /// Every draw is one of the pieces, has a density, and each light and piece gets its share.
    #[test]
    fn lights_are_drawn_by_their_probabilities() {
        let choice = |emitter, probability| Choice {
            emitter,
            place: LightPlace { position: DVec3::ZERO, normal: None },
            probability,
        };
        let choices = [choice(3, 0.5), choice(5, 0.125), choice(8, 0.375)];
        let mut counts = [0; 9];
        for k in 0..800 {
            let u = (f64::from(k) + 0.5) / 800.0;
            let (choice, rest) = choose(&choices, u).expect("there are some");
            assert!((0.0..1.0).contains(&rest), "{u}");
            counts[choice.emitter] += 1;
        }
        assert_eq!((counts[3], counts[5], counts[8]), (400, 100, 300));
        assert!(choose(&[], 0.5).is_none());
    }
}
