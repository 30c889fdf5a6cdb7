//! The baselines `nn` and `procedural` on arrays, as `mateval.lift` and `mateval.procedural`, and `delight` on a
//! scene's photo, as `mateval.delight`.

use std::collections::BTreeMap;
use std::num::NonZero;
use std::sync::{Arc, Mutex, PoisonError};

use mateval_baselines::delight::{CandidateLights, DelightOptions, DelitPhoto};
use mateval_baselines::estimate::Estimate;
use mateval_baselines::fill::FillRule;
use mateval_baselines::geometry::SceneGeometry;
use mateval_baselines::nn::{NnOptions, lift_scene, seen_pixels};
use mateval_baselines::procedural::{ProceduralOptions, scene_maps};
use mateval_baselines::{BaselineError, delight as baseline, maps};
use mateval_dataset::layout::INPUT;
use mateval_dataset::submission::MAP_SIZES;
use mateval_dataset::{PartSetId, Progress};
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_submission::map_file::BASE_COLOR_RANGE;
use numpy::{PyArray2, PyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{MapInput, plane, triples};
use crate::dataset::Scene;
use crate::instance::SharedScene;
use crate::long_work::{Listener, failed, run_long, shown_in_notebook, wrong_shape};

/// The maps of an instance, encoded as a submission stores them.
#[pyclass(frozen, get_all, module = "mateval")]
pub struct Maps {
    /// sRGB: (side, side, 3), uint8, RGB; None if the estimate has none.
    base_color: Option<Py<PyArray3<u8>>>,
    /// Perceptual roughness times 255: (side, side), uint8; None if the estimate has none.
    roughness: Option<Py<PyArray2<u8>>>,
    /// Metallic times 255: (side, side), uint8; None if the estimate has none.
    metallic: Option<Py<PyArray2<u8>>>,
    /// Whether the input view shows each texel: (side, side), bool; None from procedural without keep_seen.
    seen: Option<Py<PyArray2<bool>>>,
}

/// The maps of an instance before Python gets them.
struct MadeMaps {
    maps: maps::Maps,
    seen: Option<Mask>,
}

/// Lifts an estimate of the input view to the atlases of all instances that have one: seen texels get the estimate, the
/// others that of the seen points nearest to them. The maps are those of `mateval baseline nn`.
///
/// base_color has the shape (height, width, 3), RGB (not BGR as OpenCV reads it), roughness and metallic (height,
/// width); all have one size, which need not be the view's. At least one of them must be given. encoding says how
/// base_color is stored: "linear" or "srgb"; by default floats are linear, and uint8 and uint16 are sRGB. Floats must
/// be finite in every pixel, also where the view is not valid; they are clipped to 0 to 1. Other shapes, and other
/// proportions than the view's, raise `mateval.WrongShape`, which is a ValueError.
///
/// neighbours is the number of seen points that an unseen texel is computed from, normal_weight the distance in metres
/// (0 to 100) that opposite normals count as. any_instance searches the points of all instances. atlas_size is the side
/// of all maps in texels; None is the dataset's own size of each. progress is described in `mateval.progress`.
///
/// Returns the maps by the id of the instance, in the scene's order.
#[pyfunction]
#[pyo3(signature = (scene, *, base_color=None, roughness=None, metallic=None, encoding=None, neighbours=1, normal_weight=0.0, any_instance=false, atlas_size=None, progress=None))]
#[expect(clippy::too_many_arguments, reason = "Python's keyword arguments")]
pub fn lift<'py>(
    py: Python<'py>,
    scene: &Scene,
    base_color: Option<Bound<'py, PyAny>>,
    roughness: Option<Bound<'py, PyAny>>,
    metallic: Option<Bound<'py, PyAny>>,
    encoding: Option<&str>,
    neighbours: u8,
    normal_weight: f64,
    any_instance: bool,
    atlas_size: Option<u32>,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let listener = Listener::of(py, progress)?;
    let maps = [("base_color", base_color), ("roughness", roughness), ("metallic", metallic)];
    let options = options(neighbours, normal_weight, any_instance, atlas_size)?;
    let estimate = estimate(scene, maps, encoding)?;
    let source = Arc::clone(&scene.source);
    let all =
        run_long(py, &listener, move |progress| lifted(&source, &estimate, &options, progress))?.map_err(failed)?;
    by_id(py, scene, all)
}

/// The maps by the id of the instance.
fn by_id<'py>(py: Python<'py>, scene: &Scene, all: BTreeMap<usize, MadeMaps>) -> PyResult<Bound<'py, PyDict>> {
    let by_id = PyDict::new(py);
    for (instance, made) in all {
        by_id.set_item(scene.source.file().instances[instance].id.as_str(), made.into_python(py)?)?;
    }
    Ok(by_id)
}

/// An estimate of pictures of one size, with the proportions of the input view.
fn estimate(
    scene: &Scene,
    given: [(&'static str, Option<Bound<'_, PyAny>>); 3],
    encoding: Option<&str>,
) -> PyResult<Estimate> {
    let is_srgb = match encoding {
        None => None,
        Some("srgb") => Some(true),
        Some("linear") => Some(false),
        Some(other) => {
            return Err(PyValueError::new_err(format!("encoding: expected 'linear' or 'srgb', found '{other}'")));
        }
    };
    let read = |(name, array): &(&'static str, Option<Bound<'_, PyAny>>)| {
        array.as_ref().map(|array| MapInput::new(name, array)).transpose()
    };
    let inputs = [read(&given[0])?, read(&given[1])?, read(&given[2])?];
    inputs.iter().flatten().try_for_each(|input| input.check_range(&BASE_COLOR_RANGE))?;
    let mut present = inputs.iter().flatten();
    let Some(first) = present.next() else {
        return Err(PyValueError::new_err("expected base_color, roughness or metallic, found none of them"));
    };
    present.try_for_each(|other| other.check_same_size(first))?;
    let [base_color, roughness, metallic] = &inputs;
    let estimate = Estimate {
        base_color: base_color.as_ref().map(|map| map.linear(is_srgb)).transpose()?,
        roughness: roughness.as_ref().map(MapInput::plane).transpose()?,
        metallic: metallic.as_ref().map(MapInput::plane).transpose()?,
        ..Estimate::default()
    };
    let scene = scene.source.file();
    // The baseline itself reports a scene without an input view.
    if let Some(view) = scene.view(INPUT) {
        let k = &view.camera.intrinsics;
        let region = estimate.region(scene.id.as_str(), (k.width as usize, k.height as usize));
        region.map_err(|error| wrong_shape(error.to_string()))?;
    }
    Ok(estimate)
}

fn options(neighbours: u8, normal_weight_m: f64, any_instance: bool, atlas_size: Option<u32>) -> PyResult<NnOptions> {
    let Some(neighbours) = NonZero::new(usize::from(neighbours)) else {
        return Err(PyValueError::new_err("neighbours: expected 1 to 255, found 0"));
    };
    if !(0.0..=100.0).contains(&normal_weight_m) {
        return Err(PyValueError::new_err(format!("normal_weight: expected 0 to 100 m, found {normal_weight_m}")));
    }
    if let Some(size) = atlas_size.filter(|size| !MAP_SIZES.contains(&(*size as usize))) {
        let (least, most) = (MAP_SIZES.start(), MAP_SIZES.end());
        return Err(PyValueError::new_err(format!("atlas_size: expected {least} to {most} texels, found {size}")));
    }
    Ok(NnOptions { rule: FillRule { neighbours, normal_weight_m }, any_instance, atlas_size })
}

/// The maps by the instance's place in the scene.
fn lifted(
    source: &SharedScene,
    estimate: &Estimate,
    options: &NnOptions,
    progress: Progress<'_>,
) -> Result<BTreeMap<usize, MadeMaps>, BaselineError> {
    let geometry = SceneGeometry::read(source.folder(), source.file())?;
    let seen = seen_pixels(&geometry, estimate)?;
    let all = Mutex::new(BTreeMap::new());
    lift_scene(&geometry, estimate, &seen, options, progress, |instance, lifted, medians| {
        let given = estimate.given_maps();
        let made = match lifted {
            Some(lifted) => MadeMaps { maps: lifted.maps, seen: Some(lifted.seen) },
            None => {
                let side = *MAP_SIZES.start();
                let maps = maps::Maps::constant(medians.of(&geometry, instance), given);
                MadeMaps { maps, seen: Some(Picture::filled(side, side, false)) }
            }
        };
        all.lock().unwrap_or_else(PoisonError::into_inner).insert(instance, made);
        Ok(())
    })?;
    Ok(all.into_inner().unwrap_or_else(PoisonError::into_inner))
}

#[pymethods]
impl Maps {
    /// The arrays of pickled maps.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, MapArrays)> {
        let rebuild = py.import("mateval._core")?.getattr("rebuilt_maps")?;
        let base_color = self.base_color.as_ref().map(|map| map.clone_ref(py));
        let [roughness, metallic] = [&self.roughness, &self.metallic].map(|map| Some(map.as_ref()?.clone_ref(py)));
        Ok((rebuild, (base_color, roughness, metallic, self.seen.as_ref().map(|map| map.clone_ref(py)))))
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        shown_in_notebook(slf, "maps")
    }
}

/// The fields of [`Maps`], in their order.
type MapArrays =
    (Option<Py<PyArray3<u8>>>, Option<Py<PyArray2<u8>>>, Option<Py<PyArray2<u8>>>, Option<Py<PyArray2<bool>>>);

/// The copy of pickled maps.
#[pyfunction]
pub fn rebuilt_maps(
    base_color: Option<Py<PyArray3<u8>>>,
    roughness: Option<Py<PyArray2<u8>>>,
    metallic: Option<Py<PyArray2<u8>>>,
    seen: Option<Py<PyArray2<bool>>>,
) -> Maps {
    Maps { base_color, roughness, metallic, seen }
}

impl MadeMaps {
    fn into_python(self, py: Python<'_>) -> PyResult<Maps> {
        let colours = |picture: Picture<[u8; 3]>| PyResult::Ok(triples(py, picture, |rgb| rgb)?.unbind());
        let numbers = |picture: Picture<u8>| PyResult::Ok(plane(py, picture)?.unbind());
        Ok(Maps {
            base_color: self.maps.base_color.map(colours).transpose()?,
            roughness: self.maps.roughness.map(numbers).transpose()?,
            metallic: self.maps.metallic.map(numbers).transpose()?,
            seen: self.seen.map(|seen| PyResult::Ok(plane(py, seen)?.unbind())).transpose()?,
        })
    }
}

/// Gives each part a procedural graph that is fitted to an estimate of the input view, so that patterns continue where
/// the view shows nothing; parts without a pattern have their median. The maps are those of
/// `mateval baseline procedural`.
///
/// base_color (RGB), roughness, metallic and encoding are as `lift` takes them; base_color must be given.
/// `mateval.delight` makes all maps from the photo.
///
/// part_set names the parts; None stands for those of the source. keep_seen keeps the estimate in texels that the input
/// view shows. detail, 0 to 1, is how much of a pattern's randomness is kept.
///
/// Returns the maps by the id of the instance, in the scene's order.
#[pyfunction]
#[pyo3(signature = (scene, *, base_color=None, roughness=None, metallic=None, encoding=None, part_set=None, keep_seen=false, detail=1.0, progress=None))]
#[expect(clippy::too_many_arguments, reason = "Python's keyword arguments")]
pub fn procedural<'py>(
    py: Python<'py>,
    scene: &Scene,
    base_color: Option<Bound<'py, PyAny>>,
    roughness: Option<Bound<'py, PyAny>>,
    metallic: Option<Bound<'py, PyAny>>,
    encoding: Option<&str>,
    part_set: Option<&str>,
    keep_seen: bool,
    detail: f64,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let listener = Listener::of(py, progress)?;
    let maps = [("base_color", base_color), ("roughness", roughness), ("metallic", metallic)];
    let estimate = estimate(scene, maps, encoding)?;
    let part_set = part_set.map(|name| name.parse::<PartSetId>()).transpose();
    let part_set = part_set.map_err(|fault| PyValueError::new_err(format!("part_set: {fault}")))?;
    let options = ProceduralOptions { part_set, keep_seen, detail, ..ProceduralOptions::default() };
    options.check().map_err(|fault| PyValueError::new_err(fault.to_string()))?;
    let source = Arc::clone(&scene.source);
    let all = run_long(py, &listener, move |progress| -> Result<BTreeMap<usize, MadeMaps>, BaselineError> {
        let geometry = SceneGeometry::read(source.folder(), source.file())?;
        let all = scene_maps(&geometry, &estimate, &options, progress)?.into_iter();
        Ok(all.map(|(instance, baked)| (instance, MadeMaps { maps: baked.maps, seen: baked.seen })).collect())
    })?;
    by_id(py, scene, all.map_err(failed)?)
}

/// A photo without its light. Its pictures are those of the input view; colours are RGB.
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
/// the lights of a stage) or "stage" (the latter alone, as in PSDR-Room). progress is described in `mateval.progress`.
#[pyfunction]
#[pyo3(signature = (scene, *, lights="room", progress=None))]
pub fn delight<'py>(
    py: Python<'py>,
    scene: &Scene,
    lights: &str,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Delit> {
    let listener = Listener::of(py, progress)?;
    let lights: CandidateLights = lights
        .parse()
        .map_err(|_| PyValueError::new_err(format!("lights: expected 'room' or 'stage', found '{lights}'")))?;
    let options = DelightOptions { lights, ..DelightOptions::default() };
    let source = Arc::clone(&scene.source);
    let delit = run_long(py, &listener, move |progress| -> Result<DelitPhoto, BaselineError> {
        let geometry = SceneGeometry::read(source.folder(), source.file())?;
        baseline::delight(&geometry, &options, progress)
    })?;
    delit_into_python(py, delit.map_err(failed)?)
}

fn delit_into_python(py: Python<'_>, delit: DelitPhoto) -> PyResult<Delit> {
    let colors = |picture: Picture<LinearRgb>| PyResult::Ok(triples(py, picture, |rgb| rgb.0)?.unbind());
    let numbers = |picture: Picture<f32>| PyResult::Ok(plane(py, picture)?.unbind());
    let radiances = PyDict::new(py);
    for fitted in &delit.lights {
        let [r, g, b] = fitted.radiance;
        radiances.set_item(&fitted.light.name, (r, g, b))?;
    }
    Ok(Delit {
        base_color: colors(delit.base_color)?,
        roughness: numbers(delit.roughness)?,
        metallic: numbers(delit.metallic)?,
        shading: colors(delit.shading)?,
        gloss: colors(delit.gloss)?,
        confidence: numbers(delit.confidence)?,
        radiances: radiances.unbind(),
    })
}
