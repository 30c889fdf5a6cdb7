//! `mateval.Submission`: a folder that appears whole or not at all.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use mateval_baselines::submission::check_out;
use mateval_dataset::dataset::Instance;
use mateval_dataset::ids::quoted;
use mateval_dataset::open::Dataset as OpenDataset;
use mateval_dataset::submission::{
    Cost, MAP_SIZES, Map, SUBMISSION, SUBMISSION_FORMAT, SubmissionFile, instance_folder,
};
use mateval_dataset::{DatasetError, SceneId, json};
use mateval_files::work_folder::{WorkFolder, make_folder};
use mateval_image::exr_io::{self, Precision};
use mateval_image::{ImageError, LinearRgb, Picture, png_io};
use mateval_submission::map_file::{BASE_COLOR_RANGE, SCALAR_RANGE};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{MapInput, Numbers};
use crate::dataset::{opened, scene_place};
use crate::long_work::{failed, unknown_id};

/// Writes a submission. Its folder appears when the `with` block ends without an exception, or when `close` is called;
/// until then it is hidden beside its place, and a failed or killed program leaves nothing at that place.
///
/// cost is a dictionary with `seconds_a_scene` and, optionally, `hardware`. trained_on lists the datasets that the method
/// was trained on, as in "3D-FRONT"; boards mark those that their scenes come from. force replaces an earlier submission.
#[pyclass(frozen, module = "mateval")]
pub struct Submission {
    dataset: Arc<OpenDataset>,
    out: PathBuf,
    file: SubmissionFile,
    open: Mutex<Option<OpenFolder>>,
}

/// The hidden folder and the process that made it.
struct OpenFolder {
    /// None once it was moved to its place.
    work: Option<WorkFolder>,
    process: u32,
}

impl Drop for OpenFolder {
    /// A forked child must not remove its parent's folder.
    fn drop(&mut self) {
        if self.process != std::process::id() {
            std::mem::forget(self.work.take());
        }
    }
}

#[pymethods]
impl Submission {
    /// Starts a submission to the dataset, open or the path of its folder, in the folder `out`, which must not exist.
    #[new]
    #[pyo3(signature = (out, dataset, *, method, description=String::new(), url=None, licence=None, cost=None, trained_on=None, force=false))]
    #[expect(clippy::too_many_arguments, reason = "Python's keyword arguments")]
    fn new(
        out: PathBuf,
        dataset: &Bound<'_, PyAny>,
        method: String,
        description: String,
        url: Option<String>,
        licence: Option<String>,
        cost: Option<Bound<'_, PyDict>>,
        trained_on: Option<Vec<String>>,
        force: bool,
    ) -> PyResult<Self> {
        let dataset = opened(dataset)?;
        let file = SubmissionFile {
            format: SUBMISSION_FORMAT.to_owned(),
            method,
            description,
            url,
            licence,
            cost: cost.map(|cost| cost_of(&cost)).transpose()?,
            trained_on: trained_on.unwrap_or_default(),
            oracle: false,
            assumed_encodings: std::collections::BTreeMap::new(),
            geometry: dataset.file.perturbation(),
            dataset_manifest_sha256: dataset.file.scored_manifest_sha256().to_owned(),
        };
        // Later writes go to the same folder even if the program changes its current one.
        let out = std::path::absolute(&out)?;
        check_out(&dataset, &out, force).map_err(failed)?;
        let open = OpenFolder { work: Some(WorkFolder::start(&out).map_err(failed)?), process: std::process::id() };
        Ok(Self { dataset, out, file, open: Mutex::new(Some(open)) })
    }

    /// Writes maps of one instance. Each map is square, with a side of 64 to 4096 texels of its own choice: base_color
    /// (side, side, 3), RGB (not BGR as OpenCV reads it), roughness and metallic (side, side), rows from the top. Other
    /// shapes raise `mateval.WrongShape`, which is a ValueError.
    ///
    /// The dtype decides the encoding. uint8 and uint16 are stored as they are, as PNG: base_color is sRGB, roughness
    /// and metallic are linear. float16, float32 and float64 are linear, and stored as EXR: base_color from -1 to 16,
    /// the others from 0 to 1. A map is written once.
    #[pyo3(signature = (scene, instance, *, base_color=None, roughness=None, metallic=None))]
    fn write(
        &self,
        py: Python<'_>,
        scene: &str,
        instance: &str,
        base_color: Option<Bound<'_, PyAny>>,
        roughness: Option<Bound<'_, PyAny>>,
        metallic: Option<Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (scene, instance) = self.find(scene, instance)?;
        let open = self.opened();
        let folder = instance_folder(self.work(&open)?, scene, &instance.id);
        // Everything is checked before anything is written.
        let given = [(Map::BaseColor, base_color), (Map::Roughness, roughness), (Map::Metallic, metallic)];
        let given = given.into_iter().filter_map(|(map, array)| Some((map, array?)));
        let files = given.map(|(map, array)| MapFile::new(map, &array, &folder)).collect::<PyResult<Vec<_>>>()?;
        if files.is_empty() {
            return Err(PyValueError::new_err("expected base_color, roughness or metallic, found none of them"));
        }
        drop(open);
        py.detach(|| {
            make_folder(&folder)?;
            files.iter().try_for_each(MapFile::write).map_err(DatasetError::from)
        })
        .map_err(failed)
    }

    /// Writes `submission.json` and moves the folder to its place. Closing a closed submission does nothing.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let mut open = self.opened();
        if open.is_some() {
            self.work(&open)?;
        }
        let Some(work) = open.take().and_then(|mut folder| folder.work.take()) else { return Ok(()) };
        // A thread that is attached to Python may wait for the lock, so it is never held while detached.
        drop(open);
        py.detach(|| {
            json::write(&work.path().join(SUBMISSION), &self.file)?;
            Ok::<_, DatasetError>(work.finish()?)
        })
        .map_err(failed)
    }

    /// Removes everything that was written. Discarding a closed submission does nothing.
    fn discard(&self) {
        drop(self.opened().take());
    }

    fn __enter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __exit__(
        &self,
        py: Python<'_>,
        kind: &Bound<'_, PyAny>,
        _value: &Bound<'_, PyAny>,
        _traceback: &Bound<'_, PyAny>,
    ) -> PyResult<()> {
        if kind.is_none() {
            return self.close(py);
        }
        self.discard();
        Ok(())
    }

    fn __repr__(&self) -> String {
        let state = if self.opened().is_some() { "open" } else { "closed" };
        format!("<mateval.Submission '{}', {state}>", self.out.display())
    }
}

impl Submission {
    fn opened(&self) -> MutexGuard<'_, Option<OpenFolder>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The hidden folder. Fails where the submission is closed or belongs to the parent process.
    fn work<'a>(&self, open: &'a Option<OpenFolder>) -> PyResult<&'a Path> {
        let out = self.out.display();
        let Some(OpenFolder { work: Some(work), process }) = open else {
            return Err(PyValueError::new_err(format!("the submission '{out}' is closed; expected an open one")));
        };
        if *process != std::process::id() {
            let message = format!("the submission '{out}' was opened by process {process}; write it there");
            return Err(PyValueError::new_err(message));
        }
        Ok(work.path())
    }

    fn find(&self, scene: &str, instance: &str) -> PyResult<(&SceneId, &Instance)> {
        let file = &self.dataset.scenes[scene_place(&self.dataset, scene)?];
        let Some(found) = file.instances.iter().find(|file| file.id.as_str() == instance) else {
            let known = quoted(&file.instances.iter().map(|file| &file.id).collect::<Vec<_>>());
            return Err(unknown_id(format!("scene '{scene}' has no instance '{instance}'; it has {known}")));
        };
        if found.atlas.is_none() {
            let message = format!("instance '{instance}' of scene '{scene}' has no atlas, so it takes no maps");
            return Err(PyValueError::new_err(message));
        }
        Ok((&file.id, found))
    }
}

/// A checked map and its file.
struct MapFile {
    path: PathBuf,
    map: Map,
    side: usize,
    input: MapInput,
}

impl MapFile {
    fn new(map: Map, array: &Bound<'_, PyAny>, folder: &Path) -> PyResult<Self> {
        let input = MapInput::new(map.stem(), array)?;
        let is_color = map == Map::BaseColor;
        let side = input.side(is_color, &MAP_SIZES)?;
        input.check_range(if is_color { &BASE_COLOR_RANGE } else { &SCALAR_RANGE })?;
        let [png, exr] = ["png", "exr"].map(|ending| folder.join(map.stem()).with_extension(ending));
        if let Some(earlier) = [&png, &exr].into_iter().find(|path| path.exists()) {
            let found = format!("expected a map that was not written yet, found '{}'", earlier.display());
            return Err(PyValueError::new_err(format!("{}: {found}", map.stem())));
        }
        let is_stored = matches!(input.numbers, Numbers::Bytes(_) | Numbers::Words(_));
        Ok(Self { path: if is_stored { png } else { exr }, map, side, input })
    }

    fn write(&self) -> Result<(), ImageError> {
        let is_color = self.map == Map::BaseColor;
        match &self.input.numbers {
            Numbers::Bytes(bytes) if is_color => png_io::write_rgb_bytes(&self.path, &self.picture(triples(bytes))?),
            Numbers::Bytes(bytes) => png_io::write_grey_bytes(&self.path, &self.picture(bytes.clone())?),
            Numbers::Words(words) if is_color => png_io::write_rgb_words(&self.path, &self.picture(triples(words))?),
            Numbers::Words(words) => png_io::write_ids(&self.path, &self.picture(words.clone())?),
            Numbers::Halves(floats) => self.write_floats(floats, Precision::Half),
            Numbers::Floats(floats) => self.write_floats(floats, Precision::Float),
        }
    }

    fn write_floats(&self, floats: &[f32], precision: Precision) -> Result<(), ImageError> {
        if self.map == Map::BaseColor {
            let colours = self.picture(triples(floats))?.map(LinearRgb);
            return exr_io::write_linear(&self.path, &colours, precision);
        }
        exr_io::write_scalar(&self.path, &self.picture(floats.to_vec())?, precision)
    }

    fn picture<T: Copy>(&self, texels: Vec<T>) -> Result<Picture<T>, ImageError> {
        Picture::new(self.side, self.side, texels)
    }
}

fn triples<T: Copy>(values: &[T]) -> Vec<[T; 3]> {
    values.as_chunks::<3>().0.to_vec()
}

fn cost_of(given: &Bound<'_, PyDict>) -> PyResult<Cost> {
    let known = ["seconds_a_scene", "hardware"];
    let is_known = |key: &Bound<'_, PyAny>| key.extract::<String>().is_ok_and(|key| known.contains(&key.as_str()));
    if let Some((key, _)) = given.iter().find(|(key, _)| !is_known(key)) {
        return Err(PyValueError::new_err(format!("cost: expected 'seconds_a_scene' and 'hardware', found {key:?}")));
    }
    let Some(seconds) = given.get_item("seconds_a_scene")? else {
        return Err(PyValueError::new_err("cost: expected 'seconds_a_scene', found no such key"));
    };
    let wrong = || PyTypeError::new_err(format!("cost: expected seconds_a_scene as a number, found {seconds:?}"));
    let seconds_a_scene: f64 = seconds.extract().map_err(|_| wrong())?;
    if !(seconds_a_scene.is_finite() && seconds_a_scene >= 0.0) {
        let message = format!("cost: expected seconds_a_scene of at least 0, found {seconds_a_scene}");
        return Err(PyValueError::new_err(message));
    }
    let hardware = given.get_item("hardware")?.map(|text| text.extract()).transpose()?.unwrap_or_default();
    Ok(Cost { seconds_a_scene, hardware })
}
