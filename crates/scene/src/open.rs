//! An open dataset: its JSON files, read and checked once.

use std::path::{Path, PathBuf};

use crate::dataset::{DatasetFile, FORMAT, SceneFile, TargetsFile};
use crate::ids::SceneId;
use crate::layout::{DATASET, MANIFEST, SceneFolder, TARGETS};
use crate::{SceneError, json, manifest};

/// A finished dataset on disk.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Its folder.
    pub root: PathBuf,
    /// `dataset.json`.
    pub file: DatasetFile,
    /// `targets.json`.
    pub targets: TargetsFile,
    /// `scene.json` of every scene, in the dataset's order.
    pub scenes: Vec<SceneFile>,
}

impl Dataset {
    /// Opens the dataset in `root`. Its JSON must be sound and its manifest the one that `dataset.json` names; the other
    /// files are not hashed (that is `prep verify`'s work).
    pub fn open(root: &Path) -> Result<Self, SceneError> {
        let path = root.join(DATASET);
        let file: DatasetFile = json::read(&path)?;
        if file.format != FORMAT {
            let what = format!("format '{}'; this version reads '{FORMAT}'", file.format);
            return Err(SceneError::Unsupported { path, what });
        }
        let found = manifest::sha256_of_file(&root.join(MANIFEST))?;
        if found != file.manifest_sha256 {
            let what = format!(
                "manifest_sha256 is {}, but MANIFEST.sha256 hashes to {found}; an unfinished `prep` or a changed file",
                file.manifest_sha256
            );
            return Err(SceneError::Unsupported { path, what });
        }
        let targets = json::read(&root.join(TARGETS))?;
        let scenes = file
            .scenes
            .iter()
            .map(|id| json::read(&SceneFolder::of(root, id).scene_file()))
            .collect::<Result<Vec<SceneFile>, _>>()?;
        Ok(Self { root: root.to_owned(), file, targets, scenes })
    }

    /// The scene's folder.
    pub fn folder(&self, scene: &SceneId) -> SceneFolder {
        SceneFolder::of(&self.root, scene)
    }
}
