//! The scene model: what a scene file describes, resolved, checked and ready to render.

mod builtin;
mod checksum;
mod generate;
mod load;
mod model;
mod source;

pub use builtin::{DEFAULT_SCENE, builtin, builtin_names};
pub use generate::{GeneratedFile, GeneratedScene, generated};
pub use load::LoadOptions;
pub use model::{
    Boundary, Bsdf, Emitter, FilmSettings, IntegratorSettings, Medium, MediumId, PerspectiveSensor, Phase, PixelRect,
    ReconstructionFilter, Scene, Surface,
};
pub use source::{EmbeddedFile, SceneSource};
