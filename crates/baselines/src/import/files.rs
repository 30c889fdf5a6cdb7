//! Which file tells of an instance.

use std::path::{Path, PathBuf};

use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::source_folder::SourceFolder;
use mateval_scene::{InstanceId, SceneId};

use super::donor::{Donor, MAX_FILE_BYTES};
use super::{gltf_donor, obj_donor};
use crate::error::BaselineError;

const MESHES: [&str; 3] = ["glb", "gltf", "obj"];

/// Whether a file looks like one of those that are read; whatever the case of its ending.
fn is_ours(name: &str) -> bool {
    let name = name.to_lowercase();
    MESHES.iter().chain(&["json"]).any(|ending| name.ends_with(&format!(".{ending}")))
}

fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// What a folder holds; nothing where it cannot be read.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

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

    /// Meshes and JSON of the folder, and of its scenes' folders, that are for nobody: misspelt names. Sorted.
    pub fn unused(&self, scenes: &[SceneFile]) -> Vec<String> {
        let mut unused = Vec::new();
        for name in names(&self.path) {
            let is_folder = self.path.join(&name).is_dir();
            let of = |scene: &&SceneFile| scene.id.as_str() == if is_folder { &name } else { stem(&name) };
            match scenes.iter().find(of) {
                // A folder of textures is none of them.
                None if is_folder && names(&self.path.join(&name)).iter().any(|file| is_ours(file)) => {
                    unused.push(format!("{name}/"));
                }
                None if is_ours(&name) => unused.push(name),
                Some(scene) if is_folder => {
                    let inside = names(&self.path.join(&name)).into_iter().filter(|file| is_ours(file));
                    let is_known = |file: &String| {
                        let has_name = |instance: &Instance| instance.id.as_str() == stem(file);
                        MESHES.iter().any(|ending| file.ends_with(&format!(".{ending}")))
                            && scene.instances.iter().any(has_name)
                    };
                    unused.extend(inside.filter(|file| !is_known(file)).map(|file| format!("{name}/{file}")));
                }
                _ => {}
            }
        }
        unused.sort();
        unused
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
