//! Images as arrays.

use std::path::{Path, PathBuf};

use numpy::{IntoPyArray as _, PyArray3, PyArrayMethods as _, PyReadonlyArray3, PyUntypedArrayMethods as _};
use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use vdf_image::{
    Channel, ExrOptions, Image, Rgb,
    metrics::{self, DynamicRange, PIXELS_PER_DEGREE},
    stage_exr_layers,
};
use vdf_render::on_threads;

use crate::{arrays::array, dictionary, exception, interrupt::interruptible};

/// The pixels as an array of (height, width, 3).
pub(crate) fn pixels_to_array(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let size = [image.height as usize, image.width as usize, 3];
    let numbers: Vec<f32> = image.pixels.into_iter().flat_map(|p| p.to_array()).collect();
    numbers.into_pyarray(py).reshape(size)
}

/// An image of an array of (height, width, 3).
fn image_of_array(what: &str, given: &Bound<'_, PyAny>) -> PyResult<Image> {
    let array: PyReadonlyArray3<'_, f32> = array(what, "(height, width, 3)", &[3], given)?;
    let [height, width] = [0, 1].map(|axis| u32::try_from(array.shape()[axis]));
    let mut image = Image::try_new(width?, height?).map_err(|e| exception(&e))?;
    let view = array.as_array();
    for (pixel, rgb) in image.pixels.iter_mut().zip(view.rows()) {
        *pixel = Rgb::new(rgb[0], rgb[1], rgb[2]);
    }
    Ok(image)
}

/// The figures of ``vdf compare --json`` for two images, float32 of shape (height, width, 3): ``mse``, ``mae``, ``relmse``, ``psnr``
/// (None if they are identical), ``ssim``, ``flip_ldr``, ``flip_hdr``, ``identical``.
///
/// Raises ValueError if they differ in size, or a pixel is not finite.
#[pyfunction]
#[pyo3(signature = (image, reference, *, pixels_per_degree = PIXELS_PER_DEGREE))]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    image: &Bound<'py, PyAny>,
    reference: &Bound<'py, PyAny>,
    pixels_per_degree: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let (a, b) = (image_of_array("image", image)?, image_of_array("reference", reference)?);
    let compared = interruptible(py, |_| {
        on_threads(None, || {
            Ok::<_, vdf_render::RenderError>(metrics::compare(&a, &b, DynamicRange::High, pixels_per_degree))
        })
    })?;
    dictionary(py, &compared.map_err(|e| exception(&e))?.map_err(|e| exception(&e))?)
}

/// The channels R, G and B of an EXR, float32 of shape (height, width, 3).
///
/// Raises OSError if the file cannot be read, and ValueError if it is no such EXR.
#[pyfunction]
pub(crate) fn read_exr(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let image = py.detach(|| vdf_image::read_exr(&path)).map_err(|e| exception(&e))?;
    pixels_to_array(py, image)
}

/// Write an image, float32 of shape (height, width, 3), as an EXR, with layers of shape (height, width, channels) as
/// ``Rendering.layers`` has them, or of your own. The file appears whole or not at all.
///
/// Raises OSError if the file cannot be written.
#[pyfunction]
#[pyo3(signature = (path, image, *, layers = None))]
pub(crate) fn write_exr(
    py: Python<'_>,
    path: PathBuf,
    image: &Bound<'_, PyAny>,
    layers: Option<&Bound<'_, PyDict>>,
) -> PyResult<()> {
    let image = image_of_array("image", image)?;
    let mut channels = Vec::new();
    for (name, given) in layers.into_iter().flatten() {
        let name: String = name.extract()?;
        let what = format!("layer {name}");
        let array: PyReadonlyArray3<'_, f32> = array(&what, "(height, width, channels)", &[], &given)?;
        let &[height, width, count] = array.shape() else { continue };
        if [width, height] != [image.width as usize, image.height as usize] {
            let message =
                format!("{what} has {width} x {height} pixels, and the image {} x {}", image.width, image.height);
            return Err(PyValueError::new_err(message));
        }
        let known = name.parse().map(vdf_render::Layer::channels).ok().filter(|names| names.len() == count);
        for i in 0..count {
            let channel = known.map_or_else(|| i.to_string(), |names| names[i].to_owned());
            let values = array.as_array().rows().into_iter().map(|row| row[i]).collect();
            channels.push(Channel { name: format!("{name}.{channel}"), values });
        }
    }
    py.detach(|| write(&path, &image, &channels))
}

fn write(path: &Path, image: &Image, channels: &[Channel]) -> PyResult<()> {
    let file = stage_exr_layers(path, image, channels, &[], &ExrOptions::default()).map_err(|e| exception(&e))?;
    file.persist().map_err(|e| exception(&e))
}
