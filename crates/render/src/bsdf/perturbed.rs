//! Materials whose shading normal is turned by a texture: Mitsuba's `normalmap` and `bumpmap`.
//!
//! *Definition.* The nested material is evaluated in a frame about another normal. Directions that are on different sides of the two normals carry no light. With
//! `flip_invalid_normals` a normal that faces away from `wi` is mirrored at the shading normal \[Schuessler2017\]; with `shadowing` what leaves near the horizon
//! is dimmed as by facets whose roughness is the slope of the normal \[Estevez2019\].
//!
//! *Bumps* are heights h over (u, v): the surface is moved along its normal n, and the new normal is that of ∂p/∂u + n ∂h/∂u and ∂p/∂v + n ∂h/∂v, where
//! the curvature of the surface is left out \[Blinn1978\].
//!
//! *Reciprocity* is lost, as in Mitsuba: cosines are those to the new normal, the dimming is of the outgoing side only, and a flip depends on `wi`.
//!
//! *Deviations.* The first axis of a bumped frame goes along ∂p/∂u; Mitsuba 3.9.1 takes its coordinates in the world for those in the frame, which
//! matters only to a nested material that is rougher one way than the other. What goes straight through does so whatever the normal, and shadow rays
//! follow it; in Mitsuba they are blocked.

use glam::{DVec3, dvec3};
use vdf_scene::{Perturbation, Rgb};

use super::material::{BLACK, Lobe, Material, MaterialPoint, MaterialSample};

/// A material and what turns its normals.
#[derive(Clone, Debug)]
pub(crate) struct Perturbed {
    pub(super) by: Perturbation,
    pub(super) flip_invalid_normals: bool,
    pub(super) shadowing: bool,
    pub(super) of: Material,
}

/// A frame in the shading frame: unit vectors, the last is the normal.
#[derive(Clone, Copy, Debug)]
struct Frame([DVec3; 3]);

impl Frame {
    fn local(&self, d: DVec3) -> DVec3 {
        let [s, t, n] = self.0;
        dvec3(s.dot(d), t.dot(d), n.dot(d))
    }

    fn outer(&self, d: DVec3) -> DVec3 {
        let [s, t, n] = self.0;
        (s * d.x + t * d.y + n * d.z).normalize_or(n)
    }

    /// The point as the nested material sees it.
    fn point(&self, at: &MaterialPoint) -> MaterialPoint {
        MaterialPoint {
            texture: at.texture,
            tangents: at.tangents.map(|t| self.local(t)),
            normal: self.local(at.normal),
        }
    }
}

impl Perturbed {
    fn frame(&self, wi: DVec3, at: &MaterialPoint) -> Frame {
        let (normal, along) = match &self.by {
            Perturbation::Normals(texture) => (texture.at(&at.texture).as_dvec3() * 2.0 - DVec3::ONE, DVec3::X),
            Perturbation::Heights { texture, scale } => {
                let gradient = texture.luminance_gradient(&at.texture) * *scale;
                let [du, dv] = at.tangents;
                // Moved along the shading normal, to which they are brought to right angles before.
                let normal = dvec3(du.x, du.y, gradient.x).cross(dvec3(dv.x, dv.y, gradient.y));
                (if normal.dot(at.normal) < 0.0 { -normal } else { normal }, du)
            }
        };
        let normal = normal.try_normalize().unwrap_or(DVec3::Z);
        let turned_away = wi.z * wi.dot(normal) <= 0.0;
        let normal =
            if self.flip_invalid_normals && turned_away { dvec3(-normal.x, -normal.y, normal.z) } else { normal };
        let first = (along - normal * along.dot(normal)).try_normalize();
        let first = first.unwrap_or_else(|| normal.any_orthonormal_vector());
        Frame([first, normal.cross(first), normal])
    }

    /// What is left of light that leaves in this direction of the shading frame.
    fn shadowed(&self, frame: &Frame, wo: DVec3) -> f32 {
        if !self.shadowing {
            return 1.0;
        }
        let tan2 = |w: DVec3| (w.x * w.x + w.y * w.y) / (w.z * w.z);
        let alpha2 = (0.125 * tan2(frame.0[2])).min(1.0);
        (2.0 / (1.0 + (1.0 + alpha2 * tan2(wo)).sqrt())) as f32
    }

    pub(super) fn passes(&self, wi: DVec3, at: &MaterialPoint) -> Rgb {
        let frame = self.frame(wi, at);
        self.of.passes(frame.local(wi), &frame.point(at))
    }

    pub(super) fn eval(&self, wi: DVec3, wo: DVec3, at: &MaterialPoint) -> (Rgb, f64) {
        let frame = self.frame(wi, at);
        let inner = frame.local(wo);
        if inner.z * wo.z <= 0.0 {
            return BLACK;
        }
        let (value, pdf) = self.of.eval(frame.local(wi), inner, &frame.point(at));
        (value * self.shadowed(&frame, wo), pdf)
    }

    pub(super) fn sample(&self, wi: DVec3, at: &MaterialPoint, choice: f64, u: [f64; 2]) -> Option<MaterialSample> {
        let frame = self.frame(wi, at);
        let sample = self.of.sample(frame.local(wi), &frame.point(at), choice, u)?;
        if sample.lobe == Lobe::Null {
            return Some(MaterialSample { wo: -wi, ..sample });
        }
        let wo = frame.outer(sample.wo);
        let weight = sample.weight * self.shadowed(&frame, wo);
        (sample.wo.z * wo.z > 0.0).then_some(MaterialSample { wo, weight, ..sample })
    }
}
