//! Meshes as files hold them, whatever the format.

use std::sync::Arc;

use glam::{DVec3, Vec2};

use crate::text::quoted;
use crate::{Attribute, Rgb};

/// The corner of a triangle has no texture coordinates, or no normal.
pub(crate) const NO_INDEX: u32 = u32::MAX;

/// The triangles of a file.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Mesh {
    /// The vertices as the file has them.
    pub(crate) positions: Vec<DVec3>,
    /// Three indices into `positions` for each triangle. A polygon of n corners is n − 2 triangles in a row.
    pub(crate) triangles: Vec<[u32; 3]>,
    /// Texture coordinates.
    pub(crate) uvs: Vec<Vec2>,
    /// For each triangle three indices into `uvs`, or [`NO_INDEX`]; empty if the file has none.
    pub(crate) uv_triangles: Vec<[u32; 3]>,
    /// Normals, of any length.
    pub(crate) normals: Vec<DVec3>,
    /// For each triangle three indices into `normals`, or [`NO_INDEX`]; empty if the file has none.
    pub(crate) normal_triangles: Vec<[u32; 3]>,
    /// What the file carries beside that.
    pub(crate) attributes: Vec<NamedValues>,
    /// The file says that its triangles shade with their own normals.
    pub(crate) face_normals: bool,
    /// What is legal but probably not meant: the line, and what is odd there.
    pub(crate) warnings: Vec<(u64, String)>,
}

/// Values that a mesh file gives a name.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NamedValues {
    /// As Mitsuba calls them, with `vertex_` or `face_` in front.
    pub(crate) name: String,
    /// One for each vertex or, by `of_faces`, for each triangle. Single numbers are greys.
    pub(crate) values: Vec<Rgb>,
    pub(crate) of_faces: bool,
}

/// The attributes of a mesh and where its triangles are in them.
#[derive(Debug, Default)]
pub(crate) struct Attributes {
    pub(crate) named: Vec<NamedValues>,
    /// The vertices of each triangle, in the order of the scene's.
    pub(crate) triangles: Vec<[u32; 3]>,
}

impl Attributes {
    /// All names.
    pub(crate) fn names(&self) -> Vec<&str> {
        self.named.iter().map(|n| n.name.as_str()).collect()
    }

    /// The values of that name, scaled. What is not finite or negative becomes zero, as in pictures.
    pub(crate) fn texture(&self, name: &str, scale: f32) -> Option<Arc<Attribute>> {
        let NamedValues { values, of_faces, .. } = self.named.iter().find(|n| n.name == name)?;
        let value = |v: Rgb| (v * scale).to_array().map(|v| if v.is_finite() { v.max(0.0) } else { 0.0 }).into();
        Some(Arc::new(if *of_faces {
            Attribute::Faces(values.iter().map(|v| value(*v)).collect())
        } else {
            let of = |i: u32| values.get(i as usize).map_or(Rgb::ZERO, |v| value(*v));
            Attribute::Corners(self.triangles.iter().map(|t| t.map(of)).collect())
        }))
    }
}

/// Why a file is no mesh.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct MeshError {
    /// The line, from 1; 0 if the place is no line.
    pub(crate) line: u64,
    /// What is wrong, with the text of the line.
    pub(crate) message: String,
    /// How to mend it; may be empty.
    pub(crate) help: String,
}

impl MeshError {
    /// Something is wrong with a file that is no text, or with all of it.
    pub(crate) fn of_file(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { line: 0, message: message.into(), help: help.into() }
    }

    /// Something is wrong with a line.
    pub(crate) fn at_line(line: u64, message: &str, text: &[u8]) -> Self {
        let text = quoted(&String::from_utf8_lossy(&text[..text.len().min(200)]));
        Self { line, message: format!("{message} in {text}"), help: String::new() }
    }
}
