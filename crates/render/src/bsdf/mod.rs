//! BSDFs: how surfaces scatter. Plain Lambertian ones are `diffuse`, and the integrators call it directly; all others are a [`Material`].
//!
//! *Frame.* Directions of a material are in the frame of the shading normal, z, and point away from the surface: `wi` to where the path comes from, `wo` to
//! where it goes on, which is where light comes from. Radiance that is refracted into a denser material is compressed into a smaller cone; a path that is
//! followed from the camera has to undo that, by the square of the index of refraction \[Veach1997, 5.2\].
//!
//! *Guarantee.* [`Material::pdf`] is the density of [`Material::sample`] but for its delta lobes, and what a sample is worth is BSDF times cosine over that
//! density, so every estimate is unbiased; tests hold each against χ², energy and reciprocity.

mod diffuse;
mod fresnel;
mod material;
mod microfacet;
mod perturbed;
mod plastic;
mod polarized_plastic;
mod prepared;
mod principled;
mod principled_thin;
#[cfg(test)]
mod tests;

pub(crate) use self::{
    diffuse::{eval_diffuse, sample_diffuse},
    material::{Lobe, Material, MaterialPoint},
    prepared::Prepared,
};
