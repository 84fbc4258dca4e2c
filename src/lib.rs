//! `vdf` in one crate: the voxel, distance field and render crates under one roof.
//!
//! See `docs/ARCHITECTURE.md` for how they fit together.

pub use vdf_distfield as distfield;
pub use vdf_render as render;
pub use vdf_voxel as voxel;
