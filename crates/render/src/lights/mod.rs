//! Next-event estimation: choosing an emitter and a point on it, and the density of doing so. One file a kind of emitter.

mod area;
mod constant;
mod point;

use glam::DVec3;
use vdf_scene::{Emitter, Rgb, Scene};

use self::area::AreaLight;

/// The emitters of a scene, prepared for sampling.
#[derive(Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// Radiance from outside the scene; black without a `constant` emitter.
    background: Rgb,
    /// How far a direction is followed before it is infinitely far away, in world units.
    reach: f64,
}

#[derive(Debug)]
enum Light {
    Point { position: DVec3, intensity: Rgb },
    Area(AreaLight),
    Constant { radiance: Rgb },
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

impl Lights {
    /// Prepares the emitters of `scene`. `reach` is longer than any path through the scene, in world units.
    #[must_use]
    pub fn new(scene: &Scene, reach: f64) -> Self {
        let mut background = Rgb::ZERO;
        let lights = scene
            .emitters
            .iter()
            .map(|e| match *e {
                Emitter::Point { position, intensity } => Light::Point { position, intensity },
                Emitter::Area { surface } => {
                    let s = &scene.surfaces[surface];
                    Light::Area(AreaLight::new(&s.triangles, s.radiance.unwrap_or(Rgb::ZERO)))
                }
                Emitter::Constant { radiance } => {
                    background += radiance;
                    Light::Constant { radiance }
                }
            })
            .collect();
        Self { lights, background, reach }
    }

    /// Radiance of a ray that leaves the scene.
    #[inline]
    #[must_use]
    pub fn background(&self) -> Rgb {
        self.background
    }

    /// Draws an emitter (each equally likely) and a point on it. `None` if there is no light from there.
    #[inline]
    #[must_use]
    pub fn sample(&self, from: DVec3, u_emitter: f64, u: [f64; 2]) -> Option<LightSample> {
        let n = self.lights.len();
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in [0, n)")]
        let emitter = ((u_emitter * n as f64) as usize).min(n.checked_sub(1)?);
        let choices = n as f64;
        match &self.lights[emitter] {
            Light::Point { position, intensity } => point::sample(emitter, *position, *intensity, from, choices),
            Light::Area(light) => light.sample(emitter, from, u, choices),
            Light::Constant { radiance } => {
                Some(constant::sample(emitter, from, u, *radiance, self.pdf_background(), self.reach))
            }
        }
    }

    /// The density with which [`Lights::sample`] draws any one direction of any one constant emitter.
    #[inline]
    #[must_use]
    pub fn pdf_background(&self) -> f64 {
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
