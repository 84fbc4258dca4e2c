//! Textures and the pictures that they are made of.

use std::collections::hash_map::Entry;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec2;
use image::{DynamicImage, ImageReader};

use super::document::{Element, Place};
use super::properties::Object;
use super::spectra::Weighed;
use super::{Loader, features, plugins, transform};
use crate::{Pixels, Rgb, SceneError, Texture, TextureFilter, UvTransform, Wrap, pfm};

/// All pictures of a scene have at most this many pixels together; each takes twelve bytes.
const MAX_PIXELS: u64 = 1 << 28;
/// And their files at most this many bytes.
const MAX_FILE_BYTES: u64 = 4 << 30;
/// Textures nest at most this deep.
const MAX_DEPTH: usize = 8;

/// A texture.
pub(super) fn read<'a>(loader: &Loader<'a>, element: &'a Element) -> Result<Texture, SceneError> {
    read_within(loader, element, 0)
}

/// Whether the texture is none of the types of a spectrum, which are the same everywhere.
pub(super) fn varies(element: &Element) -> bool {
    element.attribute("type").is_none_or(|kind| !features::kinds("spectrum").contains(&kind.value.as_str()))
}

fn read_within<'a>(loader: &Loader<'a>, element: &'a Element, depth: usize) -> Result<Texture, SceneError> {
    let mut object = Object::new(loader, element, features::kinds("texture"))?;
    if depth == MAX_DEPTH {
        return Err(object.error("textures nest too deep", ""));
    }
    let texture = match object.kind() {
        "checkerboard" => {
            let to_uv = uv_transform(loader, &mut object)?;
            let mut colour = |name, default| match object.texture_element(name)? {
                Some(nested) => read_within(loader, nested, depth + 1),
                // A number may be one that is no reflectance.
                None if object.is_number(name) => Ok(Texture::Constant(object.raw(name)?.unwrap_or_default())),
                None => object.reflectance(loader, name, default).map(Texture::Constant),
            };
            let (first, second) = (colour("color0", 0.4)?, colour("color1", 0.2)?);
            Texture::Checkerboard { first: Box::new(first), second: Box::new(second), to_uv }
        }
        "mesh_attribute" => mesh_attribute(loader, &mut object)?,
        "rawconstant" => {
            let value = object.raw("value")?;
            let missing = || object.error("no value", "add <float name=\"value\" …>, or a <vector>");
            Texture::Constant(value.ok_or_else(missing)?)
        }
        _ if !varies(element) => {
            let colour = plugins::spectrum(loader, element, Weighed::ByDaylight)?;
            return Ok(Texture::Constant(colour.as_vec3()));
        }
        _ => {
            let to_uv = uv_transform(loader, &mut object)?;
            bitmap(loader, &mut object, to_uv)?
        }
    };
    object.finish()?;
    Ok(texture)
}

fn bitmap<'a>(loader: &Loader<'a>, object: &mut Object<'a>, to_uv: UvTransform) -> Result<Texture, SceneError> {
    let raw = object.boolean("raw", false)?;
    let filter = match object.choice("filter_type", "bilinear", &["bilinear", "nearest"])? {
        "nearest" => TextureFilter::Nearest,
        _ => TextureFilter::Bilinear,
    };
    let wrap = match object.choice("wrap_mode", "repeat", &["repeat", "mirror", "clamp"])? {
        "mirror" => Wrap::Mirror,
        "clamp" => Wrap::Clamp,
        _ => Wrap::Repeat,
    };
    object.choice("format", "auto", &["auto", "variant", "fp16"])?;
    object.boolean("accel", true)?;
    let name =
        object.string("filename")?.ok_or_else(|| object.error("no filename", "add <string name=\"filename\" …>"))?;
    let image = pixels(loader, name, object.place_of("filename"), raw)?;
    Ok(Texture::Bitmap { image, filter, wrap, to_uv })
}

/// What the mesh that is being read carries by that name.
fn mesh_attribute<'a>(loader: &Loader<'a>, object: &mut Object<'a>) -> Result<Texture, SceneError> {
    let Some(name) = object.string("name")? else {
        return Err(object.error("no name", "add <string name=\"name\" value=\"vertex_color\"/>"));
    };
    let in_range = |v: f64| v >= 0.0 && v <= f64::from(f32::MAX);
    let scale = object.float_where("scale", 1.0, in_range, "at least 0 and fit into single precision")? as f32;
    if !name.starts_with("vertex_") && !name.starts_with("face_") {
        let message = format!("\"{name}\" is not the name of an attribute");
        return Err(object.place_of("name").error(message, "it must begin with vertex_ or face_"));
    }
    // A BSDF that stands by itself is read again for each shape that refers to it.
    let Some(shape) = &loader.attributes else { return Ok(Texture::grey(0.0)) };
    shape.texture(name, scale).map(Texture::Attribute).ok_or_else(|| {
        let known = shape.names();
        let help = if known.is_empty() {
            "only PLY meshes have attributes, of properties such as red, green, blue".to_owned()
        } else {
            format!("it has {}", known.join(", "))
        };
        object.place_of("name").error(format!("the shape has no attribute \"{name}\""), help)
    })
}

/// `to_uv`: what of a transform concerns x and y.
fn uv_transform(loader: &Loader<'_>, object: &mut Object<'_>) -> Result<UvTransform, SceneError> {
    let Some(element) = object.transform_element("to_uv")? else { return Ok(UvTransform::default()) };
    let m = transform::read(loader, element)?;
    let flat = |v: glam::DVec4| DVec2::new(v.x, v.y);
    // A matrix of nine numbers is one of texture coordinates, its third column their translation.
    let translation = if transform::is_three_by_three(element) { flat(m.z_axis) } else { flat(m.w_axis) };
    Ok(UvTransform { columns: [flat(m.x_axis), flat(m.y_axis)], offset: translation })
}

/// The pictures that were read, by their path and whether they are raw.
pub(super) type Pictures = std::collections::HashMap<(PathBuf, bool), Arc<Pixels>>;

/// The picture in a file, in linear RGB unless it is `raw`. Each file is read once.
pub(super) fn pixels(loader: &Loader<'_>, name: &str, at: &Place, raw: bool) -> Result<Arc<Pixels>, SceneError> {
    let path = loader.search.mesh(loader.source, name);
    let mut pictures = loader.pictures.borrow_mut();
    let used: u64 = pictures.values().map(|p| p.rgb.len() as u64).sum();
    match pictures.entry((path, raw)) {
        Entry::Occupied(entry) => Ok(Arc::clone(entry.get())),
        Entry::Vacant(entry) => {
            let path = entry.key().0.clone();
            let unreadable = |why: &dyn std::fmt::Display| {
                at.error(
                    format!("cannot read \"{}\": {why}", path.display()),
                    "pictures are PNG, JPEG, OpenEXR, Radiance HDR, PFM, BMP or TGA files; the path is relative to the folder of the scene file, or to a folder of a <path>",
                )
            };
            let image = decoded(loader, &path, MAX_PIXELS.saturating_sub(used)).map_err(|e| unreadable(&e))?;
            let (pixels, unusable) = linear(&image, raw);
            if unusable > 0 {
                loader.warn(
                    at,
                    &format!(
                        "{unusable} values of \"{}\" are negative or not finite: they are taken as 0",
                        path.display()
                    ),
                );
            }
            Ok(Arc::clone(entry.insert(Arc::new(pixels))))
        }
    }
}

fn decoded(loader: &Loader<'_>, path: &Path, most: u64) -> Result<DynamicImage, Box<dyn std::error::Error>> {
    let (input, _) = loader.source.open(path, MAX_FILE_BYTES)?;
    let mut file = Vec::new();
    input.take(MAX_FILE_BYTES).read_to_end(&mut file)?;
    if pfm::is_pfm(&file) {
        return Ok(pfm::read(&file, most)?);
    }
    // Two names for one format; the decoder knows the second.
    if file.starts_with(b"#?RGBE\n") {
        file.splice(..6, *b"#?RADIANCE");
    }
    let reader = |file| ImageReader::new(std::io::Cursor::new(file)).with_guessed_format();
    let mut of_size = reader(&file)?;
    // TGA files have nothing to be known by.
    if of_size.format().is_none()
        && let Ok(format) = image::ImageFormat::from_path(path)
    {
        of_size.set_format(format);
    }
    let format = of_size.format();
    let (width, height) = of_size.into_dimensions()?;
    let count = u64::from(width) * u64::from(height);
    if count > most || count == 0 {
        return Err(format!("it has {width} × {height} pixels; at most {most} are read").into());
    }
    let mut reader = reader(&file)?;
    if let Some(format) = format {
        reader.set_format(format);
    }
    let mut limits = image::Limits::no_limits();
    // Four channels of four bytes, and what a decoder needs besides.
    limits.max_alloc = Some(count * 64 + (64 << 20));
    reader.limits(limits);
    Ok(reader.decode()?)
}

/// Linear RGB in single precision: integers are sRGB, unless raw; what is not finite or negative becomes zero. And how many values are.
fn linear(image: &DynamicImage, raw: bool) -> (Pixels, usize) {
    let is_float = matches!(image, DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_));
    let decode = |v: f32| if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) };
    let mut unusable = 0;
    let mut channel = |v: f32| {
        let v = if is_float || raw { v } else { decode(v) };
        if v.is_finite() && v >= 0.0 {
            return v;
        }
        unusable += 1;
        0.0
    };
    // Of a byte there are 256 values; a power for each channel of a large picture takes longer than all else.
    let is_bytes = matches!(
        image,
        DynamicImage::ImageRgb8(_)
            | DynamicImage::ImageRgba8(_)
            | DynamicImage::ImageLuma8(_)
            | DynamicImage::ImageLumaA8(_)
    );
    let rgb = if is_bytes {
        let table: Vec<f32> = (0..=255_u8).map(|byte| channel(f32::from(byte) / 255.0)).collect();
        let colour = |p: &image::Rgb<u8>| Rgb::from_array(p.0.map(|byte| table[usize::from(byte)]));
        image.to_rgb8().pixels().map(colour).collect()
    } else {
        image.to_rgb32f().pixels().map(|p| Rgb::from_array(p.0.map(&mut channel))).collect()
    };
    (Pixels { width: image.width(), height: image.height(), rgb }, unusable)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of bytes has the bits that one of floating point numbers with the same values has, read as sRGB.
    #[test]
    fn bytes_are_decoded_as_other_numbers() {
        let bytes =
            DynamicImage::ImageLuma8(image::GrayImage::from_fn(16, 16, |x, y| image::Luma([(16 * y + x) as u8])));
        // Sixteen bits, 257 times as large, are the same shares of what is white.
        let words = DynamicImage::ImageLuma16(image::ImageBuffer::from_fn(16, 16, |x, y| {
            image::Luma([257 * (16 * y + x) as u16])
        }));
        for raw in [false, true] {
            let [a, b] = [&bytes, &words].map(|picture| linear(picture, raw));
            assert_eq!((a.1, b.1), (0, 0));
            let apart = a.0.rgb.iter().zip(&b.0.rgb).map(|(a, b)| (*a - *b).abs().max_element());
            assert!(apart.fold(0.0, f32::max) < 1e-6, "{raw}");
            assert!((a.0.rgb[255] - Rgb::ONE).abs().max_element() < 1e-6 && a.0.rgb[0] == Rgb::ZERO);
        }
    }
}
