//! Wavefront OBJ meshes: what a renderer of surfaces needs of them, in double precision.
//!
//! Vertices (`v`), texture coordinates (`vt`), normals (`vn`) and faces (`f`) are read. Lines (`l`) and points (`p`) have no area and are passed over, like groups, materials and smoothing. All groups are one mesh.

mod polygon;
mod reader;
#[cfg(test)]
mod tests;

pub(crate) use reader::{Limits, read};

#[cfg(test)]
use crate::mesh::{Mesh, MeshError};
