//! `.build`: what `prep` keeps in a dataset's folder to work on it. No reader of a dataset needs it.

use std::path::{Path, PathBuf};

use crate::lease::{self, Lease};
use crate::{SceneError, SceneId, work_folder};

/// The folder's name in a dataset's folder.
pub const BUILD: &str = ".build";

/// The paths of one dataset's `.build`.
#[derive(Clone, Debug)]
pub struct BuildFolder(PathBuf);

impl BuildFolder {
    /// That of the dataset in `root`, whether it exists or not.
    pub fn of(root: &Path) -> Self {
        Self(root.join(BUILD))
    }

    /// The folder itself.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// States that the folder was made by `prep build`.
    pub fn key(&self) -> PathBuf {
        self.0.join("key.json")
    }

    /// The recipe of the build.
    pub fn recipe(&self) -> PathBuf {
        self.0.join("recipe.toml")
    }

    /// The folder of the marks of all scenes.
    pub fn marks(&self) -> PathBuf {
        self.0.join("scenes")
    }

    /// What `prep build` notes of a scene that it has made.
    pub fn mark(&self, scene: &SceneId) -> PathBuf {
        self.marks().join(format!("{scene}.json"))
    }

    /// The hashes of a scene's files.
    pub fn hashes(&self, scene: &SceneId) -> PathBuf {
        self.0.join("hashes").join(format!("{scene}.json"))
    }

    /// What making a scene has cost.
    pub fn cost(&self, scene: &SceneId) -> PathBuf {
        self.0.join("costs").join(format!("{scene}.json"))
    }

    /// The place of a scene that was left out of the dataset.
    pub fn left_out(&self, scene: &SceneId) -> PathBuf {
        self.0.join("left_out").join(scene.as_str())
    }

    /// The right to change a scene. Fails where another process changes it or finishes the dataset.
    pub fn lease_of_scene(&self, scene: &SceneId) -> Result<Lease, SceneError> {
        let (path, what) = self.scene_lease(scene);
        let lease = Lease::take(&path, &what)?;
        let (path, what) = self.whole_lease();
        lease::check_free(&path, &what)?;
        Ok(lease)
    }

    /// The right to write the files that describe the whole dataset. Fails where another process does so, or changes
    /// one of its scenes.
    pub fn lease_of_whole(&self, scenes: &[SceneId]) -> Result<Lease, SceneError> {
        let (path, what) = self.whole_lease();
        let lease = Lease::take(&path, &what)?;
        for scene in scenes {
            let (path, what) = self.scene_lease(scene);
            lease::check_free(&path, &what)?;
        }
        Ok(lease)
    }

    /// The right to replace the dataset as a whole. Fails where another process works on anything of it.
    pub fn lease_of_all(&self) -> Result<Lease, SceneError> {
        let entries = std::fs::read_dir(self.0.join("leases/scenes")).into_iter().flatten().flatten();
        let ids = entries.filter_map(|entry| SceneId::new(entry.file_name().to_str()?).ok());
        self.lease_of_whole(&ids.collect::<Vec<_>>())
    }

    /// The right to begin or change the build; waits for other processes, which need it for a moment.
    pub fn lease_of_start(&self) -> Result<Lease, SceneError> {
        Lease::wait(&self.0.join("leases/start"), "the start of the build")
    }

    /// The right to write the dataset's `compare.json`; waits for other processes, which need it for a moment.
    pub fn lease_of_verdict(&self) -> Result<Lease, SceneError> {
        Lease::wait(&self.0.join("leases/verdict"), "the dataset's compare.json")
    }

    fn scene_lease(&self, scene: &SceneId) -> (PathBuf, String) {
        (self.0.join("leases/scenes").join(scene.as_str()), format!("scene '{scene}'"))
    }

    fn whole_lease(&self) -> (PathBuf, String) {
        (self.0.join("leases/whole"), "the dataset's manifest".to_owned())
    }

    /// Notes that the scene is about to differ from what the manifest lists.
    pub fn note_change(&self, scene: &SceneId) -> Result<(), SceneError> {
        let path = self.changed_folder();
        std::fs::create_dir_all(&path).map_err(SceneError::io("make", &path))?;
        let path = path.join(scene.as_str());
        std::fs::write(&path, "").map_err(SceneError::io("write", path))
    }

    /// The scenes that differ from what the manifest lists.
    pub fn changed(&self) -> Vec<SceneId> {
        let Ok(entries) = std::fs::read_dir(self.changed_folder()) else { return Vec::new() };
        let mut changed: Vec<SceneId> =
            entries.flatten().filter_map(|entry| SceneId::new(entry.file_name().to_str()?).ok()).collect();
        changed.sort();
        changed
    }

    /// Notes that the manifest lists all scenes as they are.
    pub fn forget_changes(&self) -> Result<(), SceneError> {
        work_folder::remove(&self.changed_folder())
    }

    fn changed_folder(&self) -> PathBuf {
        self.0.join("changed")
    }
}
