//! Shapes whose triangles are in a file.

use super::super::Loader;
use super::super::document::Place;
use super::placement::Placement;
use crate::SceneError;
use crate::obj::{self, Limits};

/// The mesh files of a scene have at most this many bytes together; one that is named twice counts twice.
const MAX_MESH_BYTES: u64 = 8 << 30;
/// All shapes together have at most this many triangles.
const MAX_TRIANGLES: usize = 1 << 28;

/// A Wavefront OBJ file, all its groups as one mesh.
pub(super) fn obj(loader: &mut Loader<'_>, name: &str, at: &Place, placed: &mut Placement) -> Result<(), SceneError> {
    let path = loader.search.mesh(loader.source, name);
    let unreadable = |e: std::io::Error| {
        at.error(
            format!("cannot read \"{}\": {e}", path.display()),
            "the path is relative to the folder of the scene file, or to a folder of a <path>",
        )
    };
    let left = MAX_MESH_BYTES.saturating_sub(loader.mesh_bytes);
    let (mut input, size) = loader.source.open(&path, left).map_err(unreadable)?;
    let limits = Limits { triangles: MAX_TRIANGLES.saturating_sub(loader.triangles), ..Limits::default() };
    let mesh = obj::read(&mut *input, &limits)
        .map_err(|e| at.error(format!("{}:{}: {}", path.display(), e.line, e.message), e.help))?;
    loader.mesh_bytes = loader.mesh_bytes.saturating_add(size);
    for (line, message) in &mesh.warnings {
        loader.warn(at, &format!("{}:{line}: {message}", path.display()));
    }
    let vertex = |index: u32| mesh.positions.get(index as usize).copied().unwrap_or_default();
    placed.triangles.reserve_exact(mesh.triangles.len());
    for triangle in &mesh.triangles {
        placed.push(triangle.map(vertex));
    }
    if placed.triangles.is_empty() {
        return Err(at.error(format!("{}: the mesh has no faces", path.display()), "lines and points have no area"));
    }
    loader.triangles += placed.triangles.len();
    Ok(())
}
