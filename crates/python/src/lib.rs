//! vdf for Python: the module `vdf._vdf`, which `vdf` re-exports. The docstrings are for Python; those of the stubs, `vdf/__init__.pyi`, are the same,
//! which a test checks.

mod arrays;
mod images;
mod interrupt;
mod scene;
mod visibility;

use pyo3::{exceptions::PyValueError, prelude::*, types::PyDict};
use serde::Serialize;

/// The message of an error with those of its causes: OSError or one of its kinds if the system refused something, else ValueError.
fn exception(error: &(dyn std::error::Error + 'static)) -> PyErr {
    let (mut message, mut source, mut system) = (error.to_string(), error.source(), None);
    while let Some(cause) = source {
        message = format!("{message}: {cause}");
        system = system.or(cause.downcast_ref::<std::io::Error>().map(std::io::Error::kind));
        source = cause.source();
    }
    match system {
        Some(kind) => std::io::Error::new(kind, message).into(),
        None => PyValueError::new_err(message),
    }
}

/// Figures as a dictionary.
fn dictionary<'py>(py: Python<'py>, figures: &impl Serialize) -> PyResult<Bound<'py, PyDict>> {
    let json = serde_json::to_string(figures).map_err(|e| exception(&e))?;
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
