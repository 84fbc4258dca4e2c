//! Shapes: their triangles, and what is attached to them.

use std::io::BufReader;
use std::path::Path;

use glam::{DMat4, DVec3};
use vdf_geometry::Triangle;

use super::document::{Element, Place, sibling};
use super::objects;
use super::properties::Object;
use super::{Loader, names};
use crate::{Boundary, Bsdf, Emitter, MediumId, Surface};
use crate::{Rgb, SceneError};

/// Reads a shape into the scene.
pub(super) fn read<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<(), SceneError> {
    let mut object = Object::new(loader, element, &["obj", "cube", "rectangle"])?;
    let to_world = object.world_transform()?;
    let flip = object.boolean("flip_normals", false)?;
    let mut placed = Placement::new(to_world);
    match object.kind() {
        "obj" => {
            object.boolean("flip_tex_coords", true)?;
            if !object.boolean("face_normals", false)? {
                loader.warn(
                    &element.at,
                    "the mesh has no face_normals=true: vdf shades with geometric normals, Mitsuba would smooth them",
                );
            }
            let name = object
                .string("filename")?
                .ok_or_else(|| object.error("no filename", "add <string name=\"filename\" …>"))?;
            obj(loader, name, object.place_of("filename"), &mut placed)?;
        }
        "cube" => {
            object.boolean("face_normals", false)?;
            cube(&mut placed);
        }
        _ => rectangle(&mut placed),
    }
    if !placed.triangles.iter().all(Triangle::is_finite) {
        return Err(
            object.error("its vertices are too large for single precision after to_world", "scale the scene down")
        );
    }
    if let Some(message) = placed.lost_shape() {
        return Err(object.error(message, "move the whole scene closer to the origin, or make the shape larger"));
    }
    let mut triangles = placed.triangles;
    if to_world.determinant() < 0.0 {
        loader.warn(
            &element.at,
            "to_world mirrors the shape: check which side its normals point to (flip_normals turns them)",
        );
    }
    let (interior, exterior) = media(loader, &mut object)?;
    let radiance = area_emitter(loader, &mut object)?;
    let bsdf = match object.at_most_one("bsdf")? {
        Some(nested) => objects::bsdf(loader, nested.object)?,
        None => Some(objects::default_bsdf(radiance.is_some())),
    };
    // As Mitsuba 3.9.1 was seen to do: the winding of the moved vertices decides on which side a medium is, and how a
    // mesh shades; but cube and rectangle shade with their own normals, which a mirroring does not turn round.
    let own_normals = bsdf.is_some() && object.kind() != "obj";
    let turned_back = own_normals && to_world.determinant() < 0.0;
    if flip != turned_back {
        for triangle in &mut triangles {
            triangle.vertices.swap(1, 2);
        }
    }
    object.finish()?;
    attach(loader, element, triangles, bsdf, radiance, [interior, exterior])
}

fn attach<'a>(
    loader: &mut Loader<'a>,
    element: &'a Element,
    triangles: Vec<Triangle>,
    bsdf: Option<Bsdf>,
    radiance: Option<Rgb>,
    [interior, exterior]: [Option<MediumId>; 2],
) -> Result<(), SceneError> {
    let at = &element.at;
    let has_medium = interior.is_some() || exterior.is_some();
    match bsdf {
        Some(_) if has_medium => Err(at.error(
            "a shape with an interior or exterior medium but without a null BSDF is opaque",
            "add <bsdf type=\"null\"/> to let light through; without a BSDF Mitsuba 3 makes it diffuse 0.5",
        )),
        None if radiance.is_some() => Err(at.error(
            "an area emitter on a shape with a null BSDF",
            "give the light its own shape, with a diffuse BSDF or none",
        )),
        None if has_medium => {
            loader.boundaries.push(Boundary { triangles, interior, exterior });
            loader.boundary_places.push(at);
            Ok(())
        }
        None => {
            // Such a shape does not even change the medium, so nothing is left of it.
            loader.warn(at, "a null shape without a medium has no effect");
            Ok(())
        }
        Some(bsdf) => {
            if radiance.is_some() {
                loader.emitters.push(Emitter::Area { surface: loader.surfaces.len() });
            }
            loader.surfaces.push(Surface { triangles, bsdf, radiance });
            Ok(())
        }
    }
}

fn media<'a>(
    loader: &mut Loader<'a>,
    object: &mut Object<'a>,
) -> Result<(Option<MediumId>, Option<MediumId>), SceneError> {
    let (mut interior, mut exterior) = (None, None);
    for nested in object.nested("medium") {
        let slot = match nested.name {
            Some("interior") => &mut interior,
            Some("exterior") => &mut exterior,
            other => {
                return Err(nested.at.error(
                    format!("the medium of a shape is named \"{}\"", other.unwrap_or_default()),
                    format!(
                        "write name=\"interior\" or name=\"exterior\" on it; Mitsuba ignores any other; {}",
                        names::suggest(other.unwrap_or_default(), &["interior", "exterior"])
                    ),
                ));
            }
        };
        if slot.is_some() {
            return Err(nested.at.error(format!("{} has two such media", object.describe()), "remove one"));
        }
        *slot = Some(objects::medium(loader, nested.object)?);
    }
    Ok((interior, exterior))
}

fn area_emitter<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Option<Rgb>, SceneError> {
    let Some(nested) = object.at_most_one("emitter")? else { return Ok(None) };
    let mut emitter = Object::new(loader, nested.object, &["area"])?;
    let radiance = emitter.colour("radiance", 1.0, f64::from(f32::MAX))?;
    objects::sampling_weight(&mut emitter)?;
    emitter.finish()?;
    Ok(Some(radiance))
}

/// A shape may be displaced by its rounding to single precision by this share of its longest side.
const MOST_LOST: f64 = 1.0 / 256.0;

/// The triangles of a shape at their place in the world, rounded to single precision, and what that did to them.
struct Placement {
    to_world: DMat4,
    triangles: Vec<Triangle>,
    /// Bounds before the rounding.
    low: DVec3,
    high: DVec3,
    /// The largest change of a coordinate by rounding.
    lost: f64,
}

impl Placement {
    const fn new(to_world: DMat4) -> Self {
        Self { to_world, triangles: Vec::new(), low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, lost: 0.0 }
    }

    fn push(&mut self, corners: [DVec3; 3]) {
        let vertices = corners.map(|p| {
            let p = self.to_world.transform_point3(p);
            (self.low, self.high) = (self.low.min(p), self.high.max(p));
            let rounded = p.as_vec3();
            self.lost = self.lost.max((rounded.as_dvec3() - p).abs().max_element());
            rounded
        });
        self.triangles.push(Triangle { vertices });
    }

    /// What is wrong if the shape is not the one that was meant any more: far from the origin the steps of single precision are coarse.
    fn lost_shape(&self) -> Option<String> {
        let longest = (self.high - self.low).max_element();
        // A point has no shape to lose.
        (longest > 0.0 && self.lost > longest * MOST_LOST).then(|| {
            format!(
                "precision exhausted: single precision moves its vertices by up to {:.1e}, and its longest side is {longest:.1e}",
                self.lost
            )
        })
    }
}

/// [−1, 1]³, normals outward.
fn cube(placed: &mut Placement) {
    for axis in 0..3 {
        for sign in [-1.0, 1.0] {
            let corner = |u: f64, v: f64| {
                let mut p = [0.0; 3];
                p[axis] = sign;
                // (u, v, axis) is right-handed; for the lower face u is turned round to look outward.
                p[(axis + 1) % 3] = u * sign;
                p[(axis + 2) % 3] = v;
                DVec3::from_array(p)
            };
            let [a, b, c, d] = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            placed.push([a, b, c]);
            placed.push([a, c, d]);
        }
    }
}

/// [−1, 1]² at z = 0, normal +Z.
fn rectangle(placed: &mut Placement) {
    let [a, b, c, d] = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
    placed.push([a, b, c]);
    placed.push([a, c, d]);
}

/// A Wavefront OBJ file, all its groups as one mesh.
fn obj(loader: &Loader<'_>, name: &str, at: &Place, placed: &mut Placement) -> Result<(), SceneError> {
    let path = sibling(loader.source.path(), name);
    let bytes = loader.source.read(&path).map_err(|e| {
        at.error(
            format!("cannot read \"{}\": {e}", path.display()),
            "the path is relative to the folder of the scene file",
        )
    })?;
    let fail = |message: String| at.error(format!("{}: {message}", path.display()), "");
    let text = String::from_utf8_lossy(&bytes);
    check_indices(&text, &path, at)?;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
    let (models, _) = tobj::load_obj_buf(&mut BufReader::new(text.as_bytes()), &options, no_materials)
        .map_err(|e| fail(e.to_string()))?;
    for model in &models {
        let vertex = |index: u32| {
            let start = usize::try_from(index).ok()?.checked_mul(3)?;
            let p = model.mesh.positions.get(start..start.checked_add(3)?)?;
            Some(DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2])))
        };
        for face in model.mesh.indices.chunks(3) {
            let &[a, b, c] = face else { return Err(fail("a face without three vertices".to_owned())) };
            let (Some(a), Some(b), Some(c)) = (vertex(a), vertex(b), vertex(c)) else {
                return Err(fail("a face index is out of range".to_owned()));
            };
            if !(a.is_finite() && b.is_finite() && c.is_finite()) {
                return Err(fail("a vertex is not finite".to_owned()));
            }
            placed.push([a, b, c]);
        }
    }
    if placed.triangles.is_empty() {
        return Err(fail("the mesh has no faces".to_owned()));
    }
    Ok(())
}

/// `tobj` counts negative indices from the end, Mitsuba refuses them: a scene must load in both.
fn check_indices(text: &str, path: &Path, at: &Place) -> Result<(), SceneError> {
    for (number, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        if words.next() == Some("f") && words.any(|w| w.split('/').any(|i| i.starts_with('-'))) {
            return Err(at.error(
                format!("{}:{}: negative face indices are not supported", path.display(), number + 1),
                "count from the first vertex of the file, from 1; Mitsuba 3 refuses negative indices, too",
            ));
        }
    }
    Ok(())
}
