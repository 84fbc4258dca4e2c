//! The scene model: what a scene file describes, resolved, checked and ready to render.

mod model;

pub use model::{
    Boundary, Bsdf, Emitter, FilmSettings, IntegratorSettings, Medium, MediumId, PerspectiveSensor, Phase, PixelRect,
    ReconstructionFilter, Scene, Surface,
};
