//! Opens a dataset: reads and checks its JSON files.

use std::path::{Path, PathBuf};

use crate::dataset::{DatasetFile, FORMAT, SceneFile, TargetsFile};
use crate::ids::SceneId;
use crate::layout::{DATASET, MANIFEST, SceneFolder, TARGETS};
use crate::{Finding, SceneError, Severity, json, manifest};

/// A finished dataset on disk.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// Its folder.
    pub root: PathBuf,
    /// `dataset.json`.
    pub file: DatasetFile,
    /// `targets.json`, what is scored.
    pub targets: TargetsFile,
    /// `scene.json` of every scene, in the dataset's order.
    pub scenes: Vec<SceneFile>,
}

impl Dataset {
    /// Opens the dataset in `root`. Fails where a JSON file is not valid or not the one that the manifest lists, or
    /// where the manifest is not the one that `dataset.json` names. Faults of several files are reported together.
    /// Other files are not hashed: see [`Dataset::check_files`].
    pub fn open(root: &Path) -> Result<Self, SceneError> {
        let path = root.join(DATASET);
        let file: DatasetFile = json::read_format(&path, FORMAT)?;
        let found = manifest::sha256_of_file(&root.join(MANIFEST))?;
        if found != file.manifest_sha256 {
            let what = format!(
                "manifest_sha256 is {}, but MANIFEST.sha256 hashes to {found}; an unfinished `prep` or a changed file",
                file.manifest_sha256
            );
            return Err(SceneError::Unsupported { path, what });
        }
        let is_json = |path: &str| path == TARGETS || (path.starts_with("scenes/") && path.ends_with("/scene.json"));
        check_hashes(root, is_json)?;
        let mut faults = Vec::new();
        let targets = read_targets(root).map_err(|fault| faults.push((TARGETS.to_owned(), fault))).ok();
        let mut scenes = Vec::new();
        for id in &file.scenes {
            match read_scene(root, id) {
                Ok(scene) => scenes.push(scene),
                Err(fault) => faults.push((format!("scenes/{id}/scene.json"), fault)),
            }
        }
        match targets {
            Some(targets) if faults.is_empty() => Ok(Self { root: root.to_owned(), file, targets, scenes }),
            _ => Err(together(root, faults)),
        }
    }

    /// Fails where a file of the scene differs from the manifest, since results made from it would not deserve the
    /// dataset's fingerprint. Only files are checked that `concerns` accepts by their paths in the scene's folder.
    pub fn check_files(&self, scene: &SceneId, concerns: impl Fn(&str) -> bool) -> Result<(), SceneError> {
        let folder = format!("scenes/{scene}/");
        check_hashes(&self.root, |path| path.strip_prefix(&folder).is_some_and(&concerns))
    }

    /// The scenes with these ids, in the dataset's order; all scenes where `ids` is empty. Fails where an id is
    /// unknown.
    pub fn chosen_scenes(&self, ids: &[SceneId]) -> Result<Vec<&SceneFile>, SceneError> {
        let chosen = chosen_ids(&self.root, &self.file, ids)?;
        Ok(self.scenes.iter().filter(|scene| chosen.contains(&&scene.id)).collect())
    }

    /// The scene with this id. Fails where the dataset has none.
    pub fn scene(&self, id: &SceneId) -> Result<&SceneFile, SceneError> {
        let chosen = self.chosen_scenes(std::slice::from_ref(id))?;
        Ok(chosen[0])
    }

    /// The scene's folder.
    pub fn folder(&self, scene: &SceneId) -> SceneFolder {
        SceneFolder::of(&self.root, scene)
    }
}

/// The ids among `ids` in the order of the dataset in `root`; all its ids where `ids` is empty. Fails where an id is
/// unknown.
pub fn chosen_ids<'a>(root: &Path, file: &'a DatasetFile, ids: &[SceneId]) -> Result<Vec<&'a SceneId>, SceneError> {
    let unknown: Vec<SceneId> = ids.iter().filter(|id| !file.scenes.contains(id)).cloned().collect();
    if !unknown.is_empty() {
        return Err(SceneError::UnknownScenes { dataset: root.to_owned(), unknown, known: file.scenes.clone() });
    }
    Ok(file.scenes.iter().filter(|id| ids.is_empty() || ids.contains(id)).collect())
}

/// Joins the errors of several JSON files into one.
fn together(root: &Path, mut faults: Vec<(String, SceneError)>) -> SceneError {
    if faults.len() == 1 {
        return faults.remove(0).1;
    }
    let all = faults.into_iter().flat_map(|(file, fault)| match fault {
        SceneError::Invalid { findings, .. } => {
            findings.into_iter().map(|finding| Finding { file: file.clone(), ..finding }).collect()
        }
        other => vec![unreadable(file, &other)],
    });
    let mut findings: Vec<Finding> = all.collect();
    findings.sort();
    SceneError::Invalid { path: root.to_owned(), findings }
}

fn unreadable(file: String, fault: &SceneError) -> Finding {
    Finding {
        severity: Severity::Error,
        code: "unreadable".to_owned(),
        file,
        place: String::new(),
        message: fault.to_string(),
        action: "`mateval prep verify` lists every fault of a dataset".to_owned(),
    }
}

fn read_targets(root: &Path) -> Result<TargetsFile, SceneError> {
    json::read_format(&root.join(TARGETS), FORMAT)
}

fn read_scene(root: &Path, id: &SceneId) -> Result<SceneFile, SceneError> {
    let path = SceneFolder::of(root, id).scene_file();
    let scene: SceneFile = json::read_format(&path, FORMAT)?;
    if scene.id == *id {
        return Ok(scene);
    }
    let what = format!("id '{}' in the folder of '{id}'; run `mateval prep verify`", scene.id);
    Err(SceneError::Unsupported { path, what })
}

fn check_hashes(root: &Path, concerns: impl Fn(&str) -> bool) -> Result<(), SceneError> {
    let findings = manifest::check_those(root, concerns)?;
    if findings.is_empty() { Ok(()) } else { Err(SceneError::Invalid { path: root.to_owned(), findings }) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Role;

    /// The error for an untrusted word names its place in the file.
    #[test]
    fn unknown_roles_sources_and_lights_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let id = SceneId::new("room").unwrap();
        let path = SceneFolder::of(folder.path(), &id).scene_file();
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        let example = include_str!("../../../dataset_spec/examples/scene.json");
        std::fs::write(&path, example).unwrap();
        assert_eq!(read_scene(folder.path(), &id).unwrap().instances[0].role, Role::Other {});
        let words = [
            ("\"other\"", "\"ghost\"", "/instances/0/role/type"),
            ("\"bitterli\"", "\"elsewhere\"", "/source/kind"),
            ("\"own\"", "\"candles\"", "/lights"),
        ];
        for (known, unknown, pointer) in words {
            std::fs::write(&path, example.replacen(known, unknown, 1)).unwrap();
            let error = read_scene(folder.path(), &id).unwrap_err();
            let SceneError::Invalid { findings, .. } = &error else { panic!("{error}") };
            assert_eq!(findings[0].place, pointer);
        }
    }

    #[test]
    fn scenes_are_chosen_in_the_datasets_order() {
        let [room, hall, attic] = ["room", "hall", "attic"].map(|id| SceneId::new(id).unwrap());
        let file = DatasetFile {
            format: FORMAT.to_owned(),
            name: String::new(),
            version: String::new(),
            tool: String::new(),
            scenes: vec![room.clone(), hall.clone()],
            scored_renderer: None,
            licences: Vec::new(),
            manifest_sha256: String::new(),
        };
        let chosen =
            |ids: &[SceneId]| chosen_ids(Path::new("d"), &file, ids).map(|ids| ids.into_iter().cloned().collect());
        let all: Vec<SceneId> = chosen(&[]).unwrap();
        assert_eq!(all, file.scenes);
        assert_eq!(chosen(&[hall.clone(), room]).unwrap(), file.scenes);
        let text = chosen(&[attic, hall]).unwrap_err().to_string();
        assert_eq!(text, "'d' has no scene 'attic'; it has 'room', 'hall'");
    }
}
