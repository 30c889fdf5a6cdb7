//! The folder of imported files: which file belongs to which instance or scene; and `<scene>.json`, which holds one
//! uniform material per part or instance.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use glam::DVec3;
use mateval_dataset::dataset::{Instance, SceneFile};
use mateval_dataset::{InstanceId, PartSetId, SceneId, json};
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;
use mateval_files::untrusted::shortened;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::donor::{Donor, ImportError, MAX_FILE_BYTES};
use super::{gltf_donor, obj_donor};
use crate::error::BaselineError;
use crate::estimate::{GivenMaps, Values};
use crate::geometry::{PartTriangles, SceneGeometry};
use crate::maps::{DEFAULT, PartColors};

/// Endings of mesh files, in the order in which they are preferred.
const MESHES: [&str; 3] = ["glb", "gltf", "obj"];

/// Endings of mesh files that are not read, but named.
const OTHER_MESHES: [&str; 12] =
    ["ply", "fbx", "dae", "stl", "off", "usd", "usda", "usdc", "usdz", "blend", "x3d", "3ds"];

/// Whether a file has the ending of a mesh or of materials, in upper or lower case.
fn is_importable(name: &str) -> bool {
    let name = name.to_lowercase();
    let mut endings = MESHES.iter().chain(&OTHER_MESHES).chain(&["json"]);
    endings.any(|ending| name.ends_with(&format!(".{ending}")))
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

    /// Meshes, JSON files and folders that are not read, sorted: their names match no scene or instance, or their format
    /// is not read, or another file of the same name is preferred.
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
                Some(scene) if !is_folder && is_importable(&name) => {
                    let read = [self.mesh_of_scene(&scene.id), self.materials_of_scene(&scene.id)];
                    unused.extend((!read.contains(&Some(name.clone()))).then_some(name));
                }
                Some(scene) if is_folder => {
                    let inside = names(&self.path.join(&name)).into_iter().filter(|file| is_importable(file));
                    let is_known = |file: &String| {
                        let read = |instance: &Instance| self.mesh_of_instance(&scene.id, &instance.id);
                        scene.instances.iter().any(|instance| read(instance) == Some(format!("{name}/{file}")))
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
        self.folder()?.path(name).map_err(|fault| self.refused(name, &fault.into()))
    }

    /// Reads a mesh and its textures, and no file outside the folder. `shift` is what the dataset subtracted from the
    /// source's positions; it is subtracted from meshes in the source's space.
    pub fn read_mesh(&self, name: &str, shift: DVec3) -> Result<Donor, BaselineError> {
        let read = if name.ends_with(".obj") { obj_donor::read } else { gltf_donor::read };
        read(&mut self.folder()?, name, shift).map_err(|source| self.refused(name, &source))
    }

    fn refused(&self, name: &str, source: &ImportError) -> BaselineError {
        BaselineError::Unusable(format!("'{}': {source}", self.path.join(name).display()))
    }

    fn folder(&self) -> Result<SourceFolder, BaselineError> {
        Ok(SourceFolder::new(&self.path, MAX_FILE_BYTES).map_err(FileError::io("open", &self.path))?)
    }
}

/// A uniform material.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FlatMaterial {
    /// Linear base colour, 0 to 1.
    pub base_color: [f32; 3],
    /// Perceptual roughness, 0 to 1.
    #[serde(default)]
    pub roughness: Option<f32>,
    /// Metallic, 0 to 1.
    #[serde(default)]
    pub metallic: Option<f32>,
}

/// Materials by the id of a part, or of an instance, which stands for all its parts without an entry of their own.
pub type FlatMaterials = BTreeMap<String, FlatMaterial>;

impl FlatMaterial {
    fn values(&self) -> Values {
        let [r, g, b] = self.base_color;
        [r, g, b, self.roughness.unwrap_or(DEFAULT[3]), self.metallic.unwrap_or(DEFAULT[4])]
    }

    fn is_in_range(&self) -> bool {
        let numbers = self.base_color.iter().chain(&self.roughness).chain(&self.metallic);
        numbers.into_iter().all(|v| (0.0..=1.0).contains(v))
    }
}

/// Reads the file. The error lists every wrong entry.
pub fn read_flat_materials<'a>(
    path: &Path,
    geometry: &SceneGeometry<'a>,
    set: Option<&PartSetId>,
) -> Result<(PartColors<'a>, GivenMaps), BaselineError> {
    let materials: FlatMaterials = json::read(path)?;
    let triangles = PartTriangles::read(geometry, set)?;
    let parts = triangles.parts;
    let instances = geometry.scene.instances.iter().map(|instance| instance.id.as_str());
    let known: BTreeSet<&str> = parts.iter().map(|part| part.id.as_str()).chain(instances).collect();
    let unknown = materials.keys().filter(|id| !known.contains(id.as_str()));
    let unknown = unknown.map(|id| format!("/{}: expected the id of a part or an instance", shortened(id)));
    let out_of_range = materials.iter().filter(|(_, material)| !material.is_in_range());
    let out_of_range = out_of_range.map(|(id, _)| format!("/{}: expected numbers from 0 to 1", shortened(id)));
    let faults: Vec<String> = unknown.chain(out_of_range).collect();
    if !faults.is_empty() {
        return Err(BaselineError::Unusable(format!("'{}': {}", path.display(), faults.join("; "))));
    }
    let colors = PartColors::new(triangles, |part, instance| {
        let own = materials.get(parts[part].id.as_str());
        let material = own.or_else(|| materials.get(geometry.scene.instances[instance].id.as_str()));
        material.map(FlatMaterial::values)
    });
    let any = |has: fn(&FlatMaterial) -> bool| materials.values().any(has);
    let given = GivenMaps {
        base_color: true,
        roughness: any(|m| m.roughness.is_some()),
        metallic: any(|m| m.metallic.is_some()),
    };
    Ok((colors, given))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn meshes_that_are_not_read_are_named() {
        let text = include_bytes!("../../../../dataset_spec/examples/scene.json");
        let scene: SceneFile = json::parse(Path::new("scene.json"), text).unwrap();
        let (id, instance) = (scene.id.to_string(), scene.instances[0].id.to_string());
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join(&id)).unwrap();
        for ending in ["glb", "obj", "ply", "mtl"] {
            std::fs::write(folder.path().join(format!("{id}/{instance}.{ending}")), "").unwrap();
        }
        for name in [format!("{id}.gltf"), format!("{id}.obj"), format!("{id}.json"), "else.FBX".to_owned()] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let mut expected = ["else.FBX".to_owned(), format!("{id}.obj")].to_vec();
        expected.extend(["obj", "ply"].map(|ending| format!("{id}/{instance}.{ending}")));
        expected.sort();
        assert_eq!(ImportFolder::new(folder.path()).unused(&[scene]), expected);
    }
}
