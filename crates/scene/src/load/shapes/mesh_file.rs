//! Shapes whose triangles are in a file.

use std::collections::HashMap;
use std::io::BufRead;

use glam::{DMat3, DVec3, Vec2, Vec3};
use vdf_geometry::Triangle;

use super::super::Loader;
use super::super::document::Place;
use super::placement::Placement;
use crate::mesh::{Attributes, Mesh, MeshError, NO_INDEX};
use crate::obj::{self, Limits};
use crate::{MeshAttributes, SceneError, ply, serialized};

/// The mesh files of a scene have at most this many bytes together; one that is named twice counts twice.
const MAX_MESH_BYTES: u64 = 8 << 30;
/// All shapes together have at most this many triangles.
const MAX_TRIANGLES: usize = 1 << 28;
/// A corner's normal that is so close to the triangle's is that.
const SAME_NORMAL: f32 = 1e-6;

/// How a mesh file is read.
#[derive(Clone, Copy, Debug)]
pub(super) enum Format {
    /// Wavefront OBJ, all its groups as one mesh.
    Obj,
    /// PLY.
    Ply,
    /// A mesh with this number in a file of Mitsuba's own.
    Serialized(usize),
}

/// What the user says of a mesh beside where it is.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeshOptions {
    pub(super) format: Format,
    /// Each triangle shades with its own normal.
    pub(super) face_normals: bool,
    /// v becomes 1 − v.
    pub(super) flip_v: bool,
}

/// Reads the triangles of a file, and what their corners carry.
pub(super) fn read(
    loader: &mut Loader<'_>,
    name: &str,
    at: &Place,
    options: MeshOptions,
    placed: &mut Placement,
) -> Result<(), SceneError> {
    let path = loader.search.mesh(loader.source, name);
    let unreadable = |e: std::io::Error| {
        at.error(
            format!("cannot read \"{}\": {e}", path.display()),
            "the path is relative to the folder of the scene file, or to a folder of a <path>",
        )
    };
    let left = MAX_MESH_BYTES.saturating_sub(loader.mesh_bytes);
    let (mut input, size) = loader.source.open(&path, left).map_err(unreadable)?;
    let most = MAX_TRIANGLES.saturating_sub(loader.triangles);
    let parsed = parse(&mut *input, options.format, most);
    let mesh = parsed.map_err(|MeshError { line, message, help }| {
        let place = if line > 0 { format!("{}:{line}", path.display()) } else { path.display().to_string() };
        at.error(format!("{place}: {message}"), help)
    })?;
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
    placed.attributes = attributes(&mesh, options, placed);
    if !mesh.attributes.is_empty() {
        placed.named = Attributes { named: mesh.attributes, triangles: mesh.triangles };
    }
    Ok(())
}

fn parse(input: &mut dyn BufRead, format: Format, most: usize) -> Result<Mesh, MeshError> {
    match format {
        Format::Obj => obj::read(input, &Limits { triangles: most, ..Limits::default() }),
        Format::Ply => ply::read(input, most),
        Format::Serialized(index) => serialized::read(input, index, most),
    }
}

fn attributes(mesh: &Mesh, options: MeshOptions, placed: &Placement) -> MeshAttributes {
    let uv = |index: u32| {
        let uv = mesh.uvs.get(index as usize).copied().unwrap_or_default();
        if options.flip_v { Vec2::new(uv.x, 1.0 - uv.y) } else { uv }
    };
    let uvs = mesh.uv_triangles.iter().map(|t| t.map(uv)).collect();
    let normals = if options.face_normals || mesh.face_normals {
        Vec::new()
    } else if mesh.normal_triangles.is_empty() {
        smooth_normals(mesh, &placed.triangles)
    } else {
        given_normals(mesh, placed)
    };
    let is_flat = |(t, normals): (&Triangle, &[Vec3; 3])| {
        let own = t.area_normal().normalize_or_zero().as_vec3();
        normals.iter().all(|n| (*n - own).abs().max_element() < SAME_NORMAL)
    };
    let all_flat = placed.triangles.iter().zip(&normals).all(is_flat);
    MeshAttributes { normals: if all_flat { Vec::new() } else { normals }, uvs }
}

/// The normals of the file, carried by the transform. Where there is none, or zero, the triangle's own.
fn given_normals(mesh: &Mesh, placed: &Placement) -> Vec<[Vec3; 3]> {
    let carried = DMat3::from_mat4(placed.to_world()).inverse().transpose();
    let of = |(triangle, indices): (&Triangle, &[u32; 3])| {
        let own = triangle.area_normal().normalize_or_zero();
        indices.map(|i| {
            let given = if i == NO_INDEX { None } else { mesh.normals.get(i as usize) };
            let carried = given.and_then(|n| (carried * n.normalize_or_zero()).try_normalize());
            carried.unwrap_or(own).as_vec3()
        })
    };
    placed.triangles.iter().zip(&mesh.normal_triangles).map(of).collect()
}

/// A normal for each vertex: the mean of its triangles' normals, each weighted with its angle there \[Thuermer1998\], as Mitsuba does. Vertices
/// with different texture coordinates are different ones.
fn smooth_normals(mesh: &Mesh, triangles: &[Triangle]) -> Vec<[Vec3; 3]> {
    let has_uvs = !mesh.uv_triangles.is_empty();
    let key = |t: usize, corner: usize| {
        let uv = if has_uvs { mesh.uv_triangles[t][corner] } else { NO_INDEX };
        (mesh.triangles[t][corner], uv)
    };
    // Without texture coordinates a vertex is its index.
    let mut numbers: HashMap<(u32, u32), usize> = HashMap::new();
    let mut number_of = |key: (u32, u32)| {
        if has_uvs {
            let next = numbers.len();
            *numbers.entry(key).or_insert(next)
        } else {
            key.0 as usize
        }
    };
    let corners: Vec<[usize; 3]> =
        (0..triangles.len()).map(|t| [0, 1, 2].map(|corner| number_of(key(t, corner)))).collect();
    let count = corners.iter().flatten().max().map_or(0, |most| most + 1);
    let mut sums = vec![DVec3::ZERO; count];
    for (triangle, corners) in triangles.iter().zip(&corners) {
        let v = triangle.vertices_f64();
        let Some(normal) = triangle.area_normal().try_normalize() else { continue };
        for i in 0..3 {
            let (a, b) = (v[(i + 1) % 3] - v[i], v[(i + 2) % 3] - v[i]);
            sums[corners[i]] += normal * a.cross(b).length().atan2(a.dot(b));
        }
    }
    let of = |(triangle, corners): (&Triangle, &[usize; 3])| {
        let own = triangle.area_normal().normalize_or_zero();
        corners.map(|i| sums[i].normalize_or(own).as_vec3())
    };
    triangles.iter().zip(&corners).map(of).collect()
}
