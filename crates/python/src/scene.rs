//! Scenes and renders.

use std::{
    path::{Path, PathBuf},
    str::FromStr,
    sync::{Arc, Mutex, PoisonError},
};

use numpy::{IntoPyArray as _, PyArrayMethods as _};
use pyo3::{
    exceptions::{PyFileNotFoundError, PyValueError},
    prelude::*,
    types::{PyBool, PyDict},
};
use vdf_image::Image;
use vdf_render::{
    Estimator, FilmPart, Integrator, Layer, Layers, LightPaths, LiveFilm, NoiseLimit, PrepareOptions, PreparedScene,
    RenderError, RenderOptions, Roulette, SamplerKind, SegmentSamples, Statistics, TransmittanceEstimator,
};
use vdf_scene::{LoadOptions, PixelRect, Scene, SceneSource};
use vdf_scenes::builtin;
use vdf_visibility::Method;

use crate::{dictionary, exception, images::pixels_to_array, interrupt::interruptible};

/// A scene. What a render builds is kept: the next one with the same method builds nothing.
#[pyclass(name = "Scene", module = "vdf", frozen)]
pub(crate) struct PyScene {
    scene: Arc<Scene>,
    name: String,
    /// What was prepared last, and how: renders with the same method build nothing, others share the hierarchy.
    prepared: Mutex<Option<(PrepareOptions, Arc<PreparedScene>)>>,
}

/// A finished render.
#[pyclass(name = "Rendering", module = "vdf", frozen)]
pub(crate) struct PyRendering {
    /// Linear RGB with the primaries of sRGB, float32 of shape (height, width, 3), top row first.
    #[pyo3(get)]
    image: Py<PyAny>,
    /// The layers asked for, each float32 of shape (height, width, channels), as docs/layers.md describes them.
    #[pyo3(get)]
    layers: Py<PyDict>,
    /// The figures of ``vdf render --stats``: times in seconds, sizes in bytes, counts of queries.
    #[pyo3(get)]
    statistics: Py<PyDict>,
}

/// A parameter as a scene file has it.
fn parameter(value: &Bound<'_, PyAny>) -> PyResult<String> {
    if value.is_instance_of::<PyBool>() {
        return Ok(value.is_truthy()?.to_string());
    }
    Ok(value.str()?.to_string())
}

/// Load a scene file (a subset of Mitsuba 3 XML), or a built-in scene by its name.
///
/// Keyword arguments are the scene's ``$`` parameters, as ``-D`` on the command line: ``load("cbox_vol2", width=64)``.
/// ``sensor`` is the number of the camera in the file, from 0.
///
/// Raises FileNotFoundError if there is neither such a file nor such a scene, and ValueError with file, line and column if the
/// scene is not understood.
#[pyfunction]
#[pyo3(signature = (path, *, sensor = None, **params))]
pub(crate) fn load(
    py: Python<'_>,
    path: PathBuf,
    sensor: Option<usize>,
    params: Option<&Bound<'_, PyDict>>,
) -> PyResult<PyScene> {
    let mut defines = Vec::new();
    for (name, value) in params.into_iter().flatten() {
        defines.push((name.extract()?, parameter(&value)?));
    }
    let options = LoadOptions { defines, sensor };
    let scene = py.detach(|| source(&path).map(|source| Scene::from_source(&source, &options)))?;
    let scene = scene.map_err(|e| exception(&e))?;
    let name = path.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
    Ok(PyScene { scene: Arc::new(scene), name, prepared: Mutex::new(None) })
}

/// A file if there is one of that path, else a built-in scene.
fn source(path: &Path) -> PyResult<SceneSource> {
    if path.is_file() {
        return Ok(SceneSource::disk(path));
    }
    path.to_str()
        .and_then(builtin)
        .ok_or_else(|| PyFileNotFoundError::new_err(format!("{}: no such file, nor a built-in scene", path.display())))
}

/// What ``samples_per_segment`` takes.
#[derive(FromPyObject)]
enum Samples {
    Count(u32),
    Name(String),
}

impl Samples {
    fn resolved(self) -> PyResult<SegmentSamples> {
        match self {
            Self::Count(n) => Ok(SegmentSamples::Count(n)),
            Self::Name(name) => name.parse().map_err(|e| PyValueError::new_err(format!("samples_per_segment {e}"))),
        }
    }
}

/// One of several by its name.
fn named<T: Copy>(what: &str, name: &str, all: &[T], of: fn(T) -> &'static str) -> PyResult<T> {
    all.iter().copied().find(|&one| of(one) == name).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|&one| of(one)).collect();
        PyValueError::new_err(format!("{what} must be one of {}, not {name}", names.join(", ")))
    })
}

fn parsed<T: FromStr<Err: std::error::Error + 'static>>(name: &str) -> PyResult<T> {
    name.parse().map_err(|e: T::Err| exception(&e))
}

#[pymethods]
impl PyScene {
    /// The file's name without its extension, or that of the built-in scene.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Width and height of the full film in pixels.
    #[getter]
    fn size(&self) -> (u32, u32) {
        (self.scene.film.width, self.scene.film.height)
    }

    /// Samples per pixel that the scene asks for.
    #[getter]
    fn spp(&self) -> u32 {
        self.scene.sample_count
    }

    /// Triangles that occlude.
    #[getter]
    fn triangles(&self) -> usize {
        self.scene.surfaces.iter().map(|s| s.triangles.len()).sum()
    }

    /// CRC-32 of the scene as it is rendered; ``vdf.sceneHash`` of an EXR.
    #[getter]
    fn checksum(&self) -> u32 {
        self.scene.checksum()
    }

    /// What is legal but probably not meant, with file and line.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.scene.warnings.clone()
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        format!("<vdf.Scene {} of {} triangles, {width} x {height} pixels>", self.name, self.triangles())
    }

    /// Render the scene; the image has the bytes that ``vdf render`` gives it.
    ///
    /// What is None is as the scene says, or chosen. ``voxel`` is in world units; ``crop`` is x0, y0, x1, y1 in pixels, with
    /// x1 and y1 one past the last. With a limit of ``noise`` each tile of 16 x 16 pixels gets samples until the standard error of
    /// its pixels over their mean is below it, and there are the layers variance and samples. Other threads of Python run meanwhile, and Ctrl-C stops it with KeyboardInterrupt.
    ///
    /// Raises ValueError if an option is not usable.
    #[pyo3(signature = (*, spp = None, seed = None, method = None, integrator = "volpath", samples_per_segment = None,
        estimator = "equiangular", light_paths = "auto", sampler = "sobol", transmittance = "analytic", roulette = "standard", voxel = None,
        crop = None, layers = None, noise = None, threads = None))]
    #[expect(clippy::too_many_arguments, reason = "they have names in Python")]
    fn render(
        &self,
        py: Python<'_>,
        spp: Option<u32>,
        seed: Option<u64>,
        method: Option<&str>,
        integrator: &str,
        samples_per_segment: Option<Samples>,
        estimator: &str,
        light_paths: &str,
        sampler: &str,
        transmittance: &str,
        roulette: &str,
        voxel: Option<f64>,
        crop: Option<(u32, u32, u32, u32)>,
        layers: Option<Vec<String>>,
        noise: Option<f64>,
        threads: Option<usize>,
    ) -> PyResult<PyRendering> {
        let mut kind: Integrator = parsed(integrator)?;
        if let Some(n) = samples_per_segment {
            let wrong = || PyValueError::new_err("samples_per_segment goes with the integrator raymarch only");
            kind = kind.with_samples_per_segment(n.resolved()?).ok_or_else(wrong)?;
        }
        let noise = noise.map(NoiseLimit::try_from).transpose();
        let noise = noise.map_err(|e| PyValueError::new_err(format!("noise {e}")))?;
        let layers: Layers = layers.iter().flatten().map(|name| parsed::<Layer>(name)).collect::<PyResult<_>>()?;
        let transmittances = [TransmittanceEstimator::Analytic, TransmittanceEstimator::Analog];
        let roulettes = [Roulette::Standard, Roulette::Thesis];
        let options = RenderOptions {
            integrator: kind,
            transmittance: named("transmittance", transmittance, &transmittances, TransmittanceEstimator::name)?,
            roulette: named("roulette", roulette, &roulettes, Roulette::name)?,
            estimator: named("estimator", estimator, &Estimator::ALL, Estimator::name)?,
            light_paths: named("light_paths", light_paths, &LightPaths::ALL, LightPaths::name)?,
            sampler: named("sampler", sampler, &SamplerKind::ALL, SamplerKind::name)?,
            spp: spp.or_else(|| noise.map(|_| NoiseLimit::MOST_SAMPLES)),
            seed,
            threads,
            crop: crop.map(|(x0, y0, x1, y1)| PixelRect { x0, y0, x1, y1 }),
            segment_first: false,
            layers,
            noise,
        };
        let method = method.map(parsed::<Method>).transpose()?;
        let prepare = PrepareOptions { method, voxel_size: voxel, threads, ..PrepareOptions::default() };
        options.validate(&self.scene).map_err(|e| exception(&e))?;
        let rendered = interruptible(py, |stop| {
            let prepared = self.prepared(&prepare, stop)?;
            let film = LiveFilm::new(prepared.film(&options, &self.name)?);
            let spp = options.spp.unwrap_or(self.scene.sample_count);
            let start = std::time::Instant::now();
            prepared.render_part(&options, &film, &FilmPart::samples(0..spp), stop)?;
            let seconds = start.elapsed().as_secs_f64();
            let mut film = film.into_film();
            film.set_run(0, prepared.run("", 0, film.counters().paths, seconds));
            let statistics = prepared.statistics(&options, &film, spp)?;
            Ok::<_, RenderError>((film.develop()?, film.develop_layers(), statistics))
        })?;
        let (image, channels, statistics) = rendered.map_err(|e| exception(&e))?;
        finished(py, image, options.kept_layers(), channels, &statistics)
    }
}

impl PyScene {
    fn prepared(
        &self,
        options: &PrepareOptions,
        stop: &dyn vdf_render::Progress,
    ) -> Result<Arc<PreparedScene>, RenderError> {
        let last = self.prepared.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let prepared = match last {
            Some((known, prepared)) if known == *options => return Ok(prepared),
            Some((_, prepared)) => prepared.with_options(options, stop)?,
            None => PreparedScene::new(Arc::clone(&self.scene), options, stop)?,
        };
        let prepared = Arc::new(prepared);
        *self.prepared.lock().unwrap_or_else(PoisonError::into_inner) = Some((*options, Arc::clone(&prepared)));
        Ok(prepared)
    }
}

fn finished(
    py: Python<'_>,
    image: Image,
    layers: Layers,
    channels: Vec<vdf_image::Channel>,
    statistics: &Statistics,
) -> PyResult<PyRendering> {
    let (width, height) = (image.width as usize, image.height as usize);
    let arrays = PyDict::new(py);
    let mut channels = channels.into_iter();
    for layer in layers.iter() {
        let planes: Vec<Vec<f32>> = channels.by_ref().take(layer.channels().len()).map(|c| c.values).collect();
        let numbers: Vec<f32> = (0..width * height).flat_map(|i| planes.iter().map(move |plane| plane[i])).collect();
        arrays.set_item(layer.name(), numbers.into_pyarray(py).reshape([height, width, planes.len()])?)?;
    }
    Ok(PyRendering {
        image: pixels_to_array(py, image)?.into_any().unbind(),
        layers: arrays.unbind(),
        statistics: dictionary(py, statistics)?.unbind(),
    })
}
