//! The meshes of a scene's `instances.glb`, whose uv say which texels of a map are looked up.
//!
//! Only a map with bad texels needs them, so they are read when the first one asks.

use std::sync::OnceLock;

use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::{SceneError, TriangleMesh, plain_instances};

/// The atlas meshes of one scene, one for each instance in the order of `scene.json`.
pub struct AtlasMeshes<'a> {
    source: Source<'a>,
    read: OnceLock<Vec<TriangleMesh>>,
}

enum Source<'a> {
    Dataset(&'a Dataset, &'a SceneFile),
    Memory(&'a [TriangleMesh]),
}

impl<'a> AtlasMeshes<'a> {
    /// The meshes of a scene of a dataset, which are read when they are first asked for.
    pub fn on_demand(dataset: &'a Dataset, scene: &'a SceneFile) -> Self {
        Self { source: Source::Dataset(dataset, scene), read: OnceLock::new() }
    }

    /// Meshes that have been read, one for each instance.
    pub fn in_memory(meshes: &'a [TriangleMesh]) -> Self {
        Self { source: Source::Memory(meshes), read: OnceLock::new() }
    }

    /// The mesh of an instance, by its place in `scene.json`; panics where there is no such instance. Fails where
    /// `instances.glb` cannot be read, differs from the manifest or does not fit `scene.json`.
    pub fn mesh(&self, instance: usize) -> Result<&TriangleMesh, SceneError> {
        match self.source {
            Source::Memory(meshes) => Ok(&meshes[instance]),
            Source::Dataset(dataset, scene) => {
                if let Some(meshes) = self.read.get() {
                    return Ok(&meshes[instance]);
                }
                let meshes = read(dataset, scene)?;
                // Of two threads that read them at the same time the first wins; both have read the same.
                Ok(&self.read.get_or_init(|| meshes)[instance])
            }
        }
    }
}

fn read(dataset: &Dataset, scene: &SceneFile) -> Result<Vec<TriangleMesh>, SceneError> {
    // They decide what a bad texel scores, so they must be those that the dataset's fingerprint covers.
    dataset.check_files(&scene.id, |file| file == "geometry/instances.glb")?;
    let instances = plain_instances::read(&dataset.folder(&scene.id), scene)?;
    Ok(instances.surfaces.into_iter().map(|surface| surface.mesh).collect())
}
