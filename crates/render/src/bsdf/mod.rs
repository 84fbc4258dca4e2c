//! How surfaces scatter: diffusely (`diffuse`), or as metals, glass and coats do (`glossy`, with `fresnel` and `microfacet`).
//!
//! A diffuse surface is a reflectance, and all that the integrators' common way knows. All others are a [`Glossy`] apiece.

mod diffuse;
mod fresnel;
mod glossy;
mod microfacet;

pub(crate) use self::{
    diffuse::{eval_diffuse, sample_diffuse},
    glossy::{Glossy, Side},
};
