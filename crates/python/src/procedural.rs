//! `mateval.procedural`: the baseline `procedural` on arrays.

use std::collections::BTreeMap;
use std::sync::Arc;

use mateval_baselines::BaselineError;
use mateval_baselines::estimate::Estimate;
use mateval_baselines::geometry::SceneGeometry;
use mateval_baselines::procedural::{ProceduralOptions, scene_maps};
use mateval_scene::{PartSetId, Progress};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::failure::failed;
use crate::lift::{MadeMaps, by_id, estimate};
use crate::long_work::run_long;
use crate::scene::Scene;
use crate::scene_source::SceneSource;

/// Gives each part a procedural graph that is fitted to an estimate of the input view, so that patterns continue where
/// the view shows nothing; parts without a pattern have their median. The maps are those of
/// `mateval baseline procedural`.
///
/// base_color has the shape (height, width, 3), roughness and metallic (height, width); all have one size, which need
/// not be the view's. Floats are linear; uint8 and uint16 hold base_color as sRGB. base_color must be given.
/// `mateval.delight` makes all of them from the photo.
///
/// part_set names the parts; None stands for those of the source. keep_seen keeps the estimate in texels that the input
/// view shows. detail, 0 to 1, is how much of a pattern's randomness is kept.
///
/// Returns the maps by the id of the instance, in the scene's order.
#[pyfunction]
#[pyo3(signature = (scene, *, base_color=None, roughness=None, metallic=None, part_set=None, keep_seen=false, detail=1.0))]
#[expect(clippy::too_many_arguments, reason = "Python's keyword arguments")]
pub fn procedural<'py>(
    py: Python<'py>,
    scene: &Scene,
    base_color: Option<Bound<'py, PyAny>>,
    roughness: Option<Bound<'py, PyAny>>,
    metallic: Option<Bound<'py, PyAny>>,
    part_set: Option<&str>,
    keep_seen: bool,
    detail: f64,
) -> PyResult<Bound<'py, PyDict>> {
    let estimate = estimate([("base_color", base_color), ("roughness", roughness), ("metallic", metallic)])?;
    let part_set = part_set.map(|name| name.parse::<PartSetId>()).transpose();
    let part_set = part_set.map_err(|fault| PyValueError::new_err(format!("part_set: {fault}")))?;
    let options = ProceduralOptions { part_set, keep_seen, detail, ..ProceduralOptions::default() };
    options.check().map_err(|fault| PyValueError::new_err(fault.to_string()))?;
    let source = Arc::clone(&scene.source);
    let all = run_long(py, move |progress| made(&source, &estimate, &options, progress))?.map_err(failed)?;
    by_id(py, scene, all)
}

/// The maps by the instance's place in the scene.
fn made(
    source: &SceneSource,
    estimate: &Estimate,
    options: &ProceduralOptions,
    progress: Progress<'_>,
) -> Result<BTreeMap<usize, MadeMaps>, BaselineError> {
    let geometry = SceneGeometry::read(source.folder(), source.file())?;
    let mut all = BTreeMap::new();
    for (instance, baked) in scene_maps(&geometry, estimate, options, progress)? {
        all.insert(instance, MadeMaps { maps: baked.maps, seen: baked.seen });
    }
    Ok(all)
}
