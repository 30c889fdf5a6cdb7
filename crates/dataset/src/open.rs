//! Opens a dataset: reads and checks its JSON files. [`DatasetId`] states in results and reports which dataset they are
//! about.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mateval_files::FileError;
use mateval_files::untrusted::sha256_of_file;
use mateval_files::whole::is_temporary;
use mateval_files::work_folder::is_inside;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::dataset::{DatasetFile, DatasetVersion, FORMAT, SceneFile, Secrecy, TargetsFile, WideView};
use crate::layout::{DATASET, MANIFEST, SceneFolder, TARGETS};
use crate::{DatasetError, Finding, RendererId, SceneId, Severity, SourceKind, ViewId, changes, json, manifest};

/// A finished dataset on disk.
#[derive(Clone, Debug)]
pub struct Dataset {
    pub root: PathBuf,
    pub file: DatasetFile,
    /// `targets.json`, what is scored.
    pub targets: TargetsFile,
    /// `scene.json` of every scene whose folder exists, in the dataset's order; without twins, unless they were
    /// asked for by [`Self::with_twins`].
    pub scenes: Vec<SceneFile>,
    /// `scene.json` of every twin whose folder exists.
    pub twins: Vec<SceneFile>,
    /// The scenes that `dataset.json` and the manifest list and whose whole folder is missing, in the dataset's order:
    /// each scene can be downloaded on its own.
    pub absent: Vec<SceneId>,
}

impl Dataset {
    /// Opens the dataset in `root`. Fails where a JSON file is not valid or not the one that the manifest lists, or
    /// where the manifest is not the one that `dataset.json` names. Faults of several files are reported together.
    /// Other files are not hashed: see [`Dataset::check_files`]. A scene may be missing as a whole, but not in part.
    pub fn open(root: &Path) -> Result<Self, DatasetError> {
        let file = read_dataset_file(root)?;
        let found = sha256_of_file(&root.join(MANIFEST))?;
        if found != file.manifest_sha256 {
            let what = format!(
                "manifest_sha256 is {}, but MANIFEST.sha256 hashes to {found}; an unfinished `prep` or a changed file",
                file.manifest_sha256
            );
            return Err(DatasetError::Unsupported { path: root.join(DATASET), what });
        }
        let absent = absent_scenes(root, &file)?;
        // What a lost process left unfinished is no scene.
        let is_scene = |path: &str| {
            path.starts_with("scenes/") && path.ends_with("/scene.json") && !path.split('/').any(is_temporary)
        };
        check_hashes(root, |path| path == TARGETS || (is_scene(path) && !is_below(path, &absent)))?;
        let mut faults = Vec::new();
        let targets = read_targets(root).map_err(|fault| faults.push((TARGETS.to_owned(), fault))).ok();
        let (mut scenes, mut twins) = (Vec::new(), Vec::new());
        for id in file.scenes.iter().filter(|id| !absent.contains(id)) {
            match read_scene(root, id) {
                Ok(scene) if file.twins.contains_key(id) => twins.push(scene),
                Ok(scene) => scenes.push(scene),
                Err(fault) => faults.push((format!("scenes/{id}/scene.json"), fault)),
            }
        }
        match targets {
            Some(targets) if faults.is_empty() => {
                Ok(Self { root: root.to_owned(), file, targets, scenes, twins, absent })
            }
            _ => Err(together(root, faults)),
        }
    }

    /// The dataset as methods see it: twins are scenes like any other.
    pub fn with_twins(mut self) -> Self {
        self.scenes.append(&mut self.twins);
        let place = |scene: &SceneFile| self.file.scenes.iter().position(|id| *id == scene.id);
        self.scenes.sort_by_key(place);
        self
    }

    /// The twins of a scene that are not absent.
    pub fn twins_of(&self, scene: &SceneId) -> impl Iterator<Item = &SceneFile> {
        let is_twin = move |other: &&SceneFile| self.file.twins.get(&other.id).is_some_and(|found| found.of == *scene);
        self.scenes.iter().chain(&self.twins).filter(is_twin)
    }

    /// Fails where a file of the scene differs from the manifest, since results made from it would not deserve the
    /// dataset's fingerprint. Only files are checked that `concerns` accepts by their paths in the scene's folder.
    pub fn check_files(&self, scene: &SceneId, concerns: impl Fn(&str) -> bool) -> Result<(), DatasetError> {
        let folder = format!("scenes/{scene}/");
        check_hashes(&self.root, |path| path.strip_prefix(&folder).is_some_and(&concerns))
    }

    /// The scenes with these ids, in the dataset's order; all that are neither absent nor twins where `ids` is empty.
    /// Fails where an id is unknown or its scene is absent or a twin, and where every scene is absent.
    pub fn chosen_scenes(&self, ids: &[SceneId]) -> Result<Vec<&SceneFile>, DatasetError> {
        let chosen = known_ids(&self.root, &self.file, ids)?;
        check_no_twins(&self.root, &self.file, ids)?;
        let is_needed = |id: &&SceneId| ids.contains(id) || self.scenes.is_empty();
        let absent = self.absent.iter().filter(is_needed).cloned().collect();
        check_none_absent(&self.root, &self.file, absent)?;
        let is_chosen = |scene: &&SceneFile| chosen.contains(&&scene.id) && !self.file.twins.contains_key(&scene.id);
        Ok(self.scenes.iter().filter(is_chosen).collect())
    }

    /// Fails where a scene is absent, for work that needs all scenes.
    pub fn check_whole(&self) -> Result<(), DatasetError> {
        check_none_absent(&self.root, &self.file, self.absent.clone())
    }

    /// For work on the scenes that exist: a sentence that states how many are absent, or none where all exist.
    pub fn absence(&self) -> Option<String> {
        let (absent, total) = (self.absent.len(), self.file.scenes.len());
        (absent > 0).then(|| {
            format!("{absent} of the {total} scenes of '{}' are absent; only the others are used", self.root.display())
        })
    }

    /// The scene with this id. Fails where the dataset has none.
    pub fn scene(&self, id: &SceneId) -> Result<&SceneFile, DatasetError> {
        let chosen = self.chosen_scenes(std::slice::from_ref(id))?;
        Ok(chosen[0])
    }

    /// The renderer whose pictures the scene has; absent if the dataset has no photo renderer, where the scene has a
    /// photo from elsewhere, whose light is not known, and for a twin, whose photo is made of another scene's pictures.
    pub fn photo_renderer(&self, scene: &SceneFile) -> Option<&RendererId> {
        let is_rendered = scene.photo.is_none() && !self.file.twins.contains_key(&scene.id);
        self.file.photo_renderer.as_ref().filter(|_| is_rendered)
    }

    /// Whether its ground truth is withheld, or meant to be: it is a hidden split, or has scenes whose truth is a secret.
    pub fn is_hidden(&self) -> bool {
        self.file.withheld.is_some() || self.scenes.iter().any(SceneFile::is_secret)
    }

    /// Fails where the dataset holds a ground truth that is meant to be secret, unless `with_ground_truth`: for work
    /// that copies or shows it. The public part of a hidden split holds none.
    pub fn check_may_be_shown(&self, with_ground_truth: bool) -> Result<(), DatasetError> {
        let holds_truth = || self.scenes.iter().any(|scene| self.folder(&scene.id).truth().is_dir());
        if with_ground_truth || !self.is_hidden() || !holds_truth() {
            return Ok(());
        }
        Err(DatasetError::SecretTruth { path: self.root.clone() })
    }

    /// A sentence on the scenes for which no licence is stated; none if every scene has one.
    pub fn unstated_licences(&self) -> Option<String> {
        let without = self.file.without_licence();
        let first = without.first()?;
        let of = self.file.scenes.len();
        let mut text = format!("no licence is stated for {} of the {of} scenes, '{first}' first", without.len());
        let is_room = |scene: &SceneFile| scene.source.kind == SourceKind::Front3d && without.contains(&scene.id);
        if self.scenes.iter().any(is_room) {
            text += "; data of 3D-FRONT and 3D-FUTURE come under the 3D-FRONT Data Sets Use License Agreement \
                     (https://gw.alicdn.com/bao/uploaded/TB1ZJUfK.z1gK0jSZLeXXb9kVXa.pdf), which is for scientific research \
                     and can be neither transferred nor sublicensed";
        }
        Some(text)
    }

    pub fn folder(&self, scene: &SceneId) -> SceneFolder {
        SceneFolder::of(&self.root, scene)
    }
}

/// The ids among `ids` in the order of the dataset in `root`; all its ids but those of twins where `ids` is empty. Fails
/// where an id is unknown or that of a twin, or where the folder of any scene is missing: this serves work that rewrites
/// the manifest.
pub fn chosen_ids<'a>(root: &Path, file: &'a DatasetFile, ids: &[SceneId]) -> Result<Vec<&'a SceneId>, DatasetError> {
    check_whole(root, file)?;
    check_no_twins(root, file, ids)?;
    let known = known_ids(root, file, ids)?;
    Ok(known.into_iter().filter(|id| !file.twins.contains_key(id)).collect())
}

/// Fails where one of the ids is a twin's.
fn check_no_twins(root: &Path, file: &DatasetFile, ids: &[SceneId]) -> Result<(), DatasetError> {
    let twins: Vec<SceneId> = ids.iter().filter(|id| file.twins.contains_key(id)).cloned().collect();
    let mut of: Vec<SceneId> = twins.iter().filter_map(|id| Some(file.twins.get(id)?.of.clone())).collect();
    of.dedup();
    if twins.is_empty() { Ok(()) } else { Err(DatasetError::Twins { dataset: root.to_owned(), twins, of }) }
}

/// Fails where the folder of a scene that `file`, the `dataset.json` in `root`, lists is missing.
pub fn check_whole(root: &Path, file: &DatasetFile) -> Result<(), DatasetError> {
    check_none_absent(root, file, absent_scenes(root, file)?)
}

fn check_none_absent(root: &Path, file: &DatasetFile, absent: Vec<SceneId>) -> Result<(), DatasetError> {
    if absent.is_empty() {
        return Ok(());
    }
    Err(DatasetError::AbsentScenes { dataset: root.to_owned(), absent, total: file.scenes.len() })
}

/// Fails where the output `out`, the value of the argument `place`, would lie in the dataset in `root`.
pub fn check_outside(out: &Path, root: &Path, place: &'static str) -> Result<(), DatasetError> {
    match is_inside(out, root) {
        true => Err(DatasetError::OutputInDataset { path: out.to_owned(), dataset: root.to_owned(), place }),
        false => Ok(()),
    }
}

/// Fails where the output `out`, the value of the argument `place`, would lie in any dataset.
pub fn check_outside_datasets(out: &Path, place: &'static str) -> Result<(), DatasetError> {
    match enclosing_dataset(out) {
        Some(dataset) => Err(DatasetError::OutputInDataset { path: out.to_owned(), dataset, place }),
        None => Ok(()),
    }
}

/// The dataset that `path`, which need not exist, would lie in.
fn enclosing_dataset(path: &Path) -> Option<PathBuf> {
    let path = std::path::absolute(path).ok()?;
    // Of the folders above, some may be yet to be made, and others may be links.
    let above = path.ancestors().skip(1).find_map(|folder| folder.canonicalize().ok())?;
    let is_dataset = |folder: &&Path| folder.join(DATASET).is_file() && folder.join(MANIFEST).is_file();
    above.ancestors().find(is_dataset).map(Path::to_owned)
}

/// Reads `dataset.json` of the dataset in `root`. The error for another folder names what was found.
pub fn read_dataset_file(root: &Path) -> Result<DatasetFile, DatasetError> {
    let path = root.join(DATASET);
    if path.is_file() {
        return json::read_format(&path, FORMAT);
    }
    let below = || {
        let mut folders: Vec<PathBuf> = std::fs::read_dir(root).ok()?.flatten().map(|entry| entry.path()).collect();
        folders.sort_unstable();
        folders.into_iter().find(|folder| folder.join(DATASET).is_file())
    };
    let reason = match std::fs::metadata(root) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => "the folder does not exist".to_owned(),
        Err(source) => return Err(FileError::io("read", root)(source).into()),
        Ok(data) if !data.is_dir() => "it is a file; expected a folder with a dataset.json".to_owned(),
        Ok(_) => match below() {
            Some(folder) => format!("it has no dataset.json, but '{}' has one", folder.display()),
            None => "it has no dataset.json; where its build did not finish, run `mateval prep build` again".to_owned(),
        },
    };
    Err(DatasetError::NotADataset { path: root.to_owned(), reason })
}

/// The scenes that `dataset.json` and the manifest list and whose folders do not exist, in the order of `dataset.json`.
pub fn absent_scenes(root: &Path, file: &DatasetFile) -> Result<Vec<SceneId>, DatasetError> {
    let mut absent: Vec<SceneId> =
        file.scenes.iter().filter(|id| !SceneFolder::of(root, id).path().exists()).cloned().collect();
    if !absent.is_empty() {
        let listed = manifest::entries(root)?;
        absent.retain(|id| listed.iter().any(|entry| is_below(&entry.file, std::slice::from_ref(id))));
    }
    Ok(absent)
}

/// Whether a path in the dataset lies in the folder of one of the scenes.
pub fn is_below(path: &str, scenes: &[SceneId]) -> bool {
    let folder = path.strip_prefix("scenes/").and_then(|rest| rest.split_once('/'));
    folder.is_some_and(|(folder, _)| scenes.iter().any(|scene| scene.as_str() == folder))
}

fn known_ids<'a>(root: &Path, file: &'a DatasetFile, ids: &[SceneId]) -> Result<Vec<&'a SceneId>, DatasetError> {
    let unknown: Vec<SceneId> = ids.iter().filter(|id| !file.scenes.contains(id)).cloned().collect();
    if !unknown.is_empty() {
        return Err(DatasetError::UnknownScenes { dataset: root.to_owned(), unknown, known: file.scenes.clone() });
    }
    Ok(file.scenes.iter().filter(|id| ids.is_empty() || ids.contains(id)).collect())
}

/// Joins the errors of several JSON files into one.
fn together(root: &Path, mut faults: Vec<(String, DatasetError)>) -> DatasetError {
    if faults.len() == 1 {
        return faults.remove(0).1;
    }
    let all = faults.into_iter().flat_map(|(file, fault)| match fault {
        DatasetError::Invalid { findings, .. } => {
            findings.into_iter().map(|finding| Finding { file: file.clone(), ..finding }).collect()
        }
        other => {
            let action = "`mateval prep verify` lists every fault of a dataset";
            vec![Finding::new(Severity::Error, "unreadable", file, "", other.to_string(), action)]
        }
    });
    let mut findings: Vec<Finding> = all.collect();
    findings.sort();
    DatasetError::Invalid { path: root.to_owned(), findings }
}

fn read_targets(root: &Path) -> Result<TargetsFile, DatasetError> {
    json::read_format(&root.join(TARGETS), FORMAT)
}

fn read_scene(root: &Path, id: &SceneId) -> Result<SceneFile, DatasetError> {
    let path = SceneFolder::of(root, id).scene_file();
    let scene: SceneFile = json::read_format(&path, FORMAT)?;
    if scene.id == *id {
        return Ok(scene);
    }
    let what = format!("id '{}' in the folder of '{id}'; run `mateval prep verify`", scene.id);
    Err(DatasetError::Unsupported { path, what })
}

fn check_hashes(root: &Path, concerns: impl Fn(&str) -> bool) -> Result<(), DatasetError> {
    let findings = manifest::check_those(root, concerns)?;
    if findings.is_empty() {
        return Ok(());
    }
    if let Some(error) = changes::unfinished(root, |_| true) {
        return Err(error);
    }
    let path = root.to_owned();
    let is_withheld = |finding: &Finding| {
        let is_truth = finding.code == manifest::MISSING_FILE && finding.file.contains("/ground_truth/");
        is_truth || finding.code == manifest::WITHHELD_FILE
    };
    if findings.iter().all(is_withheld) {
        return Err(DatasetError::TruthWithheld { path, files: findings.len(), first: findings[0].file.clone() });
    }
    Err(DatasetError::Invalid { path, findings })
}

/// The dataset and the scenes that were scored or checked.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DatasetId {
    /// The dataset's name.
    pub name: String,
    /// The dataset's version.
    pub version: String,
    /// SHA-256 of its manifest, hex.
    pub manifest_sha256: String,
    /// The scenes that were scored, in the dataset's order.
    pub scenes: Vec<SceneId>,
    /// The number of scenes of the dataset, without twins where these are not scored by themselves.
    pub total_scenes: usize,
    /// The house of each scored scene. Rankings draw scenes of one house together.
    #[serde(default)]
    pub houses: BTreeMap<SceneId, String>,
    /// The kind of source of each scored scene. Tables of protocol `paper` keep them apart.
    #[serde(default)]
    pub sources: BTreeMap<SceneId, SourceKind>,
    /// The views from other places than the input view's, by scene.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub wide_views: BTreeMap<SceneId, BTreeMap<ViewId, WideView>>,
    /// The renderer that made the input pictures; null where none made all of them.
    #[serde(default)]
    pub photo_renderer: Option<RendererId>,
    /// Whether its ground truth is withheld and what that is worth; absent where it is not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub withheld: Option<Secrecy>,
}

impl SceneFile {
    /// Reads the `scene.json` of a scene that `prep` works on. [`Dataset::open`] also checks its format and id.
    pub fn read(folder: &SceneFolder) -> Result<Self, DatasetError> {
        json::read(&folder.scene_file())
    }

    /// Fails where the true materials are not known, for work that needs them.
    pub fn check_materials_known(&self) -> Result<(), DatasetError> {
        match self.source.kind.states_materials() {
            true => Ok(()),
            false => Err(DatasetError::Captured { scene: self.id.clone() }),
        }
    }
}

impl DatasetId {
    /// What other files name it by.
    pub fn named(&self) -> DatasetVersion {
        let Self { name, version, manifest_sha256, .. } = self;
        DatasetVersion { name: name.clone(), version: version.clone(), manifest_sha256: manifest_sha256.clone() }
    }

    /// Describes a dataset of which `scenes` are scored or checked.
    pub fn new<'a>(dataset: &Dataset, scenes: impl IntoIterator<Item = &'a SceneFile>) -> Self {
        let scenes: Vec<&SceneFile> = scenes.into_iter().collect();
        let twins = &dataset.file.twins;
        let counts_twins = scenes.iter().any(|scene| twins.contains_key(&scene.id));
        Self {
            name: dataset.file.name.clone(),
            version: dataset.file.version.clone(),
            manifest_sha256: dataset.file.manifest_sha256.clone(),
            scenes: scenes.iter().map(|scene| scene.id.clone()).collect(),
            total_scenes: dataset.file.scenes.len() - if counts_twins { 0 } else { twins.len() },
            houses: scenes.iter().map(|scene| (scene.id.clone(), scene.source.house.clone())).collect(),
            sources: scenes.iter().map(|scene| (scene.id.clone(), scene.source.kind)).collect(),
            wide_views: scenes.iter().filter_map(|scene| Some((scene.id.clone(), wide_views(scene)?))).collect(),
            photo_renderer: dataset.file.photo_renderer.clone(),
            withheld: dataset.file.withheld,
        }
    }
}

/// The wide views of a scene; none if it has none.
fn wide_views(scene: &SceneFile) -> Option<BTreeMap<ViewId, WideView>> {
    let found: BTreeMap<ViewId, WideView> =
        scene.views.iter().filter_map(|view| Some((view.id.clone(), view.wide?))).collect();
    (!found.is_empty()).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Role;

    /// The error for an untrusted word names its place in the file.
    #[test]
    fn what_is_not_a_dataset_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let reason = |root: &Path| match read_dataset_file(root) {
            Err(DatasetError::NotADataset { reason, .. }) => reason,
            other => panic!("{other:?}"),
        };
        assert_eq!(reason(&folder.path().join("nowhere")), "the folder does not exist");
        assert_eq!(reason(&file), "it is a file; expected a folder with a dataset.json");
        assert!(reason(folder.path()).ends_with("run `mateval prep build` again"));
        std::fs::create_dir(folder.path().join("inner")).unwrap();
        std::fs::write(folder.path().join("inner/dataset.json"), "{}").unwrap();
        assert!(reason(folder.path()).ends_with("inner' has one"));
    }

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
            let DatasetError::Invalid { findings, .. } = &error else { panic!("{error}") };
            assert_eq!(findings[0].place, pointer);
        }
    }

    #[test]
    fn scenes_are_chosen_in_the_datasets_order() {
        let [room, hall, attic] = ["room", "hall", "attic"].map(|id| SceneId::new(id).unwrap());
        let file = DatasetFile::new("", "", "", vec![room.clone(), hall.clone()]);
        let chosen =
            |ids: &[SceneId]| known_ids(Path::new("d"), &file, ids).map(|ids| ids.into_iter().cloned().collect());
        let all: Vec<SceneId> = chosen(&[]).unwrap();
        assert_eq!(all, file.scenes);
        assert_eq!(chosen(&[hall.clone(), room]).unwrap(), file.scenes);
        let text = chosen(&[attic, hall]).unwrap_err().to_string();
        assert_eq!(text, "'d' has no scene 'attic'; it has 'room', 'hall'");
    }
}
