//! Media, BSDFs and emitters.

use super::document::Element;
use super::properties::Object;
use super::{Loader, features};
use crate::{Bsdf, Emitter, Medium, MediumId, Phase};
use crate::{Rgb, SceneError};

/// The medium's index; each is read once, however often it is referred to.
pub(super) fn medium<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<MediumId, SceneError> {
    if let Some(&id) = loader.medium_of_element.get(&element.serial) {
        return Ok(id);
    }
    let mut object = Object::new(loader, element, features::kinds("medium"))?;
    object.fixed("sample_emitters", true)?;
    object.boolean("has_spectral_extinction", true)?;
    let albedo = object.reflectance("albedo", 0.75)?;
    let scale = object.float_where("scale", 1.0, |v| v >= 0.0, "at least 0")?;
    let sigma_t = object.grey("sigma_t", 1.0)?;
    if sigma_t < 0.0 || !(sigma_t * scale).is_finite() {
        let at = object.place_of("sigma_t");
        return Err(
            at.error(format!("the extinction is {}", sigma_t * scale), "sigma_t × scale must be finite and at least 0")
        );
    }
    let phase = match object.at_most_one("phase")? {
        Some(nested) => phase(loader, nested.object)?,
        None => Phase::Isotropic,
    };
    object.finish()?;
    let id = MediumId(u32::try_from(loader.media.len()).unwrap_or(u32::MAX));
    loader.media.push(Medium { sigma_t: sigma_t * scale, albedo, phase });
    loader.medium_of_element.insert(element.serial, id);
    Ok(id)
}

/// A phase function.
pub(super) fn phase<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Phase, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("phase"))?;
    let phase = if object.kind() == "hg" {
        Phase::HenyeyGreenstein {
            g: object.float_where("g", 0.8, |g| g > -1.0 && g < 1.0, "between -1 and 1, both excluded")?,
        }
    } else {
        Phase::Isotropic
    };
    object.finish()?;
    Ok(phase)
}

/// What a shape without a BSDF has.
pub(super) fn default_bsdf(emits: bool) -> Bsdf {
    Bsdf { front: Rgb::splat(if emits { 0.0 } else { 0.5 }), back: Rgb::ZERO }
}

/// A BSDF; `None` is `null`.
pub(super) fn bsdf<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Option<Bsdf>, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("bsdf"))?;
    let bsdf = match object.kind() {
        "diffuse" => Some(Bsdf { front: object.reflectance("reflectance", 0.5)?, back: Rgb::ZERO }),
        "twosided" => {
            let nested = object.nested("bsdf");
            let (front, back) = match nested.as_slice() {
                [both] => (both, both),
                [front, back] => (front, back),
                other => {
                    return Err(object
                        .error(format!("{} nested BSDFs", other.len()), "nest one diffuse, or two: front and back"));
                }
            };
            Some(Bsdf { front: diffuse(loader, front.object)?, back: diffuse(loader, back.object)? })
        }
        _ => None,
    };
    object.finish()?;
    Ok(bsdf)
}

fn diffuse<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Rgb, SceneError> {
    let mut object = Object::new(loader, element, &["diffuse"])?;
    let reflectance = object.reflectance("reflectance", 0.5)?;
    object.finish()?;
    Ok(reflectance)
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
            Emitter::Point { position, intensity: object.emission("intensity")? }
        }
        _ => Emitter::Constant { radiance: object.emission("radiance")? },
    };
    sampling_weight(&mut object)?;
    object.finish()?;
    Ok(Some(emitter))
}

/// The radiance of an area light.
pub(super) fn area_emitter<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Rgb, SceneError> {
    let mut object = Object::new(loader, element, &["area"])?;
    let radiance = object.emission("radiance")?;
    sampling_weight(&mut object)?;
    object.finish()?;
    Ok(radiance)
}

/// vdf chooses emitters uniformly.
fn sampling_weight(object: &mut Object<'_>) -> Result<(), SceneError> {
    object.float_where("sampling_weight", 1.0, |w| w == 1.0, "1: vdf chooses emitters uniformly").map(drop)
}
