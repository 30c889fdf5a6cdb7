//! Writes the files that describe a whole dataset, once its scenes are made.
//!
//! These are `dataset.json`, `targets.json`, the recipe and the manifest. Files of scenes are not read again where their
//! hashes are known.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_dataset::changes::{self, SceneHashes};
use mateval_dataset::dataset::{DatasetFile, FORMAT, SceneFile, Target, TargetsFile, Twin};
use mateval_dataset::layout::{BuildFolder, DATASET, SceneFolder, TARGETS, is_input_picture, is_rendered};
use mateval_dataset::lighting::parse_twin;
use mateval_dataset::manifest;
use mateval_dataset::open::{check_whole, read_dataset_file};
use mateval_dataset::render_file::RENDER_FILE;
use mateval_dataset::{DatasetError, Progress, RendererId, Report, SceneId, json};
use mateval_files::FileError;
use mateval_files::whole::write_whole;
use mateval_files::work_folder::{make_folder, remove};

use super::start::{SceneMark, is_build, settings_sha256};
use super::twins;
use crate::error::PrepError;
use crate::recipe::{self, RECIPE, Recipe, RecipeScene};
use crate::render::run::{RendererKind, can_show_input, show_input};

/// Pictures that a killed render wrote and that no list names yet.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CutOffRenders {
    /// A fault: `prep finish` promises a whole dataset.
    Refused,
    /// Listed as they are: the build can be resumed, and then the render.
    Listed,
}

/// Finishes the dataset that `prep build` makes in `root`, without the scenes `without`, which are put aside in
/// `.build` until a later call wants them. Fails where another process works on the dataset, where a scene is not made,
/// where one was changed by anything but `prep`, or where a folder is none of the recipe's scenes; everything of one
/// kind is named at once. Of a dataset that was not built here, the list of scenes stays as it is.
pub fn finish(root: &Path, without: &[SceneId], tool: &str, progress: Progress<'_>) -> Result<DatasetFile, PrepError> {
    finish_with(root, without, CutOffRenders::Refused, tool, progress)
}

/// Like [`finish`] for all scenes, at the end of a build, also where a render of its scenes was killed.
pub(crate) fn finish_build(root: &Path, tool: &str, progress: Progress<'_>) -> Result<DatasetFile, PrepError> {
    finish_with(root, &[], CutOffRenders::Listed, tool, progress)
}

fn finish_with(
    root: &Path,
    without: &[SceneId],
    cut_off: CutOffRenders,
    tool: &str,
    progress: Progress<'_>,
) -> Result<DatasetFile, PrepError> {
    if !is_build(root) {
        return match without.is_empty() {
            true => finish_again(root, progress),
            false => Err(PrepError::unusable(root, "was not built here, so --without cannot leave scenes out of it")),
        };
    }
    let build = BuildFolder::of(root);
    let (recipe, text) = recipe::read(&build.recipe())?;
    let all: Vec<SceneId> = recipe.scenes.iter().map(|entry| entry.id.clone()).collect();
    let unknown: Vec<SceneId> = without.iter().filter(|id| !all.contains(id)).cloned().collect();
    if !unknown.is_empty() {
        return Err(DatasetError::UnknownScenes { dataset: root.to_owned(), unknown, known: all }.into());
    }
    let _lease = build.lease_of_whole(&all)?;
    changes::remove_unfinished(&root.join("scenes"))?;
    let scenes: Vec<SceneId> = all.iter().filter(|id| !without.contains(id)).cloned().collect();
    if scenes.is_empty() {
        return Err(PrepError::unusable(root, "would have no scene left; leave one --without away"));
    }
    check_strays(root, &all)?;
    check_made(root, &recipe, &scenes, tool)?;
    // Everything that can be refused by names alone has been.
    for id in &all {
        put_in_place(root, id, !without.contains(id))?;
    }
    let mut dataset = DatasetFile::new(&recipe.name, &recipe.version, tool, scenes);
    for id in &dataset.scenes {
        dataset.licences.extend(json::read::<SceneMark>(&build.mark(id))?.licence);
        dataset.licences.extend(recipe.licence_of(id));
    }
    json::write(&root.join(TARGETS), &targets(root, &dataset)?)?;
    let known = refresh_scenes(root, &mut dataset, &wanted_twins(&recipe), cut_off, progress)?;
    twins::remove_others(root, &all, &dataset.scenes)?;
    write_whole(&root.join(RECIPE), text.as_bytes())?;
    write(root, dataset, &known)
}

/// Writes the manifest and `dataset.json` again, after scenes that the dataset lists were rendered.
pub fn finish_again(root: &Path, progress: Progress<'_>) -> Result<DatasetFile, PrepError> {
    let mut dataset = read_dataset_file(root)?;
    check_whole(root, &dataset)?;
    let _lease = BuildFolder::of(root).lease_of_whole(&dataset.scenes)?;
    changes::remove_unfinished(&root.join("scenes"))?;
    check_strays(root, &dataset.scenes)?;
    let twins = std::mem::take(&mut dataset.twins);
    dataset.scenes.retain(|id| !twins.contains_key(id));
    dataset.licences.retain(|licence| !twins.contains_key(&licence.scene));
    // Without the recipe of the build, those that exist are wanted.
    let wanted = match is_build(root) {
        true => wanted_twins(&recipe::read(&BuildFolder::of(root).recipe())?.0),
        false => twins.into_values().collect(),
    };
    let all = dataset.scenes.clone();
    let known = refresh_scenes(root, &mut dataset, &wanted, CutOffRenders::Refused, progress)?;
    twins::remove_others(root, &all, &dataset.scenes)?;
    write(root, dataset, &known)
}

/// The twins that a recipe asks for, in its order.
fn wanted_twins(recipe: &Recipe) -> Vec<Twin> {
    let of = |entry: &RecipeScene| {
        let of = entry.id.clone();
        entry.twins.clone().into_iter().map(move |lighting| Twin { of: of.clone(), lighting })
    };
    recipe.scenes.iter().flat_map(of).collect()
}

/// Fails where a scene is not made, or was made otherwise than the recipe says.
fn check_made(root: &Path, recipe: &Recipe, scenes: &[SceneId], tool: &str) -> Result<(), PrepError> {
    let build = BuildFolder::of(root);
    let (mut missing, mut changed) = (Vec::new(), Vec::new());
    for entry in recipe.scenes.iter().filter(|entry| scenes.contains(&entry.id)) {
        let exists = SceneFolder::of(root, &entry.id).path().exists() || build.left_out(&entry.id).exists();
        match json::read::<SceneMark>(&build.mark(&entry.id)) {
            Ok(mark) if exists && mark.settings_sha256 != settings_sha256(recipe, &entry.id, tool) => {
                changed.push(entry.id.clone());
            }
            Ok(_) if exists => {}
            _ => missing.push(entry.id.clone()),
        }
    }
    if !missing.is_empty() {
        return Err(PrepError::MissingScenes { path: root.to_owned(), scenes: missing });
    }
    match changed.is_empty() {
        true => Ok(()),
        false => Err(PrepError::OtherBuild { path: root.to_owned(), changed, dropped: Vec::new() }),
    }
}

/// Moves the scene's folder out of the dataset or back.
fn put_in_place(root: &Path, id: &SceneId, is_wanted: bool) -> Result<(), PrepError> {
    let (inside, outside) = (SceneFolder::of(root, id).path().to_owned(), BuildFolder::of(root).left_out(id));
    let (from, to) = if is_wanted { (outside, inside) } else { (inside, outside) };
    if !from.exists() {
        return Ok(());
    }
    if to.exists() {
        // The one in the dataset is the newer.
        remove(if is_wanted { &from } else { &to })?;
        if is_wanted {
            return Ok(());
        }
    }
    if is_wanted {
        BuildFolder::of(root).note_change(id)?;
    }
    let parent = to.parent().unwrap_or(root);
    make_folder(parent)?;
    Ok(std::fs::rename(&from, &to).map_err(FileError::io("move", &from))?)
}

/// Fails where `scenes` holds what is no scene of the dataset, such as a copy that was made by hand.
pub(crate) fn check_strays(root: &Path, scenes: &[SceneId]) -> Result<(), PrepError> {
    let folder = root.join("scenes");
    let entries = std::fs::read_dir(&folder).map_err(FileError::io("list", &folder))?;
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    // Twins that a killed run has made are not listed yet.
    let is_twin = |name: &str| parse_twin(name).is_some_and(|(of, _)| scenes.contains(&of));
    let is_stray = |name: &String| {
        let is_known = mateval_files::whole::is_temporary(name) || scenes.iter().any(|id| id.as_str() == name);
        !is_known && !is_twin(name)
    };
    let mut names: Vec<String> = names.filter(is_stray).collect();
    names.sort();
    if names.is_empty() { Ok(()) } else { Err(PrepError::StrayScenes { path: folder, names }) }
}

/// Checks the scenes' files, shows the photo renderer's picture in each, makes the `wanted` twins of those that are
/// rendered, and returns the hashes of all files. Sets the photo renderer, and lists the twins in the dataset, which has
/// none before.
fn refresh_scenes(
    root: &Path,
    dataset: &mut DatasetFile,
    wanted: &[Twin],
    cut_off: CutOffRenders,
    progress: Progress<'_>,
) -> Result<BTreeMap<String, String>, PrepError> {
    dataset.photo_renderer = photo_renderer(root, dataset);
    let shown = dataset.photo_renderer.clone().or_else(|| any_renderer(root, &dataset.scenes));
    let changed = BuildFolder::of(root).changed();
    // Check every file against the scenes' lists. Nothing is written unless all fit.
    let (mut findings, mut lists) = (Vec::new(), Vec::new());
    for (at, id) in dataset.scenes.iter().enumerate() {
        progress(Report::step("hashes", at, dataset.scenes.len()));
        let mut list = SceneHashes::open(root, id)?;
        let can_show =
            |renderer: &&RendererId| !is_photographed(root, id) && can_show_input(&SceneFolder::of(root, id), renderer);
        let shown = shown.as_ref().filter(can_show);
        // The input picture is a copy of that renderer's and is made again.
        let is_remade = |path: &str| shown.is_some() && is_input_picture(path);
        let listed: BTreeSet<String> = list.entries().map(|(file, _)| file.to_owned()).collect();
        let may_be_cut_off = cut_off == CutOffRenders::Listed && changed.contains(id);
        let is_cut_off = |path: &str| may_be_cut_off && is_rendered(path) && !listed.contains(path);
        findings.extend(list.check(|path| !is_remade(path) && !is_cut_off(path))?);
        lists.push((id, shown, list));
    }
    if !findings.is_empty() {
        return Err(DatasetError::Invalid { path: root.to_owned(), findings }.into());
    }
    // Show the renderer's picture in each scene, and make its twins of that scene's files.
    let mut twins = Vec::new();
    for (id, shown, list) in &mut lists {
        let of_scene: Vec<Twin> = wanted.iter().filter(|twin| twin.of == **id).cloned().collect();
        match shown {
            Some(renderer) => {
                list.note_change()?;
                show_input(&SceneFolder::of(root, id), renderer)?;
                twins.extend(twins::make(root, &of_scene, renderer, list, progress)?);
            }
            // Without renders, such as in the public part of a hidden split, those that exist stay as they are.
            None => twins.extend(twins::keep(root, of_scene)?),
        }
        list.update()?;
    }
    // List the twins, and gather the hashes of all files.
    let mut lists: Vec<SceneHashes> = lists.into_iter().map(|(_, _, list)| list).collect();
    for twin in twins {
        let list = twins::list(root, dataset, twin)?;
        lists.push(list);
    }
    let entries = lists.iter().flat_map(SceneHashes::entries);
    Ok(entries.map(|(file, sha256)| (file.to_owned(), sha256.to_owned())).collect())
}

/// The first renderer in the order of [`RendererKind::ALL`] that has rendered every view of the scenes that have no
/// photo from elsewhere; absent if none has, or where all scenes have one.
fn photo_renderer(root: &Path, dataset: &DatasetFile) -> Option<RendererId> {
    let mut known = RendererKind::ALL.iter().map(|kind| kind.id());
    let rendered: Vec<SceneId> = dataset.scenes.iter().filter(|id| !is_photographed(root, id)).cloned().collect();
    known.find(|renderer| !rendered.is_empty() && rendered.iter().all(|id| is_complete(root, id, renderer)))
}

/// Whether the scene's input picture is a photo from elsewhere.
fn is_photographed(root: &Path, id: &SceneId) -> bool {
    SceneFile::read(&SceneFolder::of(root, id)).is_ok_and(|scene| scene.photo.is_some())
}

/// The first renderer that has rendered every view of some scene.
fn any_renderer(root: &Path, scenes: &[SceneId]) -> Option<RendererId> {
    let mut known = RendererKind::ALL.iter().map(|kind| kind.id());
    known.find(|renderer| scenes.iter().any(|id| is_complete(root, id, renderer)))
}

fn is_complete(root: &Path, id: &SceneId, renderer: &RendererId) -> bool {
    let folder = SceneFolder::of(root, id);
    SceneFile::read(&folder)
        .is_ok_and(|scene| scene.views.iter().all(|view| folder.render(renderer, &view.id).join(RENDER_FILE).is_file()))
}

/// Every view of every scene: scenes differ in the wide views that they have a place for.
fn targets(root: &Path, dataset: &DatasetFile) -> Result<TargetsFile, PrepError> {
    let mut targets = Vec::new();
    for id in &dataset.scenes {
        let scene = SceneFile::read(&SceneFolder::of(root, id))?;
        targets.extend(scene.views.into_iter().map(|view| Target { scene: id.clone(), view: view.id }));
    }
    Ok(TargetsFile { format: FORMAT.to_owned(), targets })
}

/// `dataset.json` is written last: it names the manifest.
fn write(root: &Path, mut dataset: DatasetFile, known: &BTreeMap<String, String>) -> Result<DatasetFile, PrepError> {
    dataset.manifest_sha256 = manifest::write_with(root, known)?;
    json::write(&root.join(DATASET), &dataset)?;
    BuildFolder::of(root).forget_changes()?;
    Ok(dataset)
}
