//! Film and reconstruction filter.

use super::document::Element;
use super::properties::Object;
use super::{Loader, features};
use crate::{ComponentFormat, FilmSettings, PixelRect, ReconstructionFilter, SceneError};

const MAX_FILM_SIZE: i64 = 1 << 16;

/// What a sensor without a film has, as in Mitsuba.
pub(super) fn default() -> FilmSettings {
    let (width, height) = (768, 576);
    FilmSettings {
        width,
        height,
        crop: PixelRect { x0: 0, y0: 0, x1: width, y1: height },
        filter: ReconstructionFilter::Gaussian { stddev: 0.5 },
        component_format: ComponentFormat::Float32,
    }
}

/// Reads the film.
pub(super) fn read<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<FilmSettings, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("film"))?;
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
    let file_format = object.choice("file_format", "openexr", &["openexr", "exr", "rgbe", "pfm"])?;
    if !file_format.contains("exr") {
        loader.warn(object.place_of("file_format"), &format!("the image is written as OpenEXR, not as {file_format}"));
    }
    let formats = ["rgb", "rgba", "luminance", "luminance_alpha", "xyz", "xyza"];
    let pixel_format = object.choice("pixel_format", "rgb", &formats)?;
    if pixel_format != "rgb" {
        loader.warn(object.place_of("pixel_format"), &format!("the image is written as rgb, not as {pixel_format}"));
    }
    let component_format = match object.choice("component_format", "float32", &["float16", "float32"])? {
        "float32" => ComponentFormat::Float32,
        _ => ComponentFormat::Float16,
    };
    object.boolean("banner", true)?;
    object.boolean("compensate", false)?;
    // It makes the borders of a picture as free of noise as the rest; here each pixel has its own samples anyway.
    object.boolean("sample_border", false)?;
    let filter = match object.at_most_one("rfilter")? {
        Some(nested) => read_filter(loader, nested.object)?,
        None => ReconstructionFilter::Gaussian { stddev: 0.5 },
    };
    object.finish()?;
    let crop = PixelRect { x0: pixels(x0), y0: pixels(y0), x1: pixels(x0 + crop_width), y1: pixels(y0 + crop_height) };
    Ok(FilmSettings { width: pixels(width), height: pixels(height), crop, filter, component_format })
}

/// Only for numbers that were checked to be within the film.
fn pixels(n: i64) -> u32 {
    u32::try_from(n).unwrap_or(0)
}

fn read_filter<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<ReconstructionFilter, SceneError> {
    const THIRD: f64 = 1.0 / 3.0;
    let mut object = Object::new(loader, element, features::kinds("rfilter"))?;
    let size = |v: f64| v > 0.0 && v <= 64.0;
    let range = "positive and at most 64";
    let filter = match object.kind() {
        "box" => ReconstructionFilter::Box,
        "tent" => ReconstructionFilter::Tent { radius: object.float_where("radius", 1.0, size, range)? },
        "mitchell" => ReconstructionFilter::Mitchell {
            b: object.float_where("B", THIRD, |v| v.abs() <= 8.0, "between -8 and 8")?,
            c: object.float_where("C", THIRD, |v| v.abs() <= 8.0, "between -8 and 8")?,
        },
        "catmullrom" => ReconstructionFilter::CatmullRom,
        "lanczos" => ReconstructionFilter::Lanczos { lobes: pixels(object.integer("lobes", 3, 1..=64)?) },
        _ => ReconstructionFilter::Gaussian { stddev: object.float_where("stddev", 0.5, size, range)? },
    };
    object.finish()?;
    Ok(filter)
}
