//! Pictures and lists of vectors as NumPy arrays.

use mateval_image::Picture;
use numpy::{Element, PyArray1, PyArray2, PyArray3, PyArrayMethods as _};
use pyo3::prelude::*;

/// Rows of pixels as an array of shape (height, width).
pub fn plane<'py, T: Element + Copy>(py: Python<'py>, picture: &Picture<T>) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, picture.pixels()).reshape([picture.height(), picture.width()])
}

/// Rows of pixels as an array of shape (height, width, 3).
pub fn triples<'py, P: Copy, T: Element + Copy>(
    py: Python<'py>,
    picture: &Picture<P>,
    channels: impl Fn(P) -> [T; 3],
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let values: Vec<T> = picture.pixels().iter().flat_map(|pixel| channels(*pixel)).collect();
    PyArray1::from_vec(py, values).reshape([picture.height(), picture.width(), 3])
}

/// Vectors as an array of shape (number, N).
pub fn rows<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    vectors: impl Iterator<Item = [T; N]>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let values: Vec<T> = vectors.flatten().collect();
    let count = values.len() / N;
    PyArray1::from_vec(py, values).reshape([count, N])
}
