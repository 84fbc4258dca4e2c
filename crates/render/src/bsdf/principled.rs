//! Mitsuba's `principled`: Disney's materials \[Burley2012, Burley2015\], and what they share with the thin ones.
//!
//! *Definition.* With m metallic and t `spec_trans`, a base of weight (1 − m)(1 − t), diffuse with retro-reflection or flattened; a microfacet lobe of GGX that
//! reflects by Fresnel's equations, in part tinted or metallic by Schlick's approximation; refraction of weight (1 − m)t; sheen; and a clear coat of
//! facets that are distributed as GTR1. Behind the surface only the microfacets scatter, and only if it transmits.
//!
//! *Energy* is not conserved exactly, as in the papers: smooth bases and sheen may send back more than comes in where light grazes.
//!
//! *Reciprocity*: all lobes but refraction, which changes radiance by the square of the index.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use vdf_scene::{Microfacets, Principled, Rgb, Texture, luminance};

use super::{
    fresnel,
    material::{BLACK, MaterialPoint},
    microfacet::Facets,
};
use crate::frame::{sample_cosine_hemisphere, sin_cos_of_turn};

/// Smoother facets are drawn as rough as this.
const LEAST_ALPHA: f64 = 1e-3;
/// What a clear coat reflects of light that comes along the normal: an index of 1.5.
const COAT_REFLECTANCE: f64 = 0.04;
/// The roughness by which a clear coat shadows itself.
const COAT_SHADOWING: f64 = 0.25;
/// The share of a clear coat, as in the papers.
const COAT_SHARE: f64 = 0.25;

/// The parameters at a point.
pub(super) struct Lobes {
    base: Base,
    facets: Facets,
    metallic: f64,
    spec_tint: f64,
    eta: f64,
    clearcoat: f64,
    coat: Gtr1,
    /// Weights of base and refraction.
    reflects: f64,
    refracts: f64,
    rates: [f64; 3],
}

/// What a diffuse base and its sheen depend on.
pub(super) struct Base {
    pub(super) color: Rgb,
    pub(super) roughness: f64,
    pub(super) flatness: f64,
    pub(super) sheen: f64,
    pub(super) sheen_tint: f64,
}

/// The luminance of a texture at a point, in [0, 1].
pub(super) fn share(texture: &Texture, at: &MaterialPoint) -> f64 {
    f64::from(texture.luminance_at(&at.texture)).clamp(0.0, 1.0)
}

/// GGX with the α of a roughness along and across u.
pub(super) fn facets(roughness: f64, anisotropic: f64) -> Facets {
    let (alpha, aspect) = (roughness * roughness, (1.0 - 0.9 * anisotropic).sqrt());
    let alpha = [alpha / aspect, alpha * aspect].map(|a| a.max(LEAST_ALPHA));
    Facets { kind: Microfacets::Ggx, alpha }
}

/// (1 − cos)⁵, of \[Schlick1994\].
fn schlick_weight(cos: f64) -> f64 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Schlick's approximation, for light that meets a boundary of index `eta` from a side: in the thinner material the angle is that of the refracted ray.
pub(super) fn schlick(r0: Rgb, cos: f64, eta: f64) -> Rgb {
    let relative = if cos >= 0.0 { eta } else { 1.0 / eta };
    let cos =
        if relative > 1.0 { cos.abs() } else { (1.0 - (1.0 - cos * cos) / (relative * relative)).max(0.0).sqrt() };
    r0 + (Rgb::ONE - r0) * schlick_weight(cos) as f32
}

/// The colour with the luminance 1.
pub(super) fn hue(color: Rgb) -> Rgb {
    let luminance = luminance(color);
    if luminance > 0.0 { color / luminance } else { Rgb::ONE }
}

/// What a boundary reflects along its normal.
pub(super) fn normal_reflectance(eta: f64) -> f64 {
    ((eta - 1.0) / (eta + 1.0)).powi(2)
}

fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

impl Base {
    /// Diffuse reflection without its weight, times cosine: \[Burley2012, 5.3\] and \[Burley2015, 4\]; and the sheen.
    pub(super) fn eval(&self, wi: DVec3, wo: DVec3, half: DVec3) -> (Rgb, Rgb) {
        let (cos_i, cos_o) = (wi.z.abs(), wo.z.abs());
        let (fi, fo) = (schlick_weight(cos_i), schlick_weight(cos_o));
        let cos_d = half.dot(wo);
        let retro = 2.0 * self.roughness * cos_d * cos_d;
        let lambert = (1.0 - 0.5 * fi) * (1.0 - 0.5 * fo);
        let diffuse = lambert + retro * (fo + fi + fo * fi * (retro - 1.0));
        // Light that comes out beside where it went in, by the approximation of Hanrahan and Krueger.
        let flat = mix(1.0, 0.5 * retro, fo) * mix(1.0, 0.5 * retro, fi);
        let flat = 1.25 * (flat * (1.0 / (cos_o + cos_i) - 0.5) + 0.5);
        let value = mix(diffuse, flat, self.flatness) * cos_o / PI;
        let sheen = self.sheen * schlick_weight(cos_d.abs()) * cos_o;
        let tint = Rgb::ONE.lerp(hue(self.color), self.sheen_tint as f32);
        (self.color * value as f32, tint * sheen as f32)
    }
}

impl Lobes {
    pub(super) fn new(p: &Principled, at: &MaterialPoint) -> Self {
        let of = |texture| share(texture, at);
        let (metallic, spec_trans, roughness) = (of(&p.metallic), of(&p.spec_trans), of(&p.roughness));
        Self {
            base: Base {
                color: p.base_color.at(&at.texture),
                roughness,
                flatness: of(&p.flatness),
                sheen: of(&p.sheen),
                sheen_tint: of(&p.sheen_tint),
            },
            facets: facets(roughness, of(&p.anisotropic)),
            metallic,
            spec_tint: of(&p.spec_tint),
            eta: p.eta,
            clearcoat: of(&p.clearcoat),
            coat: Gtr1 { alpha: mix(0.1, 0.001, of(&p.clearcoat_gloss)) },
            reflects: (1.0 - metallic) * (1.0 - spec_trans),
            refracts: (1.0 - metallic) * spec_trans,
            rates: p.sampling_rates,
        }
    }

    /// With which probabilities base, coat and facets are drawn.
    fn choices(&self, front: bool) -> [f64; 3] {
        if !front {
            return [0.0, 0.0, if self.refracts > 0.0 { 1.0 } else { 0.0 }];
        }
        let [base, facets, coat] = self.rates;
        let rates = [self.reflects * base, COAT_SHARE * self.clearcoat * coat, facets];
        let sum: f64 = rates.iter().sum();
        rates.map(|r| if sum > 0.0 { r / sum } else { 0.0 })
    }

    /// Of the draws of facets those that refract, where Fresnel's equations reflect the share `f`.
    fn refracted_share(&self, front: bool, f: f64) -> f64 {
        if front { self.refracts * (1.0 - f) } else { 1.0 - f }
    }

    /// What the facets reflect at this cosine, of which `f` is Fresnel's.
    fn reflectance(&self, front: bool, f: f64, cos: f64) -> Rgb {
        if !front {
            return Rgb::splat((self.refracts * f) as f32);
        }
        let relative = if cos >= 0.0 { self.eta } else { 1.0 / self.eta };
        let plain = (1.0 - self.metallic) * (1.0 - self.spec_tint) * f;
        let tinted = hue(self.base.color) * normal_reflectance(relative) as f32;
        Rgb::splat(plain as f32)
            + schlick(self.base.color, cos, self.eta) * self.metallic as f32
            + schlick(tinted, cos, self.eta) * ((1.0 - self.metallic) * self.spec_tint) as f32
    }

    /// BSDF times cosine, and the density of [`Lobes::sample`].
    pub(super) fn eval(&self, wi: DVec3, wo: DVec3) -> (Rgb, f64) {
        let front = wi.z > 0.0;
        if wi.z == 0.0 || wo.z == 0.0 || (!front && self.refracts == 0.0) {
            return BLACK;
        }
        let reflects = wi.z * wo.z > 0.0;
        let relative = if front { self.eta } else { 1.0 / self.eta };
        let Some(m) = (wi + wo * if reflects { 1.0 } else { relative }).try_normalize() else { return BLACK };
        let m = if m.z < 0.0 { -m } else { m };
        let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
        // Both see the same side of the facet that they see of the surface.
        let seen = cos_i * wi.z > 0.0 && cos_o * wo.z > 0.0;
        let [base, coat, facets] = self.choices(front);
        let f = fresnel::dielectric(cos_i, self.eta).reflected;
        let (d, shadowing) = (self.facets.density(m), self.facets.visible(wi, m) * self.facets.visible(wo, m));
        let drawn = self.facets.pdf(if front { wi } else { -wi }, m);
        let refracted = self.refracted_share(front, f);
        if !reflects {
            if !seen || self.refracts == 0.0 {
                return BLACK;
            }
            let sum = cos_i + relative * cos_o;
            let value = self.refracts * (1.0 - f) * d * shadowing * (cos_i * cos_o / (wi.z * sum * sum)).abs();
            let jacobian = (relative * relative * cos_o / (sum * sum)).abs();
            let color = self.base.color.to_array().map(f32::sqrt);
            return (Rgb::from_array(color) * value as f32, facets * refracted * drawn * jacobian);
        }
        let (mut value, mut pdf) = (Rgb::ZERO, 0.0);
        let jacobian = 1.0 / (4.0 * cos_o.abs());
        if seen {
            let microfacets = d * shadowing / (4.0 * wi.z.abs());
            value += self.reflectance(front, f, cos_i) * microfacets as f32;
            pdf += facets * (1.0 - refracted) * drawn * jacobian;
        }
        if front {
            if seen {
                let shadowing = COAT_GGX.visible(wi, m) * COAT_GGX.visible(wo, m);
                let fresnel = schlick(Rgb::splat(COAT_REFLECTANCE as f32), cos_i, self.eta);
                let coating = COAT_SHARE * self.clearcoat * self.coat.density(m) * shadowing * wo.z;
                value += fresnel * coating as f32;
                pdf += coat * self.coat.density(m) * m.z * jacobian;
            }
            let (diffuse, sheen) = self.base.eval(wi, wo, m);
            value += diffuse * self.reflects as f32 + sheen * (1.0 - self.metallic) as f32;
            pdf += base * wo.z / PI;
        }
        (value, pdf)
    }

    /// A direction, and the index of refraction where it leads over that where `wi` is.
    pub(super) fn sample(&self, wi: DVec3, choice: f64, u: [f64; 2]) -> Option<(DVec3, f64)> {
        let front = wi.z > 0.0;
        let [base, coat, facets] = self.choices(front);
        if choice < base {
            return Some((sample_cosine_hemisphere(DVec3::Z, u).0, 1.0));
        }
        let reflected = |m| Some(fresnel::reflected(wi, m)).filter(|wo| wo.z * wi.z > 0.0).map(|wo| (wo, 1.0));
        if choice < base + coat {
            return reflected(self.coat.sample(u));
        }
        if facets == 0.0 || wi.z == 0.0 {
            return None;
        }
        let m = self.facets.sample(if front { wi } else { -wi }, u);
        let f = fresnel::dielectric(wi.dot(m), self.eta);
        let rest = (choice - base - coat) / facets;
        if rest < self.refracted_share(front, f.reflected) {
            return Some((fresnel::refracted(wi, m, &f), f.eta)).filter(|(wo, _)| wo.z * wi.z < 0.0);
        }
        reflected(m)
    }
}

/// What shadows a clear coat.
const COAT_GGX: Facets = Facets { kind: Microfacets::Ggx, alpha: [COAT_SHADOWING; 2] };

/// The distribution GTR1 of facets \[Burley2012, B.2\], whose tails are longer than those of GGX.
struct Gtr1 {
    alpha: f64,
}

impl Gtr1 {
    /// Per steradian and per area of the surface.
    fn density(&self, m: DVec3) -> f64 {
        let alpha2 = self.alpha * self.alpha;
        if m.z <= 0.0 {
            return 0.0;
        }
        (alpha2 - 1.0) / (PI * alpha2.ln() * (1.0 + (alpha2 - 1.0) * m.z * m.z))
    }

    /// A normal with density times cosine.
    fn sample(&self, [u0, u1]: [f64; 2]) -> DVec3 {
        let alpha2 = self.alpha * self.alpha;
        let cos2 = ((1.0 - alpha2.powf(1.0 - u1)) / (1.0 - alpha2)).clamp(0.0, 1.0);
        let ((sin_phi, cos_phi), sin) = (sin_cos_of_turn(u0), (1.0 - cos2).sqrt());
        dvec3(sin * cos_phi, sin * sin_phi, cos2.sqrt())
    }
}
