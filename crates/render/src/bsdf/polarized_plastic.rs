//! A diffuse base under a coat of microfacets: Mitsuba's `pplastic`, for light that is not polarized.
//!
//! *Definition* \[Baek2018\]. The coat reflects by its facets, and its base as a Lambertian surface of which light that comes and goes loses what the smooth coat reflects:
//! ρ (1 − F(θ_i)) (1 − F(θ_o))/π. Nothing is scattered between base and coat, unlike in `plastic`.

use std::f64::consts::PI;

use glam::DVec3;
use vdf_scene::{Rgb, Roughness, Texture};

use super::{
    fresnel,
    material::{BLACK, MaterialPoint, facets, reflection},
    prepared::Prepared,
};
use crate::frame::sample_cosine_hemisphere;

/// The model and what of it does not depend on the place.
#[derive(Clone, Debug)]
pub(crate) struct PolarizedPlastic {
    eta: f64,
    diffuse: Texture,
    specular: Texture,
    roughness: Roughness,
    /// The probability with which the coat is sampled.
    coat_share: f64,
}

impl PolarizedPlastic {
    pub(super) fn new(
        eta: f64,
        diffuse: &Texture,
        specular: &Texture,
        roughness: &Roughness,
        prepared: &mut Prepared,
    ) -> Self {
        let coat_share = prepared.coat_share(diffuse, specular);
        Self { eta, diffuse: diffuse.clone(), specular: specular.clone(), roughness: roughness.clone(), coat_share }
    }

    /// BRDF times cosine, and the density of [`PolarizedPlastic::sample`].
    pub(super) fn eval(&self, wi: DVec3, wo: DVec3, at: &MaterialPoint) -> (Rgb, f64) {
        if wi.z <= 0.0 || wo.z <= 0.0 {
            return BLACK;
        }
        let passes = |cos| 1.0 - fresnel::dielectric(cos, self.eta).reflected;
        let mut value = self.diffuse.at(&at.texture) * (passes(wi.z) * passes(wo.z) * wo.z / PI) as f32;
        let mut pdf = (1.0 - self.coat_share) * wo.z / PI;
        if let Some((d, pdf_coat, cos)) = reflection(&facets(&self.roughness, at), wi, wo) {
            value += self.specular.at(&at.texture) * (fresnel::dielectric(cos, self.eta).reflected * d) as f32;
            pdf += self.coat_share * pdf_coat;
        }
        (value, pdf)
    }

    /// A direction; it may be below the surface, where a path ends.
    pub(super) fn sample(&self, wi: DVec3, at: &MaterialPoint, choice: f64, u: [f64; 2]) -> DVec3 {
        if choice < self.coat_share {
            fresnel::reflected(wi, facets(&self.roughness, at).sample(wi, u))
        } else {
            sample_cosine_hemisphere(DVec3::Z, u).0
        }
    }
}
