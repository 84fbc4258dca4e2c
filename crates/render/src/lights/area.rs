//! Area emitters: the front sides of a shape's triangles, or of a curved shape, drawn uniformly by area.

use std::f64::consts::{PI, TAU};

use glam::{DVec3, dvec3};
use vdf_geometry::{CurvedKind, CurvedShape, Triangle};
use vdf_scene::Rgb;

use super::LightSample;
use crate::world::{curved_lift, lift};

/// One shape that shines.
#[derive(Debug)]
pub(super) struct AreaLight {
    triangles: Vec<Triangle>,
    /// In place of triangles.
    curved: Option<Box<CurvedShape>>,
    /// Running sum of the triangles' areas.
    cumulative_area: Vec<f64>,
    radiance: Rgb,
}

/// A point of the light.
#[derive(Clone, Copy, Debug)]
pub(super) struct AreaPoint {
    pub(super) point: DVec3,
    /// Unit normal of the side that shines.
    pub(super) normal: DVec3,
    /// How far a ray to the point ends from its triangle.
    lift: f64,
}

impl AreaLight {
    pub(super) fn new(triangles: &[Triangle], curved: Option<CurvedShape>, radiance: Rgb) -> Self {
        let triangles: Vec<_> = triangles.iter().copied().filter(|t| t.area_normal() != DVec3::ZERO).collect();
        let cumulative_area = triangles
            .iter()
            .scan(0.0, |sum, t| {
                *sum += 0.5 * t.area_normal().length();
                Some(*sum)
            })
            .collect();
        let cumulative_area = curved.map_or(cumulative_area, |c| vec![curved_area(&c)]);
        Self { triangles, curved: curved.map(Box::new), cumulative_area, radiance }
    }

    fn area(&self) -> f64 {
        self.cumulative_area.last().copied().unwrap_or(0.0)
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
                };
            }
            let (triangle, point) = self.sample_point(u);
            AreaPoint { point, normal: triangle.area_normal().normalize(), lift: lift(triangle) }
        })
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
        let AreaPoint { point, normal, lift } = *place;
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
            point: point + normal * lift,
            direction,
            weight: self.radiance * (1.0 / pdf) as f32,
            pdf,
            on_surface: true,
        })
    }

    /// The density per steradian with which a point `distance` away, seen under `cos_theta` to its normal, is drawn.
    #[inline]
    pub(super) fn pdf(&self, distance: f64, cos_theta: f64, choices: f64) -> f64 {
        distance * distance / (cos_theta * self.area() * choices)
    }

    /// A triangle and a point on it, uniform over the area.
    fn sample_point(&self, [u0, u1]: [f64; 2]) -> (&Triangle, DVec3) {
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
    let (sin, cos) = (TAU * u1).sin_cos();
    match kind {
        CurvedKind::Sphere => {
            let r = 2.0 * (u0 * (1.0 - u0)).max(0.0).sqrt();
            dvec3(r * cos, r * sin, 1.0 - 2.0 * u0)
        }
        CurvedKind::Disk => dvec3(u0.sqrt() * cos, u0.sqrt() * sin, 0.0),
        CurvedKind::Cylinder => dvec3(cos, sin, u0),
    }
}
