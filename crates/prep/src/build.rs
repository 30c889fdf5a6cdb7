//! Makes the dataset of a recipe scene by scene, each completely or not at all. A run that was killed is resumed.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_scene::dataset::{DatasetFile, FORMAT, Licence, SceneFile, SourceFile, Target, TargetsFile};
use mateval_scene::layout::{DATASET, SceneFolder, TARGETS};
use mateval_scene::work_folder::{WorkFolder, put_aside, remove_aside};
use mateval_scene::{Finding, SceneId, json, manifest};
use serde::{Deserialize, Serialize};

use crate::build_scene::{self, Built};
use crate::error::PrepError;
use crate::part_labels;
use crate::recipe::fault::{RecipeFault, RecipeSceneFault};
use crate::recipe::{self, Recipe, RecipeScene, SourcePath};
use mateval_scene::Progress;
use mateval_sources::below::relative_below;

/// The name of the recipe in the dataset.
pub const RECIPE: &str = "recipe.toml";
/// The folder that an unfinished build keeps in the dataset's; a finished build removes it.
const BUILD: &str = ".build";

/// The inputs of a build.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// The recipe.
    pub recipe: PathBuf,
    /// The folder that the recipe's paths are relative to; if absent, the recipe's own.
    pub source: Option<PathBuf>,
    /// The dataset's folder.
    pub out: PathBuf,
    /// Replace a finished dataset.
    pub force: bool,
}

/// The result of a build.
#[derive(Clone, Debug)]
pub struct BuildReport {
    /// The dataset's description.
    pub dataset: DatasetFile,
    /// The findings of every scene.
    pub findings: Vec<(SceneId, Vec<Finding>)>,
    /// Scenes that an earlier, unfinished run had already finished.
    pub resumed: Vec<SceneId>,
}

/// The properties in which an unfinished build must equal the build that resumes it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct BuildKey {
    tool: String,
    recipe_sha256: String,
    source: PathBuf,
}

/// Makes the dataset. `tool` is the name and version that the dataset records.
pub fn build(options: &BuildOptions, tool: &str, progress: Progress<'_>) -> Result<BuildReport, PrepError> {
    let (mut recipe, text) = recipe::read(&options.recipe)?;
    let source = source_folder(options);
    make_relative(options, &mut recipe, &source)?;
    check_sources(options, &recipe, &source)?;
    let key = BuildKey {
        tool: tool.to_owned(),
        recipe_sha256: manifest::sha256_of_bytes(text.as_bytes()),
        source: std::path::absolute(&source).map_err(PrepError::io("find", &source))?,
    };
    let resumes = prepare_output(options, &key)?;

    let mut report = BuildReport { dataset: empty_dataset(&recipe, tool), findings: Vec::new(), resumed: Vec::new() };
    for (at, entry) in recipe.scenes.iter().enumerate() {
        progress(&format!("scene {}", entry.id), at, recipe.scenes.len());
        let mark = options.out.join(BUILD).join(format!("{}.json", entry.id));
        let folder = SceneFolder::of(&options.out, &entry.id);
        let finished = if resumes { finished_scene(&folder, &mark, entry, &source) } else { None };
        let made = match finished {
            Some(mark) => {
                // Left by a run that was killed between making a scene again and removing the old one.
                remove_aside(folder.path())?;
                report.resumed.push(entry.id.clone());
                mark
            }
            None => make_scene(&recipe, entry, &source, &folder, &mark, progress)?,
        };
        let file: SceneFile = json::read(&folder.scene_file())?;
        report.dataset.scenes.push(entry.id.clone());
        report.dataset.licences.extend(made.licence);
        report.findings.push((entry.id.clone(), file.findings));
    }
    finish(&options.out, &recipe, &text, &mut report.dataset)?;
    Ok(report)
}

/// The folder that the recipe's paths are relative to.
fn source_folder(options: &BuildOptions) -> PathBuf {
    // The parent of a file name alone is the empty path, which names no folder.
    let parent = options.recipe.parent().filter(|folder| !folder.as_os_str().is_empty());
    options.source.clone().unwrap_or_else(|| parent.unwrap_or(Path::new(".")).to_owned())
}

/// Makes the paths that the dataset records relative to `source`.
fn make_relative(options: &BuildOptions, recipe: &mut Recipe, source: &Path) -> Result<(), PrepError> {
    let mut faults = Vec::new();
    for scene in &mut recipe.scenes {
        let id = scene.id.clone();
        for (key, path) in scene.recorded_paths() {
            match relative_below(path, source) {
                Ok(relative) => *path = relative,
                Err(source) => faults.push((id.clone(), RecipeSceneFault::OutsideSource { key, source })),
            }
        }
    }
    refuse_if_any(options, faults)
}

/// Fails where a scene of the recipe has a fault.
fn refuse_if_any(options: &BuildOptions, faults: Vec<(SceneId, RecipeSceneFault)>) -> Result<(), PrepError> {
    if faults.is_empty() {
        return Ok(());
    }
    let faults = faults.into_iter().map(|(scene, fault)| RecipeFault::Scene { scene, fault }).collect();
    Err(PrepError::Recipe { path: options.recipe.clone(), faults })
}

/// Fails before the first scene is made if any scene's sources are missing or differ from those that the recipe pins.
fn check_sources(options: &BuildOptions, recipe: &Recipe, source: &Path) -> Result<(), PrepError> {
    refuse_if_any(options, faults_of_all(recipe, source, missing_sources))?;
    refuse_if_any(options, faults_of_all(recipe, source, changed_inputs))
}

/// The faults that `check` finds in every scene of the recipe.
fn faults_of_all(
    recipe: &Recipe,
    source: &Path,
    check: fn(&RecipeScene, &Path) -> Vec<RecipeSceneFault>,
) -> Vec<(SceneId, RecipeSceneFault)> {
    let mut all = Vec::new();
    for scene in &recipe.scenes {
        all.extend(check(scene, source).into_iter().map(|fault| (scene.id.clone(), fault)));
    }
    all
}

fn missing_sources(scene: &RecipeScene, source: &Path) -> Vec<RecipeSceneFault> {
    let labels = scene.part_labels.values();
    let labels = labels.map(|path| ("part_labels", scene.root(source).join(path), true));
    let paths =
        scene.source_paths().into_iter().map(|SourcePath { key, path, is_folder }| (key, source.join(path), is_folder));
    let fault = |(key, path, is_folder): (&'static str, PathBuf, bool)| {
        let exists = if is_folder { path.is_dir() } else { path.is_file() };
        let kind = if is_folder { "folder" } else { "file" };
        (!exists).then_some(RecipeSceneFault::MissingSource { key, kind, path })
    };
    paths.chain(labels).filter_map(fault).collect()
}

/// The pinned inputs that do not exist or have other bytes.
fn changed_inputs(scene: &RecipeScene, source: &Path) -> Vec<RecipeSceneFault> {
    let root = scene.root(source);
    let fault = |(file, pinned): (&String, &String)| {
        let (path, file) = (root.join(file), file.clone());
        if !path.is_file() {
            return Some(RecipeSceneFault::MissingInput { file });
        }
        match manifest::sha256_of_file(&path) {
            Ok(found) if found == *pinned => None,
            Ok(found) => Some(RecipeSceneFault::ChangedInput { file, found, pinned: pinned.clone() }),
            Err(source) => Some(RecipeSceneFault::UnreadableInput { file, source }),
        }
    };
    scene.inputs.iter().filter_map(fault).collect()
}

fn empty_dataset(recipe: &Recipe, tool: &str) -> DatasetFile {
    DatasetFile {
        format: FORMAT.to_owned(),
        name: recipe.name.clone(),
        version: recipe.version.clone(),
        tool: tool.to_owned(),
        scenes: Vec::new(),
        scored_renderer: None,
        licences: Vec::new(),
        manifest_sha256: String::new(),
    }
}

/// Prepares the output's folder. Returns whether an unfinished build of the same recipe and source is resumed.
fn prepare_output(options: &BuildOptions, key: &BuildKey) -> Result<bool, PrepError> {
    let out = &options.out;
    let path = || out.clone();
    let marks = out.join(BUILD);
    let key_file = marks.join("key.json");
    let is_dataset = out.join(DATASET).is_file();
    // Other tools may use a folder of that name: only one with our key is ours.
    let found_key = json::read::<BuildKey>(&key_file).ok();
    let unfinished = !is_dataset && found_key.is_some();
    if unfinished && !options.force && found_key.as_ref() == Some(key) {
        return Ok(true);
    }
    // A build killed before it wrote its key has written nothing else.
    let is_empty = !out.exists() || holds_only(out, &[BUILD]) && !key_file.exists();
    match (unfinished || is_dataset, is_empty, options.force) {
        (_, true, _) => {}
        (true, _, true) => put_aside(out)?,
        (true, ..) if unfinished => return Err(PrepError::OtherBuild { path: path() }),
        (true, ..) => return Err(PrepError::FinishedDataset { path: path() }),
        _ => return Err(PrepError::NotADataset { path: path() }),
    }
    std::fs::create_dir_all(&marks).map_err(PrepError::io("make", &marks))?;
    json::write(&key_file, key)?;
    remove_aside(out)?;
    Ok(false)
}

/// Whether every entry of the folder has one of these names; false where the folder cannot be read.
pub(crate) fn holds_only(folder: &Path, names: &[&str]) -> bool {
    std::fs::read_dir(folder)
        .and_then(|entries| entries.collect::<Result<Vec<_>, _>>())
        .is_ok_and(|entries| entries.iter().all(|entry| names.iter().any(|name| entry.file_name() == *name)))
}

/// The file that a finished scene leaves in the build folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct SceneMark {
    licence: Option<Licence>,
    /// Files that were looked for but do not exist, with paths as in `scene.json`.
    absent: Vec<String>,
    /// All files in the folders of labels, whether used or not.
    labels: BTreeSet<PathBuf>,
}

/// The mark of a scene that an earlier run made from the same files: none has changed, and none has been added since.
fn finished_scene(folder: &SceneFolder, mark: &Path, entry: &RecipeScene, source: &Path) -> Option<SceneMark> {
    let mark: SceneMark = json::read(mark).ok()?;
    let scene: SceneFile = json::read(&folder.scene_file()).ok()?;
    let root = entry.root(source);
    let is_same = |file: &SourceFile| manifest::sha256_of_file(&root.join(&file.path)).is_ok_and(|h| h == file.sha256);
    let is_absent = |file: &String| !root.join(file).exists();
    let same = scene.source.files.iter().all(is_same) && mark.absent.iter().all(is_absent);
    (same && mark.labels == label_files(entry, source)).then_some(mark)
}

/// The files in the folders of a scene's labels.
fn label_files(entry: &RecipeScene, source: &Path) -> BTreeSet<PathBuf> {
    let files = |folder: &PathBuf| {
        // A folder that cannot be listed fails where it is read.
        let names = part_labels::file_names(&entry.root(source).join(folder)).unwrap_or_default();
        names.into_iter().map(|name| folder.join(name)).collect::<Vec<_>>()
    };
    entry.part_labels.values().flat_map(files).collect()
}

fn make_scene(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    folder: &SceneFolder,
    mark: &Path,
    progress: Progress<'_>,
) -> Result<SceneMark, PrepError> {
    if mark.exists() {
        // The mark belongs to the scene that is about to be replaced.
        std::fs::remove_file(mark).map_err(PrepError::io("remove", mark))?;
    }
    let work = WorkFolder::start(folder.path())?;
    let labels = label_files(entry, source);
    let Built { licence, absent } =
        build_scene::build(recipe, entry, source, &SceneFolder::at(work.path().to_owned()), progress)?;
    let licence = licence.map(|licence| Licence { scene: entry.id.clone(), file: licence.file, text: licence.text });
    let made = SceneMark { licence, absent, labels };
    work.finish()?;
    // The mark is written last, since a scene without its mark is made again.
    json::write(mark, &made)?;
    Ok(made)
}

fn finish(out: &Path, recipe: &Recipe, text: &str, dataset: &mut DatasetFile) -> Result<(), PrepError> {
    let targets = dataset.scenes.iter().flat_map(|scene| {
        let input = mateval_scene::ViewId::new(mateval_scene::layout::INPUT).expect("our own id is an id");
        let views = std::iter::once(input).chain(recipe.views.iter().map(|view| view.id.clone()));
        views.map(|view| Target { scene: scene.clone(), view })
    });
    json::write(&out.join(TARGETS), &TargetsFile { format: FORMAT.to_owned(), targets: targets.collect() })?;
    mateval_image::store::write_whole(&out.join(RECIPE), text.as_bytes())?;
    dataset.manifest_sha256 = manifest::write(out)?;
    json::write(&out.join(DATASET), dataset)?;
    // From here on the dataset is finished, and the build folder no longer matters.
    let marks = out.join(BUILD);
    std::fs::remove_dir_all(&marks).map_err(PrepError::io("remove", &marks))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recipe_without_a_folder_lies_in_the_current_one() {
        let source = |recipe: &str| {
            source_folder(&BuildOptions { recipe: recipe.into(), source: None, out: "out".into(), force: false })
        };
        for (recipe, folder) in [("mini.toml", "."), ("recipes/mini.toml", "recipes"), ("/mini.toml", "/")] {
            assert_eq!(source(recipe), Path::new(folder));
            assert!(std::path::absolute(source(recipe)).is_ok());
        }
    }
}
