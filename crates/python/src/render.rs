//! Pictures of a scene under its own lights with given maps, for `mateval.Scene.render`.

use std::path::PathBuf;
use std::sync::Arc;

use mateval_eval::protocol::{Protocol, SampleRules};
use mateval_eval::shown::scene_light;
use mateval_image::SrgbRgb;
use mateval_image::transfer::byte_from_unit;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::triples;
use crate::dataset::Scene;
use crate::long_work::{Listener, failed, run_long};

/// The pictures of a submission that the scorer compares, and the truth's: by the id of the view.
#[pyfunction]
pub fn render<'py>(
    py: Python<'py>,
    scene: &Scene,
    submission: PathBuf,
    light: &str,
    samples: u32,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Bound<'py, PyDict>)> {
    let lighting = match light {
        "true" => None,
        name => Some(name.parse().map_err(|_| {
            let expected = "'true', 'warm_cool', 'alone_1', 'alone_2', ...";
            PyValueError::new_err(format!("light: expected {expected}, found '{name}'"))
        })?),
    };
    if !(1..=4096).contains(&samples) {
        return Err(PyValueError::new_err(format!("samples: expected 1 to 4096, found {samples}")));
    }
    let mut protocol = Protocol::named("mateval-3").map_err(failed)?;
    protocol.light.samples =
        SampleRules { at_320x240: samples, least: samples, most: samples, ..protocol.light.samples };
    let listener = Listener::of(py, progress)?;
    let source = Arc::clone(&scene.source);
    let views = run_long(py, &listener, move |progress| {
        scene_light(&source.dataset, source.file(), &[&submission], &protocol, lighting, progress)
    })?
    .map_err(failed)?;
    let pictures = [PyDict::new(py), PyDict::new(py)];
    for view in views {
        let shown = [view.predicted.into_iter().next(), Some(view.reference)];
        for (of_view, picture) in pictures.iter().zip(shown) {
            let bytes = picture.map(|picture| triples(py, picture, |SrgbRgb(rgb)| rgb.map(byte_from_unit)));
            of_view.set_item(view.id.as_str(), bytes.transpose()?)?;
        }
    }
    let [predicted, truth] = pictures;
    Ok((predicted, truth))
}
