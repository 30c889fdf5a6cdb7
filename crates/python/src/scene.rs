//! A scene, with its instances, parts and views by their ids.

use std::sync::Arc;

use mateval_scene::layout::INPUT;
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyDict, PyType};

use crate::instance::{Instance, Part};
use crate::scene_source::SceneSource;
use crate::view::View;

/// A scene of a dataset.
#[pyclass(frozen, module = "mateval")]
pub struct Scene {
    /// What it shares with its views and instances.
    pub source: Arc<SceneSource>,
    instances: PyOnceLock<Py<PyAny>>,
    parts: PyOnceLock<Py<PyAny>>,
    views: PyOnceLock<Py<PyAny>>,
}

impl Scene {
    /// A scene whose instances, parts and views are not made yet.
    pub fn new(source: SceneSource) -> Self {
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
        let all = || by_id(py, self, "part", self.source.file().parts.iter().map(|p| (p.id.as_str(), Part(p.clone()))));
        Ok(self.parts.get_or_try_init(py, all)?.clone_ref(py))
    }

    /// The views by id: `input` first, then the novel ones.
    #[getter]
    fn views(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let all = || {
            let views = self.source.file().views.iter().enumerate();
            by_id(py, self, "view", views.map(|(at, view)| (view.id.as_str(), View::new(&self.source, at))))
        };
        Ok(self.views.get_or_try_init(py, all)?.clone_ref(py))
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
