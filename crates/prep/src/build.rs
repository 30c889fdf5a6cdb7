//! A recipe carried out: scene by scene, each whole or not at all, going on where an earlier run was killed.

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
use crate::recipe::{self, Recipe, RecipeScene};
use mateval_scene::Progress;
use mateval_sources::below::relative_below;

/// The recipe as the dataset keeps it.
pub const RECIPE: &str = "recipe.toml";
/// What an unfinished build keeps in the dataset's folder; a finished one removes it.
const BUILD: &str = ".build";

/// What a build was given.
#[derive(Clone, Debug)]
pub struct BuildOptions {
    /// The recipe.
    pub recipe: PathBuf,
    /// The folder that its paths are relative to; the recipe's own where absent.
    pub source: Option<PathBuf>,
    /// The dataset's folder.
    pub out: PathBuf,
    /// Replace a finished dataset that is there.
    pub force: bool,
}

/// What a build gave.
#[derive(Clone, Debug)]
pub struct BuildReport {
    /// The dataset's description.
    pub dataset: DatasetFile,
    /// The findings of every scene.
    pub findings: Vec<(SceneId, Vec<Finding>)>,
    /// Scenes that an earlier, unfinished run had already made.
    pub resumed: Vec<SceneId>,
}

/// What an unfinished build must share with the one that goes on with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct BuildKey {
    tool: String,
    recipe_sha256: String,
    source: PathBuf,
}

/// Carries the recipe out. `tool` is the name and version that the dataset is marked with.
pub fn build(options: &BuildOptions, tool: &str, progress: Progress<'_>) -> Result<BuildReport, PrepError> {
    let (mut recipe, text) = recipe::read(&options.recipe)?;
    let source = source_folder(options);
    place_below(options, &mut recipe, &source)?;
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
                // Of a run killed between making a scene anew and removing the old one.
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

fn source_folder(options: &BuildOptions) -> PathBuf {
    let beside = || options.recipe.parent().map(Path::to_owned).unwrap_or_default();
    options.source.clone().unwrap_or_else(beside)
}

/// Makes the paths of all rooms relative to `source`: they end in the dataset.
fn place_below(options: &BuildOptions, recipe: &mut Recipe, source: &Path) -> Result<(), PrepError> {
    let mut faults = Vec::new();
    for scene in &mut recipe.scenes {
        let Some(room) = &mut scene.front3d else { continue };
        let paths = [("house", Some(&mut room.house)), ("models", Some(&mut room.models))];
        let paths = paths.into_iter().chain([("textures", room.textures.as_mut()), ("cameras", room.cameras.as_mut())]);
        for (key, path) in paths.filter_map(|(key, path)| Some((key, path?))) {
            match relative_below(path, source) {
                Ok(relative) => *path = relative,
                Err(what) => {
                    let hint = "name the folder that holds house, models, textures and cameras with --source";
                    faults.push(format!("scene '{}': {key}: {what}; {hint}", scene.id));
                }
            }
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(PrepError::Recipe { path: options.recipe.clone(), faults }) }
}

/// Whatever can fail early must: every scene's sources are there, and are what the recipe pins, before the first is made.
fn check_sources(options: &BuildOptions, recipe: &Recipe, source: &Path) -> Result<(), PrepError> {
    let mut faults: Vec<String> = recipe.scenes.iter().flat_map(|scene| missing_sources(scene, source)).collect();
    if faults.is_empty() {
        faults = recipe.scenes.iter().flat_map(|scene| changed_inputs(scene, &scene.root(source))).collect();
    }
    if faults.is_empty() { Ok(()) } else { Err(PrepError::Recipe { path: options.recipe.clone(), faults }) }
}

fn missing_sources(scene: &RecipeScene, source: &Path) -> Vec<String> {
    let mut wanted: Vec<(&str, &Path, bool)> = Vec::new();
    if let Some(xml) = &scene.bitterli {
        wanted.push(("bitterli", xml, false));
    }
    if let Some(room) = &scene.front3d {
        wanted.push(("house", &room.house, false));
        wanted.push(("models", &room.models, true));
        wanted.extend(room.textures.as_deref().map(|path| ("textures", path, true)));
        wanted.extend(room.cameras.as_deref().map(|path| ("cameras", path, false)));
    }
    let mut wanted: Vec<_> = wanted.into_iter().map(|(key, path, folder)| (key, source.join(path), folder)).collect();
    let labels = scene.part_labels.values().map(|path| ("part_labels", scene.root(source).join(path), true));
    wanted.extend(labels);
    let fault = |(key, path, is_folder): (&str, PathBuf, bool)| {
        let there = if is_folder { path.is_dir() } else { path.is_file() };
        let kind = if is_folder { "folder" } else { "file" };
        let hint = format!("correct `{key}`, or name the folder with --source");
        (!there).then(|| format!("scene '{}': there is no {kind} '{}'; {hint}", scene.id, path.display()))
    };
    wanted.into_iter().filter_map(fault).collect()
}

/// What of `inputs` is missing or another file than it says.
fn changed_inputs(scene: &RecipeScene, root: &Path) -> Vec<String> {
    let fault = |(path, pinned): (&String, &String)| {
        let file = root.join(path);
        if !file.is_file() {
            return Some(format!("scene '{}': input '{path}' is not there, or is no ordinary file", scene.id));
        }
        let found = match manifest::sha256_of_file(&file) {
            Ok(found) if found == *pinned => return None,
            Ok(found) => format!("is {found}"),
            Err(error) => format!("cannot be read ({error})"),
        };
        let hint = "get the file that the release was made of";
        Some(format!("scene '{}': input '{path}' {found}, expected {pinned}; {hint}", scene.id))
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

/// Makes the output's folder ready. True where an unfinished build of the same recipe and source is gone on with.
fn prepare_output(options: &BuildOptions, key: &BuildKey) -> Result<bool, PrepError> {
    let out = &options.out;
    let refuse = |what: &str| PrepError::Output { path: out.clone(), what: what.to_owned() };
    let marks = out.join(BUILD);
    let key_file = marks.join("key.json");
    let is_dataset = out.join(DATASET).is_file();
    // Other tools have folders of that name: only one with our key is ours.
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
        (true, ..) if unfinished => {
            let what = "holds an unfinished build of another recipe, source or version; add --force to replace it";
            return Err(refuse(what));
        }
        (true, ..) => return Err(refuse("holds a finished dataset; add --force to replace it")),
        _ => return Err(refuse("is there and is no dataset: it is not replaced; choose another --out")),
    }
    std::fs::create_dir_all(&marks).map_err(PrepError::io("make", &marks))?;
    json::write(&key_file, key)?;
    remove_aside(out)?;
    Ok(false)
}

/// Whether nothing in the folder has another name.
pub(crate) fn holds_only(folder: &Path, names: &[&str]) -> bool {
    std::fs::read_dir(folder)
        .is_ok_and(|entries| entries.flatten().all(|entry| names.iter().any(|name| entry.file_name() == *name)))
}

/// What a finished scene leaves in the build folder.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct SceneMark {
    licence: Option<Licence>,
    /// Files that were looked for and were not there, as `scene.json` would tell them.
    absent: Vec<String>,
    /// All that was in the folders of labels, whether used or not.
    labels: BTreeSet<PathBuf>,
}

/// A scene that an earlier run made of the same files as are there now: none is another one, and none has come since.
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
        // One that cannot be listed fails where it is read.
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
        // It is of what is about to be replaced.
        std::fs::remove_file(mark).map_err(PrepError::io("remove", mark))?;
    }
    let work = WorkFolder::start(folder.path())?;
    let labels = label_files(entry, source);
    let Built { licence, absent } =
        build_scene::build(recipe, entry, source, &SceneFolder::at(work.path().to_owned()), progress)?;
    let licence = licence.map(|licence| Licence { scene: entry.id.clone(), file: licence.file, text: licence.text });
    let made = SceneMark { licence, absent, labels };
    work.finish()?;
    // Only now: a scene without its mark is made again.
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
    // From here on the dataset is finished: what is left of the build folder no longer counts.
    let marks = out.join(BUILD);
    std::fs::remove_dir_all(&marks).map_err(PrepError::io("remove", &marks))
}
