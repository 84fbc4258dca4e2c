//! Mitsuba's `principledthin`: Disney's material for thin sheets \[Burley2015, 5\].
//!
//! *Definition.* With t `spec_trans` and s half of `diff_trans`, a sheet that reflects as facets of GGX and lets through as their mirror image behind it, of weight
//! t; a diffuse base with sheen in front, of weight (1 − t)(1 − s); and Lambertian transmission, of weight (1 − t)s. What goes through is scattered
//! by facets whose roughness shrinks with the index of refraction \[Burley2015, fig. 15\]. Both sides are alike, and nothing is bent.
//!
//! *Reciprocity*: of reflection and of diffuse transmission. Clear transmission is left out where `wo` is on the wrong side of the facet, as in Mitsuba, and `wi` is not
//! asked in the same way.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use vdf_scene::{PrincipledThin, Rgb};

use super::{
    fresnel,
    material::{BLACK, MaterialPoint},
    microfacet::Facets,
    principled::{Base, facets, hue, normal_reflectance, schlick, share},
};
use crate::frame::sample_cosine_hemisphere;

/// The parameters at a point.
pub(super) struct Sheet {
    base: Base,
    mirrors: Facets,
    passes: Facets,
    spec_trans: f64,
    spec_tint: f64,
    diff_trans: f64,
    eta: f64,
    /// The probabilities of diffuse and clear reflection, diffuse and clear transmission.
    choices: [f64; 4],
}

impl Sheet {
    pub(super) fn new(p: &PrincipledThin, at: &MaterialPoint) -> Self {
        let of = |texture| share(texture, at);
        let (roughness, anisotropic, spec_trans) = (of(&p.roughness), of(&p.anisotropic), of(&p.spec_trans));
        let eta = f64::from(p.eta.luminance_at(&at.texture)).max(1e-3);
        let diff_trans = (0.5 * f64::from(p.diff_trans.luminance_at(&at.texture))).clamp(0.0, 1.0);
        let [diffuse, clear, diffuse_through, clear_through] = p.sampling_rates;
        let rates = [
            diffuse * (1.0 - spec_trans) * (1.0 - diff_trans),
            clear * 0.5 * spec_trans,
            diffuse_through * (1.0 - spec_trans) * diff_trans,
            clear_through * 0.5 * spec_trans,
        ];
        let sum: f64 = rates.iter().sum();
        Self {
            base: Base {
                color: p.base_color.at(&at.texture),
                roughness,
                flatness: of(&p.flatness),
                sheen: of(&p.sheen),
                sheen_tint: of(&p.sheen_tint),
            },
            mirrors: facets(roughness, anisotropic),
            passes: facets((0.65 * eta - 0.35) * roughness, anisotropic),
            spec_trans,
            spec_tint: of(&p.spec_tint),
            diff_trans,
            eta,
            choices: rates.map(|r| if sum > 0.0 { r / sum } else { 0.0 }),
        }
    }

    /// BSDF times cosine, and the density of [`Sheet::sample`].
    pub(super) fn eval(&self, wi: DVec3, wo: DVec3) -> (Rgb, f64) {
        if wi.z == 0.0 || wo.z == 0.0 {
            return BLACK;
        }
        // Both sides are alike.
        let (wi, wo) = if wi.z > 0.0 { (wi, wo) } else { (-wi, -wo) };
        let reflects = wo.z > 0.0;
        let mirrored = dvec3(wo.x, wo.y, wo.z.abs());
        let Some(m) = (wi + mirrored).try_normalize() else { return BLACK };
        let cos = wi.dot(m);
        let seen = cos > 0.0 && if reflects { wo.dot(m) > 0.0 } else { wo.dot(m) < 0.0 };
        let [diffuse, clear, diffuse_through, clear_through] = self.choices;
        let f = fresnel::dielectric(cos, self.eta).reflected;
        let lobe = |facets: &Facets| {
            let shadowing = facets.visible(wi, m) * facets.visible(wo, m);
            let value = self.spec_trans * facets.density(m) * shadowing / (4.0 * wi.z);
            (value, facets.pdf(wi, m) / (4.0 * mirrored.dot(m)))
        };
        let (mut value, mut pdf) = (Rgb::ZERO, 0.0);
        if reflects {
            if seen {
                let (microfacets, drawn) = lobe(&self.mirrors);
                let tinted = schlick(hue(self.base.color) * normal_reflectance(self.eta) as f32, cos, self.eta);
                value += Rgb::splat(f as f32).lerp(tinted, self.spec_tint as f32) * microfacets as f32;
                pdf += clear * drawn;
            }
            let (base, sheen) = self.base.eval(wi, wo, m);
            value += (base + sheen) * ((1.0 - self.spec_trans) * (1.0 - self.diff_trans)) as f32;
            pdf += diffuse * wo.z / PI;
        } else {
            if seen {
                let (microfacets, drawn) = lobe(&self.passes);
                value += self.base.color * ((1.0 - f) * microfacets) as f32;
                pdf += clear_through * drawn;
            }
            let through = (1.0 - self.spec_trans) * self.diff_trans * mirrored.z / PI;
            value += self.base.color * through as f32;
            pdf += diffuse_through * mirrored.z / PI;
        }
        (value, pdf)
    }

    /// A direction.
    pub(super) fn sample(&self, wi: DVec3, choice: f64, u: [f64; 2]) -> Option<DVec3> {
        let above = if wi.z > 0.0 { wi } else { -wi };
        let [diffuse, clear, diffuse_through, clear_through] = self.choices;
        if wi.z == 0.0 || diffuse + clear + diffuse_through + clear_through == 0.0 {
            return None;
        }
        let hemisphere = || sample_cosine_hemisphere(DVec3::Z, u).0;
        let facet = |facets: &Facets| Some(fresnel::reflected(above, facets.sample(above, u))).filter(|wo| wo.z > 0.0);
        let behind = |wo: DVec3| dvec3(wo.x, wo.y, -wo.z);
        let wo = if choice < diffuse {
            hemisphere()
        } else if choice < diffuse + clear {
            facet(&self.mirrors)?
        } else if choice < diffuse + clear + diffuse_through {
            behind(hemisphere())
        } else {
            behind(facet(&self.passes)?)
        };
        Some(if wi.z > 0.0 { wo } else { -wo })
    }
}
