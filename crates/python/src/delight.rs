//! `mateval.delight`: the baseline `delight` on a scene's photo.

use std::sync::Arc;

use mateval_baselines::BaselineError;
use mateval_baselines::delight as baseline;
use mateval_baselines::delight::{CandidateLights, DelightOptions, DelitPhoto};
use mateval_baselines::geometry::SceneGeometry;
use mateval_image::{LinearRgb, Picture};
use numpy::{PyArray2, PyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{plane, triples};
use crate::failure::failed;
use crate::long_work::run_long;
use crate::scene::Scene;

/// A photo without its light. Its pictures are those of the input view.
#[pyclass(frozen, get_all, module = "mateval")]
pub struct Delit {
    /// Linear, 0 to 1: (height, width, 3), float32. Black where a pixel is not valid.
    base_color: Py<PyArray3<f32>>,
    /// Perceptual roughness: (height, width), float32. 0.5 unless another value explains the photo better.
    roughness: Py<PyArray2<f32>>,
    /// 1 for mirrors, else 0: (height, width), float32.
    metallic: Py<PyArray2<f32>>,
    /// The radiance that a white surface would show, apart from what it reflects: (height, width, 3), float32, linear,
    /// before exposure.
    shading: Py<PyArray3<f32>>,
    /// The radiance that does not depend on base colour: (height, width, 3), float32, linear, before exposure.
    gloss: Py<PyArray3<f32>>,
    /// How well base_color is known: (height, width), float32, 0 to 1; 0.5 where its standard error is 0.05.
    confidence: Py<PyArray2<f32>>,
    /// The radiance of each light that may shine, by its name: linear Rec. 709, before exposure.
    radiances: Py<PyDict>,
}

/// Takes the light out of a scene's photo, by physics alone: geometry is known, so that the light can be computed. The
/// result is that of `mateval baseline delight`.
///
/// lights chooses which lights may shine: "room" (light fixtures, ceilings, what is seen to glow, the world around, and
/// the lights of a stage) or "stage" (the latter alone, as in PSDR-Room).
#[pyfunction]
#[pyo3(signature = (scene, *, lights="room"))]
pub fn delight(py: Python<'_>, scene: &Scene, lights: &str) -> PyResult<Delit> {
    let lights = match lights {
        "room" => CandidateLights::Room,
        "stage" => CandidateLights::Stage,
        other => return Err(PyValueError::new_err(format!("lights: expected 'room' or 'stage', found '{other}'"))),
    };
    let options = DelightOptions { lights, ..DelightOptions::default() };
    let source = Arc::clone(&scene.source);
    let delit = run_long(py, move |progress| -> Result<DelitPhoto, BaselineError> {
        let geometry = SceneGeometry::read(source.folder(), source.file())?;
        baseline::delight(&geometry, &options, progress)
    })?;
    into_python(py, &delit.map_err(failed)?)
}

fn into_python(py: Python<'_>, delit: &DelitPhoto) -> PyResult<Delit> {
    let colors = |picture: &Picture<LinearRgb>| PyResult::Ok(triples(py, picture, |rgb| rgb.0)?.unbind());
    let numbers = |picture: &Picture<f32>| PyResult::Ok(plane(py, picture)?.unbind());
    let radiances = PyDict::new(py);
    for fitted in &delit.lights {
        let [r, g, b] = fitted.radiance;
        radiances.set_item(&fitted.light.name, (r, g, b))?;
    }
    Ok(Delit {
        base_color: colors(&delit.base_color)?,
        roughness: numbers(&delit.roughness)?,
        metallic: numbers(&delit.metallic)?,
        shading: colors(&delit.shading)?,
        gloss: colors(&delit.gloss)?,
        confidence: numbers(&delit.confidence)?,
        radiances: radiances.unbind(),
    })
}
