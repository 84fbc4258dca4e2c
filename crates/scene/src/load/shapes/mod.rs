//! Shapes: their triangles, and what is attached to them.

mod mesh_file;
mod placement;
mod standard;

use vdf_geometry::Triangle;

use placement::Placement;

use super::document::Element;
use super::objects;
use super::properties::Object;
use super::{Loader, features, names};
use crate::{Boundary, Bsdf, Emitter, MediumId, Surface};
use crate::{Rgb, SceneError};

/// Reads a shape into the scene.
pub(super) fn read<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<(), SceneError> {
    let mut object = Object::new(loader, element, features::kinds("shape"))?;
    let to_world = object.world_transform(loader)?;
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
            mesh_file::obj(loader, name, object.place_of("filename"), &mut placed)?;
        }
        "cube" => {
            object.boolean("face_normals", false)?;
            standard::cube(&mut placed);
        }
        _ => standard::rectangle(&mut placed),
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
        None if radiance.is_some() && has_medium => Err(at.error(
            "an area emitter on the boundary of a medium",
            "give the light its own shape, with a diffuse BSDF or none",
        )),
        // The Blender add-on writes every area light so. In Mitsuba one can look through such a light; here it is black behind its
        // emission. The pictures are the same unless something is behind the light, or is seen or lit through its back.
        None if radiance.is_some() => {
            loader.warn(
                at,
                "an area emitter with a null BSDF: Mitsuba lets light through it, here it is opaque and black",
            );
            attach(loader, element, triangles, Some(objects::default_bsdf(true)), radiance, [None, None])
        }
        None if has_medium => {
            loader.boundaries.push(Boundary { triangles, interior, exterior });
            loader.boundary_elements.push(element);
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

fn area_emitter<'a>(loader: &mut Loader<'a>, object: &mut Object<'a>) -> Result<Option<Rgb>, SceneError> {
    let Some(nested) = object.at_most_one("emitter")? else { return Ok(None) };
    let radiance = objects::area_emitter(loader, nested.object)?;
    if !loader.area_emitters.insert(nested.object.serial) {
        loader.warn(nested.at, "several shapes share this emitter: Mitsuba refuses that; here each of them shines");
    }
    Ok(Some(radiance))
}
