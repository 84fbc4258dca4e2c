//! Area emitters: the front sides of a shape's triangles, or of a curved shape, drawn uniformly by area. A sphere that shines outwards is drawn uniformly by
//! solid angle, as it fills a cone \[Wang1992\].

use std::{
    f64::consts::{PI, TAU},
    sync::Arc,
};

use glam::{DVec3, dvec3};
use vdf_geometry::{Bounds, CurvedKind, CurvedShape, Triangle};
use vdf_scene::{MeshAttributes, Rgb, Surface, Texture};

use super::LightSample;
use crate::{
    frame::{direction_about, sin_cos_of_turn},
    world::{curved_lift, glow, lift, parametrization},
};

/// One shape that shines.
#[derive(Debug)]
pub(super) struct AreaLight {
    triangles: Vec<Triangle>,
    /// The unit normal of each, and how far a ray to it ends from it.
    faces: Vec<(DVec3, f64)>,
    /// In place of triangles.
    curved: Option<Box<CurvedShape>>,
    /// Running sum of the triangles' areas.
    cumulative_area: Vec<f64>,
    radiance: Radiance,
    ball: Option<Ball>,
}

/// What a light emits.
#[derive(Debug)]
enum Radiance {
    Constant(Rgb),
    /// A texture, with the number of each triangle in its surface.
    Texture {
        texture: Texture,
        attributes: Arc<MeshAttributes>,
        numbers: Vec<u32>,
    },
}

/// A sphere that shines outwards.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) centre: DVec3,
    radius: f64,
}

/// A point of the light.
#[derive(Clone, Copy, Debug)]
pub(super) struct AreaPoint {
    pub(super) point: DVec3,
    /// Unit normal of the side that shines.
    pub(super) normal: DVec3,
    /// How far a ray to the point ends from its triangle.
    lift: f64,
    radiance: Rgb,
}

impl AreaPoint {
    /// Where a ray to the point ends.
    #[inline]
    pub(super) fn lifted(&self) -> DVec3 {
        self.point + self.normal * self.lift
    }

    /// What leaves it.
    pub(super) const fn radiance(&self) -> Rgb {
        self.radiance
    }
}

impl AreaLight {
    pub(super) fn new(surface: &Surface) -> Self {
        let Surface { triangles, curved, attributes, radiance, .. } = surface;
        let numbered: Vec<(u32, Triangle)> =
            (0..).zip(triangles.iter().copied()).filter(|(_, t)| t.area_normal() != DVec3::ZERO).collect();
        let radiance = match radiance {
            Some(Texture::Constant(radiance)) => Radiance::Constant(*radiance),
            None => Radiance::Constant(Rgb::ZERO),
            Some(texture) => {
                let (texture, attributes) = (texture.clone(), attributes.clone());
                Radiance::Texture { texture, attributes, numbers: numbered.iter().map(|(number, _)| *number).collect() }
            }
        };
        let triangles: Vec<Triangle> = numbered.into_iter().map(|(_, triangle)| triangle).collect();
        let faces = triangles.iter().map(|t| (t.area_normal().normalize(), lift(t))).collect();
        let cumulative_area = triangles
            .iter()
            .scan(0.0, |sum, t| {
                *sum += 0.5 * t.area_normal().length();
                Some(*sum)
            })
            .collect();
        let cumulative_area = curved.map_or(cumulative_area, |c| vec![curved_area(&c)]);
        let ball = curved.filter(|c| c.kind() == CurvedKind::Sphere && !c.is_flipped()).map(|c| {
            let (linear, centre) = c.placement();
            Ball { centre, radius: linear.determinant().abs().cbrt() }
        });
        Self { triangles, faces, curved: curved.map(Box::new), cumulative_area, radiance, ball }
    }

    /// The light, if it is a ball.
    #[inline]
    pub(super) fn ball(&self) -> Option<&Ball> {
        self.ball.as_ref()
    }

    /// The area of all of it.
    pub(super) fn area(&self) -> f64 {
        self.cumulative_area.last().copied().unwrap_or(0.0)
    }

    /// Where it is.
    pub(super) fn bounds(&self) -> Bounds {
        self.curved.as_ref().map_or_else(|| Bounds::of_triangles(&self.triangles), |shape| *shape.bounds())
    }

    /// The mean of what it emits.
    pub(super) fn mean_radiance(&self) -> Rgb {
        match &self.radiance {
            Radiance::Constant(radiance) => *radiance,
            Radiance::Texture { texture, .. } => texture.mean(),
        }
    }

    /// A place just before the surface; `None` if there is no area.
    pub(super) fn place(&self) -> Option<DVec3> {
        Some(self.sample([0.5; 2])?.lifted())
    }

    /// A point, uniform over the area. Nothing can be sampled on an emitter without area.
    #[inline]
    pub(super) fn sample(&self, u: [f64; 2]) -> Option<AreaPoint> {
        (self.area() > 0.0).then(|| {
            if let Some(shape) = &self.curved {
                let local = sample_curved(shape.kind(), u);
                return AreaPoint {
                    point: shape.to_world(local),
                    normal: shape.normal(local),
                    lift: curved_lift(shape),
                    radiance: self.radiance_on(shape, local),
                };
            }
            let (i, [wb, wc], point) = self.sample_point(u);
            let radiance = match &self.radiance {
                Radiance::Constant(radiance) => *radiance,
                Radiance::Texture { texture, attributes, numbers } => glow(texture, attributes, numbers[i], [wb, wc]),
            };
            let (normal, lift) = self.faces[i];
            AreaPoint { point, normal, lift, radiance }
        })
    }

    /// What the curved shape emits at a point of its own space.
    fn radiance_on(&self, shape: &CurvedShape, local: DVec3) -> Rgb {
        match &self.radiance {
            Radiance::Constant(radiance) => *radiance,
            Radiance::Texture { texture, .. } => texture.at(&parametrization(shape, local).0.into()),
        }
    }

    /// A point of the light as seen from `from`. `choices` is the number of emitters of which this one was drawn.
    #[inline]
    pub(super) fn seen_from(
        &self,
        emitter: usize,
        from: DVec3,
        place: &AreaPoint,
        choices: f64,
    ) -> Option<LightSample> {
        let AreaPoint { point, normal, radiance, .. } = *place;
        let d = point - from;
        let distance2 = d.length_squared();
        let direction = d / distance2.sqrt();
        let cos_theta = -direction.dot(normal);
        if !(cos_theta > 0.0 && distance2 > 0.0) {
            return None;
        }
        let pdf = distance2 / (cos_theta * self.area() * choices);
        Some(LightSample {
            emitter,
            point: place.lifted(),
            direction,
            weight: radiance * (1.0 / pdf) as f32,
            pdf,
            on_surface: true,
            choices,
        })
    }

    /// The density per steradian with which a point `distance` away, seen under `cos_theta` to its normal, is drawn.
    #[inline]
    pub(super) fn pdf(&self, distance: f64, cos_theta: f64, choices: f64) -> f64 {
        if let Some(ball) = &self.ball {
            let r = ball.radius;
            // The law of cosines: how far the middle is.
            return ball.pdf(distance * distance + r * r + 2.0 * distance * r * cos_theta) / choices;
        }
        distance * distance / (cos_theta * self.area() * choices)
    }

    /// A triangle and a point on it, uniform over the area, with the weights of its second and third corner.
    fn sample_point(&self, [u0, u1]: [f64; 2]) -> (usize, [f64; 2], DVec3) {
        let target = u0 * self.area();
        let i = self.cumulative_area.partition_point(|&a| a <= target).min(self.triangles.len() - 1);
        let before = if i == 0 { 0.0 } else { self.cumulative_area[i - 1] };
        // What is left of u0 within the triangle's share is uniform again.
        let u0 = ((target - before) / (self.cumulative_area[i] - before)).clamp(0.0, 1.0);
        let root = u0.sqrt();
        let [a, b, c] = self.triangles[i].vertices_f64();
        let [wb, wc] = [root * (1.0 - u1), root * u1];
        (i, [wb, wc], a * (1.0 - root) + b * wb + c * wc)
    }
}

impl Ball {
    /// 1 − cos of the cone that the ball fills, from where its middle is so far; `None` from within.
    #[inline]
    fn cone(&self, distance2: f64) -> Option<f64> {
        let sin2 = self.radius * self.radius / distance2;
        // In the form in which nothing cancels, however small the ball looks.
        (sin2 < 1.0).then(|| sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }

    /// The density per steradian of a direction in the cone.
    #[inline]
    fn pdf(&self, distance2: f64) -> f64 {
        self.cone(distance2).map_or(0.0, |cone| 1.0 / (TAU * cone))
    }

    /// A direction in the cone, and the point of the ball that it meets first.
    pub(super) fn sample(
        &self,
        light: &AreaLight,
        emitter: usize,
        from: DVec3,
        [u0, u1]: [f64; 2],
        choices: f64,
    ) -> Option<LightSample> {
        let shape = light.curved.as_deref()?;
        let to_centre = self.centre - from;
        let distance2 = to_centre.length_squared();
        let cone = self.cone(distance2)?;
        let distance = distance2.sqrt();
        let below = u0 * cone;
        let sin2 = below * (2.0 - below);
        let direction = direction_about(to_centre / distance, 1.0 - below, sin2.sqrt(), u1);
        let half_chord = (self.radius * self.radius - distance2 * sin2).max(0.0).sqrt();
        let t = distance * (1.0 - below) - half_chord;
        let local = shape.snapped(shape.to_local(from + direction * t));
        let normal = shape.normal(local);
        let pdf = 1.0 / (TAU * cone * choices);
        (direction.dot(normal) < 0.0).then(|| LightSample {
            emitter,
            point: shape.to_world(local) + normal * curved_lift(shape),
            direction,
            weight: light.radiance_on(shape, local) * (1.0 / pdf) as f32,
            pdf,
            on_surface: true,
            choices,
        })
    }
}

/// The area of a curved shape; of a sphere or cylinder whose axes are equal and at right angles.
fn curved_area(shape: &CurvedShape) -> f64 {
    let (m, _) = shape.placement();
    match shape.kind() {
        CurvedKind::Sphere => 4.0 * PI * m.determinant().abs().powf(2.0 / 3.0),
        CurvedKind::Disk => PI * m.x_axis.cross(m.y_axis).length(),
        CurvedKind::Cylinder => TAU * m.x_axis.length() * m.z_axis.length(),
    }
}

/// A point of the canonical shape, uniform over its area.
fn sample_curved(kind: CurvedKind, [u0, u1]: [f64; 2]) -> DVec3 {
    let (sin, cos) = sin_cos_of_turn(u1);
    match kind {
        CurvedKind::Sphere => {
            let r = 2.0 * (u0 * (1.0 - u0)).max(0.0).sqrt();
            dvec3(r * cos, r * sin, 1.0 - 2.0 * u0)
        }
        CurvedKind::Disk => dvec3(u0.sqrt() * cos, u0.sqrt() * sin, 0.0),
        CurvedKind::Cylinder => dvec3(cos, sin, u0),
    }
}

#[cfg(test)]
mod tests {
    use glam::DMat3;

    use super::*;
    use crate::Sampler;

    fn ball(radius: f64, flipped: bool) -> Surface {
        let linear = DMat3::from_rotation_y(0.7) * radius;
        let curved = CurvedShape::new(CurvedKind::Sphere, linear, dvec3(0.3, -0.2, 4.0), flipped);
        Surface { curved, radiance: Some(Rgb::ONE.into()), ..Surface::default() }
    }

    /// From large and near to small and far: points lie on the ball and face the place, their density is that of rays that meet them, and what arrives at a patch that faces
    /// the middle is π (r/d)², within 5 standard errors (false alarm below 10⁻⁶ each). Points that are uniform by area, of which half is not seen, do it with at least seven times the
    /// variance.
    #[test]
    fn balls_are_drawn_by_solid_angle() {
        let centre = dvec3(0.3, -0.2, 4.0);
        for (radius, from) in
            [(3.9, dvec3(0.0, 0.0, 0.0)), (1.0, dvec3(0.3, -0.2, 0.0)), (1e-6, dvec3(-50.0, 9.0, 1.0))]
        {
            let light = AreaLight::new(&ball(radius, false));
            let facing = (centre - from).normalize();
            let n = 20_000;
            let (mut cone, mut area) = ([0.0; 2], [0.0; 2]);
            for i in 0..n {
                let u = Sampler::new(5, i, 0, 0).next_2d();
                let s = light.ball().unwrap().sample(&light, 0, from, u, 2.0).expect("it is seen");
                assert!(((s.point.distance(centre) / radius) - 1.0).abs() < 1e-3);
                let normal = (s.point - centre).normalize();
                let pdf = light.pdf(s.point.distance(from), -s.direction.dot(normal), 2.0);
                assert!((pdf / s.pdf - 1.0).abs() < 1e-3, "{pdf} {}", s.pdf);
                let value = f64::from(s.weight.x) / 2.0 * s.direction.dot(facing);
                cone[0] += value;
                cone[1] += value * value;
                let seen = light.seen_from(0, from, &light.sample(u).unwrap(), 1.0);
                let d = light.sample(u).unwrap().point - from;
                let by_area = seen.map_or(0.0, |s| f64::from(s.weight.x) * d.normalize().dot(facing));
                area[0] += by_area;
                area[1] += by_area * by_area;
            }
            let expected = PI * radius * radius / from.distance_squared(centre);
            let variance = |[sum, squares]: [f64; 2]| squares / f64::from(n) - (sum / f64::from(n)).powi(2);
            let error = (variance(cone).max(0.0) / f64::from(n)).sqrt();
            let mean = cone[0] / f64::from(n);
            assert!((mean - expected).abs() <= 5.0 * error + 1e-5 * expected, "{mean} {expected} ± {error}");
            assert!(variance(area) > 7.0 * variance(cone), "{radius}: {} {}", variance(area), variance(cone));
        }
        assert!(AreaLight::new(&ball(1.0, true)).ball().is_none());
        let within = AreaLight::new(&ball(1.0, false));
        assert!(within.ball().unwrap().sample(&within, 0, centre, [0.5; 2], 1.0).is_none());
    }
}
