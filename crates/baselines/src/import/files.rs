//! Which file tells of an instance.

use std::path::{Path, PathBuf};

use mateval_scene::source_folder::SourceFolder;
use mateval_scene::{InstanceId, SceneId};

use super::donor::{Donor, MAX_FILE_BYTES};
use super::{gltf_donor, obj_donor};
use crate::error::BaselineError;

const MESHES: [&str; 3] = ["glb", "gltf", "obj"];

/// The folder of imports.
pub struct ImportFolder {
    path: PathBuf,
}

impl ImportFolder {
    /// At that path.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// `<scene>/<instance>.glb`, `.gltf` or `.obj`: the name of the first that is there.
    pub fn mesh_of_instance(&self, scene: &SceneId, instance: &InstanceId) -> Option<String> {
        self.first(&format!("{scene}/{instance}"), &MESHES)
    }

    /// `<scene>.glb`, `.gltf` or `.obj`: the name of the first that is there.
    pub fn mesh_of_scene(&self, scene: &SceneId) -> Option<String> {
        self.first(scene.as_str(), &MESHES)
    }

    /// `<scene>.json`, where it is there.
    pub fn materials_of_scene(&self, scene: &SceneId) -> Option<String> {
        self.first(scene.as_str(), &["json"])
    }

    fn first(&self, stem: &str, endings: &[&str]) -> Option<String> {
        endings.iter().map(|ending| format!("{stem}.{ending}")).find(|name| self.path.join(name).is_file())
    }

    /// Where a file is; an error where it leads out of the folder.
    pub fn checked_path(&self, name: &str) -> Result<PathBuf, BaselineError> {
        let invalid = |what| BaselineError::BadImport { path: self.path.join(name), what };
        self.folder()?.path(name).map_err(|fault| invalid(fault.message))
    }

    /// Reads a mesh and its textures; nothing outside the folder.
    pub fn read_mesh(&self, name: &str) -> Result<Donor, BaselineError> {
        let read = if name.ends_with(".obj") { obj_donor::read } else { gltf_donor::read };
        let invalid = |what| BaselineError::BadImport { path: self.path.join(name), what };
        read(&mut self.folder()?, name).map_err(invalid)
    }

    fn folder(&self) -> Result<SourceFolder, BaselineError> {
        let io = |source| BaselineError::Io { action: "open", path: self.path.clone(), source };
        SourceFolder::new(&self.path, MAX_FILE_BYTES).map_err(io)
    }
}
