//! Next-event estimation: choosing an emitter and a point on it, and the density of doing so.

use glam::DVec3;

use crate::{
    Rgb, Triangle,
    frame::sample_uniform_sphere,
    scene::{Emitter, Scene},
};

/// The emitters of a scene, prepared for sampling.
#[derive(Debug)]
pub struct Lights {
    lights: Vec<Light>,
    /// Radiance from outside the scene; black without a `constant` emitter.
    background: Rgb,
    /// How far a direction is followed before it is infinitely far away, in world units.
    reach: f64,
    /// How far a sampled point is lifted off its surface, in world units.
    lift: f64,
}

#[derive(Debug)]
enum Light {
    Point { position: DVec3, intensity: Rgb },
    Area(AreaLight),
    Constant,
}

#[derive(Debug)]
struct AreaLight {
    triangles: Vec<Triangle>,
    /// Running sum of the triangles' areas.
    cumulative_area: Vec<f64>,
    radiance: Rgb,
}

/// A point on an emitter as seen from a place in the scene.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Number of the emitter in [`Scene::emitters`].
    pub emitter: usize,
    /// The point, or for an infinitely far emitter a point outside the scene, in its direction.
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
    /// Prepares the emitters of `scene`. `reach` is longer than any way through the scene, `lift` clears the rounding of a surface point.
    #[must_use]
    pub fn new(scene: &Scene, reach: f64, lift: f64) -> Self {
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
                    Light::Constant
                }
            })
            .collect();
        Self { lights, background, reach, lift }
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
            Light::Point { position, intensity } => {
                let d = *position - from;
                let distance2 = d.length_squared();
                // At the light itself the intensity has no limit; no event of positive probability happens there.
                (distance2 > 0.0).then(|| LightSample {
                    emitter,
                    point: *position,
                    direction: d / distance2.sqrt(),
                    weight: *intensity * (choices / distance2) as f32,
                    pdf: 0.0,
                    on_surface: false,
                })
            }
            Light::Area(light) if light.area() > 0.0 => {
                let (triangle, point) = light.sample(u);
                let normal = triangle.area_normal().normalize();
                let d = point - from;
                let distance2 = d.length_squared();
                let direction = d / distance2.sqrt();
                let cos_theta = -direction.dot(normal);
                if !(cos_theta > 0.0 && distance2 > 0.0) {
                    return None;
                }
                let pdf = distance2 / (cos_theta * light.area() * choices);
                Some(LightSample {
                    emitter,
                    point: point + normal * self.lift,
                    direction,
                    weight: light.radiance * (1.0 / pdf) as f32,
                    pdf,
                    on_surface: true,
                })
            }
            // Nothing can be sampled on an emitter without area.
            Light::Area(_) => None,
            Light::Constant => {
                let direction = sample_uniform_sphere(u);
                let pdf = self.pdf_background();
                Some(LightSample {
                    emitter,
                    point: from + direction * self.reach,
                    direction,
                    weight: self.background * (1.0 / pdf) as f32,
                    pdf,
                    on_surface: false,
                })
            }
        }
    }

    /// The density with which [`Lights::sample`] draws any one direction of the background.
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
            Light::Area(light) => distance * distance / (cos_theta * light.area() * self.lights.len() as f64),
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

impl AreaLight {
    fn new(triangles: &[Triangle], radiance: Rgb) -> Self {
        let triangles: Vec<_> = triangles.iter().copied().filter(|t| t.area_normal() != DVec3::ZERO).collect();
        let cumulative_area = triangles
            .iter()
            .scan(0.0, |sum, t| {
                *sum += 0.5 * t.area_normal().length();
                Some(*sum)
            })
            .collect();
        Self { triangles, cumulative_area, radiance }
    }

    fn area(&self) -> f64 {
        self.cumulative_area.last().copied().unwrap_or(0.0)
    }

    /// A triangle and a point on it, uniform over the area.
    fn sample(&self, [u0, u1]: [f64; 2]) -> (&Triangle, DVec3) {
        let target = u0 * self.area();
        let i = self.cumulative_area.partition_point(|&a| a <= target).min(self.triangles.len() - 1);
        let before = if i == 0 { 0.0 } else { self.cumulative_area[i - 1] };
        // What is left of u0 within the triangle's share is uniform again.
        let u0 = ((target - before) / (self.cumulative_area[i] - before)).clamp(0.0, 1.0);
        let root = u0.sqrt();
        let [a, b, c] = self.triangles[i].vertices_f64();
        (&self.triangles[i], a * (1.0 - root) + b * (root * (1.0 - u1)) + c * (root * u1))
    }
}
