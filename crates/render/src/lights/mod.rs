//! Next-event estimation: choosing an emitter and a point on it, and the density of doing so. One file a kind of emitter.

mod area;
mod beam;
mod constant;
mod directional;
mod envmap;
mod point;
mod projector;
mod spot;

use glam::DVec3;
use vdf_scene::{Emitter, Rgb, Scene};

pub(crate) use self::beam::{Beam, LightRay};
use self::{
    area::{AreaLight, AreaPoint},
    envmap::EnvmapLight,
    projector::ProjectorLight,
    spot::SpotLight,
};

/// The emitters of a scene, prepared for sampling.
#[derive(Debug)]
pub struct Lights {
    lights: Vec<Light>,
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
}

/// A place on an emitter, drawn before it is known from where it will be seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EmitterPoint {
    emitter: usize,
    place: Place,
}

#[derive(Clone, Copy, Debug)]
enum Place {
    Point,
    Area(AreaPoint),
    /// The numbers that the direction is drawn with, once it is known from where.
    Numbers([f64; 2]),
}

impl EmitterPoint {
    /// The emitter's number.
    #[inline]
    pub(crate) const fn emitter(&self) -> usize {
        self.emitter
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
        let mut beam_of_emitter = vec![None; lights.len()];
        for (i, beam) in beams.iter().enumerate() {
            beam_of_emitter[beam.emitter] = Some(i);
        }
        Self {
            lights,
            points,
            all,
            others,
            background,
            envmap,
            reach,
            may_be_met,
            numbers_of_place,
            beams,
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
    /// the emitter, of density `pdf` per steradian there, starts at the same place; 0 if no ray leaves the emitter.
    #[inline]
    pub(crate) fn density_of_beam(&self, emitter: usize, distance2: f64, pdf: f64) -> f64 {
        let Some(i) = self.beam_of_emitter[emitter] else { return 0.0 };
        let beam = &self.beams[i];
        // `pdf` has the choice of the emitter in it; a point has none.
        let choices = if beam.is_point() { self.lights.len() as f64 } else { 1.0 };
        beam.density(distance2, pdf) * choices / self.beams.len() as f64
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

    /// Draws a place on an emitter. `None` if it has none.
    #[inline]
    pub(crate) fn sample_point(&self, emitter: usize, u: [f64; 2]) -> Option<EmitterPoint> {
        if self.numbers_of_place == 0 {
            return Some(EmitterPoint { emitter, place: Place::Point });
        }
        let place = match &self.lights[emitter] {
            Light::Point { .. } | Light::Spot(_) | Light::Projector(_) => Place::Point,
            Light::Area(light) if light.ball().is_none() => Place::Area(light.sample(u)?),
            Light::Area(_) | Light::Directional { .. } | Light::Constant { .. } | Light::Envmap(_) => Place::Numbers(u),
        };
        Some(EmitterPoint { emitter, place })
    }

    /// The place as seen from `from`, one of as many as there are emitters. `None` if there is no light from there.
    #[inline]
    pub(crate) fn seen_from(&self, from: DVec3, point: &EmitterPoint) -> Option<LightSample> {
        let (emitter, choices) = (point.emitter, self.lights.len() as f64);
        match (&self.lights[emitter], &point.place) {
            (Light::Point { position, intensity }, _) => point::sample(emitter, *position, *intensity, from, choices),
            (Light::Area(light), Place::Area(place)) => light.seen_from(emitter, from, place, choices),
            (Light::Area(light), Place::Numbers(u)) => light.ball()?.sample(light, emitter, from, *u, choices),
            (Light::Constant { radiance }, Place::Numbers(u)) => {
                Some(constant::sample(emitter, from, *u, *radiance, self.pdf_constant(), self.reach))
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

    /// The density with which [`Lights::sample`] draws this direction of the environment map, or of any one constant emitter.
    #[inline]
    #[must_use]
    pub fn pdf_background(&self, direction: DVec3) -> f64 {
        match self.map() {
            None => self.pdf_constant(),
            Some(map) => map.pdf(direction) / self.lights.len() as f64,
        }
    }

    #[inline]
    fn pdf_constant(&self) -> f64 {
        0.25 / std::f64::consts::PI / self.lights.len() as f64
    }

    /// The density with which [`Lights::sample`], from a place `distance` away, draws the point of area emitter `emitter`
    /// that is seen under `cos_theta` to its normal.
    #[inline]
    #[must_use]
    pub fn pdf_area(&self, emitter: usize, distance: f64, cos_theta: f64) -> f64 {
        match &self.lights[emitter] {
            Light::Area(light) => light.pdf(distance, cos_theta, self.lights.len() as f64),
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
