//! Errors of the libraries as exceptions of the package `mateval.errors`.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::PyType;

/// `mateval.Error` with the text that the command prints after `error: `.
pub fn failed(error: impl Into<anyhow::Error>) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "Error", mateval_cli::error_text(&error.into()))
}

/// `mateval.UnknownId`.
pub fn unknown_id(message: String) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "UnknownId", message)
}

/// `mateval.Withheld`.
pub fn withheld(message: String) -> PyErr {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    exception(&CLASS, "Withheld", message)
}

fn exception(class: &'static PyOnceLock<Py<PyType>>, name: &str, message: String) -> PyErr {
    Python::attach(|py| match class.import(py, "mateval.errors", name) {
        Ok(class) => PyErr::from_type(class.clone(), message),
        // The extension module was copied out of its package.
        Err(_) => PyRuntimeError::new_err(message),
    })
}
