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
    /// All light passes.
    Null,
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
            Self::Dielectric { .. } | Self::ThinDielectric { .. } | Self::Mask { .. } | Self::Null => true,
            Self::Blend { of, .. } => of.iter().any(Self::transmits),
            Self::Lambertian { .. }
            | Self::Diffuse { .. }
            | Self::Conductor { .. }
            | Self::Plastic { .. }
            | Self::TwoSided(_) => false,
        }
    }

    /// Whether it is rougher one way than the other, so that it matters where u grows.
    pub(crate) fn has_directions(&self) -> bool {
        match self {
            Self::Conductor { roughness: Some(r), .. } | Self::Dielectric { roughness: Some(r), .. } => {
                r.alpha_u != r.alpha_v
            }
            Self::TwoSided(of) | Self::Blend { of, .. } => of.iter().any(Self::has_directions),
            Self::Mask { of, .. } => of.has_directions(),
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
            Self::TwoSided(of) => of.iter().flat_map(Self::textures).collect(),
            Self::Blend { weight, of } => std::iter::once(weight).chain(of.iter().flat_map(Self::textures)).collect(),
            Self::Mask { opacity, of } => std::iter::once(opacity).chain(of.textures()).collect(),
        }
    }
}

fn rough(roughness: &Option<Roughness>) -> Vec<&Texture> {
    roughness.as_ref().map_or_else(Vec::new, |r| vec![&r.alpha_u, &r.alpha_v])
}
