//! Next-event estimation: choosing an emitter and a point on it, and the density of doing so. One file a kind of emitter.

mod area;
mod beam;
mod choice;
mod constant;
mod directional;
mod envmap;
mod point;
mod projector;
mod spot;

use std::f64::consts::PI;

use glam::DVec3;
use vdf_geometry::Bounds;
use vdf_scene::{Emitter, Rgb, Scene};

use self::{
    area::{AreaLight, AreaPoint},
    choice::{Choice, Node, Shining, along, at},
    envmap::EnvmapLight,
    projector::ProjectorLight,
    spot::SpotLight,
};
pub(crate) use self::{
    beam::{Beam, LightRay},
    choice::Drawn,
};

/// The emitters of a scene, prepared for sampling.
#[derive(Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// Which of them an event asks.
    choice: Choice,
    /// The number, position and intensity of each that is a point.
    points: Vec<(usize, DVec3, Rgb)>,
    /// The numbers of all, and of those that are no points.
    all: Vec<usize>,
    others: Vec<usize>,
    /// Radiance from outside the scene but for that of a map; black without a `constant` emitter.
    background: Rgb,
    /// Number of the environment map, if there is one.
    envmap: Option<usize>,
    /// How far a direction is followed before it is infinitely far away, in world units.
    reach: f64,
    may_be_met: bool,
    numbers_of_place: u32,
    /// Of each that rays are sent from.
    beams: Vec<Beam>,
    /// How likely each of these is drawn, and the sums of these up to each.
    beam_chances: Vec<f64>,
    beam_sums: Vec<f64>,
    numbers_of_origin: u32,
    /// By number of emitter.
    beam_of_emitter: Vec<Option<usize>>,
}

#[derive(Debug)]
enum Light {
    Point { position: DVec3, intensity: Rgb },
    Spot(Box<SpotLight>),
    Projector(Box<ProjectorLight>),
    Area(AreaLight),
    Directional { direction: DVec3, irradiance: Rgb },
    Constant { radiance: Rgb },
    Envmap(Box<EnvmapLight>),
}

/// A point on an emitter as seen from a place in the scene.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Number of the emitter in [`Scene::emitters`].
    pub emitter: usize,
    /// The point, or for an infinitely far emitter a point outside the scene, in its direction. World units.
    pub point: DVec3,
    /// Unit direction towards the point.
    pub direction: DVec3,
    /// Radiance (or intensity over squared distance) divided by the density, in the absence of media and occluders.
    pub weight: Rgb,
    /// Density per steradian; 0 for a point emitter, which no scattered ray can meet.
    pub pdf: f64,
    /// Whether the point lies on an occluder, so that the query is superficial (Def. 2 in \[Houska2013\]).
    pub on_surface: bool,
    /// One over the probability with which the emitter was drawn.
    pub choices: f64,
}

/// A place on an emitter, drawn before it is known from where it will be seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmitterPoint {
    emitter: usize,
    place: Place,
    /// One over the probability of the emitter.
    choices: f64,
}

#[derive(Clone, Copy, Debug)]
enum Place {
    Point,
    Area(AreaPoint),
    /// The numbers that the direction is drawn with, once it is known from where.
    Numbers([f64; 2]),
}

impl EmitterPoint {
    /// The same place of an emitter that was drawn as one of so many.
    #[inline]
    pub(crate) const fn of_choices(self, choices: f64) -> Self {
        Self { choices, ..self }
    }
}

/// One of so many, each equally likely, by a uniform number, and what is left of it: uniform again.
#[inline]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in [0, n)")]
pub(crate) fn choose(u: f64, n: usize) -> Option<(usize, f64)> {
    let u = u * n as f64;
    let i = (u as usize).min(n.checked_sub(1)?);
    Some((i, (u - i as f64).clamp(0.0, 1.0 - f64::EPSILON / 2.0)))
}

impl Lights {
    /// Prepares the emitters of `scene`. `reach` is longer than any path through the scene, in world units.
    #[must_use]
    pub fn new(scene: &Scene, reach: f64) -> Self {
        let mut background = Rgb::ZERO;
        let lights: Vec<_> = scene
            .emitters
            .iter()
            .map(|e| match *e {
                Emitter::Point { position, intensity } => Light::Point { position, intensity },
                Emitter::Spot { position, direction, intensity, beam, cutoff, ref slide } => {
                    Light::Spot(Box::new(SpotLight {
                        position,
                        direction,
                        intensity,
                        beam,
                        cutoff,
                        slide: slide.clone(),
                    }))
                }
                Emitter::Projector { position, direction, ref slide } => {
                    Light::Projector(Box::new(ProjectorLight { position, direction, slide: (**slide).clone() }))
                }
                Emitter::Directional { direction, irradiance } => Light::Directional { direction, irradiance },
                Emitter::Envmap { ref image, scale, ref world_from_map } => {
                    Light::Envmap(Box::new(EnvmapLight::new(image, scale, world_from_map)))
                }
                Emitter::Area { surface } => {
                    let s = &scene.surfaces[surface];
                    Light::Area(AreaLight::new(s))
                }
                Emitter::Constant { radiance } => {
                    background += radiance;
                    Light::Constant { radiance }
                }
            })
            .collect();
        let point = |(i, light): (usize, &Light)| match *light {
            Light::Point { position, intensity } => Some((i, position, intensity)),
            _ => None,
        };
        let points: Vec<_> = lights.iter().enumerate().filter_map(point).collect();
        let others = (0..lights.len()).filter(|i| points.iter().all(|(point, ..)| point != i)).collect();
        let envmap = lights.iter().position(|l| matches!(l, Light::Envmap(_)));
        let may_be_met =
            background != Rgb::ZERO || envmap.is_some() || scene.surfaces.iter().any(|s| s.radiance.is_some());
        let is_point = |light: &Light| matches!(light, Light::Point { .. } | Light::Spot(_) | Light::Projector(_));
        let numbers_of_place = if lights.iter().all(is_point) { 0 } else { 2 };
        let all = (0..lights.len()).collect();
        let beam = |(i, light): (usize, &Light)| match light {
            Light::Point { position, .. } => Some(Beam::sphere(i, *position)),
            Light::Spot(light) => Beam::cone(i, light.position, light.direction, light.cutoff),
            Light::Projector(light) => Beam::cone(i, light.position, light.direction, light.angle()),
            Light::Area(light) => light.place().map(|position| Beam::surface(i, position, light.area())),
            Light::Directional { .. } | Light::Constant { .. } | Light::Envmap(_) => None,
        };
        let beams: Vec<_> = lights.iter().enumerate().filter_map(beam).collect();
        let numbers_of_origin = if beams.iter().all(Beam::is_point) { 0 } else { 2 };
        // An even share for all, for the brightest may be shut in.
        let powers: Vec<f64> = beams.iter().map(|b| b.throughput() * lights[b.emitter].intensity()).collect();
        let (sum, n) = (powers.iter().sum::<f64>(), beams.len() as f64);
        let chance = |power: &f64| if sum > 0.0 && sum.is_finite() { 0.2 / n + 0.8 * power / sum } else { 1.0 / n };
        let beam_chances: Vec<f64> = powers.iter().map(chance).collect();
        let beam_sums = beam_chances
            .iter()
            .scan(0.0, |sum, chance| {
                *sum += chance;
                Some(*sum)
            })
            .collect();
        let choice = Choice::new(&lights.iter().map(Light::shining).collect::<Vec<_>>());
        let mut beam_of_emitter = vec![None; lights.len()];
        for (i, beam) in beams.iter().enumerate() {
            beam_of_emitter[beam.emitter] = Some(i);
        }
        Self {
            lights,
            choice,
            points,
            all,
            others,
            background,
            envmap,
            reach,
            may_be_met,
            numbers_of_place,
            beams,
            beam_chances,
            beam_sums,
            numbers_of_origin,
            beam_of_emitter,
        }
    }

    /// Radiance of a ray that leaves the scene in the unit direction `direction`.
    #[inline]
    #[must_use]
    pub fn background(&self, direction: DVec3) -> Rgb {
        match self.map() {
            None => self.background,
            Some(map) => self.background + map.radiance(direction),
        }
    }

    #[inline]
    fn map(&self) -> Option<&EnvmapLight> {
        match &self.lights[self.envmap?] {
            Light::Envmap(map) => Some(map),
            _ => None,
        }
    }

    /// Draws an emitter (each equally likely) and a point on it. `None` if there is no light from there.
    #[inline]
    #[must_use]
    pub fn sample(&self, from: DVec3, u_emitter: f64, u: [f64; 2]) -> Option<LightSample> {
        let (emitter, _) = choose(u_emitter, self.lights.len())?;
        self.seen_from(from, &self.sample_point(emitter, u)?)
    }

    /// Whether a ray may meet any light: there is a background, or a surface that shines.
    #[inline]
    pub(crate) const fn may_be_met(&self) -> bool {
        self.may_be_met
    }

    /// So many random numbers are set aside for a place on an emitter, whichever it is: none if all are points.
    #[inline]
    pub(crate) const fn numbers_of_place(&self) -> u32 {
        self.numbers_of_place
    }

    /// The emitters that rays are sent from: all but those that are infinitely far away.
    #[inline]
    pub(crate) fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// One of [`Lights::beams`] by its power, and what is left of the uniform number that drew it; `None` if there are none.
    #[inline]
    pub(crate) fn choose_beam(&self, u: f64) -> Option<(usize, f64)> {
        let i = self.beam_sums.partition_point(|&sum| sum <= u).min(self.beams.len().checked_sub(1)?);
        let before = if i == 0 { 0.0 } else { self.beam_sums[i - 1] };
        Some((i, ((u - before) / self.beam_chances[i]).clamp(0.0, 1.0 - f64::EPSILON / 2.0)))
    }

    /// The probability of a beam.
    #[inline]
    pub(crate) fn beam_chance(&self, beam: usize) -> f64 {
        self.beam_chances[beam]
    }

    /// An emitter that can give much to an event at `point`; `None` if there are none.
    #[inline]
    pub(crate) fn choose_at(&self, point: DVec3, u: f64) -> Option<Drawn> {
        self.choose_by(u, at(point))
    }

    /// An emitter that can give much to what is scattered on so much of a ray; `None` if there are none.
    #[inline]
    pub(crate) fn choose_along(&self, origin: DVec3, direction: DVec3, length: f64, u: f64) -> Option<Drawn> {
        self.choose_by(u, along(origin, direction, length))
    }

    #[inline]
    fn choose_by(&self, u: f64, importance: impl Fn(&Node) -> f64) -> Option<Drawn> {
        match self.lights.len() {
            1 => Some(Drawn { emitter: 0, rest: u, chance: 1.0 }),
            _ => self.choice.draw(u, importance),
        }
    }

    /// One over the probability with which [`Lights::choose_at`] takes this emitter.
    #[inline]
    pub(crate) fn choices_at(&self, emitter: usize, point: DVec3) -> f64 {
        if self.lights.len() == 1 { 1.0 } else { 1.0 / self.choice.chance(emitter, at(point)) }
    }

    /// So many random numbers are set aside for a place to send a ray from.
    #[inline]
    pub(crate) const fn numbers_of_origin(&self) -> u32 {
        self.numbers_of_origin
    }

    /// A point just before an emitter's surface, uniform over its area, the unit normal there and the radiance.
    #[inline]
    fn surface_point(&self, emitter: usize, u: [f64; 2]) -> Option<(DVec3, DVec3, Rgb)> {
        let Light::Area(light) = &self.lights[emitter] else { return None };
        let place = light.sample(u)?;
        Some((place.lifted(), place.normal, place.radiance()))
    }

    /// The density per steradian of a ray, from one of [`Lights::beams`], to a point at this squared distance, over the density with which the point's own sample of
    /// the emitter, one of `choices` and of density `pdf` per steradian there, starts at the same place; 0 if no ray leaves the emitter.
    #[inline]
    pub(crate) fn density_of_beam(&self, emitter: usize, distance2: f64, pdf: f64, choices: f64) -> f64 {
        let Some(i) = self.beam_of_emitter[emitter] else { return 0.0 };
        let beam = &self.beams[i];
        // `pdf` has the choice of the emitter in it; a point has none.
        let choices = if beam.is_point() { choices } else { 1.0 };
        beam.density(distance2, pdf) * choices * self.beam_chances[i]
    }

    /// How many emitters there are.
    #[inline]
    pub(crate) const fn count(&self) -> usize {
        self.lights.len()
    }

    /// The number, position and intensity of each emitter that is a point.
    #[inline]
    pub(crate) fn points(&self) -> &[(usize, DVec3, Rgb)] {
        &self.points
    }

    /// The numbers of all emitters.
    #[inline]
    pub(crate) fn all(&self) -> &[usize] {
        &self.all
    }

    /// The numbers of those that are no points.
    #[inline]
    pub(crate) fn others(&self) -> &[usize] {
        &self.others
    }

    /// Draws a place on an emitter, which counts as one that was drawn with the same probability as all others. `None` if it has none.
    #[inline]
    pub(crate) fn sample_point(&self, emitter: usize, u: [f64; 2]) -> Option<EmitterPoint> {
        let choices = self.lights.len() as f64;
        if self.numbers_of_place == 0 {
            return Some(EmitterPoint { emitter, place: Place::Point, choices });
        }
        let place = match &self.lights[emitter] {
            Light::Point { .. } | Light::Spot(_) | Light::Projector(_) => Place::Point,
            Light::Area(light) if light.ball().is_none() => Place::Area(light.sample(u)?),
            Light::Area(_) | Light::Directional { .. } | Light::Constant { .. } | Light::Envmap(_) => Place::Numbers(u),
        };
        Some(EmitterPoint { emitter, place, choices })
    }

    /// The place as seen from `from`. `None` if there is no light from there.
    #[inline]
    pub(crate) fn seen_from(&self, from: DVec3, point: &EmitterPoint) -> Option<LightSample> {
        let &EmitterPoint { emitter, choices, .. } = point;
        match (&self.lights[emitter], &point.place) {
            (Light::Point { position, intensity }, _) => point::sample(emitter, *position, *intensity, from, choices),
            (Light::Area(light), Place::Area(place)) => light.seen_from(emitter, from, place, choices),
            (Light::Area(light), Place::Numbers(u)) => light.ball()?.sample(light, emitter, from, *u, choices),
            (Light::Constant { radiance }, Place::Numbers(u)) => {
                Some(constant::sample(emitter, from, *u, *radiance, choices, self.reach))
            }
            (Light::Spot(light), _) => light.sample(emitter, from, choices),
            (Light::Projector(light), _) => light.sample(emitter, from, choices),
            (Light::Directional { direction, irradiance }, _) => {
                Some(directional::sample(emitter, from, *direction, *irradiance, choices, self.reach))
            }
            (Light::Envmap(map), Place::Numbers(u)) => map.sample(emitter, from, *u, choices, self.reach),
            (Light::Area(_) | Light::Constant { .. } | Light::Envmap(_), _) => None,
        }
    }

    /// Where a place is and, if it shines to one side only, the unit normal of that side; `None` if it is infinitely far away. Of a ball, whose points are
    /// drawn once it is known from where, it is the middle.
    #[inline]
    pub(crate) fn position(&self, point: &EmitterPoint) -> Option<(DVec3, Option<DVec3>)> {
        match &point.place {
            Place::Point => self.point_position(point.emitter).map(|position| (position, None)),
            Place::Area(place) => Some((place.point, Some(place.normal))),
            Place::Numbers(_) => match &self.lights[point.emitter] {
                Light::Area(light) => light.ball().map(|ball| (ball.centre, None)),
                _ => None,
            },
        }
    }

    /// Where an emitter is, if it is a point.
    #[inline]
    pub(crate) fn point_position(&self, emitter: usize) -> Option<DVec3> {
        match &self.lights[emitter] {
            Light::Point { position, .. } => Some(*position),
            Light::Spot(light) => Some(light.position),
            Light::Projector(light) => Some(light.position),
            _ => None,
        }
    }

    /// The density with which this direction of the environment map, or of any one constant emitter, is drawn where an emitter is one of `choices`.
    #[inline]
    #[must_use]
    pub fn pdf_background(&self, direction: DVec3, choices: f64) -> f64 {
        match self.map() {
            None => pdf_constant(choices),
            Some(map) => map.pdf(direction) / choices,
        }
    }

    /// An emitter that is infinitely far away, if there is one: all of them are drawn with the same probability.
    #[inline]
    pub(crate) fn a_far_one(&self) -> Option<usize> {
        self.choice.far().first().copied()
    }

    /// The density with which the point of area emitter `emitter` that is seen under `cos_theta` to its normal is drawn from a place `distance` away, where the emitter is
    /// one of `choices`.
    #[inline]
    #[must_use]
    pub fn pdf_area(&self, emitter: usize, distance: f64, cos_theta: f64, choices: f64) -> f64 {
        match &self.lights[emitter] {
            Light::Area(light) => light.pdf(distance, cos_theta, choices),
            _ => 0.0,
        }
    }

    /// How far a direction is followed before it is infinitely far away, in world units.
    #[inline]
    #[must_use]
    pub fn reach(&self) -> f64 {
        self.reach
    }
}

impl Light {
    /// Where it is, and its intensity: a surface's radiance times its area.
    fn shining(&self) -> Shining {
        let bounds = match self {
            Self::Point { position, .. } => Bounds::of_points([*position]),
            Self::Spot(light) => Bounds::of_points([light.position]),
            Self::Projector(light) => Bounds::of_points([light.position]),
            Self::Area(light) => light.bounds(),
            Self::Directional { .. } | Self::Constant { .. } | Self::Envmap(_) => return None,
        };
        let area = if let Self::Area(light) = self { light.area() } else { 1.0 };
        // What has no area is nowhere, and gives nothing.
        let bounds = if bounds.is_empty() { Bounds::of_points([DVec3::ZERO]) } else { bounds };
        Some((bounds, self.intensity() * area))
    }

    /// The mean of the colours of its intensity, or of a surface's radiance; a slide's are not looked at.
    fn intensity(&self) -> f64 {
        let colour = match self {
            Self::Point { intensity, .. } => *intensity,
            Self::Spot(light) => light.intensity,
            Self::Projector(light) => light.slide.texture.mean() * (PI * f64::from(light.slide.scale)) as f32,
            Self::Area(light) => light.mean_radiance(),
            Self::Directional { .. } | Self::Constant { .. } | Self::Envmap(_) => Rgb::ZERO,
        };
        let intensity = f64::from(colour.element_sum()) / 3.0;
        if intensity.is_finite() { intensity.max(0.0) } else { 0.0 }
    }
}

/// The density of a direction of a constant emitter, one of `choices`.
#[inline]
fn pdf_constant(choices: f64) -> f64 {
    0.25 / PI / choices
}
