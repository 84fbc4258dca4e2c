//! The proofs, for other programs.

use std::sync::atomic::{AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use numpy::{
    IntoPyArray as _, PyArrayDyn, PyArrayMethods as _, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods as _,
};
use pyo3::{
    exceptions::{PyIndexError, PyValueError},
    prelude::*,
    types::PyDict,
};
use rayon::prelude::*;
use vdf_geometry::{Bvh, Triangle};
use vdf_render::{Progress as _, RenderError, default_voxel_size, on_threads};
use vdf_visibility::{Counters, LightShape, Method, ProverOptions, Provers, QueryKind, ShadowQuery, Visibility};

use crate::{interrupt::interruptible, value_error};

/// Points between two looks whether to stop.
const POINTS_PER_LOOK: usize = 1 << 12;

#[pyclass(name = "Visibility", module = "vdf", frozen)]
pub(crate) struct PyVisibility {
    bvh: Bvh,
    provers: Provers,
    lights: Vec<DVec3>,
    method: Method,
    threads: Option<usize>,
    seconds: f64,
    bytes: usize,
    queries: AtomicU64,
    proved: AtomicU64,
}

fn shape_error(what: &str, shape: &str) -> PyErr {
    PyValueError::new_err(format!("{what} must be an array of shape {shape}"))
}

/// Points of an array of (n, 3).
fn points(what: &str, array: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<DVec3>> {
    if array.shape()[1] != 3 {
        return Err(shape_error(what, "(n, 3)"));
    }
    let points: Vec<DVec3> = array.as_array().rows().into_iter().map(|p| DVec3::new(p[0], p[1], p[2])).collect();
    match points.iter().position(|p| !p.is_finite()) {
        Some(at) => Err(PyValueError::new_err(format!("{what}: number {at} is not finite"))),
        None => Ok(points),
    }
}

#[pymethods]
impl PyVisibility {
    #[new]
    #[pyo3(signature = (triangles, lights, *, method = None, voxel = None, threads = None))]
    fn new(
        py: Python<'_>,
        triangles: PyReadonlyArray3<'_, f32>,
        lights: PyReadonlyArray2<'_, f64>,
        method: Option<&str>,
        voxel: Option<f64>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        if triangles.shape()[1..] != [3, 3] {
            return Err(shape_error("triangles", "(n, 3, 3)"));
        }
        let lights = points("lights", &lights)?;
        let vertex = |v: numpy::ndarray::ArrayView1<'_, f32>| Vec3::new(v[0], v[1], v[2]);
        let view = triangles.as_array();
        let triangles: Vec<Triangle> =
            view.outer_iter().map(|t| Triangle { vertices: [0, 1, 2].map(|i| vertex(t.row(i))) }).collect();
        if let Some(at) = triangles.iter().position(|t| !t.vertices.iter().all(|v| v.is_finite())) {
            return Err(PyValueError::new_err(format!("triangles: number {at} is not finite")));
        }
        let shapes: Vec<_> = lights.iter().map(|&p| LightShape::Point(p)).collect();
        let named = method.map(str::parse::<Method>).transpose().map_err(|e| value_error(&e))?;
        let method = named.unwrap_or_else(|| Method::for_scene(&shapes, triangles.len()));
        let built = interruptible(py, |stop| {
            on_threads(threads, || {
                let bvh = Bvh::new(&triangles);
                let bounds = lights.iter().fold(*bvh.bounds(), |bounds, &p| bounds.with(p));
                let voxel_size = voxel.unwrap_or_else(|| default_voxel_size(&bounds));
                let options = ProverOptions { method, voxel_size, ..ProverOptions::default() };
                let (provers, report) = Provers::build(&options, &triangles, bounds, &shapes, stop)?;
                Ok::<_, RenderError>((bvh, provers, report))
            })
        })?;
        let (bvh, provers, report) = built.map_err(|e| value_error(&e))?;
        let (queries, proved) = (AtomicU64::new(0), AtomicU64::new(0));
        let (seconds, bytes) = (report.seconds(), report.bytes());
        Ok(Self { bvh, provers, lights, method, threads, seconds, bytes, queries, proved })
    }

    #[pyo3(signature = (points, *, light = None))]
    fn unoccluded<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        light: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        if points.shape()[1] != 3 {
            return Err(shape_error("points", "(n, 3)"));
        }
        if light.is_some_and(|light| light >= self.lights.len()) {
            return Err(PyIndexError::new_err(format!("there are {} lights", self.lights.len())));
        }
        let lights = light.map_or(0..self.lights.len(), |light| light..light + 1);
        let n = points.shape()[0];
        let shape = if light.is_some() { vec![n] } else { vec![n, lights.len()] };
        // In place where the points lie one after the other, as they mostly do.
        let (view, copied) = (points.as_array(), std::cell::OnceCell::new());
        let coordinates: &[f64] =
            view.as_slice().unwrap_or_else(|| copied.get_or_init(|| view.iter().copied().collect::<Vec<f64>>()));
        if let Some(at) = coordinates.iter().position(|x| !x.is_finite()) {
            return Err(PyValueError::new_err(format!("points: number {} is not finite", at / 3)));
        }
        let answers = interruptible(py, |stop| {
            on_threads(self.threads, || {
                let mut answers = vec![false; n * lights.len()];
                let counters = answers
                    .par_chunks_mut(POINTS_PER_LOOK * lights.len().max(1))
                    .zip(coordinates.par_chunks(3 * POINTS_PER_LOOK))
                    .map(|(answers, coordinates)| {
                        if stop.cancelled() {
                            Counters::default()
                        } else {
                            self.ask(lights.clone(), coordinates, answers)
                        }
                    })
                    .reduce(Counters::default, |mut a, b| {
                        a += b;
                        a
                    });
                self.queries.fetch_add(counters.queries, Ordering::Relaxed);
                self.proved.fetch_add(counters.proved, Ordering::Relaxed);
                Ok::<_, RenderError>(answers)
            })
        })?;
        answers.map_err(|e| value_error(&e))?.into_pyarray(py).reshape(shape)
    }

    #[getter]
    fn method(&self) -> &'static str {
        self.method.name()
    }

    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let figures = PyDict::new(py);
        figures.set_item("method", self.method.name())?;
        figures.set_item("lights", self.lights.len())?;
        figures.set_item("t_build", self.seconds)?;
        figures.set_item("bytes", self.bytes)?;
        figures.set_item("queries", self.queries.load(Ordering::Relaxed))?;
        figures.set_item("proved", self.proved.load(Ordering::Relaxed))?;
        Ok(figures)
    }

    fn __repr__(&self) -> String {
        format!("<vdf.Visibility by {} towards {} lights>", self.method.name(), self.lights.len())
    }
}

impl PyVisibility {
    /// Answers all queries from some points to these lights, point by point.
    fn ask(&self, lights: std::ops::Range<usize>, coordinates: &[f64], answers: &mut [bool]) -> Counters {
        const BATCH: usize = 64;
        let visibility = Visibility::new(&self.bvh, &self.provers);
        let mut counters = Counters::default();
        let query = |(i, light): (usize, usize)| ShadowQuery {
            from: DVec3::new(coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2]),
            to: self.lights[light],
            emitter: light,
            kind: QueryKind::Spatial,
        };
        let all = (0..coordinates.len() / 3).flat_map(|i| lights.clone().map(move |light| (i, light)));
        let queries: Vec<ShadowQuery> = all.map(query).collect();
        for (queries, answers) in queries.chunks(BATCH).zip(answers.chunks_mut(BATCH)) {
            visibility.all_unoccluded(queries, answers, &mut counters);
        }
        counters
    }
}
