//! A scene of an opened dataset, shared by all Python objects that are made from it.

use std::sync::{Arc, OnceLock};

use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::SceneFolder;
use mateval_scene::open::Dataset;
use mateval_scene::{SceneError, TriangleMesh, plain_instances};

/// A scene and the dataset that it belongs to.
pub struct SceneSource {
    /// The dataset.
    pub dataset: Arc<Dataset>,
    /// The scene's place in the dataset.
    at: usize,
    /// The instances' meshes, once one of them was read.
    meshes: OnceLock<Vec<Arc<TriangleMesh>>>,
}

impl SceneSource {
    /// The scene at this place of the dataset, which must exist.
    pub fn new(dataset: Arc<Dataset>, at: usize) -> Self {
        Self { dataset, at, meshes: OnceLock::new() }
    }

    /// `scene.json`.
    pub fn file(&self) -> &SceneFile {
        &self.dataset.scenes[self.at]
    }

    /// Its folder.
    pub fn folder(&self) -> SceneFolder {
        self.dataset.folder(&self.file().id)
    }

    /// The mesh of an instance by its place in `scene.json`. The first call reads those of all instances.
    pub fn mesh(&self, instance: usize) -> Result<Arc<TriangleMesh>, SceneError> {
        if let Some(meshes) = self.meshes.get() {
            return Ok(Arc::clone(&meshes[instance]));
        }
        // Reading fails where the file holds other instances than scene.json.
        let surfaces = plain_instances::read(&self.folder(), self.file())?.surfaces;
        let meshes: Vec<Arc<TriangleMesh>> = surfaces.into_iter().map(|surface| Arc::new(surface.mesh)).collect();
        // Two threads may both read; no lock is held meanwhile, which a forked child could wait for.
        Ok(Arc::clone(&self.meshes.get_or_init(|| meshes)[instance]))
    }
}
