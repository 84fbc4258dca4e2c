//! The proofs, for other programs.

use std::{
    ops::Range,
    sync::atomic::{AtomicU64, Ordering},
};

use glam::{DVec3, Vec3};
use numpy::{IntoPyArray as _, PyArray1, PyArray2, PyArrayDyn, PyArrayMethods as _, PyReadonlyArray3};
use pyo3::{
    exceptions::{PyIndexError, PyValueError},
    prelude::*,
    types::PyDict,
};
use rayon::prelude::*;
use vdf_geometry::{Bvh, Segment, Triangle};
use vdf_render::{Progress as _, RenderError, check_voxel_size, default_voxel_size, on_threads};
use vdf_visibility::{
    Answer, Counters, LightShape, Method, ProverOptions, Provers, QueryKind, ShadowQuery, Visibility,
};

use crate::{
    arrays::{Points, array, point, room},
    exception,
    interrupt::interruptible,
};

/// Queries between two looks whether to stop, at most. So few are asked without threads, which would take as long to start.
const QUERIES_AT_ONCE: usize = 1 << 12;

/// Points that are asked about together, light by light.
const POINTS_AT_ONCE: usize = 256;

/// Proofs that points see lights, for other programs.
///
/// ``triangles``: float32 of shape (n, 3, 3), three vertices each, in world units. ``lights``: float64 of shape (m, 3).
/// ``method`` as on the command line (``"lb"`` answers nearly all queries), chosen by the number of triangles if None;
/// ``voxel`` is the side of a voxel in world units, for the methods that need one. ``threads``: one for each processor if None.
///
/// Ctrl-C stops building and asking with KeyboardInterrupt. Raises TypeError for arrays of other numbers, and ValueError
/// for arrays of other shapes or with numbers that are not finite.
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
    lit_segments: AtomicU64,
}

/// The intervals of some segments.
#[derive(Default)]
struct Intervals {
    ends: Vec<f64>,
    lit: Vec<bool>,
    /// Of each segment and light, where its intervals end.
    numbers: Vec<i64>,
}

#[pymethods]
impl PyVisibility {
    #[new]
    #[pyo3(signature = (triangles, lights, *, method = None, voxel = None, threads = None))]
    fn new(
        py: Python<'_>,
        triangles: &Bound<'_, PyAny>,
        lights: &Bound<'_, PyAny>,
        method: Option<&str>,
        voxel: Option<f64>,
        threads: Option<usize>,
    ) -> PyResult<Self> {
        let array: PyReadonlyArray3<'_, f32> = array("triangles", "(n, 3, 3)", &[3, 3], triangles)?;
        let vertex = |v: numpy::ndarray::ArrayView1<'_, f32>| Vec3::new(v[0], v[1], v[2]);
        let triangles: Vec<Triangle> =
            array.as_array().outer_iter().map(|t| Triangle { vertices: [0, 1, 2].map(|i| vertex(t.row(i))) }).collect();
        if let Some(at) = triangles.iter().position(|t| !t.vertices.iter().all(|v| v.is_finite())) {
            return Err(PyValueError::new_err(format!("triangles: number {at} is not finite")));
        }
        let points = Points::new("lights", lights)?;
        let lights: Vec<DVec3> =
            (0..points.len()).map(|i| Ok(point(points.coordinates()?, i))).collect::<PyResult<_>>()?;
        let shapes: Vec<_> = lights.iter().map(|&p| LightShape::Point(p)).collect();
        let named = method.map(str::parse::<Method>).transpose().map_err(|e| exception(&e))?;
        let method = named.unwrap_or_else(|| Method::for_scene(&shapes, triangles.len()));
        voxel.map_or(Ok(()), check_voxel_size).map_err(|e| exception(&e))?;
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
        let (bvh, provers, report) = built.map_err(|e| exception(&e))?;
        let (seconds, bytes) = (report.seconds(), report.bytes());
        let [queries, proved, lit_segments] = [(); 3].map(|()| AtomicU64::new(0));
        Ok(Self { bvh, provers, lights, method, threads, seconds, bytes, queries, proved, lit_segments })
    }

    /// Whether the closed segments from the points to the lights meet no triangle, exactly.
    ///
    /// ``points``: float64 of shape (k, 3), read in place where they lie one after the other. The answer has shape (k, m), or
    /// (k,) with the number of a ``light``. Both ends belong to the segment: a point on a triangle sees nothing.
    ///
    /// Other threads of Python run meanwhile; they must not change ``points``. Raises IndexError if there is no such light.
    #[pyo3(signature = (points, *, light = None))]
    fn unoccluded<'py>(
        &self,
        py: Python<'py>,
        points: &Bound<'py, PyAny>,
        light: Option<usize>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        let points = Points::new("points", points)?;
        let lights = self.lights_of(light)?;
        let (n, coordinates) = (points.len(), points.coordinates()?);
        let mut answers: Vec<bool> = room(n, lights.len())?;
        if !answers.is_empty() {
            let at_once = points_at_once(&lights);
            let parts = answers.chunks_mut(at_once * lights.len()).zip(coordinates.chunks(3 * at_once)).collect();
            let counters = self.in_parts(py, parts, |(answers, points)| self.ask(lights.clone(), points, answers))?;
            counters.iter().for_each(|counters| self.count(counters));
        }
        let shape = if light.is_some() { vec![n] } else { vec![n, lights.len()] };
        answers.into_pyarray(py).reshape(shape)
    }

    /// Where segments see the lights: of each segment and light, the intervals that are not certainly dark.
    ///
    /// ``origins`` and ``ends``: float64 of shape (k, 3), the ends of the segments. Of (k, m) pairs, or of k with the number
    /// of a ``light``, pair p = i * m + j has the rows offsets[p] to offsets[p + 1] of the answer:
    ///
    /// - ``intervals``: float64 of shape (n, 2), closed intervals of t, where x(t) = origin + (end - origin) * t; disjoint and
    ///   in order,
    /// - ``lit``: bool of shape (n,), True where every x(t) sees the light, False where nothing is known: ask ``unoccluded``
    ///   there. Guard bands of some 1e-14, and whole segments with too many triangles between them and the light,
    /// - ``offsets``: int64 of shape (k * m + 1,).
    ///
    /// What is in no interval is occluded. All is exact, as ``unoccluded`` says it of x(t) in double precision. No method is asked,
    /// but the hierarchy, once a segment and light. Raises IndexError if there is no such light.
    #[pyo3(signature = (origins, ends, *, light = None))]
    #[expect(clippy::type_complexity, reason = "a tuple, as NumPy's functions with several results have it")]
    fn lit_intervals<'py>(
        &self,
        py: Python<'py>,
        origins: &Bound<'py, PyAny>,
        ends: &Bound<'py, PyAny>,
        light: Option<usize>,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<bool>>, Bound<'py, PyArray1<i64>>)> {
        let (origins, ends) = (Points::new("origins", origins)?, Points::new("ends", ends)?);
        if origins.len() != ends.len() {
            let message = format!("origins and ends must be as many, not {} and {}", origins.len(), ends.len());
            return Err(PyValueError::new_err(message));
        }
        let lights = self.lights_of(light)?;
        let (origins, ends, at_once) = (origins.coordinates()?, ends.coordinates()?, 3 * points_at_once(&lights));
        let parts = origins.chunks(at_once).zip(ends.chunks(at_once)).collect();
        let mut all = Intervals::default();
        let mut offsets = vec![0];
        for (part, counters) in self.in_parts(py, parts, |(p, q)| self.light_up(lights.clone(), p, q))? {
            self.count(&counters);
            let before = all.lit.len() as i64;
            offsets.extend(part.numbers.into_iter().map(|number| before + number));
            all.ends.extend(part.ends);
            all.lit.extend(part.lit);
        }
        let intervals = all.lit.len();
        Ok((all.ends.into_pyarray(py).reshape([intervals, 2])?, all.lit.into_pyarray(py), offsets.into_pyarray(py)))
    }

    /// The name of the method.
    #[getter]
    fn method(&self) -> &'static str {
        self.method.name()
    }

    /// ``method``, ``lights``, ``t_build`` in seconds, ``bytes``; and of all calls so far ``queries`` with those ``proved``, and
    /// ``lit_segments``.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let figures = PyDict::new(py);
        figures.set_item("method", self.method.name())?;
        figures.set_item("lights", self.lights.len())?;
        figures.set_item("t_build", self.seconds)?;
        figures.set_item("bytes", self.bytes)?;
        for (name, number) in
            [("queries", &self.queries), ("proved", &self.proved), ("lit_segments", &self.lit_segments)]
        {
            figures.set_item(name, number.load(Ordering::Relaxed))?;
        }
        Ok(figures)
    }

    fn __repr__(&self) -> String {
        format!("<vdf.Visibility by {} towards {} lights>", self.method.name(), self.lights.len())
    }
}

/// Points that are asked about between two looks whether to stop.
fn points_at_once(lights: &Range<usize>) -> usize {
    (QUERIES_AT_ONCE / lights.len().max(1)).max(1)
}

impl PyVisibility {
    fn lights_of(&self, light: Option<usize>) -> PyResult<Range<usize>> {
        match light {
            None => Ok(0..self.lights.len()),
            Some(light) if light < self.lights.len() => Ok(light..light + 1),
            Some(light) => Err(PyIndexError::new_err(format!("there is no light {light} of {}", self.lights.len()))),
        }
    }

    /// Does all parts, on threads if they are several. No threads are kept for the next time: they would be missing in a forked process.
    fn in_parts<P: Send, A: Send>(
        &self,
        py: Python<'_>,
        parts: Vec<P>,
        work: impl Fn(P) -> A + Send + Sync,
    ) -> PyResult<Vec<A>> {
        if parts.len() < 2 {
            return Ok(py.detach(|| parts.into_iter().map(work).collect()));
        }
        let done = interruptible(py, |stop| {
            let work = |part| (!stop.cancelled()).then(|| work(part));
            on_threads(self.threads, || Ok::<_, RenderError>(parts.into_par_iter().filter_map(work).collect()))
        })?;
        done.map_err(|e| exception(&e))
    }

    fn count(&self, counters: &Counters) {
        self.queries.fetch_add(counters.queries, Ordering::Relaxed);
        self.proved.fetch_add(counters.proved, Ordering::Relaxed);
        self.lit_segments.fetch_add(counters.lit_segments, Ordering::Relaxed);
    }

    /// Answers all queries from some points to these lights, point by point; asks them light by light, for light buffers answer many at once.
    fn ask(&self, lights: Range<usize>, points: &[f64], answers: &mut [bool]) -> Counters {
        let visibility = Visibility::new(&self.bvh, &self.provers);
        let mut counters = Counters::default();
        let mut queries = Vec::with_capacity(POINTS_AT_ONCE);
        let mut unoccluded = [false; POINTS_AT_ONCE];
        let together = points.chunks(3 * POINTS_AT_ONCE).zip(answers.chunks_mut(lights.len().max(1) * POINTS_AT_ONCE));
        for (points, answers) in together {
            for light in lights.clone() {
                let to = self.lights[light];
                let query = |i| ShadowQuery { from: point(points, i), to, emitter: light, kind: QueryKind::Spatial };
                queries.clear();
                queries.extend((0..points.len() / 3).map(query));
                let unoccluded = &mut unoccluded[..queries.len()];
                visibility.all_unoccluded(&queries, unoccluded, &mut counters);
                let of_light = answers.iter_mut().skip(light - lights.start).step_by(lights.len());
                for (answer, &unoccluded) in of_light.zip(&*unoccluded) {
                    *answer = unoccluded;
                }
            }
        }
        counters
    }

    /// The intervals of some segments that see these lights, segment by segment.
    fn light_up(&self, lights: Range<usize>, origins: &[f64], ends: &[f64]) -> (Intervals, Counters) {
        let visibility = Visibility::new(&self.bvh, &self.provers);
        let (mut all, mut counters) = (Intervals::default(), Counters::default());
        for i in 0..origins.len() / 3 {
            let segment = Segment::new(point(origins, i), point(ends, i));
            for light in lights.clone() {
                for (interval, answer) in visibility.lit_intervals(self.lights[light], &segment, &mut counters).parts()
                {
                    all.ends.extend(interval);
                    all.lit.push(answer == Answer::Unoccluded);
                }
                all.numbers.push(all.lit.len() as i64);
            }
        }
        (all, counters)
    }
}
