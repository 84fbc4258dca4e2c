//! The sensor and its sampler.

use glam::{DMat3, DMat4, DVec3};

use super::document::Element;
use super::properties::Object;
use super::{Loader, features, film, objects};
use crate::SceneError;
use crate::{FilmSettings, Lens, Projection, Sensor};

/// A matrix written with three digits is this far from a rotation in the products of its columns; a scale of 0.1 % is farther.
const MOST_SCALE: f64 = 2e-3;
/// Less is the rounding of single precision, which nobody needs to hear of.
const LEAST_TO_WARN: f64 = 1e-6;

/// The sensor with what is nested in it: film, samples per pixel, seed.
#[derive(Debug)]
pub(super) struct Camera {
    pub(super) sensor: Sensor,
    pub(super) film: FilmSettings,
    pub(super) sample_count: u32,
    pub(super) seed: u64,
}

/// Reads the sensor.
pub(super) fn read<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<Camera, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("sensor"))?;
    let world_from_camera = object.world_transform(loader)?;
    let is_orthographic = object.kind() == "orthographic";
    let (scale, world_from_camera) = if is_orthographic {
        let scale = scale(world_from_camera);
        (scale, world_from_camera * DMat4::from_scale(scale.recip()))
    } else {
        (DVec3::ONE, world_from_camera)
    };
    let world_from_camera = rigid(loader, &object, world_from_camera)?;
    object.without_effect(loader, &["shutter_open", "shutter_close", "sample_border", "use_radiance"])?;
    let near_clip = object.float_where("near_clip", 0.01, |v| v > 0.0, "positive")?;
    let far_clip = object.float_where("far_clip", 1e4, |v| v > near_clip, "more than near_clip")?;
    // As in Mitsuba, the camera's scale moves the near plane, and the far one stays as far behind it.
    let (near_clip, far_clip) = (near_clip * scale.z, far_clip + near_clip * (scale.z - 1.0));
    let lens = lens(&mut object, far_clip)?;
    let film = match object.at_most_one("film")? {
        Some(film) => film::read(loader, film.object)?,
        None => film::default(),
    };
    let (sample_count, seed) = match object.at_most_one("sampler")? {
        Some(nested) => sampler(loader, nested.object)?,
        None => (4, 0),
    };
    let medium = match object.at_most_one("medium")? {
        Some(nested) => Some(objects::medium(loader, nested.object)?),
        None => None,
    };
    let aspect = f64::from(film.width) / f64::from(film.height);
    let projection = if is_orthographic {
        Projection::Orthographic { half_width: scale.x, half_height: scale.y / aspect }
    } else {
        let principal_point = if object.kind() == "perspective" { principal_point(&mut object)? } else { [0.0; 2] };
        Projection::Perspective { tan_half_fov_x: field_of_view(&mut object, aspect)?, lens, principal_point }
    };
    object.finish()?;
    let sensor = Sensor { world_from_camera, projection, near_clip, far_clip, medium };
    Ok(Camera { sensor, film, sample_count, seed })
}

/// How much a transform stretches each axis; of an orthographic camera that is what it sees.
fn scale(m: DMat4) -> DVec3 {
    DVec3::from_array([m.x_axis, m.y_axis, m.z_axis].map(|axis| axis.length()))
}

/// The transform without what its digits lost: its axes become unit vectors at right angles. Mitsuba takes such a matrix as it is; a
/// camera that scales is refused by both.
pub(super) fn rigid(loader: &Loader<'_>, object: &Object<'_>, m: DMat4) -> Result<DMat4, SceneError> {
    let linear = DMat3::from_mat4(m);
    let product = linear.transpose() * linear - DMat3::IDENTITY;
    let error = product.to_cols_array().into_iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    if error.is_nan() || error > MOST_SCALE {
        let (what, help) = if object.kind() == "orthographic" {
            ("shears", "only rotate, translate and scale it, the scaling first")
        } else {
            ("scales", "only rotate and translate it; an axis of <rotate> must have length 1")
        };
        return Err(object.place_of("to_world").error(format!("to_world of the {} {what}", object.element.tag), help));
    }
    if error > LEAST_TO_WARN {
        let message = format!(
            "to_world of the {} is a rotation only up to {error:.0e}: its axes were made orthonormal",
            object.element.tag
        );
        loader.warn(object.place_of("to_world"), &message);
    } else if error < 1e-12 {
        return Ok(m);
    }
    let forward = linear.z_axis.normalize();
    let left = (linear.x_axis - linear.x_axis.dot(forward) * forward).normalize();
    // A mirroring stays one.
    let up = forward.cross(left) * linear.determinant().signum();
    Ok(DMat4::from_cols(left.extend(0.0), up.extend(0.0), forward.extend(0.0), m.w_axis))
}

fn lens(object: &mut Object<'_>, far_clip: f64) -> Result<Option<Lens>, SceneError> {
    if object.kind() != "thinlens" {
        // Mitsuba reads it of every camera, and its users copy it from one to the next.
        object.float("focus_distance")?;
        return Ok(None);
    }
    if !object.has("aperture_radius") {
        return Err(object.error("no aperture_radius", "add <float name=\"aperture_radius\" …>, or use perspective"));
    }
    let radius = object.float_where("aperture_radius", 0.0, |v| v >= 0.0, "at least 0")?;
    let focus_distance = object.float_where("focus_distance", far_clip, |v| v > 0.0, "positive")?;
    Ok((radius > 0.0).then_some(Lens { radius, focus_distance }))
}

/// Where the axis meets the film: as Mitsuba takes them, a positive offset goes left and up.
fn principal_point(object: &mut Object<'_>) -> Result<[f64; 2], SceneError> {
    let mut offset = |name| object.float_where(name, 0.0, f64::is_finite, "a number");
    Ok([offset("principal_point_offset_x")?, offset("principal_point_offset_y")?])
}

/// tan(X/2), X the horizontal field of view.
pub(super) fn field_of_view(object: &mut Object<'_>, aspect: f64) -> Result<f64, SceneError> {
    let from_diagonal = |tan: f64| tan / (1.0 + 1.0 / (aspect * aspect)).sqrt();
    let axis = object.choice("fov_axis", "x", &["x", "y", "diagonal", "smaller", "larger"])?;
    let focal_length = object.string("focal_length")?;
    if object.has("fov") {
        if focal_length.is_some() {
            return Err(object.place_of("focal_length").error("both \"fov\" and \"focal_length\"", "remove one"));
        }
        let fov = object.float_where("fov", 0.0, |v| v > 0.0 && v < 180.0, "between 0 and 180 degrees")?;
        let tan = (fov.to_radians() / 2.0).tan();
        let vertical = axis == "y" || (axis == "smaller" && aspect > 1.0) || (axis == "larger" && aspect <= 1.0);
        return Ok(match axis {
            "diagonal" => from_diagonal(tan),
            _ if vertical => tan * aspect,
            _ => tan,
        });
    }
    if object.has("fov_axis") {
        let help = "add \"fov\", or remove it: the axis of a focal length is the diagonal";
        return Err(object.place_of("fov_axis").error("\"fov_axis\" without \"fov\"", help));
    }
    // A focal length is that of a 36 × 24 mm frame, whose diagonal counts.
    object.float("fov")?;
    let text = focal_length.unwrap_or("50mm");
    let millimetres = text.trim().trim_end_matches("mm").trim().parse::<f64>();
    let f = millimetres.ok().filter(|f| f.is_finite() && *f > 0.0).ok_or_else(|| {
        object.place_of("focal_length").error(format!("\"{text}\" is not a focal length"), "write it as in 50mm")
    })?;
    Ok(from_diagonal(f64::hypot(36.0, 24.0) / (2.0 * f)))
}

/// Samples per pixel and seed. All of Mitsuba's samplers stand for ours.
fn sampler<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<(u32, u64), SceneError> {
    let mut object = Object::new(loader, element, features::kinds("sampler"))?;
    let count = object.integer("sample_count", 4, 1..=i64::from(u32::MAX))?;
    let seed = object.integer("seed", 0, 0..=i64::MAX)?;
    if matches!(object.kind(), "stratified" | "multijitter" | "orthogonal") {
        object.boolean("jitter", true)?;
    }
    if object.kind() == "orthogonal" {
        object.integer("strength", 2, 2..=2)?;
    }
    object.finish()?;
    Ok((u32::try_from(count).unwrap_or(u32::MAX), seed.unsigned_abs()))
}
