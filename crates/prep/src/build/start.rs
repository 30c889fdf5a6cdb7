//! Begins a build in a new folder, or resumes one that was begun there.
//!
//! The files that the scenes are made of must exist and be those that the recipe pins. Each scene that is made leaves a
//! mark, by which a later run finds that it need not make the scene again.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::{Licence, SceneFile, SourceFile};
use mateval_dataset::layout::{BUILD, BuildFolder};
use mateval_dataset::layout::{DATASET, SceneFolder};
use mateval_dataset::{SceneId, json};
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::work_folder::{check_holds_none, make_folder, put_aside, remove, remove_abandoned};
use serde::{Deserialize, Serialize};

use super::labels::file_names;
use crate::error::PrepError;
use crate::recipe::fault::{RecipeFault, RecipeSceneFault};
use crate::recipe::{Recipe, RecipeScene, Redress, SourcePath};
use crate::redress::RedressKey;
use crate::redress::secret::SecretFault;
use crate::render::BlenderOptions;

#[derive(Clone, Debug)]
pub struct BuildOptions {
    pub recipe: PathBuf,
    /// The folder that the recipe's paths are relative to; if absent, the recipe's own.
    pub source: Option<PathBuf>,
    pub out: PathBuf,
    /// Make only these scenes, and leave the files of the whole dataset to [`crate::build::finish`]; all scenes where
    /// empty.
    pub scenes: Vec<SceneId>,
    /// Replace what exists: the scenes that are named, or the whole dataset where none is.
    pub force: bool,
    /// The Blender that reads `.blend` files; absent if none was found.
    pub blender: Option<BlenderOptions>,
    /// The folder of atlases that earlier builds made; none to make all of them.
    pub atlas_cache: Option<PathBuf>,
}

/// Fails where a scene of the recipe has a fault.
pub(super) fn refuse_if_any(options: &BuildOptions, faults: Vec<(SceneId, RecipeSceneFault)>) -> Result<(), PrepError> {
    if faults.is_empty() {
        return Ok(());
    }
    let faults = faults.into_iter().map(|(scene, fault)| RecipeFault::Scene { scene, fault }).collect();
    Err(PrepError::Recipe { path: options.recipe.clone(), faults })
}

/// Fails before the first scene is made if any scene's sources are missing or differ from those that the recipe pins.
pub(super) fn check_sources(options: &BuildOptions, scenes: &[&RecipeScene], source: &Path) -> Result<(), PrepError> {
    refuse_if_any(options, faults_of_all(scenes, source, missing_sources))?;
    let secret = |scene: &&RecipeScene| Some((scene.id.clone(), secret_of(scene, source, &options.out).err()?.into()));
    refuse_if_any(options, scenes.iter().filter_map(secret).collect())?;
    refuse_if_any(options, faults_of_all(scenes, source, changed_inputs))
}

/// The key and the materials that a scene is redressed with, if it is. Fails where they could be published with the
/// dataset `out` or with what lies below `source`.
pub(super) fn secret_of(entry: &RecipeScene, source: &Path, out: &Path) -> Result<Option<RedressKey>, SecretFault> {
    let Some(Redress { key, materials }) = &entry.redress else { return Ok(None) };
    let materials = materials.as_ref().map(|folder| source.join(folder));
    RedressKey::open(&source.join(key), materials.as_deref(), &[source, out]).map(Some)
}

/// The faults that `check` finds in the scenes.
fn faults_of_all(
    scenes: &[&RecipeScene],
    source: &Path,
    check: fn(&RecipeScene, &Path) -> Vec<RecipeSceneFault>,
) -> Vec<(SceneId, RecipeSceneFault)> {
    let mut all = Vec::new();
    for scene in scenes {
        all.extend(check(scene, source).into_iter().map(|fault| (scene.id.clone(), fault)));
    }
    all
}

fn missing_sources(scene: &RecipeScene, source: &Path) -> Vec<RecipeSceneFault> {
    let root = scene.root(source);
    let labels = scene.part_labels.values().map(|path| ("part_labels", root.join(path), true));
    let photo = scene.photo.iter().map(|path| ("photo", root.join(path), false));
    let paths =
        scene.source_paths().into_iter().map(|SourcePath { key, path, is_folder }| (key, source.join(path), is_folder));
    let fault = |(key, path, is_folder): (&'static str, PathBuf, bool)| {
        let exists = if is_folder { path.is_dir() } else { path.is_file() };
        let kind = if is_folder { "folder" } else { "file" };
        (!exists).then_some(RecipeSceneFault::MissingSource { key, kind, path })
    };
    paths.chain(labels).chain(photo).filter_map(fault).collect()
}

/// The pinned inputs that do not exist or have other bytes.
fn changed_inputs(scene: &RecipeScene, source: &Path) -> Vec<RecipeSceneFault> {
    let root = scene.root(source);
    let fault = |(file, pinned): (&String, &String)| {
        let (path, file) = (root.join(file), file.clone());
        if !path.is_file() {
            return Some(RecipeSceneFault::MissingInput { file });
        }
        match sha256_of_file(&path) {
            Ok(found) if found == *pinned => None,
            Ok(found) => Some(RecipeSceneFault::ChangedInput { file, found, pinned: pinned.clone() }),
            Err(source) => Some(RecipeSceneFault::UnreadableInput { file, source }),
        }
    };
    scene.inputs.iter().filter_map(fault).collect()
}

const KEY_FORMAT: &str = "mateval-build/1";

/// States that a `.build` is ours: other tools use folders of that name too.
#[derive(Serialize, Deserialize)]
struct BuildKey {
    format: String,
}

/// What the output's folder holds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Nothing.
    New,
    /// A build, begun or finished.
    Build,
    /// A dataset without its build, such as one that was downloaded.
    Dataset,
    /// Anything else.
    Other,
}

impl Place {
    fn of(out: &Path) -> Self {
        // A build that was killed before it wrote its key has written nothing else. Asked before the key is, since
        // another build may begin meanwhile, and writes its scenes after its key.
        let is_new = !out.exists() || holds_only(out, &[BUILD]);
        if is_build(out) {
            Self::Build
        } else if out.join(DATASET).is_file() {
            Self::Dataset
        } else if is_new {
            Self::New
        } else {
            Self::Other
        }
    }
}

/// Whether the folder holds a build, begun or finished.
pub(crate) fn is_build(root: &Path) -> bool {
    json::read::<BuildKey>(&BuildFolder::of(root).key()).is_ok_and(|key| key.format == KEY_FORMAT)
}

/// Prepares the output's folder for the recipe as written, whose text is kept there. Fails where the folder holds
/// something else, or scenes that the recipe would make otherwise or not at all, unless they may be replaced.
pub(super) fn begin(
    options: &BuildOptions,
    recipe: &Recipe,
    text: &str,
    tool: &str,
    source: &Path,
) -> Result<(), PrepError> {
    let out = &options.out;
    // Before the lease, which is a file in the folder.
    check_place(options, Place::of(out))?;
    let build = BuildFolder::of(out);
    make_folder(build.path())?;
    let _lease = build.lease_of_start()?;
    let place = Place::of(out);
    check_place(options, place)?;
    if place == Place::Build && (!options.force || !options.scenes.is_empty()) {
        check_scenes(options, recipe, tool, source)?;
        return Ok(mateval_files::whole::write_whole(&build.recipe(), text.as_bytes())?);
    }
    if place != Place::New {
        check_holds_none(out, &[&options.recipe, source])?;
        let _whole = build.lease_of_whole(&[])?;
        let old = put_aside(out)?;
        make_folder(build.path())?;
        old.as_deref().map_or(Ok(()), remove)?;
    }
    remove_abandoned(out)?;
    mateval_files::whole::write_whole(&build.recipe(), text.as_bytes())?;
    json::write(&build.key(), &BuildKey { format: KEY_FORMAT.to_owned() })?;
    Ok(())
}

/// Fails where the folder must not be written to.
fn check_place(options: &BuildOptions, place: Place) -> Result<(), PrepError> {
    match place {
        Place::Other => Err(PrepError::unusable(
            &options.out,
            "exists and is not a dataset; it is not replaced: choose another --out",
        )),
        Place::Dataset if !options.force || !options.scenes.is_empty() => {
            let why = "holds a finished dataset without the `.build` of its making; --force \
                       without --scene replaces it as a whole";
            Err(PrepError::unusable(&options.out, why))
        }
        _ => Ok(()),
    }
}

/// Fails where scenes that are to be made were made otherwise than the recipe says, or scenes are not in it and all are
/// to be made: of the others, `prep finish` says so. Scenes of a build that never finished are made again where only
/// their files have changed: nobody can have rendered them.
fn check_scenes(options: &BuildOptions, recipe: &Recipe, tool: &str, source: &Path) -> Result<(), PrepError> {
    let build = BuildFolder::of(&options.out);
    let is_finished = options.out.join(DATASET).is_file();
    let is_changed = |id: &SceneId| {
        let Some(entry) = recipe.scenes.iter().find(|entry| entry.id == *id) else { return false };
        // A mark that cannot be read is of a scene that is made again.
        let Ok(mark) = json::read::<SceneMark>(&build.mark(id)) else { return false };
        mark.settings_sha256 != settings_sha256(recipe, id, tool)
            || is_finished
                && SceneFolder::of(&options.out, id).path().exists()
                && finished_scene(&options.out, entry, source).is_none()
    };
    let is_apart = !options.scenes.is_empty();
    let is_kept = |id: &SceneId| is_apart && (options.force || !options.scenes.contains(id));
    let (known, dropped): (Vec<SceneId>, Vec<SceneId>) =
        marked(&build).into_iter().partition(|id| recipe.scenes.iter().any(|entry| entry.id == *id));
    let changed: Vec<SceneId> = known.into_iter().filter(|id| !is_kept(id) && is_changed(id)).collect();
    match changed.is_empty() && (dropped.is_empty() || is_apart) {
        true => Ok(()),
        false => Err(PrepError::OtherBuild { path: options.out.clone(), changed, dropped }),
    }
}

/// The scenes that have a mark.
fn marked(build: &BuildFolder) -> Vec<SceneId> {
    let Ok(entries) = std::fs::read_dir(build.marks()) else { return Vec::new() };
    let id = |name: std::ffi::OsString| SceneId::new(name.to_str()?.strip_suffix(".json")?).ok();
    let mut ids: Vec<SceneId> = entries.flatten().filter_map(|entry| id(entry.file_name())).collect();
    ids.sort();
    ids
}

/// Whether every entry of the folder has one of these names; false where the folder cannot be read.
pub(crate) fn holds_only(folder: &Path, names: &[&str]) -> bool {
    std::fs::read_dir(folder)
        .and_then(|entries| entries.collect::<Result<Vec<_>, _>>())
        .is_ok_and(|entries| entries.iter().all(|entry| names.iter().any(|name| entry.file_name() == *name)))
}

/// The file that a finished scene leaves in the build folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct SceneMark {
    /// The hash of the recipe's settings for the scene, and of the tool that made it.
    pub(crate) settings_sha256: String,
    pub(crate) licence: Option<Licence>,
    /// What the key and the materials were that the scene was redressed with; absent if it was not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) secret: Option<String>,
    /// Files that were looked for but do not exist, with paths as in `scene.json`.
    pub(super) absent: Vec<String>,
    /// All files in the folders of labels, whether used or not.
    pub(super) labels: BTreeSet<PathBuf>,
}

/// The mark of a scene that an earlier run made from the same files: none has changed, and none has been added since.
pub(super) fn finished_scene(root: &Path, entry: &RecipeScene, source: &Path) -> Option<SceneMark> {
    let mark: SceneMark = json::read(&BuildFolder::of(root).mark(&entry.id)).ok()?;
    let scene = SceneFile::read(&SceneFolder::of(root, &entry.id)).ok()?;
    let secret = secret_of(entry, source, root).ok()?;
    if mark.secret != secret.as_ref().map(RedressKey::fingerprint) {
        return None;
    }
    let root = entry.root(source);
    let is_same = |file: &SourceFile| sha256_of_file(&root.join(&file.path)).is_ok_and(|h| h == file.sha256);
    let is_absent = |file: &String| !root.join(file).exists();
    let same = scene.source.files.iter().all(is_same) && mark.absent.iter().all(is_absent);
    (same && mark.labels == label_files(entry, source)).then_some(mark)
}

/// The files in the folders of a scene's labels.
pub(super) fn label_files(entry: &RecipeScene, source: &Path) -> BTreeSet<PathBuf> {
    let files = |folder: &PathBuf| {
        // A folder that cannot be listed fails where it is read.
        let names = file_names(&entry.root(source).join(folder)).unwrap_or_default();
        names.into_iter().map(|name| folder.join(name)).collect::<Vec<_>>()
    };
    entry.part_labels.values().flat_map(files).collect()
}

/// The hash of everything but files that decides how the scene of this id is made. `recipe` is as written.
pub(crate) fn settings_sha256(recipe: &Recipe, id: &SceneId, tool: &str) -> String {
    // Every setting is printed with all its fields; other scenes, the dataset's name and the renderer's samples are not
    // among them. The text is read by nobody, and the tool's version stands in it.
    let Recipe {
        name: _,
        version: _,
        resolution,
        views,
        wide,
        atlas_size,
        materials,
        camera_rules,
        samples: _,
        licences: _,
        scenes,
    } = recipe;
    // Twins are made of a finished scene and change nothing in it.
    let entry =
        scenes.iter().find(|entry| entry.id == *id).cloned().map(|entry| RecipeScene { twins: Vec::new(), ..entry });
    let settings = format!(
        "{tool}\n{resolution:?}\n{views:?}\n{wide:?}\n{atlas_size:?}\n{materials:?}\n{camera_rules}\n{entry:?}"
    );
    sha256_of_bytes(settings.as_bytes())
}
