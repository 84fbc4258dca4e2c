//! How surfaces scatter: Mitsuba's models with their parameters resolved. What they mean is in `docs/scenes.md`, and how they are evaluated and sampled is the
//! renderer's affair.

use crate::{Rgb, Texture};

/// A model of scattering at a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Bsdf {
    /// A Lambertian reflector, each side with its own reflectance, black where a side does not reflect. Mitsuba's `diffuse` has a black back;
    /// `twosided` puts a `diffuse` on each side.
    Lambertian {
        /// Reflectance of the side of the normal, each channel in [0, 1].
        front: Rgb,
        /// Reflectance of the other side, each channel in [0, 1].
        back: Rgb,
    },
    /// A Lambertian reflector with a texture, on the side of the normal.
    Diffuse {
        /// Each channel in [0, 1].
        reflectance: Texture,
    },
    /// A metal, on the side of the normal.
    Conductor {
        /// Real part of the index of refraction, relative to what is outside.
        eta: Rgb,
        /// Imaginary part; 0 with an `eta` of 0 is a perfect mirror.
        k: Rgb,
        /// What reflections are multiplied with.
        specular: Texture,
        /// `None` is smooth.
        roughness: Option<Roughness>,
    },
    /// A boundary between two transparent materials.
    Dielectric {
        /// Index of refraction behind the normal, divided by that before it; positive.
        eta: f64,
        /// What reflections are multiplied with.
        reflectance: Texture,
        /// What transmitted light is multiplied with.
        transmittance: Texture,
        /// `None` is smooth.
        roughness: Option<Roughness>,
    },
    /// A thin sheet of a transparent material: two boundaries at one place.
    ThinDielectric {
        /// Index of refraction of the sheet, divided by that around it; positive.
        eta: f64,
        /// What reflections are multiplied with.
        reflectance: Texture,
        /// What transmitted light is multiplied with.
        transmittance: Texture,
    },
    /// A diffuse base under a transparent coat, on the side of the normal.
    Plastic {
        /// Index of refraction of the coat, divided by that outside; positive.
        eta: f64,
        /// Reflectance of the base, each channel in [0, 1].
        diffuse: Texture,
        /// What reflections of the coat are multiplied with.
        specular: Texture,
        /// Whether colours shift by scattering between base and coat.
        nonlinear: bool,
        /// Of the coat; `None` is smooth.
        roughness: Option<Roughness>,
    },
    /// A diffuse base under a coat of microfacets, as in Mitsuba's `pplastic` where light is not polarized; on the side of the normal.
    PolarizedPlastic {
        /// Index of refraction of the coat, divided by that outside; positive.
        eta: f64,
        /// Reflectance of the base, each channel in [0, 1].
        diffuse: Texture,
        /// What reflections of the coat are multiplied with.
        specular: Texture,
        /// Of the coat.
        roughness: Roughness,
    },
    /// A sheet that lets light straight on, weakened: what polarizers and retarders are for light that is not polarized.
    Filter {
        /// What light is multiplied with, besides `share`.
        transmittance: Texture,
        /// In [0, 1]; half of the light is polarized the other way.
        share: f32,
    },
    /// A model for each side; neither transmits.
    TwoSided(Box<[Bsdf; 2]>),
    /// A mixture: the second model with this weight, else the first.
    Blend {
        /// In [0, 1].
        weight: Texture,
        /// The two.
        of: Box<[Bsdf; 2]>,
    },
    /// A model that is there with this opacity; the rest of the light passes.
    Mask {
        /// In [0, 1].
        opacity: Texture,
        /// The model.
        of: Box<Bsdf>,
    },
    /// A model whose shading normal is turned by a texture.
    Perturbed {
        /// By what.
        by: Perturbation,
        /// Whether a normal that turns away from where light is looked for is mirrored at the surface's \[Schuessler2017\].
        flip_invalid_normals: bool,
        /// Whether light fades before it falls below the surface \[Estevez2019\].
        shadowing: bool,
        /// The model.
        of: Box<Bsdf>,
    },
    /// Many lobes under few names \[Burley2012, Burley2015\]; transmits where `spec_trans` is not 0.
    Principled(Box<Principled>),
    /// As that, for a thin sheet.
    PrincipledThin(Box<PrincipledThin>),
    /// All light passes.
    Null,
}

/// The parameters of Mitsuba's `principled`. Of each texture but the colour the luminance counts; all are in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct Principled {
    /// The colour of the base, and of the metal.
    pub base_color: Texture,
    /// Its square is the α of GGX.
    pub roughness: Texture,
    /// How much rougher it is across u.
    pub anisotropic: Texture,
    /// How much of it is metal.
    pub metallic: Texture,
    /// How much of what is no metal lets light through.
    pub spec_trans: Texture,
    /// Index of refraction inside over that outside; positive, and not 1 if it transmits.
    pub eta: f64,
    /// How much reflections of what is no metal have the base's colour.
    pub spec_tint: Texture,
    /// Light that grazes as on cloth.
    pub sheen: Texture,
    /// How much the sheen has the base's colour.
    pub sheen_tint: Texture,
    /// How much the base looks as if light went through it.
    pub flatness: Texture,
    /// A second, colourless layer of reflections.
    pub clearcoat: Texture,
    /// How sharp those are.
    pub clearcoat_gloss: Texture,
    /// How often the lobes are drawn: the base, the reflections and refractions, the clear coat. At least 0.
    pub sampling_rates: [f64; 3],
}

/// The parameters of Mitsuba's `principledthin`. Of each texture but the colour the luminance counts; all but two are in [0, 1].
#[derive(Clone, Debug, PartialEq)]
pub struct PrincipledThin {
    /// The colour of the sheet.
    pub base_color: Texture,
    /// Its square is the α of GGX.
    pub roughness: Texture,
    /// How much rougher it is across u.
    pub anisotropic: Texture,
    /// How much of it is clear rather than diffuse.
    pub spec_trans: Texture,
    /// Index of refraction of the sheet, positive.
    pub eta: Texture,
    /// How much reflections have the base's colour.
    pub spec_tint: Texture,
    /// Light that grazes as on cloth.
    pub sheen: Texture,
    /// How much the sheen has the base's colour.
    pub sheen_tint: Texture,
    /// How much the base looks as if light went through it.
    pub flatness: Texture,
    /// How much of the diffuse light goes through: from 0 to 2, which is all.
    pub diff_trans: Texture,
    /// How often the lobes are drawn: diffuse and clear reflection, diffuse and clear transmission. At least 0.
    pub sampling_rates: [f64; 4],
}

impl Principled {
    /// Whether any light passes.
    #[must_use]
    pub fn transmits(&self) -> bool {
        self.spec_trans != Texture::grey(0.0)
    }

    pub(crate) fn textures(&self) -> [&Texture; 11] {
        let Self { base_color, roughness, anisotropic, metallic, spec_trans, eta: _, .. } = self;
        let Self { spec_tint, sheen, sheen_tint, flatness, clearcoat, clearcoat_gloss, sampling_rates: _, .. } = self;
        [
            base_color,
            roughness,
            anisotropic,
            metallic,
            spec_trans,
            spec_tint,
            sheen,
            sheen_tint,
            flatness,
            clearcoat,
            clearcoat_gloss,
        ]
    }
}

impl PrincipledThin {
    pub(crate) fn textures(&self) -> [&Texture; 10] {
        let Self { base_color, roughness, anisotropic, spec_trans, eta, .. } = self;
        let Self { spec_tint, sheen, sheen_tint, flatness, diff_trans, sampling_rates: _, .. } = self;
        [base_color, roughness, anisotropic, spec_trans, eta, spec_tint, sheen, sheen_tint, flatness, diff_trans]
    }
}

/// What turns the normals of a surface.
#[derive(Clone, Debug, PartialEq)]
pub enum Perturbation {
    /// Normals in the shading frame, (n + 1)/2.
    Normals(Texture),
    /// The luminance is how far the surface is displaced along its normal, in world units.
    Heights {
        /// A picture.
        texture: Texture,
        /// What it is multiplied with.
        scale: f64,
    },
}

impl Perturbation {
    /// Of which the perturbation is made.
    #[must_use]
    pub const fn texture(&self) -> &Texture {
        match self {
            Self::Normals(texture) | Self::Heights { texture, .. } => texture,
        }
    }
}

/// How rough a surface of microfacets is.
#[derive(Clone, Debug, PartialEq)]
pub struct Roughness {
    /// How the facets' normals are distributed.
    pub distribution: Microfacets,
    /// Along the direction of growing u.
    pub alpha_u: Texture,
    /// At right angles to it.
    pub alpha_v: Texture,
}

/// A distribution of the normals of microfacets.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Microfacets {
    /// Beckmann.
    #[default]
    Beckmann,
    /// Trowbridge–Reitz.
    Ggx,
}

impl Default for Bsdf {
    /// Black on both sides.
    fn default() -> Self {
        Self::lambertian(Rgb::ZERO, Rgb::ZERO)
    }
}

impl Bsdf {
    /// A Lambertian reflector with these reflectances in front and behind.
    #[must_use]
    pub const fn lambertian(front: Rgb, back: Rgb) -> Self {
        Self::Lambertian { front, back }
    }

    /// Whether light may pass to the other side.
    #[must_use]
    pub fn transmits(&self) -> bool {
        match self {
            Self::Dielectric { .. }
            | Self::ThinDielectric { .. }
            | Self::PrincipledThin(_)
            | Self::Mask { .. }
            | Self::Filter { .. }
            | Self::Null => true,
            Self::Principled(p) => p.transmits(),
            Self::Blend { of, .. } => of.iter().any(Self::transmits),
            Self::Perturbed { of, .. } => of.transmits(),
            Self::Lambertian { .. }
            | Self::Diffuse { .. }
            | Self::Conductor { .. }
            | Self::Plastic { .. }
            | Self::PolarizedPlastic { .. }
            | Self::TwoSided(_) => false,
        }
    }

    /// Whether some light goes straight on to the other side.
    pub(crate) fn passes_straight(&self) -> bool {
        match self {
            Self::ThinDielectric { .. } | Self::Mask { .. } | Self::Filter { .. } | Self::Null => true,
            Self::Blend { of, .. } => of.iter().any(Self::passes_straight),
            Self::Perturbed { of, .. } => of.passes_straight(),
            _ => false,
        }
    }

    /// Whether it matters where u grows: it is rougher one way than the other, or its normals are turned.
    pub(crate) fn has_directions(&self) -> bool {
        match self {
            Self::Conductor { roughness: Some(r), .. } | Self::Dielectric { roughness: Some(r), .. } => {
                r.alpha_u != r.alpha_v
            }
            Self::PolarizedPlastic { roughness, .. } => roughness.alpha_u != roughness.alpha_v,
            Self::TwoSided(of) | Self::Blend { of, .. } => of.iter().any(Self::has_directions),
            Self::Mask { of, .. } => of.has_directions(),
            Self::Perturbed { .. } => true,
            Self::Principled(p) => p.anisotropic != Texture::grey(0.0),
            Self::PrincipledThin(p) => p.anisotropic != Texture::grey(0.0),
            _ => false,
        }
    }

    /// All textures that it is made of.
    pub(crate) fn textures(&self) -> Vec<&Texture> {
        match self {
            Self::Lambertian { .. } | Self::Null => vec![],
            Self::Diffuse { reflectance } => vec![reflectance],
            Self::Conductor { specular, roughness, .. } => [vec![specular], rough(roughness)].concat(),
            Self::Dielectric { reflectance, transmittance, roughness, .. } => {
                [vec![reflectance, transmittance], rough(roughness)].concat()
            }
            Self::ThinDielectric { reflectance, transmittance, .. } => vec![reflectance, transmittance],
            Self::Plastic { diffuse, specular, roughness, .. } => [vec![diffuse, specular], rough(roughness)].concat(),
            Self::PolarizedPlastic { diffuse, specular, roughness, .. } => {
                vec![diffuse, specular, &roughness.alpha_u, &roughness.alpha_v]
            }
            Self::Filter { transmittance, .. } => vec![transmittance],
            Self::TwoSided(of) => of.iter().flat_map(Self::textures).collect(),
            Self::Blend { weight, of } => std::iter::once(weight).chain(of.iter().flat_map(Self::textures)).collect(),
            Self::Mask { opacity, of } => std::iter::once(opacity).chain(of.textures()).collect(),
            Self::Principled(p) => p.textures().to_vec(),
            Self::PrincipledThin(p) => p.textures().to_vec(),
            Self::Perturbed { by, of, .. } => std::iter::once(by.texture()).chain(of.textures()).collect(),
        }
    }
}

fn rough(roughness: &Option<Roughness>) -> Vec<&Texture> {
    roughness.as_ref().map_or_else(Vec::new, |r| vec![&r.alpha_u, &r.alpha_v])
}
