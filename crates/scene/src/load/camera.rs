//! Sensor, film, filter, sampler and integrator.

use glam::{DMat3, DMat4};

use super::document::Element;
use super::properties::Object;
use super::{Loader, objects};
use crate::SceneError;
use crate::{FilmSettings, IntegratorSettings, PerspectiveSensor, PixelRect, ReconstructionFilter};

const MAX_FILM_SIZE: i64 = 1 << 16;

/// The sensor with what is nested in it: film, samples per pixel, seed.
#[derive(Debug)]
pub(super) struct Camera {
    pub(super) sensor: PerspectiveSensor,
    pub(super) film: FilmSettings,
    pub(super) sample_count: u32,
    pub(super) seed: u64,
}

/// Reads the sensor.
pub(super) fn read<'a>(loader: &mut Loader<'a>, element: &'a Element) -> Result<Camera, SceneError> {
    let mut object = Object::new(loader, element, &["perspective"])?;
    let world_from_camera = object.world_transform()?;
    if !is_rigid(world_from_camera) {
        return Err(object.place_of("to_world").error("to_world of the sensor scales", "only rotate and translate it"));
    }
    for name in ["principal_point_offset_x", "principal_point_offset_y", "shutter_open", "shutter_close"] {
        object.float_where(name, 0.0, |v| v == 0.0, "0: nothing else is supported")?;
    }
    let near_clip = object.float_where("near_clip", 0.01, |v| v > 0.0, "positive")?;
    let far_clip = object.float_where("far_clip", 1e4, |v| v > near_clip, "more than near_clip")?;
    let Some(film) = object.at_most_one("film")? else {
        return Err(object.error("no film", "add <film type=\"hdrfilm\"> to the sensor"));
    };
    let film = read_film(loader, film.object)?;
    let (sample_count, seed) = match object.at_most_one("sampler")? {
        Some(nested) => sampler(loader, nested.object)?,
        None => (4, 0),
    };
    let medium = match object.at_most_one("medium")? {
        Some(nested) => Some(objects::medium(loader, nested.object)?),
        None => None,
    };
    let tan_half_fov_x = field_of_view(&mut object, f64::from(film.width) / f64::from(film.height))?;
    object.finish()?;
    let sensor = PerspectiveSensor { world_from_camera, tan_half_fov_x, near_clip, far_clip, medium };
    Ok(Camera { sensor, film, sample_count, seed })
}

fn is_rigid(m: DMat4) -> bool {
    let linear = DMat3::from_mat4(m);
    (linear.transpose() * linear).abs_diff_eq(DMat3::IDENTITY, 1e-4)
}

/// tan(X/2), X the horizontal field of view.
fn field_of_view(object: &mut Object<'_>, aspect: f64) -> Result<f64, SceneError> {
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
    // A focal length is that of a 36 × 24 mm frame, whose diagonal counts.
    object.float("fov")?;
    let text = focal_length.unwrap_or("50mm");
    let millimetres = text.trim().trim_end_matches("mm").trim().parse::<f64>();
    let f = millimetres.ok().filter(|f| f.is_finite() && *f > 0.0).ok_or_else(|| {
        object.place_of("focal_length").error(format!("\"{text}\" is not a focal length"), "write it as in 50mm")
    })?;
    Ok(from_diagonal(f64::hypot(36.0, 24.0) / (2.0 * f)))
}

fn read_film<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<FilmSettings, SceneError> {
    let mut object = Object::new(loader, element, &["hdrfilm"])?;
    let width = object.integer("width", 768, 1..=MAX_FILM_SIZE)?;
    let height = object.integer("height", 576, 1..=MAX_FILM_SIZE)?;
    let x0 = object.integer("crop_offset_x", 0, 0..=width - 1)?;
    let y0 = object.integer("crop_offset_y", 0, 0..=height - 1)?;
    // The default of the size reaches beyond the film if there is an offset: Mitsuba refuses that, and so do we.
    let crop_width = object.integer("crop_width", width, 1..=width)?;
    let crop_height = object.integer("crop_height", height, 1..=height)?;
    if x0 + crop_width > width || y0 + crop_height > height {
        return Err(object.error("the crop window reaches beyond the film", "crop_offset + crop size ≤ film size"));
    }
    object.choice("file_format", "openexr", &["openexr"])?;
    object.choice("pixel_format", "rgb", &["rgb"])?;
    object.choice("component_format", "float16", &["float16", "float32"])?;
    object.boolean("banner", true)?;
    object.boolean("compensate", false)?;
    object.fixed("sample_border", false)?;
    let filter = match object.at_most_one("rfilter")? {
        Some(nested) => read_filter(loader, nested.object)?,
        None => ReconstructionFilter::Gaussian { stddev: 0.5 },
    };
    object.finish()?;
    let crop = PixelRect { x0: pixels(x0), y0: pixels(y0), x1: pixels(x0 + crop_width), y1: pixels(y0 + crop_height) };
    Ok(FilmSettings { width: pixels(width), height: pixels(height), crop, filter })
}

/// Only for numbers that were checked to be within the film.
fn pixels(n: i64) -> u32 {
    u32::try_from(n).unwrap_or(0)
}

fn read_filter<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<ReconstructionFilter, SceneError> {
    let mut object = Object::new(loader, element, &["box", "gaussian"])?;
    let filter = if object.kind() == "box" {
        ReconstructionFilter::Box
    } else {
        let stddev = object.float_where("stddev", 0.5, |v| v > 0.0 && v <= 64.0, "positive and at most 64")?;
        ReconstructionFilter::Gaussian { stddev }
    };
    object.finish()?;
    Ok(filter)
}

/// Samples per pixel and seed. All of Mitsuba's samplers stand for ours.
fn sampler<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<(u32, u64), SceneError> {
    let kinds = ["independent", "stratified", "multijitter", "orthogonal", "ldsampler"];
    let mut object = Object::new(loader, element, &kinds)?;
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

/// Reads the integrator.
pub(super) fn integrator<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<IntegratorSettings, SceneError> {
    let mut object = Object::new(loader, element, &["volpath"])?;
    let max_depth = u32::try_from(object.integer("max_depth", -1, -1..=i64::from(u32::MAX))?).ok();
    let rr_depth = object.integer("rr_depth", 5, 1..=i64::from(u32::MAX))?;
    object.fixed("hide_emitters", false)?;
    object.float_where("timeout", -1.0, |v| v <= 0.0, "-1: no time limit")?;
    // How Mitsuba cuts up its work; no meaning here.
    object.integer("block_size", 0, 0..=i64::MAX)?;
    object.integer("samples_per_pass", 0, 0..=i64::MAX)?;
    object.finish()?;
    Ok(IntegratorSettings { max_depth, rr_depth: u32::try_from(rr_depth).unwrap_or(u32::MAX) })
}
