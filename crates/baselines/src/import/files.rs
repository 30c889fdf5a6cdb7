//! The folder of imported files: which file belongs to which instance or scene.

use std::path::{Path, PathBuf};

use glam::DVec3;
use mateval_scene::dataset::{Instance, SceneFile};
use mateval_scene::source_folder::SourceFolder;
use mateval_scene::{InstanceId, SceneId};

use super::donor::Donor;
use super::error::ImportError;
use super::limits::MAX_FILE_BYTES;
use super::{gltf_donor, obj_donor};
use crate::error::BaselineError;

/// Endings of mesh files, in the order in which they are preferred.
const MESHES: [&str; 3] = ["glb", "gltf", "obj"];

/// Whether a file has the ending of a mesh or of materials, in upper or lower case.
fn is_importable(name: &str) -> bool {
    let name = name.to_lowercase();
    MESHES.iter().chain(&["json"]).any(|ending| name.ends_with(&format!(".{ending}")))
}

fn stem(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(stem, _)| stem)
}

/// The names of a folder's entries; none where it cannot be read.
fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    entries.map(|entry| entry.file_name().to_string_lossy().into_owned()).collect()
}

/// The folder of imported files.
pub struct ImportFolder {
    path: PathBuf,
}

impl ImportFolder {
    /// The folder at this path.
    pub fn new(path: &Path) -> Self {
        Self { path: path.to_owned() }
    }

    /// The first of `<scene>/<instance>.glb`, `.gltf` and `.obj` that exists.
    pub fn mesh_of_instance(&self, scene: &SceneId, instance: &InstanceId) -> Option<String> {
        self.first(&format!("{scene}/{instance}"), &MESHES)
    }

    /// The first of `<scene>.glb`, `.gltf` and `.obj` that exists.
    pub fn mesh_of_scene(&self, scene: &SceneId) -> Option<String> {
        self.first(scene.as_str(), &MESHES)
    }

    /// `<scene>.json`, if it exists.
    pub fn materials_of_scene(&self, scene: &SceneId) -> Option<String> {
        self.first(scene.as_str(), &["json"])
    }

    /// Meshes, JSON files and folders whose names match no scene or instance, sorted; they are probably misspelt.
    pub fn unused(&self, scenes: &[SceneFile]) -> Vec<String> {
        let mut unused = Vec::new();
        for name in names(&self.path) {
            let is_folder = self.path.join(&name).is_dir();
            let of = |scene: &&SceneFile| scene.id.as_str() == if is_folder { &name } else { stem(&name) };
            match scenes.iter().find(of) {
                // A folder without importable files may hold textures.
                None if is_folder && names(&self.path.join(&name)).iter().any(|file| is_importable(file)) => {
                    unused.push(format!("{name}/"));
                }
                None if is_importable(&name) => unused.push(name),
                Some(scene) if is_folder => {
                    let inside = names(&self.path.join(&name)).into_iter().filter(|file| is_importable(file));
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

    /// The path of a file; an error where it leads out of the folder.
    pub fn checked_path(&self, name: &str) -> Result<PathBuf, BaselineError> {
        self.folder()?.path(name).map_err(|fault| self.refused(name, fault.into()))
    }

    /// Reads a mesh and its textures, and no file outside the folder. `shift` is what the dataset subtracted from the
    /// source's positions; it is subtracted from meshes in the source's space.
    pub fn read_mesh(&self, name: &str, shift: DVec3) -> Result<Donor, BaselineError> {
        let read = if name.ends_with(".obj") { obj_donor::read } else { gltf_donor::read };
        read(&mut self.folder()?, name, shift).map_err(|source| self.refused(name, source))
    }

    fn refused(&self, name: &str, source: ImportError) -> BaselineError {
        BaselineError::BadImport { path: self.path.join(name), source }
    }

    fn folder(&self) -> Result<SourceFolder, BaselineError> {
        let io = |source| BaselineError::Io { action: "open", path: self.path.clone(), source };
        SourceFolder::new(&self.path, MAX_FILE_BYTES).map_err(io)
    }
}
