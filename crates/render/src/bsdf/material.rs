//! Mitsuba's BSDFs, evaluated and sampled.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};
use vdf_scene::{Bsdf, Perturbation, Principled, PrincipledThin, Rgb, Roughness, Texture, TexturePoint};

use super::{
    fresnel, microfacet::Facets, perturbed::Perturbed, plastic::Coat, polarized_plastic::PolarizedPlastic,
    prepared::Prepared, principled, principled_thin,
};
use crate::frame::sample_cosine_hemisphere;

/// Smoother surfaces are drawn as rough as this, as in Mitsuba.
pub(super) const LEAST_ALPHA: f64 = 1e-4;

/// How a surface that is no plain Lambertian one scatters.
#[derive(Clone, Debug)]
pub(crate) enum Material {
    Diffuse { front: Texture, back: Texture },
    Conductor { eta: Rgb, k: Rgb, specular: Texture, roughness: Option<Roughness> },
    Dielectric { eta: f64, reflectance: Texture, transmittance: Texture, roughness: Option<Roughness> },
    ThinDielectric { eta: f64, reflectance: Texture, transmittance: Texture },
    Plastic { coat: Coat, diffuse: Texture, specular: Texture, nonlinear: bool, roughness: Option<Roughness> },
    PolarizedPlastic(Box<PolarizedPlastic>),
    Filter { transmittance: Texture, share: f32 },
    TwoSided(Box<[Material; 2]>),
    Blend { weight: Texture, of: Box<[Material; 2]> },
    Mask { opacity: Texture, of: Box<Material> },
    Perturbed(Box<Perturbed>),
    Principled(Box<Principled>),
    PrincipledThin(Box<PrincipledThin>),
    Null,
}

/// A point of a surface as materials see it. Vectors are in the shading frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MaterialPoint {
    pub(crate) texture: TexturePoint,
    /// ∂p/∂u and ∂p/∂v; zero unless [`Material::needs_tangents`].
    pub(crate) tangents: [DVec3; 2],
    /// The normal of the surface itself, on the side of the shading normal.
    pub(crate) normal: DVec3,
}

impl From<TexturePoint> for MaterialPoint {
    fn from(texture: TexturePoint) -> Self {
        Self { texture, tangents: [DVec3::ZERO; 2], normal: DVec3::Z }
    }
}

/// What kind of lobe a direction was drawn from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lobe {
    /// One with a density.
    Smooth,
    /// A single direction.
    Delta,
    /// Straight on, as if nothing were there.
    Null,
}

/// A direction that a path goes on in.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MaterialSample {
    pub(crate) wo: DVec3,
    /// BSDF times cosine over the density.
    pub(crate) weight: Rgb,
    /// Per steradian; of a smooth lobe.
    pub(crate) pdf: f64,
    /// The index of refraction where the path goes over that where it comes from.
    pub(crate) eta: f64,
    pub(crate) lobe: Lobe,
}

pub(super) const BLACK: (Rgb, f64) = (Rgb::ZERO, 0.0);

impl Material {
    /// The material of a shape, of the scene that `prepared` is of.
    pub(crate) fn new(bsdf: &Bsdf, prepared: &mut Prepared) -> Self {
        let mut both = |of: &[Bsdf; 2]| Box::new([Self::new(&of[0], prepared), Self::new(&of[1], prepared)]);
        match bsdf {
            Bsdf::Lambertian { front, back } => {
                Self::Diffuse { front: Texture::Constant(*front), back: Texture::Constant(*back) }
            }
            Bsdf::Diffuse { reflectance } => {
                Self::Diffuse { front: reflectance.clone(), back: Texture::Constant(Rgb::ZERO) }
            }
            Bsdf::Conductor { eta, k, specular, roughness } => {
                Self::Conductor { eta: *eta, k: *k, specular: specular.clone(), roughness: roughness.clone() }
            }
            Bsdf::Dielectric { eta, reflectance, transmittance, roughness } => Self::Dielectric {
                eta: *eta,
                reflectance: reflectance.clone(),
                transmittance: transmittance.clone(),
                roughness: roughness.clone(),
            },
            Bsdf::ThinDielectric { eta, reflectance, transmittance } => Self::ThinDielectric {
                eta: *eta,
                reflectance: reflectance.clone(),
                transmittance: transmittance.clone(),
            },
            Bsdf::Plastic { eta, diffuse, specular, nonlinear, roughness } => Self::Plastic {
                coat: Coat::new(*eta, diffuse, specular, roughness.as_ref(), prepared),
                diffuse: diffuse.clone(),
                specular: specular.clone(),
                nonlinear: *nonlinear,
                roughness: roughness.clone(),
            },
            Bsdf::PolarizedPlastic { eta, diffuse, specular, roughness } => {
                Self::PolarizedPlastic(Box::new(PolarizedPlastic::new(*eta, diffuse, specular, roughness, prepared)))
            }
            Bsdf::Filter { transmittance, share } => {
                Self::Filter { transmittance: transmittance.clone(), share: *share }
            }
            Bsdf::TwoSided(of) => Self::TwoSided(both(of)),
            Bsdf::Blend { weight, of } => Self::Blend { weight: weight.clone(), of: both(of) },
            Bsdf::Mask { opacity, of } => {
                Self::Mask { opacity: opacity.clone(), of: Box::new(Self::new(of, prepared)) }
            }
            Bsdf::Perturbed { by, flip_invalid_normals, shadowing, of } => Self::Perturbed(Box::new(Perturbed {
                by: by.clone(),
                flip_invalid_normals: *flip_invalid_normals,
                shadowing: *shadowing,
                of: Self::new(of, prepared),
            })),
            Bsdf::Principled(p) => Self::Principled(p.clone()),
            Bsdf::PrincipledThin(p) => Self::PrincipledThin(p.clone()),
            Bsdf::Null => Self::Null,
        }
    }
}

pub(super) fn facets(roughness: &Roughness, at: &MaterialPoint) -> Facets {
    let alpha = |t: &Texture| f64::from(t.luminance_at(&at.texture)).max(LEAST_ALPHA);
    Facets { kind: roughness.distribution, alpha: [alpha(&roughness.alpha_u), alpha(&roughness.alpha_v)] }
}

fn upside_down(w: DVec3) -> DVec3 {
    dvec3(w.x, w.y, -w.z)
}

impl Material {
    /// Whether some light may go straight through, which shadow rays have to follow.
    pub(crate) fn may_pass(&self) -> bool {
        match self {
            Self::ThinDielectric { .. } | Self::Mask { .. } | Self::Filter { .. } | Self::Null => true,
            Self::Blend { of, .. } => of.iter().any(Self::may_pass),
            Self::Perturbed(p) => p.of.may_pass(),
            _ => false,
        }
    }

    /// Whether any lobe has a density, so that it is worth to ask for light.
    pub(crate) fn has_smooth_lobes(&self) -> bool {
        match self {
            Self::Conductor { roughness, .. } | Self::Dielectric { roughness, .. } => roughness.is_some(),
            Self::ThinDielectric { .. } | Self::Filter { .. } | Self::Null => false,
            Self::TwoSided(of) | Self::Blend { of, .. } => of.iter().any(Self::has_smooth_lobes),
            Self::Mask { of, .. } => of.has_smooth_lobes(),
            Self::Perturbed(p) => p.of.has_smooth_lobes(),
            Self::Diffuse { .. }
            | Self::Plastic { .. }
            | Self::PolarizedPlastic(_)
            | Self::Principled(_)
            | Self::PrincipledThin(_) => true,
        }
    }

    /// Whether it asks how a point moves with the texture coordinates.
    pub(crate) fn needs_tangents(&self) -> bool {
        match self {
            Self::TwoSided(of) | Self::Blend { of, .. } => of.iter().any(Self::needs_tangents),
            Self::Mask { of, .. } => of.needs_tangents(),
            Self::Perturbed(p) => p.of.needs_tangents() || matches!(p.by, Perturbation::Heights { .. }),
            _ => false,
        }
    }

    /// What of light goes straight through.
    pub(crate) fn passes(&self, wi: DVec3, at: &MaterialPoint) -> Rgb {
        match self {
            Self::ThinDielectric { eta, transmittance, .. } => {
                transmittance.at(&at.texture) * (1.0 - thin_reflectance(wi.z, *eta)) as f32
            }
            Self::Mask { opacity, of } => {
                let opacity = opacity.luminance_at(&at.texture).clamp(0.0, 1.0);
                of.passes(wi, at) * opacity + Rgb::splat(1.0 - opacity)
            }
            Self::Blend { weight, of } => {
                let weight = weight.luminance_at(&at.texture).clamp(0.0, 1.0);
                of[0].passes(wi, at) * (1.0 - weight) + of[1].passes(wi, at) * weight
            }
            Self::Perturbed(p) => p.passes(wi, at),
            Self::Filter { transmittance, share } => transmittance.at(&at.texture) * *share,
            Self::Null => Rgb::ONE,
            _ => Rgb::ZERO,
        }
    }

    /// BSDF times cosine of the lobes that have a density, and the density with which [`Material::sample`] draws `wo` from these.
    pub(crate) fn eval(&self, wi: DVec3, wo: DVec3, at: &MaterialPoint) -> (Rgb, f64) {
        match self {
            Self::Diffuse { front, back } => {
                let reflectance = if wi.z > 0.0 { front } else { back };
                if wi.z * wo.z <= 0.0 {
                    return BLACK;
                }
                let pdf = wo.z.abs() / PI;
                (reflectance.at(&at.texture) * pdf as f32, pdf)
            }
            Self::Conductor { eta, k, specular, roughness: Some(roughness) } => {
                let Some((value, pdf, cos)) = reflection(&facets(roughness, at), wi, wo) else { return BLACK };
                (specular.at(&at.texture) * fresnel::conductor(cos, *eta, *k) * value as f32, pdf)
            }
            Self::Dielectric { eta, reflectance, transmittance, roughness: Some(roughness) } => {
                rough_dielectric(*eta, reflectance, transmittance, &facets(roughness, at), wi, wo, at)
            }
            Self::Plastic { coat, diffuse, specular, nonlinear, roughness } => {
                if wi.z <= 0.0 || wo.z <= 0.0 {
                    return BLACK;
                }
                let choice = coat.choice(wi.z);
                let mut pdf = (1.0 - choice) * wo.z / PI;
                let mut value = coat.base(diffuse.at(&at.texture), *nonlinear, wi.z, wo.z) * (wo.z / PI) as f32;
                let shine = roughness.as_ref().and_then(|r| reflection(&facets(r, at), wi, wo));
                if let Some((d, pdf_coat, cos)) = shine {
                    value += specular.at(&at.texture) * (fresnel::dielectric(cos, coat.eta).reflected * d) as f32;
                    pdf += choice * pdf_coat;
                }
                (value, pdf)
            }
            Self::TwoSided(of) => {
                if wi.z > 0.0 {
                    of[0].eval(wi, wo, at)
                } else {
                    of[1].eval(upside_down(wi), upside_down(wo), at)
                }
            }
            Self::Blend { weight, of } => {
                let weight = weight.luminance_at(&at.texture).clamp(0.0, 1.0);
                let ((a, pdf_a), (b, pdf_b)) = (of[0].eval(wi, wo, at), of[1].eval(wi, wo, at));
                let w = f64::from(weight);
                (a * (1.0 - weight) + b * weight, pdf_a * (1.0 - w) + pdf_b * w)
            }
            Self::Mask { opacity, of } => {
                let opacity = opacity.luminance_at(&at.texture).clamp(0.0, 1.0);
                let (value, pdf) = of.eval(wi, wo, at);
                (value * opacity, pdf * f64::from(opacity))
            }
            Self::Perturbed(p) => p.eval(wi, wo, at),
            Self::PolarizedPlastic(p) => p.eval(wi, wo, at),
            Self::Principled(p) => principled::Lobes::new(p, at).eval(wi, wo),
            Self::PrincipledThin(p) => principled_thin::Sheet::new(p, at).eval(wi, wo),
            Self::Conductor { .. }
            | Self::Dielectric { .. }
            | Self::ThinDielectric { .. }
            | Self::Filter { .. }
            | Self::Null => BLACK,
        }
    }

    /// A direction to go on in, from a uniform number that chooses a lobe and two that choose in it. `None` if the path ends.
    pub(crate) fn sample(&self, wi: DVec3, at: &MaterialPoint, choice: f64, u: [f64; 2]) -> Option<MaterialSample> {
        match self {
            Self::Diffuse { .. } => {
                let (wo, _) = sample_cosine_hemisphere(DVec3::Z, u);
                self.smooth(wi, if wi.z > 0.0 { wo } else { -wo }, at, 1.0)
            }
            Self::Conductor { eta, k, specular, roughness } => {
                if wi.z <= 0.0 {
                    return None;
                }
                match roughness {
                    None => {
                        let weight = specular.at(&at.texture) * fresnel::conductor(wi.z, *eta, *k);
                        Some(delta(fresnel::mirrored(wi), weight, 1.0))
                    }
                    Some(roughness) => {
                        let m = facets(roughness, at).sample(wi, u);
                        self.smooth(wi, fresnel::reflected(wi, m), at, 1.0)
                    }
                }
            }
            Self::Dielectric { eta, reflectance, transmittance, roughness: None } => {
                let f = fresnel::dielectric(wi.z, *eta);
                if choice < f.reflected {
                    return Some(delta(fresnel::mirrored(wi), reflectance.at(&at.texture), 1.0));
                }
                let wo = dvec3(-wi.x / f.eta, -wi.y / f.eta, f.cos_t);
                Some(delta(wo, transmittance.at(&at.texture) / (f.eta * f.eta) as f32, f.eta))
            }
            Self::Dielectric { eta, roughness: Some(roughness), .. } => {
                let above = if wi.z < 0.0 { -wi } else { wi };
                // The facet is seen from the side that the light comes to.
                let m = facets(roughness, at).sample(above, u);
                let f = fresnel::dielectric(wi.dot(m), *eta);
                if choice < f.reflected {
                    self.smooth(wi, fresnel::reflected(wi, m), at, 1.0).filter(|s| s.wo.z * wi.z > 0.0)
                } else {
                    self.smooth(wi, fresnel::refracted(wi, m, &f), at, f.eta).filter(|s| s.wo.z * wi.z < 0.0)
                }
            }
            Self::ThinDielectric { eta, reflectance, transmittance } => {
                if choice < thin_reflectance(wi.z, *eta) {
                    Some(delta(fresnel::mirrored(wi), reflectance.at(&at.texture), 1.0))
                } else {
                    Some(straight_on(wi, transmittance.at(&at.texture)))
                }
            }
            Self::Plastic { coat, specular, roughness, .. } => {
                if wi.z <= 0.0 {
                    return None;
                }
                let of_coat = coat.choice(wi.z);
                if choice >= of_coat {
                    return self.smooth(wi, sample_cosine_hemisphere(DVec3::Z, u).0, at, 1.0);
                }
                match roughness {
                    None => {
                        let reflected = fresnel::dielectric(wi.z, coat.eta).reflected / of_coat;
                        Some(delta(fresnel::mirrored(wi), specular.at(&at.texture) * reflected as f32, 1.0))
                    }
                    Some(roughness) => {
                        let m = facets(roughness, at).sample(wi, u);
                        self.smooth(wi, fresnel::reflected(wi, m), at, 1.0)
                    }
                }
            }
            Self::TwoSided(of) => {
                if wi.z > 0.0 {
                    return of[0].sample(wi, at, choice, u);
                }
                let sample = of[1].sample(upside_down(wi), at, choice, u)?;
                Some(MaterialSample { wo: upside_down(sample.wo), ..sample })
            }
            Self::Blend { weight, of } => {
                let weight = f64::from(weight.luminance_at(&at.texture).clamp(0.0, 1.0));
                let second = choice < weight;
                let rest = if second { choice / weight } else { (choice - weight) / (1.0 - weight) };
                let sample = of[usize::from(second)].sample(wi, at, rest, u)?;
                self.among_lobes(wi, sample, at)
            }
            Self::Mask { opacity, of } => {
                let opacity = f64::from(opacity.luminance_at(&at.texture).clamp(0.0, 1.0));
                if choice >= opacity {
                    return Some(straight_on(wi, Rgb::ONE));
                }
                let sample = of.sample(wi, at, choice / opacity, u)?;
                self.among_lobes(wi, sample, at)
            }
            Self::Perturbed(p) => p.sample(wi, at, choice, u),
            Self::PolarizedPlastic(p) => {
                if wi.z <= 0.0 {
                    return None;
                }
                self.smooth(wi, p.sample(wi, at, choice, u), at, 1.0)
            }
            Self::Filter { transmittance, share } => Some(straight_on(wi, transmittance.at(&at.texture) * *share)),
            Self::Principled(p) => {
                let (wo, eta) = principled::Lobes::new(p, at).sample(wi, choice, u)?;
                self.smooth(wi, wo, at, eta)
            }
            Self::PrincipledThin(p) => {
                self.smooth(wi, principled_thin::Sheet::new(p, at).sample(wi, choice, u)?, at, 1.0)
            }
            Self::Null => Some(straight_on(wi, Rgb::ONE)),
        }
    }

    /// A direction of a lobe with a density.
    fn smooth(&self, wi: DVec3, wo: DVec3, at: &MaterialPoint, eta: f64) -> Option<MaterialSample> {
        let (value, pdf) = self.eval(wi, wo, at);
        (pdf > 0.0 && pdf.is_finite()).then(|| MaterialSample {
            wo,
            weight: value / pdf as f32,
            pdf,
            eta,
            lobe: Lobe::Smooth,
        })
    }

    /// A sample of one part of a mixture as one of the mixture: what has a density is weighed with that of all parts. The probability of the part
    /// cancels for the others.
    fn among_lobes(&self, wi: DVec3, sample: MaterialSample, at: &MaterialPoint) -> Option<MaterialSample> {
        if sample.lobe == Lobe::Smooth { self.smooth(wi, sample.wo, at, sample.eta) } else { Some(sample) }
    }
}

fn delta(wo: DVec3, weight: Rgb, eta: f64) -> MaterialSample {
    MaterialSample { wo, weight, pdf: 0.0, eta, lobe: Lobe::Delta }
}

fn straight_on(wi: DVec3, weight: Rgb) -> MaterialSample {
    MaterialSample { wo: -wi, weight, pdf: 0.0, eta: 1.0, lobe: Lobe::Null }
}

/// What a thin sheet reflects, with all that goes to and fro in it: R + T²R + T²R³ + … = 2R/(1 + R).
fn thin_reflectance(cos: f64, eta: f64) -> f64 {
    let r = fresnel::dielectric(cos.abs(), eta).reflected;
    2.0 * r / (1.0 + r)
}

/// D·G/(4 cos θ_i), which is the BRDF times cosine without its Fresnel term; the density of `wo`, and the cosine at the facet.
pub(super) fn reflection(facets: &Facets, wi: DVec3, wo: DVec3) -> Option<(f64, f64, f64)> {
    if wi.z <= 0.0 || wo.z <= 0.0 {
        return None;
    }
    let m = (wi + wo).try_normalize()?;
    let cos = wi.dot(m);
    let pdf = facets.pdf(wi, m) / (4.0 * cos);
    let shadowing = facets.visible(wi, m) * facets.visible(wo, m);
    Some((facets.density(m) * shadowing / (4.0 * wi.z), pdf, cos))
}

/// [Walter2007], equations 20 and 21.
fn rough_dielectric(
    eta: f64,
    reflectance: &Texture,
    transmittance: &Texture,
    facets: &Facets,
    wi: DVec3,
    wo: DVec3,
    at: &MaterialPoint,
) -> (Rgb, f64) {
    if wi.z == 0.0 || wo.z == 0.0 {
        return BLACK;
    }
    let reflects = wi.z * wo.z > 0.0;
    let relative = if wi.z > 0.0 { eta } else { 1.0 / eta };
    let Some(m) = (wi + wo * if reflects { 1.0 } else { relative }).try_normalize() else { return BLACK };
    let m = if m.z < 0.0 { -m } else { m };
    let (cos_i, cos_o) = (wi.dot(m), wo.dot(m));
    // Both see the same side of the facet that they see of the surface.
    if cos_i * wi.z <= 0.0 || cos_o * wo.z <= 0.0 {
        return BLACK;
    }
    let f = fresnel::dielectric(cos_i, eta).reflected;
    let (above, seen) = (if wi.z < 0.0 { -wi } else { wi }, facets.visible(wi, m) * facets.visible(wo, m));
    let (d, pdf) = (facets.density(m), facets.pdf(above, m));
    if reflects {
        let value = f * d * seen / (4.0 * wi.z.abs());
        return (reflectance.at(&at.texture) * value as f32, pdf * f / (4.0 * cos_o.abs()));
    }
    let sum = cos_i + relative * cos_o;
    // The square of the index in eq. 21 is undone by the compression of radiance.
    let value = (1.0 - f) * d * seen * (cos_i * cos_o / (wi.z * sum * sum)).abs();
    let jacobian = (relative * relative * cos_o / (sum * sum)).abs();
    (transmittance.at(&at.texture) * value as f32, pdf * (1.0 - f) * jacobian)
}
