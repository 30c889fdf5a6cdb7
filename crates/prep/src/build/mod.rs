//! Makes the dataset of a recipe scene by scene, each completely or not at all. A run that was killed is resumed.

mod options;
pub(crate) mod scene_mark;
mod source_check;
pub(crate) mod start;

use std::path::Path;

use mateval_scene::build_folder::BuildFolder;
use mateval_scene::dataset::{Licence, SceneFile};
use mateval_scene::layout::SceneFolder;
use mateval_scene::scene_cost::{self, Step, TimedStep};
use mateval_scene::scene_hashes::SceneHashes;
use mateval_scene::work_folder::{WorkFolder, remove, remove_beside};
use mateval_scene::{Finding, Progress, Report, SceneError, SceneId, json};

use crate::atlas::cache::AtlasCache;
use crate::build_scene::{self, Built};
use crate::error::PrepError;
use crate::finish::finish_build;
use crate::recipe::{self, Recipe, RecipeScene};
pub use options::BuildOptions;
use scene_mark::{SceneMark, finished_scene, label_files, settings_sha256};
use source_check::{check_sources, make_relative, source_folder};

/// The result of a build.
#[derive(Clone, Debug, Default)]
pub struct BuildReport {
    /// The findings of every scene.
    pub findings: Vec<(SceneId, Vec<Finding>)>,
    /// Scenes that an earlier run had already made.
    pub resumed: Vec<SceneId>,
}

/// Makes the scenes, and finishes the dataset if they are all. `tool` is the name and version that the dataset records.
/// Several processes may make different scenes of one dataset at once.
pub fn build(options: &BuildOptions, tool: &str, progress: Progress<'_>) -> Result<BuildReport, PrepError> {
    let (written, text) = recipe::read(&options.recipe)?;
    let mut recipe = written.clone();
    let source = source_folder(options);
    make_relative(options, &mut recipe, &source)?;
    let scenes = chosen(options, &recipe)?;
    check_sources(options, &scenes, &source)?;
    start::begin(options, &written, &text, tool, &source)?;

    let mut report = BuildReport::default();
    for (at, entry) in scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", entry.id), at, scenes.len()));
        let _lease = BuildFolder::of(&options.out).lease_of_scene(&entry.id)?;
        let replaced = options.force && !options.scenes.is_empty();
        match finished_scene(&options.out, entry, &source).filter(|_| !replaced) {
            Some(_) => report.resumed.push(entry.id.clone()),
            None => {
                let settings = settings_sha256(&written, &entry.id, tool);
                scene_cost::forget(&options.out, &entry.id)?;
                let step = TimedStep { step: Step::Build, renderer: None, is_alone: true };
                scene_cost::timed(&options.out, &entry.id, &step, || {
                    make_scene(options, &recipe, entry, &source, settings, progress)
                })?;
            }
        }
        let file: SceneFile = json::read(&SceneFolder::of(&options.out, &entry.id).scene_file())?;
        report.findings.push((entry.id.clone(), file.findings));
    }
    if options.scenes.is_empty() {
        finish_build(&options.out, tool, progress)?;
    }
    Ok(report)
}

/// The recipe's scenes that are to be made.
fn chosen<'a>(options: &BuildOptions, recipe: &'a Recipe) -> Result<Vec<&'a RecipeScene>, PrepError> {
    let known = || recipe.scenes.iter().map(|entry| entry.id.clone());
    let unknown: Vec<SceneId> = options.scenes.iter().filter(|id| known().all(|k| k != **id)).cloned().collect();
    if !unknown.is_empty() {
        let dataset = options.recipe.clone();
        return Err(SceneError::UnknownScenes { dataset, unknown, known: known().collect() }.into());
    }
    let is_chosen = |entry: &&RecipeScene| options.scenes.is_empty() || options.scenes.contains(&entry.id);
    Ok(recipe.scenes.iter().filter(is_chosen).collect())
}

fn make_scene(
    options: &BuildOptions,
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    settings_sha256: String,
    progress: Progress<'_>,
) -> Result<(), PrepError> {
    let build = BuildFolder::of(&options.out);
    let folder = SceneFolder::of(&options.out, &entry.id);
    let mark = build.mark(&entry.id);
    // The mark belongs to the scene that is about to be replaced.
    remove(&mark)?;
    build.note_change(&entry.id)?;
    // What a lost host left: this process holds the scene's lease.
    remove_beside(folder.path())?;
    let work = WorkFolder::start(folder.path())?;
    let labels = label_files(entry, source);
    let cache = options.atlas_cache.as_deref().map(AtlasCache::new);
    let at = SceneFolder::at(work.path().to_owned());
    let Built { licence, absent } =
        build_scene::build(recipe, entry, source, options.blender.as_ref(), &at, cache.as_ref(), progress)?;
    let licence = licence.map(|licence| Licence { scene: entry.id.clone(), file: licence.file, text: licence.text });
    let made = SceneMark { settings_sha256, licence, absent, labels };
    work.finish()?;
    remove(&build.left_out(&entry.id))?;
    SceneHashes::empty(&options.out, &entry.id).update()?;
    // The mark is written last, since a scene without its mark is made again.
    let marks = mark.parent().unwrap_or(&mark);
    std::fs::create_dir_all(marks).map_err(PrepError::io("make", marks))?;
    Ok(json::write(&mark, &made)?)
}
