//! Where the maps of an instance lie in a submission's folder.

use std::path::{Path, PathBuf};

use mateval_scene::submission::{Map, instance_folder};
use mateval_scene::{InstanceId, SceneId};

/// The instance that maps belong to, in one submission.
#[derive(Clone, Copy)]
pub(crate) struct MapFolder<'a> {
    pub(crate) submission: &'a Path,
    pub(crate) scene: &'a SceneId,
    pub(crate) instance: &'a InstanceId,
}

impl MapFolder<'_> {
    /// The two places of a map: as PNG, as EXR.
    pub(crate) fn candidates(&self, map: Map) -> [PathBuf; 2] {
        let folder = instance_folder(self.submission, self.scene, self.instance);
        ["png", "exr"].map(|ending| folder.join(map.stem()).with_extension(ending))
    }

    /// Those of the two that exist.
    pub(crate) fn present(&self, map: Map) -> Vec<PathBuf> {
        self.candidates(map).into_iter().filter(|path| exists(path)).collect()
    }
}

/// Whether anything exists at a path, a link that leads nowhere included.
pub(crate) fn exists(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}
