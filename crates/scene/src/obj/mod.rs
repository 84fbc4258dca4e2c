//! Wavefront OBJ meshes: what a renderer of surfaces needs of them, in double precision.
//!
//! Vertices (`v`) and faces (`f`) are read. Texture coordinates and normals are counted, so that a face cannot name one that is not
//! there. Lines (`l`) and points (`p`) have no area and are passed over, like groups, materials and smoothing. All groups are one mesh.

mod polygon;
mod reader;
#[cfg(test)]
mod tests;

pub(crate) use reader::{Limits, read};

use glam::DVec3;

/// The triangles of a file.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    /// The vertices as the file has them.
    pub(crate) positions: Vec<DVec3>,
    /// Three indices into `positions` for each triangle. A polygon of n corners is n − 2 triangles in a row.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// What is legal but probably not meant: the line, and what is odd there.
    pub(crate) warnings: Vec<(u64, String)>,
}

/// Why a file is no mesh.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct MeshError {
    /// The line, from 1.
    pub(crate) line: u64,
    /// What is wrong, with the text of the line.
    pub(crate) message: String,
    /// How to mend it; may be empty.
    pub(crate) help: String,
}
