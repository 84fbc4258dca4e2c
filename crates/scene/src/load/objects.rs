//! Media and emitters.

use glam::{DMat3, DMat4, DVec3, DVec4};

use super::document::Element;
use super::properties::{Nested, Object};
use super::{Loader, camera, features, textures, volumes};
use crate::{Albedo, Emitter, Medium, MediumId, Phase};
use crate::{SceneError, Slide, Texture};

/// The medium's index; each is read once, however often it is referred to.
pub(super) fn medium<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<MediumId, SceneError> {
    if let Some(&id) = loader.medium_of_element.get(&element.serial) {
        return Ok(id);
    }
    let mut object = Object::new(loader, element, features::kinds("medium"))?;
    // How light is looked for, not what there is.
    object.boolean("sample_emitters", true)?;
    object.boolean("has_spectral_extinction", true)?;
    let albedo = match object.volume_element("albedo")? {
        Some(volume) => volumes::albedo(loader, volume)?,
        None => Albedo::Constant(object.reflectance(loader, "albedo", 0.75)?),
    };
    let scale = object.float_where("scale", 1.0, |v| v >= 0.0, "at least 0")?;
    let sigma_t = volumes::extinction(loader, &mut object, scale)?;
    let phase = match object.at_most_one("phase")? {
        Some(nested) => phase(loader, nested.object)?,
        None => Phase::Isotropic,
    };
    object.finish()?;
    let id = MediumId(u32::try_from(loader.media.len()).unwrap_or(u32::MAX));
    loader.media.push(Medium { sigma_t, albedo, phase });
    loader.medium_of_element.insert(element.serial, id);
    Ok(id)
}

/// A phase function.
pub(super) fn phase<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Phase, SceneError> {
    phase_within(loader, element, false)
}

fn phase_within<'a>(loader: &Loader<'a>, element: &'a Element, in_blend: bool) -> Result<Phase, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("phase"))?;
    let phase = match object.kind() {
        "hg" => Phase::HenyeyGreenstein {
            g: object.float_where("g", 0.8, |g| g > -1.0 && g < 1.0, "between -1 and 1, both excluded")?,
        },
        "rayleigh" => Phase::Rayleigh,
        "blendphase" if in_blend => return Err(object.error("blends do not nest", "blend two lobes")),
        "blendphase" => blend(loader, &mut object)?,
        _ => Phase::Isotropic,
    };
    object.finish()?;
    Ok(phase)
}

/// Two lobes.
fn blend<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Phase, SceneError> {
    if !object.has("weight") {
        return Err(object.error("no \"weight\"", "add <float name=\"weight\" …>; a volume is not supported there"));
    }
    let weight = object.float_where("weight", 0.5, |w| (0.0..=1.0).contains(&w), "in [0, 1]")?;
    let [first, second] = object.nested("phase")[..] else {
        return Err(object.error("it must hold two phase functions", "nest two"));
    };
    let mean_cosine = |nested: Nested<'a>| match phase_within(loader, nested.object, true)? {
        Phase::Isotropic => Ok(0.0),
        Phase::HenyeyGreenstein { g } => Ok(g),
        _ => Err(nested.at.error("only isotropic and hg can be blended", "use one of these")),
    };
    Ok(Phase::TwoLobes { weight, g: [mean_cosine(first)?, mean_cosine(second)?] })
}

/// An emitter that stands by itself; `None` for an area light, which shines where a shape refers to it.
pub(super) fn emitter<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Option<Emitter>, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("emitter"))?;
    let emitter = match object.kind() {
        "area" if element.attribute("id").is_none() => {
            return Err(object.error("it belongs to no shape", "put it inside the <shape> that shines"));
        }
        "area" => return area_emitter(loader, element).map(|_| None),
        "point" => {
            if object.has("position") && object.has("to_world") {
                return Err(object.place_of("to_world").error("both \"position\" and \"to_world\"", "remove one"));
            }
            let to_world = object.world_transform(loader)?;
            let position = object.point("position")?.unwrap_or_else(|| to_world.w_axis.truncate());
            Emitter::Point { position, intensity: object.emission(loader, "intensity")? }
        }
        "spot" => spot(loader, &mut object)?,
        "projector" => projector(loader, &mut object)?,
        "directional" => directional(loader, &mut object)?,
        "envmap" => envmap(loader, &mut object)?,
        _ => Emitter::Constant { radiance: object.emission(loader, "radiance")? },
    };
    sampling_weight(&mut object)?;
    object.finish()?;
    Ok(Some(emitter))
}

fn spot<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Emitter, SceneError> {
    let to_world = object.world_transform(loader)?;
    let intensity = object.emission(loader, "intensity")?;
    let in_range = |angle: f64| angle > 0.0 && angle <= 180.0;
    let cutoff = object.float_where("cutoff_angle", 20.0, in_range, "more than 0 and at most 180 degrees")?;
    let beam =
        object.float_where("beam_width", cutoff * 0.75, |b| b >= 0.0 && b <= cutoff, "from 0 to cutoff_angle")?;
    let (position, direction) = (to_world.w_axis.truncate(), to_world.z_axis.truncate().normalize());
    let (beam, cutoff) = (beam.to_radians(), cutoff.to_radians());
    let slide = match object.texture_element("texture")? {
        None => None,
        Some(nested) => {
            let local = DMat3::from_mat4(to_world).inverse();
            // The rows of the map to the light's space, where its own axis has unit length.
            let row = |i| local.row(i) / (local.row(2).length() * cutoff.tan());
            Some(Box::new(Slide { texture: textures::read(loader, nested)?, scale: 1.0, axes: [row(0), row(1)] }))
        }
    };
    Ok(Emitter::Spot { position, direction, intensity, beam, cutoff, slide })
}

fn projector<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Emitter, SceneError> {
    let to_world = object.world_transform(loader)?;
    let to_world = camera::rigid(loader, object, to_world)?;
    let texture = match object.texture_element("irradiance")? {
        Some(nested) => textures::read(loader, nested)?,
        None => Texture::Constant(object.emission(loader, "irradiance")?),
    };
    let scale = object.float_where("scale", 1.0, |v| v >= 0.0 && v <= f64::from(f32::MAX), "at least 0")? as f32;
    let aspect = match &texture {
        Texture::Bitmap { image, .. } => f64::from(image.width) / f64::from(image.height),
        _ => 1.0,
    };
    let tan = camera::field_of_view(object, aspect)?;
    let [left, up, forward] = [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(DVec4::truncate);
    // The picture begins at its upper left.
    let slide = Box::new(Slide { texture, scale, axes: [-left / tan, -up * aspect / tan] });
    Ok(Emitter::Projector { position: to_world.w_axis.truncate(), direction: forward, slide })
}

fn directional<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Emitter, SceneError> {
    if object.has("direction") && object.has("to_world") {
        return Err(object.place_of("to_world").error("both \"direction\" and \"to_world\"", "remove one"));
    }
    let to_world = object.world_transform(loader)?;
    let direction = object.vector("direction")?.unwrap_or_else(|| to_world.z_axis.truncate());
    let Some(direction) = direction.try_normalize() else {
        return Err(object.place_of("direction").error("the direction is zero", "write a vector"));
    };
    Ok(Emitter::Directional { direction, irradiance: object.emission(loader, "irradiance")? })
}

fn envmap<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Emitter, SceneError> {
    let world_from_map = object.world_transform(loader)?;
    let scale = object.float_where("scale", 1.0, |v| v >= 0.0 && v <= f64::from(f32::MAX), "at least 0")? as f32;
    // How directions are drawn, not what is drawn.
    object.boolean("mis_compensation", false)?;
    let name =
        object.string("filename")?.ok_or_else(|| object.error("no filename", "add <string name=\"filename\" …>"))?;
    let image = textures::pixels(loader, name, object.place_of("filename"), false)?;
    if image.width < 2 || image.height < 2 {
        return Err(object.error("the picture has less than 2 × 2 pixels", ""));
    }
    // Directions are all that it turns: what else it does has no meaning at infinity.
    let axes = [world_from_map.x_axis, world_from_map.y_axis, world_from_map.z_axis].map(|a| a.truncate());
    let size = axes[0].length();
    let is_rotation = axes.iter().all(|a| (a.length() / size - 1.0).abs() < 1e-3)
        && axes[0].dot(axes[1]).abs() + axes[1].dot(axes[2]).abs() + axes[2].dot(axes[0]).abs() < 1e-3 * size * size;
    if !is_rotation {
        return Err(object.place_of("to_world").error("to_world of the envmap distorts it", "only rotate it"));
    }
    let z = axes[2].normalize();
    let x = (axes[0] - z * axes[0].dot(z)).normalize();
    let y = z.cross(x) * axes[0].cross(axes[1]).dot(axes[2]).signum();
    let world_from_map = DMat4::from_cols(x.extend(0.0), y.extend(0.0), z.extend(0.0), DVec3::ZERO.extend(1.0));
    Ok(Emitter::Envmap { image, scale, world_from_map })
}

/// The radiance of an area light.
pub(super) fn area_emitter<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Texture, SceneError> {
    if let Some(kind) = element.attribute("type").filter(|kind| kind.value != "area")
        && features::kinds("emitter").contains(&kind.value.as_str())
    {
        let message = format!("emitter \"{}\" cannot be inside of a shape: only an area light can", kind.value);
        return Err(kind.at.error(message, "put it directly inside <scene>, with a to_world of its own"));
    }
    let mut object = Object::new(loader, element, &["area"])?;
    let radiance = match object.texture_element("radiance")? {
        Some(nested) if textures::varies(nested) => textures::read(loader, nested)?,
        _ => Texture::Constant(object.emission(loader, "radiance")?),
    };
    sampling_weight(&mut object)?;
    object.finish()?;
    Ok(radiance)
}

/// How often Mitsuba draws an emitter, not how bright it is; vdf chooses emitters uniformly.
fn sampling_weight(object: &mut Object<'_>) -> Result<(), SceneError> {
    object.float_where("sampling_weight", 1.0, |w| w > 0.0, "positive").map(drop)
}
