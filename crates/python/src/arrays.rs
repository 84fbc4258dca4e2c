//! Arrays that come from Python: what is wrong with one is said by name, and nothing is converted in silence.

use glam::DVec3;
use numpy::{
    Element, PyArray, PyArrayDescrMethods as _, PyArrayMethods as _, PyReadonlyArray, PyReadonlyArray2, PyUntypedArray,
    PyUntypedArrayMethods as _, dtype, ndarray::Dimension,
};
use pyo3::{
    exceptions::{PyMemoryError, PyTypeError, PyValueError},
    prelude::*,
};

/// Looks at an array of numbers of type `T`. `shape` is for messages; its last axes are as long as `last` says.
pub(crate) fn array<'py, T: Element, D: Dimension>(
    what: &str,
    shape: &str,
    last: &[usize],
    given: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    let wanted = dtype::<T>(given.py());
    let Ok(untyped) = given.cast::<PyUntypedArray>() else {
        let message = format!("{what} must be a NumPy array of {wanted} of shape {shape}, not {}", given.get_type());
        return Err(PyTypeError::new_err(message));
    };
    if !untyped.dtype().is_equiv_to(&wanted) {
        let message = format!("{what} must be of {wanted}, not {}; .astype(numpy.{wanted}) converts", untyped.dtype());
        return Err(PyTypeError::new_err(message));
    }
    let Some(array) = given.cast::<PyArray<T, D>>().ok().filter(|_| untyped.shape().ends_with(last)) else {
        let message = format!("{what} must be of shape {shape}, not {}", given.getattr("shape")?);
        return Err(PyValueError::new_err(message));
    };
    if !untyped.is_aligned() {
        return Err(PyValueError::new_err(format!("{what}: its numbers are not aligned in memory; .copy() mends it")));
    }
    Ok(array.try_readonly()?)
}

/// The coordinates of points, in place where they lie one after the other, as they mostly do.
pub(crate) struct Points<'py> {
    array: PyReadonlyArray2<'py, f64>,
    copied: Option<Vec<f64>>,
}

impl<'py> Points<'py> {
    /// Looks at an array of shape (n, 3), all of whose numbers are finite.
    pub(crate) fn new(what: &str, given: &Bound<'py, PyAny>) -> PyResult<Self> {
        let array: PyReadonlyArray2<'py, f64> = array(what, "(n, 3)", &[3], given)?;
        let copied = match array.as_array().as_slice() {
            Some(_) => None,
            None => {
                let mut copied = room(array.shape()[0], 3)?;
                copied.iter_mut().zip(array.as_array()).for_each(|(to, &from)| *to = from);
                Some(copied)
            }
        };
        let points = Self { array, copied };
        match points.coordinates()?.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(PyValueError::new_err(format!("{what}: number {} is not finite", at / 3))),
            None => Ok(points),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.array.shape()[0]
    }

    /// Three numbers a point.
    pub(crate) fn coordinates(&self) -> PyResult<&[f64]> {
        match &self.copied {
            Some(copied) => Ok(copied),
            None => Ok(self.array.as_slice()?),
        }
    }
}

/// The point that three coordinates make.
pub(crate) fn point(coordinates: &[f64], i: usize) -> DVec3 {
    DVec3::new(coordinates[3 * i], coordinates[3 * i + 1], coordinates[3 * i + 2])
}

/// A table of zeros, or MemoryError.
pub(crate) fn room<T: Clone + Default>(rows: usize, columns: usize) -> PyResult<Vec<T>> {
    let mut room = Vec::new();
    let length = rows.checked_mul(columns).filter(|&length| room.try_reserve_exact(length).is_ok());
    let length =
        length.ok_or_else(|| PyMemoryError::new_err(format!("there is no memory for {rows} x {columns} numbers")))?;
    room.resize(length, T::default());
    Ok(room)
}
