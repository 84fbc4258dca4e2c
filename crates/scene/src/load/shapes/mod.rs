//! Shapes: their triangles, and what is attached to them.

mod curved;
mod mesh_file;
mod placement;
mod standard;

use std::sync::Arc;

use glam::DMat4;
use vdf_geometry::{CurvedKind, CurvedShape, Triangle};

use mesh_file::{Format, MeshOptions};
use placement::Placement;

use super::document::Element;
use super::properties::Object;
use super::{Loader, features, materials, names, objects};
use crate::SceneError;
use crate::{Boundary, Bsdf, Emitter, MediumId, MeshAttributes, Surface, Texture};

/// What a shape is made of.
#[derive(Debug, Default)]
struct Geometry {
    triangles: Vec<Triangle>,
    attributes: MeshAttributes,
    curved: Option<CurvedShape>,
}

/// Shapes that instances may make: a line of XML makes thousands, and each takes a kilobyte.
const MOST_COPIES: usize = 100_000;

/// Reads a shape into the scene. A `shapegroup` is read where an `instance` refers to it, once for each.
pub(super) fn read<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<(), SceneError> {
    let mut object = Object::new(loader, element, features::kinds("shape"))?;
    match object.kind() {
        "shapegroup" => Ok(()),
        // Mitsuba joins the meshes in it into one; they look the same.
        "merge" => {
            for member in object.nested("shape") {
                if member.object.attribute("type").is_some_and(|kind| kind.value == "merge") {
                    return Err(member.at.error("a merge inside of a merge", "put the shapes into one"));
                }
                read(loader, member.object)?;
            }
            object.finish()
        }
        "instance" => {
            let to_world = object.world_transform(loader)?;
            let Some(group) = object.at_most_one("shape")? else {
                return Err(object.error("no shapegroup", "refer to one, with <ref id=\"…\"/>"));
            };
            object.finish()?;
            let mut members = Object::new(loader, group.object, &["shapegroup"])?;
            let shapes = members.nested("shape");
            loader.copies += shapes.len();
            if loader.copies > MOST_COPIES {
                let message = format!("the instances up to here make more than {MOST_COPIES} shapes");
                return Err(element
                    .at
                    .error(message, "an instance is a copy here: join the shapes of a group into one mesh"));
            }
            for member in shapes {
                read_at(loader, member.object, to_world)?;
            }
            members.finish()
        }
        _ => read_at(loader, element, DMat4::IDENTITY),
    }
}

/// Reads a shape that is no instance, and moves it by `outer` when it is where its own transform puts it.
fn read_at<'a>(loader: &mut Loader<'a>, element: &'a Element, outer: DMat4) -> Result<(), SceneError> {
    let mut object = Object::new(loader, element, features::kinds("shape"))?;
    if matches!(object.kind(), "shapegroup" | "instance" | "merge") {
        return Err(object.error("groups and instances do not nest", "put the shapes themselves into the group"));
    }
    let to_world = outer * object.world_transform(loader)?;
    let flip = object.boolean("flip_normals", false)?;
    // Of derivatives, which are not taken here.
    object.float("silhouette_sampling_weight")?;
    let is_mirrored = to_world.determinant() < 0.0;
    let curved = curved::read(&mut object, to_world, flip)?;
    let placed = if curved.is_none() {
        triangles(loader, &mut object, Placement::new(to_world))?
    } else {
        Placement::new(to_world)
    };
    if is_mirrored && curved.is_none() {
        loader.warn(
            &element.at,
            "to_world mirrors the shape: check which side its normals point to (flip_normals turns them)",
        );
    }
    let (interior, exterior) = media(loader, &mut object)?;
    let mut placed = placed;
    let mut named = std::mem::take(&mut placed.named);
    if flip {
        named.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    }
    loader.attributes = Some(named);
    let looks = looks(loader, &mut object);
    loader.attributes = None;
    let (bsdf, radiance) = looks?;
    // As Mitsuba 3.9.1 was seen to do: the winding of the moved vertices decides on which side a medium is, and how a
    // mesh shades; but cube and rectangle shade with their own normals, which a mirroring does not turn round.
    let own_normals = bsdf != Bsdf::Null && matches!(object.kind(), "cube" | "rectangle");
    if flip != (own_normals && is_mirrored) {
        placed.turn();
    }
    if flip {
        placed.attributes.normals.iter_mut().flatten().for_each(|n| *n = -*n);
    }
    object.finish()?;
    let geometry = Geometry { triangles: placed.triangles, attributes: placed.attributes, curved };
    attach(loader, element, geometry, bsdf, radiance, [interior, exterior])
}

/// How the shape scatters, and what it emits.
fn looks<'a>(loader: &mut Loader<'a>, object: &mut Object<'a>) -> Result<(Bsdf, Option<Texture>), SceneError> {
    let radiance = area_emitter(loader, object)?;
    let bsdf = match object.at_most_one("bsdf")? {
        Some(nested) => materials::bsdf(loader, nested.object)?,
        None => materials::default_bsdf(radiance.is_some()),
    };
    Ok((bsdf, radiance))
}

/// The triangles of a shape that is not curved.
fn triangles<'a>(
    loader: &mut Loader<'a>,
    object: &mut Object<'a>,
    mut placed: Placement,
) -> Result<Placement, SceneError> {
    match object.kind() {
        "cube" => {
            object.boolean("face_normals", false)?;
            standard::cube(&mut placed);
        }
        "rectangle" => standard::rectangle(&mut placed),
        kind => {
            let format = match kind {
                "ply" => Format::Ply,
                "serialized" => {
                    let index = object.integer("shape_index", 0, 0..=i64::from(u32::MAX))?;
                    Format::Serialized(usize::try_from(index).unwrap_or(usize::MAX))
                }
                _ => Format::Obj,
            };
            let face_normals = object.boolean("face_normals", false)?;
            let flip_v = object.boolean("flip_tex_coords", kind == "obj")?;
            let name = object
                .string("filename")?
                .ok_or_else(|| object.error("no filename", "add <string name=\"filename\" …>"))?;
            let options = MeshOptions { format, face_normals, flip_v };
            mesh_file::read(loader, name, object.place_of("filename"), options, &mut placed)?;
        }
    }
    if !placed.triangles.iter().all(Triangle::is_finite) {
        return Err(
            object.error("its vertices are too large for single precision after to_world", "scale the scene down")
        );
    }
    if let Some(message) = placed.lost_shape() {
        return Err(object.error(message, "move the whole scene closer to the origin, or make the shape larger"));
    }
    Ok(placed)
}

fn attach<'a>(
    loader: &mut Loader<'a>,
    element: &'a Element,
    geometry: Geometry,
    bsdf: Bsdf,
    radiance: Option<Texture>,
    [interior, exterior]: [Option<MediumId>; 2],
) -> Result<(), SceneError> {
    let at = &element.at;
    let has_medium = interior.is_some() || exterior.is_some();
    if bsdf == Bsdf::Null && radiance.is_some() {
        if has_medium {
            return Err(at.error(
                "an area emitter on the boundary of a medium",
                "give the light its own shape, with a diffuse BSDF or none",
            ));
        }
        // The Blender add-on writes every area light so. In Mitsuba one can look through such a light; here it is black behind its
        // emission. The pictures are the same unless something is behind the light, or is seen or lit through its back.
        loader.warn(at, "an area emitter with a null BSDF: Mitsuba lets light through it, here it is opaque and black");
        return attach(loader, element, geometry, materials::default_bsdf(true), radiance, [None, None]);
    }
    if bsdf == Bsdf::Null && !has_medium {
        // Such a shape does not even change the medium, so nothing is left of it.
        loader.warn(at, "a null shape without a medium has no effect");
        return Ok(());
    }
    if has_medium && !bsdf.transmits() {
        loader.warn(
            at,
            "a medium inside of an opaque shape is not seen: <bsdf type=\"null\"/> lets light through; without a BSDF Mitsuba 3 makes it diffuse 0.5",
        );
    } else if has_medium {
        let (triangles, curved) = (geometry.triangles.clone(), geometry.curved);
        if curved.is_some_and(|c| c.kind() != CurvedKind::Sphere) {
            let help = "of the curved shapes only a sphere encloses a medium; use a mesh that is closed";
            return Err(at.error("the medium boundary is open: a disk or a cylinder has rims", help));
        }
        // `interior` is behind the normals, which a sphere may have turned round.
        let turned = curved.is_some_and(|c| c.is_flipped());
        let (interior, exterior) = if turned { (exterior, interior) } else { (interior, exterior) };
        loader.boundaries.push(Boundary { triangles, curved, interior, exterior });
        loader.boundary_elements.push(element);
    }
    if bsdf == Bsdf::Null {
        return Ok(());
    }
    if radiance.is_some() {
        loader.emitters.push(Emitter::Area { surface: loader.surfaces.len() });
    }
    let Geometry { triangles, mut attributes, curved } = geometry;
    let mut textures = bsdf.textures().into_iter().chain(&radiance);
    if textures.all(|t| matches!(t, Texture::Constant(_))) && !bsdf.has_directions() {
        attributes.uvs = Vec::new();
    }
    loader.surfaces.push(Surface { triangles, curved, attributes: Arc::new(attributes), bsdf, radiance });
    Ok(())
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
            Some(other) => {
                return Err(nested.at.error(
                    format!("the medium of a shape is named \"{other}\""),
                    format!(
                        "write name=\"interior\" or name=\"exterior\" on it; Mitsuba ignores any other; {}",
                        names::suggest(other, &["interior", "exterior"])
                    ),
                ));
            }
            None => {
                let message = "a medium of a shape without a name is ignored, as in Mitsuba: \
                               write name=\"interior\" or name=\"exterior\" on it";
                loader.warn(nested.at, message);
                // Read all the same, so that it cannot hide a mistake.
                objects::medium(loader, nested.object)?;
                continue;
            }
        };
        if slot.is_some() {
            return Err(nested.at.error(format!("{} has two such media", object.describe()), "remove one"));
        }
        *slot = Some(objects::medium(loader, nested.object)?);
    }
    Ok((interior, exterior))
}

fn area_emitter<'a>(loader: &mut Loader<'a>, object: &mut Object<'a>) -> Result<Option<Texture>, SceneError> {
    let Some(nested) = object.at_most_one("emitter")? else { return Ok(None) };
    let radiance = objects::area_emitter(loader, nested.object)?;
    if !loader.area_emitters.insert(nested.object.serial) {
        loader.warn(nested.at, "several shapes share this emitter: Mitsuba refuses that; here each of them shines");
    }
    Ok(Some(radiance))
}
