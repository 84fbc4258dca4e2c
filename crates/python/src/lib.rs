//! vdf for Python: the module `vdf._vdf`, which `vdf` re-exports. What is public, with shapes and units, is documented in `vdf/__init__.pyi`.

mod images;
mod interrupt;
mod scene;
mod visibility;

use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use serde::Serialize;

/// The message of an error with those of its causes.
fn value_error(error: &dyn std::error::Error) -> PyErr {
    let (mut message, mut source) = (error.to_string(), error.source());
    while let Some(cause) = source {
        message = format!("{message}: {cause}");
        source = cause.source();
    }
    PyValueError::new_err(message)
}

/// Figures as a dictionary.
fn dictionary<'py>(py: Python<'py>, figures: &impl Serialize) -> PyResult<Bound<'py, PyDict>> {
    let json = serde_json::to_string(figures).map_err(|e| value_error(&e))?;
    Ok(py.import("json")?.call_method1("loads", (json,))?.cast_into()?)
}

#[pymodule]
fn _vdf(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<scene::PyScene>()?;
    module.add_class::<scene::PyRendering>()?;
    module.add_class::<visibility::PyVisibility>()?;
    module.add_function(wrap_pyfunction!(scene::load, module)?)?;
    module.add_function(wrap_pyfunction!(images::compare, module)?)?;
    module.add_function(wrap_pyfunction!(images::read_exr, module)?)?;
    module.add_function(wrap_pyfunction!(images::write_exr, module)?)
}
