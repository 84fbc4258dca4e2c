//! A diffuse base under a transparent coat, smooth or rough: Mitsuba's `plastic` and `roughplastic`.
//!
//! *Definition.* The coat reflects as a dielectric. What passes it is scattered by the base with reflectance ρ, and of that the coat sends back the share
//! f on the inside, again and again: ρ/(1 − ρf) comes out in all if the model is nonlinear, else ρ/(1 − f).
//!
//! *Deviation.* What passes a rough coat is tabulated at 64 cosines, as in Mitsuba, with a quadrature of our own.

use std::sync::Arc;

use glam::dvec3;
use vdf_scene::{Microfacets, Rgb, Roughness, Texture};

use super::{fresnel, microfacet::Facets, prepared::Prepared};

/// Entries of the table of a rough coat.
const ENTRIES: usize = 64;
/// Points along each side of the unit square for one entry.
const QUADRATURE: u32 = 32;

/// What does not depend on the place.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    /// Index of refraction of the coat over that outside.
    pub(super) eta: f64,
    /// The share that is reflected back to the base, the mean over directions.
    pub(super) inside: f64,
    /// How much of the samples the coat gets where it reflects half of the light.
    pub(super) coat_share: f64,
    /// If it is rough.
    rough: Option<Arc<RoughCoat>>,
}

/// What passes a rough coat, and what it sends back.
#[derive(Debug)]
pub(super) struct RoughCoat {
    /// What passes into the coat at equal steps of the cosine.
    passes: Vec<f64>,
    inside: f64,
}

impl RoughCoat {
    /// Cost: some milliseconds.
    pub(super) fn new(facets: &Facets, eta: f64) -> Self {
        let cosine = |i: usize| (i as f64 / (ENTRIES - 1) as f64).max(1e-6);
        let passes = (0..ENTRIES).map(|i| share(facets, cosine(i), eta, true)).collect();
        let back = |i| share(facets, cosine(i), 1.0 / eta, false) * cosine(i);
        let inside = (0..ENTRIES).map(back).sum::<f64>() / ENTRIES as f64 * 2.0;
        Self { passes, inside }
    }
}

impl Coat {
    pub(super) fn new(
        eta: f64,
        diffuse: &Texture,
        specular: &Texture,
        roughness: Option<&Roughness>,
        prepared: &mut Prepared,
    ) -> Self {
        let coat_share = prepared.coat_share(diffuse, specular);
        let Some(roughness) = roughness else {
            return Self { eta, inside: fresnel::diffuse_reflectance(1.0 / eta), coat_share, rough: None };
        };
        let alpha = prepared.mean_luminance(&roughness.alpha_u).max(super::material::LEAST_ALPHA);
        let rough = prepared.rough_coat(roughness.distribution, alpha, eta);
        Self { eta, inside: rough.inside, coat_share, rough: Some(rough) }
    }

    /// The share of light with this cosine that passes the coat.
    pub(super) fn passes(&self, cos: f64) -> f64 {
        match &self.rough {
            None => 1.0 - fresnel::dielectric(cos, self.eta).reflected,
            Some(rough) => {
                let table = &rough.passes;
                let place = cos.clamp(0.0, 1.0) * (ENTRIES - 1) as f64;
                let i = (place as usize).min(ENTRIES - 2);
                let share = place - i as f64;
                table[i] * (1.0 - share) + table[i + 1] * share
            }
        }
    }

    /// The base's BRDF, without π, for light that comes and goes with these cosines.
    pub(super) fn base(&self, reflectance: Rgb, nonlinear: bool, cos_i: f64, cos_o: f64) -> Rgb {
        let inside = self.inside as f32;
        let lost = if nonlinear { reflectance * inside } else { Rgb::splat(inside) };
        reflectance / (Rgb::ONE - lost) * (self.passes(cos_i) * self.passes(cos_o) / (self.eta * self.eta)) as f32
    }

    /// The probability with which the coat is sampled rather than the base.
    pub(super) fn choice(&self, cos_i: f64) -> f64 {
        let reflected = (1.0 - self.passes(cos_i)).max(0.0);
        let (coat, base) = (reflected * self.coat_share, (1.0 - reflected) * (1.0 - self.coat_share));
        if coat + base > 0.0 { coat / (coat + base) } else { 1.0 }
    }
}

/// The share of light with this cosine that a rough boundary reflects to the side it comes from, or lets pass to the other. What facets shadow is in neither.
fn share(facets: &Facets, cos: f64, eta: f64, passes: bool) -> f64 {
    let v = dvec3((1.0 - cos * cos).max(0.0).sqrt(), 0.0, cos);
    let n = f64::from(QUADRATURE);
    let mut sum = 0.0;
    for i in 0..QUADRATURE * QUADRATURE {
        let u = [f64::from(i % QUADRATURE) + 0.5, f64::from(i / QUADRATURE) + 0.5].map(|x| x / n);
        let m = facets.sample(v, u);
        let f = fresnel::dielectric(v.dot(m), eta);
        let (wo, share) = if passes {
            (fresnel::refracted(v, m, &f), 1.0 - f.reflected)
        } else {
            (fresnel::reflected(v, m), f.reflected)
        };
        if (wo.z > 0.0) == passes || share == 0.0 {
            continue;
        }
        let weight = match facets.kind {
            Microfacets::Ggx => facets.visible(wo, m),
            Microfacets::Beckmann => {
                let pdf = facets.pdf(v, m);
                if pdf > 0.0 {
                    facets.density(m) * facets.visible(v, m) * facets.visible(wo, m) * v.dot(m) / (v.z * pdf)
                } else {
                    0.0
                }
            }
        };
        sum += weight * share;
    }
    (sum / (n * n)).min(1.0)
}
