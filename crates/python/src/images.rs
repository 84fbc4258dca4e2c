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

use crate::{dictionary, interrupt::interruptible, value_error};

/// The pixels as an array of (height, width, 3).
pub(crate) fn pixels_to_array(py: Python<'_>, image: Image) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let size = [image.height as usize, image.width as usize, 3];
    let numbers: Vec<f32> = image.pixels.into_iter().flat_map(|p| p.to_array()).collect();
    numbers.into_pyarray(py).reshape(size)
}

/// An image of an array of (height, width, 3).
fn image_of_array(array: &PyReadonlyArray3<'_, f32>) -> PyResult<Image> {
    let wrong = || PyValueError::new_err("an image is an array of float32 of shape (height, width, 3)");
    let &[height, width, 3] = array.shape() else { return Err(wrong()) };
    let (Ok(width), Ok(height)) = (u32::try_from(width), u32::try_from(height)) else { return Err(wrong()) };
    let mut image = Image::try_new(width, height).map_err(|e| value_error(&e))?;
    let view = array.as_array();
    for (pixel, rgb) in image.pixels.iter_mut().zip(view.rows()) {
        *pixel = Rgb::new(rgb[0], rgb[1], rgb[2]);
    }
    Ok(image)
}

#[pyfunction]
#[pyo3(signature = (image, reference, *, pixels_per_degree = PIXELS_PER_DEGREE))]
pub(crate) fn compare<'py>(
    py: Python<'py>,
    image: PyReadonlyArray3<'py, f32>,
    reference: PyReadonlyArray3<'py, f32>,
    pixels_per_degree: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let (a, b) = (image_of_array(&image)?, image_of_array(&reference)?);
    let compared = interruptible(py, |_| {
        on_threads(None, || {
            Ok::<_, vdf_render::RenderError>(metrics::compare(&a, &b, DynamicRange::High, pixels_per_degree))
        })
    })?;
    dictionary(py, &compared.map_err(|e| value_error(&e))?.map_err(|e| value_error(&e))?)
}

#[pyfunction]
pub(crate) fn read_exr(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyArray3<f32>>> {
    let image = py.detach(|| vdf_image::read_exr(&path)).map_err(|e| value_error(&e))?;
    pixels_to_array(py, image)
}

#[pyfunction]
#[pyo3(signature = (path, image, *, layers = None))]
pub(crate) fn write_exr(
    py: Python<'_>,
    path: PathBuf,
    image: PyReadonlyArray3<'_, f32>,
    layers: Option<&Bound<'_, PyDict>>,
) -> PyResult<()> {
    let image = image_of_array(&image)?;
    let mut channels = Vec::new();
    for (name, array) in layers.into_iter().flatten() {
        let (name, array): (String, PyReadonlyArray3<'_, f32>) = (name.extract()?, array.extract()?);
        let count = array.shape()[2];
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
    let file = stage_exr_layers(path, image, channels, &[], &ExrOptions::default()).map_err(|e| value_error(&e))?;
    file.persist().map_err(|e| value_error(&e))
}
