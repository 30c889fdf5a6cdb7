//! A dataset: scenes by their ids, with their instances, parts and views by theirs. The Python class `mateval.Dataset`
//! makes it a mapping.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context as _;
use mateval_dataset::ids::quoted;
use mateval_dataset::layout::INPUT;
use mateval_dataset::open;
use mateval_eval::protocol::Protocol;
use mateval_eval::shown::{scene_light, scene_lightings};
use mateval_image::SrgbRgb;
use mateval_image::transfer::byte_from_unit;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyIterator, PyList, PyType};

use crate::arrays::triples;
use crate::instance::{Instance, Part, SharedScene};
use crate::long_work::{Listener, failed, run_long, shown_in_notebook, unknown_id};
use crate::view::{View, check_truth_held};

/// A dataset on disk. Opening it checks its JSON files against its manifest; pictures are read when they are used.
#[pyclass(frozen, subclass, mapping, module = "mateval._core")]
pub struct Dataset(pub Arc<open::Dataset>);

#[pymethods]
impl Dataset {
    /// Opens the dataset in the folder `path`.
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let opened = py.detach(|| open::Dataset::open(&path).context("cannot open the dataset"));
        Ok(Self(Arc::new(opened.map_err(failed)?.with_twins())))
    }

    /// Its folder, as it was given.
    #[getter]
    fn path(&self) -> PathBuf {
        self.0.root.clone()
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.0.file.name
    }

    /// Its own version.
    #[getter]
    fn version(&self) -> &str {
        &self.0.file.version
    }

    /// SHA-256 of its manifest, which identifies it.
    #[getter]
    fn manifest_sha256(&self) -> &str {
        &self.0.file.manifest_sha256
    }

    /// The renderer of the photo and of the pictures of other views; None until all views are rendered.
    #[getter]
    fn photo_renderer(&self) -> Option<&str> {
        self.0.file.photo_renderer.as_ref().map(|renderer| renderer.as_str())
    }

    /// Ids of the scenes that the dataset lists and whose folders are missing: they were not downloaded.
    #[getter]
    fn absent(&self) -> Vec<&str> {
        self.0.absent.iter().map(|scene| scene.as_str()).collect()
    }

    /// By the id of each twin, the id of the scene that it shows and the name of its lighting.
    #[getter]
    fn twins(&self) -> BTreeMap<&str, (&str, String)> {
        let twins = self.0.file.twins.iter();
        twins.map(|(id, twin)| (id.as_str(), (twin.of.as_str(), twin.lighting.to_string()))).collect()
    }

    fn __len__(&self) -> usize {
        self.0.scenes.len()
    }

    fn __getitem__(&self, key: &str) -> PyResult<Scene> {
        let at = scene_place(&self.0, key)?;
        Ok(Scene::new(SharedScene::new(Arc::clone(&self.0), at)))
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.0.scenes.iter().map(|scene| scene.id.as_str()))?.try_iter()
    }

    fn __repr__(&self) -> String {
        let root = self.0.root.display();
        format!("<mateval.Dataset '{}' in '{root}', {} scenes>", self.0.file.name, self.0.scenes.len())
    }
}

/// An open dataset, or that in the folder of a path.
pub fn opened(given: &Bound<'_, PyAny>) -> PyResult<Arc<open::Dataset>> {
    let dataset = given.py().import("mateval.dataset")?.getattr("open")?.call1((given,))?;
    Ok(Arc::clone(&dataset.cast::<Dataset>()?.get().0))
}

/// The place of the scene with this id. Fails where the dataset has none.
pub fn scene_place(dataset: &open::Dataset, id: &str) -> PyResult<usize> {
    dataset.scenes.iter().position(|scene| scene.id.as_str() == id).ok_or_else(|| {
        let root = dataset.root.display();
        if dataset.absent.iter().any(|absent| absent.as_str() == id) {
            return unknown_id(format!(
                "scene '{id}' is listed in '{root}/dataset.json', but its folder is not there: unpack 'scenes/{id}.tar' in '{root}'"
            ));
        }
        let known = quoted(&dataset.scenes.iter().map(|scene| &scene.id).collect::<Vec<_>>());
        unknown_id(format!("'{root}' has no scene '{id}'; it has {known}"))
    })
}

/// The name of a scene's own light, beside its lightings.
const OWN_LIGHT: &str = "true";

/// A scene of a dataset.
#[pyclass(frozen, module = "mateval")]
pub struct Scene {
    /// What it shares with its views and instances.
    pub source: Arc<SharedScene>,
    instances: PyOnceLock<Py<PyAny>>,
    parts: PyOnceLock<Py<PyAny>>,
    views: PyOnceLock<Py<PyAny>>,
}

impl Scene {
    /// A scene whose instances, parts and views are not made yet.
    pub fn new(source: SharedScene) -> Self {
        let (instances, parts, views) = (PyOnceLock::new(), PyOnceLock::new(), PyOnceLock::new());
        Self { source: Arc::new(source), instances, parts, views }
    }
}

#[pymethods]
impl Scene {
    /// Its id.
    #[getter]
    fn id(&self) -> &str {
        self.source.file().id.as_str()
    }

    /// The house that it belongs to. Scenes of one house are not independent of each other.
    #[getter]
    fn house(&self) -> &str {
        &self.source.file().source.house
    }

    /// The factor by which radiance is multiplied before it is clipped for a picture or a metric.
    #[getter]
    fn exposure(&self) -> f64 {
        self.source.file().exposure
    }

    /// The source's file of the input picture, where that is a photo from elsewhere; None where it is rendered. The
    /// light of a photo is not known, so such a scene is scored without its light.
    #[getter]
    fn photo(&self) -> Option<&str> {
        self.source.file().photo.as_ref().map(|photo| photo.file.as_str())
    }

    /// Whether materials of the source were replaced by others that were drawn with a secret key.
    #[getter]
    fn redressed(&self) -> bool {
        self.source.file().redressed.is_some()
    }

    /// The lights that `render` takes: "true" for the scene's own, then lightings such as "warm_cool" and "alone_1", in
    /// which its lights have other weights. Empty for twins and photos from elsewhere, which have no renders. The
    /// lightings follow from the ground truth, which is read at each access: raises `mateval.Withheld` where the
    /// dataset does not hold it, and `mateval.Error` where the scene is not rendered yet.
    #[getter]
    fn lightings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let (dataset, file) = (&self.source.dataset, self.source.file());
        if file.photo.is_some() || dataset.file.twins.contains_key(&file.id) {
            return Ok(Vec::new());
        }
        check_truth_held(&self.source, &self.source.folder().truth())?;
        let protocol = Protocol::named(Protocol::DEFAULT).map_err(failed)?;
        let found = py.detach(|| scene_lightings(dataset, file, &protocol)).map_err(failed)?;
        let others = found.iter().map(ToString::to_string);
        Ok(std::iter::once(OWN_LIGHT.to_owned()).chain(others).collect())
    }

    /// The objects that methods provide textures for, by id, in the order of their index.
    #[getter]
    fn instances(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let all = || {
            let instances = self.source.file().instances.iter().enumerate();
            by_id(py, self, "instance", instances.map(|(at, i)| (i.id.as_str(), Instance::new(&self.source, at))))
        };
        Ok(self.instances.get_or_try_init(py, all)?.clone_ref(py))
    }

    /// The source's own parts of the instances, by id, in the order of their index.
    #[getter]
    fn parts(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let all = || by_id(py, self, "part", self.source.file().parts.iter().map(|p| (p.id.as_str(), Part::new(p))));
        Ok(self.parts.get_or_try_init(py, all)?.clone_ref(py))
    }

    /// The views by id: `input` first, then the novel ones.
    #[getter]
    fn views(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let all = || {
            let views = self.source.file().views.iter().enumerate();
            let source = &self.source;
            let view = |at| View { source: Arc::clone(source), at };
            by_id(py, self, "view", views.map(|(at, file)| (file.id.as_str(), view(at))))
        };
        Ok(self.views.get_or_try_init(py, all)?.clone_ref(py))
    }

    /// Renders the scene with these maps, as the scorer shows them: by the id of the view, (height, width, 3), uint8,
    /// RGB, sRGB after exposure. The views are those that share the input view's place. The dataset's ground truth is
    /// needed. Raises `mateval.Error` for a captured room, whose materials and lights are not known.
    ///
    /// maps holds, by the id of the instance, `mateval.Maps` or dictionaries with base_color, roughness and metallic, as
    /// `Submission.write` takes them; or it is the path of a submission. Instances without maps are grey, as they are
    /// scored. light is one of `lightings`. samples is the number of paths a pixel in each of two halves.
    #[pyo3(signature = (maps, *, light="true", samples=16, progress=None))]
    fn render<'py>(
        slf: &Bound<'py, Self>,
        maps: Bound<'py, PyAny>,
        light: &str,
        samples: u32,
        progress: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let render = slf.py().import("mateval.rendering")?.getattr("render")?;
        render.call1((slf, maps, light, samples, progress))
    }

    /// The paths of a pickled scene: the copy opens the same folder.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, (PathBuf, String))> {
        let reopen = py.import("mateval.dataset")?.getattr("reopened_scene")?;
        Ok((reopen, (std::path::absolute(&self.source.dataset.root)?, self.id().to_owned())))
    }

    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        shown_in_notebook(slf, "scene")
    }

    /// The input view, whose picture methods may see.
    #[getter]
    fn input<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        self.views(py)?.into_bound(py).get_item(INPUT)
    }

    fn __repr__(&self) -> String {
        let file = self.source.file();
        format!("<mateval.Scene '{}', {} instances, {} views>", file.id, file.instances.len(), file.views.len())
    }
}

/// A `mateval.ById` of these items.
fn by_id<'a, T: pyo3::PyClass + Into<PyClassInitializer<T>>>(
    py: Python<'_>,
    scene: &Scene,
    kind: &str,
    items: impl Iterator<Item = (&'a str, T)>,
) -> PyResult<Py<PyAny>> {
    static CLASS: PyOnceLock<Py<PyType>> = PyOnceLock::new();
    let all = PyDict::new(py);
    for (id, item) in items {
        all.set_item(id, Py::new(py, item)?)?;
    }
    let owner = format!("scene '{}'", scene.source.file().id);
    Ok(CLASS.import(py, "mateval.by_id", "ById")?.call1((owner, kind, all))?.unbind())
}

/// For `mateval.Scene.render`: the pictures of a submission that the scorer compares, by the id of the view.
#[pyfunction]
pub fn render<'py>(
    py: Python<'py>,
    scene: &Scene,
    submission: PathBuf,
    light: &str,
    samples: u32,
    progress: Option<Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    scene.source.file().check_materials_known().map_err(failed)?;
    let lighting = match light {
        OWN_LIGHT => None,
        name => Some(name.parse().map_err(|_| {
            let expected = "a name of `Scene.lightings`, such as 'true' or 'warm_cool'";
            PyValueError::new_err(format!("light: expected {expected}, found '{name}'"))
        })?),
    };
    if !(1..=4096).contains(&samples) {
        return Err(PyValueError::new_err(format!("samples: expected 1 to 4096, found {samples}")));
    }
    let mut protocol = Protocol::named(Protocol::DEFAULT).map_err(failed)?;
    protocol.light.samples.each_half = samples;
    let listener = Listener::of(py, progress)?;
    let source = Arc::clone(&scene.source);
    let views = run_long(py, &listener, move |progress| {
        scene_light(&source.dataset, source.file(), &[&submission], &protocol, lighting, progress)
    })?
    .map_err(failed)?;
    if views.is_empty() {
        let has = "`Scene.lightings` lists those that it has";
        return Err(PyValueError::new_err(format!("light: scene '{}' has no lighting '{light}'; {has}", scene.id())));
    }
    let pictures = PyDict::new(py);
    for view in views {
        for picture in view.predicted {
            pictures.set_item(view.id.as_str(), triples(py, picture, |SrgbRgb(rgb)| rgb.map(byte_from_unit))?)?;
        }
    }
    Ok(pictures)
}
