//! A dataset: scenes by their ids. The Python class `mateval.Dataset` makes it a mapping.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Context as _;
use mateval_scene::open;
use pyo3::prelude::*;
use pyo3::types::{PyIterator, PyList};

use crate::failure::{failed, unknown_id};
use crate::scene::Scene;
use crate::scene_source::SceneSource;

/// A dataset on disk. Opening it checks its JSON files against its manifest; pictures are read when they are used.
#[pyclass(frozen, subclass, mapping, module = "mateval._core")]
pub struct Dataset(pub Arc<open::Dataset>);

#[pymethods]
impl Dataset {
    /// Opens the dataset in the folder `path`.
    #[new]
    fn new(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let opened = py.detach(|| open::Dataset::open(&path).context("cannot open the dataset"));
        Ok(Self(Arc::new(opened.map_err(failed)?)))
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

    fn __len__(&self) -> usize {
        self.0.scenes.len()
    }

    fn __getitem__(&self, key: &str) -> PyResult<Scene> {
        let at = scene_place(&self.0, key)?;
        Ok(Scene::new(SceneSource::new(Arc::clone(&self.0), at)))
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        PyList::new(py, self.0.scenes.iter().map(|scene| scene.id.as_str()))?.try_iter()
    }

    fn __repr__(&self) -> String {
        let root = self.0.root.display();
        format!("<mateval.Dataset '{}' in '{root}', {} scenes>", self.0.file.name, self.0.scenes.len())
    }
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
        let known = quoted(dataset.scenes.iter().map(|scene| scene.id.as_str()));
        unknown_id(format!("'{root}' has no scene '{id}'; it has {known}"))
    })
}

/// `'a', 'b'`.
pub fn quoted<'a>(ids: impl Iterator<Item = &'a str>) -> String {
    ids.map(|id| format!("'{id}'")).collect::<Vec<_>>().join(", ")
}
