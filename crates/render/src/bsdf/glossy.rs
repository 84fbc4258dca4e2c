//! Metals, glass and coats: evaluated and sampled as in Mitsuba 3, whose parameters they have.
//!
//! What a mirror or smooth glass does is a delta distribution: no emitter sample finds it, and light that is met after it counts in full. A
//! coat has both. Light that is refracted is compressed: radiance from a body of index η₁ into one of η₂ grows by (η₂/η₁)²; the paths go
//! the other way, so their weight falls by it.
//!
//! *Departure from Mitsuba 3:* with Beckmann's distribution normals are drawn from all, not from those that are seen; the mean is the same.

use std::f64::consts::PI;

use glam::DVec3;
use vdf_scene::{Bsdf, Conductor, Dielectric, Plastic, Rgb};

use super::{
    fresnel::{conductor, dielectric, diffuse_reflectance},
    microfacet::Distribution,
};
use crate::frame::sample_cosine_hemisphere;

/// How a surface scatters that is not diffuse.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Glossy {
    Metal { metal: Conductor, facets: Option<Distribution> },
    Glass { glass: Dielectric, facets: Option<Distribution> },
    Coat { plastic: Plastic, fdr_int: f64 },
}

/// A place on a surface as a path comes to it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Side {
    /// Unit normal on the side that the path comes from.
    pub(crate) normal: DVec3,
    /// Unit direction back to where the path comes from.
    pub(crate) wo: DVec3,
    /// Whether that is the side of the surface's own normal.
    pub(crate) is_front: bool,
}

/// A direction that was drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scattered {
    pub(crate) to: DVec3,
    /// BSDF times cosine over density.
    pub(crate) weight: Rgb,
    /// The density with which emitter sampling competes; `None` if it cannot find this direction.
    pub(crate) pdf: Option<f64>,
    /// Index of refraction where the path goes over that where it comes from: 1 unless it was refracted.
    pub(crate) eta: f64,
}

impl Glossy {
    /// Of a surface's BSDF; `None` if it is diffuse.
    pub(crate) fn new(bsdf: &Bsdf) -> Option<Self> {
        Some(match *bsdf {
            Bsdf::Diffuse { .. } => return None,
            Bsdf::Conductor(metal) => Self::Metal { metal, facets: metal.roughness.map(Distribution::new) },
            Bsdf::Dielectric(glass) => {
                // Between equal bodies nothing is bent, whatever the facets are like.
                let roughness = glass.roughness.filter(|_| glass.eta != 1.0);
                Self::Glass { glass, facets: roughness.map(Distribution::new) }
            }
            Bsdf::Plastic(plastic) => Self::Coat { plastic, fdr_int: diffuse_reflectance(plastic.eta.recip()) },
        })
    }

    /// Whether emitter samples are worth anything.
    #[inline]
    pub(crate) fn has_density(&self) -> bool {
        match self {
            Self::Metal { facets, .. } | Self::Glass { facets, .. } => facets.is_some(),
            Self::Coat { .. } => true,
        }
    }

    /// BSDF times cosine towards `to`, but for delta distributions; and the density with which [`Glossy::sample`] draws it.
    pub(crate) fn eval(&self, side: &Side, to: DVec3) -> (Rgb, f64) {
        let nothing = (Rgb::ZERO, 0.0);
        let (wo, wi) = (side.local(side.wo), side.local(to));
        // Also false for NaN.
        if !(wo.z > 0.0 && wi.z != 0.0) {
            return nothing;
        }
        match self {
            Self::Metal { metal, facets: Some(facets) } if side.is_front || metal.two_sided => {
                eval_metal(metal, facets, wo, wi)
            }
            Self::Glass { glass, facets: Some(facets) } => eval_glass(glass, facets, side, wo, wi),
            Self::Coat { plastic, fdr_int } if side.is_front || plastic.two_sided => {
                eval_ground(plastic, *fdr_int, wo.z, wi.z)
            }
            _ => nothing,
        }
    }

    /// A direction, by a number that chooses and two that place it; `None` where the surface takes all.
    pub(crate) fn sample(&self, side: &Side, choice: f64, u: [f64; 2]) -> Option<Scattered> {
        let wo = side.local(side.wo);
        if wo.z <= 0.0 || wo.z.is_nan() {
            return None;
        }
        match self {
            Self::Metal { metal, .. } if !(side.is_front || metal.two_sided) => None,
            Self::Metal { metal, facets: None } => {
                let weight = metal.specular_reflectance * conductor(wo.z, metal.eta, metal.k);
                Some(side.mirrored(wo, weight))
            }
            Self::Metal { facets: Some(facets), .. } => {
                let m = facets.sample(wo, u);
                self.by_density(side, m * (2.0 * wo.dot(m)) - wo, None)
            }
            Self::Glass { glass, facets: None } => Some(sample_glass(glass, side, wo, choice)),
            Self::Glass { glass, facets: Some(facets) } => {
                let (eta, m) = (side.eta(glass.eta), facets.sample(wo, u));
                let cos = wo.dot(m);
                if cos <= 0.0 {
                    return None;
                }
                let (share, cos_t) = dielectric(cos, eta);
                if choice < share {
                    self.by_density(side, m * (2.0 * cos) - wo, None)
                } else {
                    self.by_density(side, refracted(wo, m, cos, cos_t, eta), Some(eta))
                }
            }
            Self::Coat { plastic, .. } if !(side.is_front || plastic.two_sided) => None,
            Self::Coat { plastic, .. } => {
                let share = coat_share(plastic, dielectric(wo.z, plastic.eta).0);
                if choice < share {
                    let weight = plastic.specular_reflectance * to_f32(dielectric(wo.z, plastic.eta).0 / share);
                    return Some(side.mirrored(wo, weight));
                }
                let (to, _) = sample_cosine_hemisphere(DVec3::Z, u);
                self.by_density(side, to, None)
            }
        }
    }

    /// A local direction that was drawn with the density that [`Glossy::eval`] gives it. Facets may also reflect into the surface, and refract
    /// out of it: that is lost.
    fn by_density(&self, side: &Side, to: DVec3, eta: Option<f64>) -> Option<Scattered> {
        if (to.z > 0.0) != eta.is_none() {
            return None;
        }
        let to = side.world(to);
        let (value, pdf) = self.eval(side, to);
        (pdf > 0.0).then(|| Scattered { to, weight: value / to_f32(pdf), pdf: Some(pdf), eta: eta.unwrap_or(1.0) })
    }
}

impl Side {
    /// In the frame of the surface on this side.
    fn local(&self, d: DVec3) -> DVec3 {
        let (s, t) = self.normal.any_orthonormal_pair();
        DVec3::new(s.dot(d), t.dot(d), self.normal.dot(d))
    }

    fn world(&self, d: DVec3) -> DVec3 {
        let (s, t) = self.normal.any_orthonormal_pair();
        (s * d.x + t * d.y + self.normal * d.z).normalize()
    }

    /// The index of refraction beyond the surface over that on this side.
    fn eta(&self, eta: f64) -> f64 {
        if self.is_front { eta } else { eta.recip() }
    }

    fn mirrored(&self, wo: DVec3, weight: Rgb) -> Scattered {
        Scattered { to: self.world(DVec3::new(-wo.x, -wo.y, wo.z)), weight, pdf: None, eta: 1.0 }
    }
}

/// The direction in which light that comes from `wo` goes on, by the law of Snellius.
fn refracted(wo: DVec3, m: DVec3, cos: f64, cos_t: f64, eta: f64) -> DVec3 {
    (m * (cos / eta - cos_t) - wo / eta).normalize()
}

fn eval_metal(metal: &Conductor, facets: &Distribution, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
    if wi.z <= 0.0 {
        return (Rgb::ZERO, 0.0);
    }
    let m = (wo + wi).normalize();
    let cos = wo.dot(m);
    let value = facets.density(m) * facets.seen(wo, m) * facets.seen(wi, m) / (4.0 * wo.z);
    let pdf = facets.pdf(wo, m) / (4.0 * cos);
    (metal.specular_reflectance * conductor(cos, metal.eta, metal.k) * to_f32(value), pdf)
}

/// \[Walter2007\], eq. 20 and 21, with the compression of radiance.
fn eval_glass(glass: &Dielectric, facets: &Distribution, side: &Side, wo: DVec3, wi: DVec3) -> (Rgb, f64) {
    let nothing = (Rgb::ZERO, 0.0);
    let eta = side.eta(glass.eta);
    let reflects = wi.z > 0.0;
    let Some(m) = (wo + wi * if reflects { 1.0 } else { eta }).try_normalize() else { return nothing };
    let m = if m.z < 0.0 { -m } else { m };
    let (cos_o, cos_i) = (wo.dot(m), wi.dot(m));
    if cos_o <= 0.0 || cos_i * wi.z <= 0.0 {
        return nothing;
    }
    let (share, _) = dielectric(cos_o, eta);
    let common = facets.density(m) * facets.seen(wo, m) * facets.seen(wi, m) / wo.z;
    if reflects {
        let value = glass.specular_reflectance * to_f32(share * common / 4.0);
        return (value, share * facets.pdf(wo, m) / (4.0 * cos_o));
    }
    let bend = cos_o + eta * cos_i;
    let (value, per_normal) = (cos_o * -cos_i / (bend * bend), eta * eta * -cos_i / (bend * bend));
    let value = glass.specular_transmittance * to_f32((1.0 - share) * common * value);
    (value, (1.0 - share) * facets.pdf(wo, m) * per_normal)
}

/// Smooth glass.
fn sample_glass(glass: &Dielectric, side: &Side, wo: DVec3, choice: f64) -> Scattered {
    let eta = side.eta(glass.eta);
    let (share, cos_t) = dielectric(wo.z, eta);
    if choice < share {
        return side.mirrored(wo, glass.specular_reflectance);
    }
    let to = side.world(refracted(wo, DVec3::Z, wo.z, cos_t, eta));
    Scattered { to, weight: glass.specular_transmittance / to_f32(eta * eta), pdf: None, eta }
}

/// The ground under a coat: light is refracted in and out, and between them reflected from the ground any number of times.
fn eval_ground(plastic: &Plastic, fdr_int: f64, cos_o: f64, cos_i: f64) -> (Rgb, f64) {
    if cos_i <= 0.0 {
        return (Rgb::ZERO, 0.0);
    }
    let ((f_o, _), (f_i, _)) = (dielectric(cos_o, plastic.eta), dielectric(cos_i, plastic.eta));
    let ground = plastic.diffuse_reflectance;
    let between = Rgb::ONE - to_f32(fdr_int) * if plastic.nonlinear { ground } else { Rgb::ONE };
    let through = (1.0 - f_o) * (1.0 - f_i) / (plastic.eta * plastic.eta);
    (ground / between * to_f32(through * cos_i / PI), (1.0 - coat_share(plastic, f_o)) * cos_i / PI)
}

/// The probability that the coat, not the ground, is drawn.
fn coat_share(plastic: &Plastic, f_o: f64) -> f64 {
    let mean = |c: Rgb| f64::from(c.element_sum()) / 3.0;
    let (coat, ground) = (f_o * mean(plastic.specular_reflectance), (1.0 - f_o) * mean(plastic.diffuse_reflectance));
    if coat + ground > 0.0 { coat / (coat + ground) } else { 0.0 }
}

#[allow(clippy::cast_possible_truncation, reason = "radiance is single precision")]
fn to_f32(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests;
