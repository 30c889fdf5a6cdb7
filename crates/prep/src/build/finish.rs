//! Writes the files that describe a whole dataset, once its scenes are made.
//!
//! These are `dataset.json`, `targets.json`, the recipe and the manifest. Files of scenes are not read again where
//! their hashes are known.
//!
//! [`bring_up_to_date`] does so for a dataset of the format before this one, from what it holds. `mateval/3` differs
//! from `mateval/2` in the word of its JSON files, in a key of `dataset.json` and in the pictures that scores under
//! light are computed from. These are made by the caller; everything else happens here, and no other file changes. A
//! run that was killed resumes.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use mateval_dataset::dataset::{DatasetFile, FORMAT, PREVIOUS_FORMAT, SceneFile, Target, TargetsFile};
use mateval_dataset::layout::BuildFolder;
use mateval_dataset::layout::{DATASET, MANIFEST, SceneFolder, TARGETS, is_rendered};
use mateval_dataset::manifest;
use mateval_dataset::manifest::SceneHashes;
use mateval_dataset::manifest::change_scene;
use mateval_dataset::open::{check_whole, read_dataset_file};
use mateval_dataset::render_file::RENDER_FILE;
use mateval_dataset::{Progress, RendererId, Report, SceneError, SceneId, json};
use mateval_files::FileError;
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::whole::write_whole;
use mateval_files::work_folder::{self, remove};
use serde::Deserialize;

use super::start::{SceneMark, is_build, settings_sha256};
use crate::error::PrepError;
use crate::recipe::{self, RECIPE, Recipe};
use crate::render::run::{RendererKind, can_show_input, show_input};

/// Pictures that a killed render wrote and that no list names yet.
#[derive(Clone, Copy, PartialEq, Eq)]
enum CutOffRenders {
    /// A fault: who finishes a dataset wants it whole.
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
        return Err(SceneError::UnknownScenes { dataset: root.to_owned(), unknown, known: all }.into());
    }
    let _lease = build.lease_of_whole(&all)?;
    manifest::remove_unfinished(&root.join("scenes"))?;
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
    let mut dataset = DatasetFile {
        format: FORMAT.to_owned(),
        name: recipe.name.clone(),
        version: recipe.version.clone(),
        tool: tool.to_owned(),
        scenes,
        photo_renderer: None,
        licences: Vec::new(),
        geometry: None,
        manifest_sha256: String::new(),
    };
    for id in &dataset.scenes {
        dataset.licences.extend(json::read::<SceneMark>(&build.mark(id))?.licence);
    }
    let known = scene_hashes(root, &mut dataset, cut_off, progress)?;
    json::write(&root.join(TARGETS), &targets(root, &dataset)?)?;
    write_whole(&root.join(RECIPE), text.as_bytes())?;
    write(root, dataset, &known)
}

/// Writes the manifest and `dataset.json` again, after scenes that the dataset lists were rendered.
pub fn finish_again(root: &Path, progress: Progress<'_>) -> Result<DatasetFile, PrepError> {
    let mut dataset = read_dataset_file(root)?;
    check_whole(root, &dataset)?;
    let _lease = BuildFolder::of(root).lease_of_whole(&dataset.scenes)?;
    manifest::remove_unfinished(&root.join("scenes"))?;
    check_strays(root, &dataset.scenes)?;
    let known = scene_hashes(root, &mut dataset, CutOffRenders::Refused, progress)?;
    write(root, dataset, &known)
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
    std::fs::create_dir_all(parent).map_err(FileError::io("make", parent))?;
    Ok(std::fs::rename(&from, &to).map_err(FileError::io("move", &from))?)
}

/// Fails where `scenes` holds what is no scene of the dataset, such as a copy that was made by hand.
pub(crate) fn check_strays(root: &Path, scenes: &[SceneId]) -> Result<(), PrepError> {
    let folder = root.join("scenes");
    let entries = std::fs::read_dir(&folder).map_err(FileError::io("list", &folder))?;
    let names = entries.flatten().map(|entry| entry.file_name().to_string_lossy().into_owned());
    let is_stray =
        |name: &String| !mateval_files::whole::is_temporary(name) && scenes.iter().all(|id| id.as_str() != name);
    let mut names: Vec<String> = names.filter(is_stray).collect();
    names.sort();
    if names.is_empty() { Ok(()) } else { Err(PrepError::StrayScenes { path: folder, names }) }
}

/// Checks the scenes' files, shows the photo renderer's picture in each, and returns the hashes of all files. Sets the
/// photo renderer.
fn scene_hashes(
    root: &Path,
    dataset: &mut DatasetFile,
    cut_off: CutOffRenders,
    progress: Progress<'_>,
) -> Result<BTreeMap<String, String>, PrepError> {
    dataset.photo_renderer = photo_renderer(root, dataset);
    let shown = dataset.photo_renderer.clone().or_else(|| any_renderer(root, &dataset.scenes));
    let changed = BuildFolder::of(root).changed();
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
        return Err(SceneError::Invalid { path: root.to_owned(), findings }.into());
    }
    for (id, shown, list) in &mut lists {
        if let Some(renderer) = shown {
            list.note_change()?;
            show_input(&SceneFolder::of(root, id), renderer)?;
        }
        list.update()?;
    }
    let entries = lists.iter().flat_map(|(_, _, list)| list.entries());
    Ok(entries.map(|(file, sha256)| (file.to_owned(), sha256.to_owned())).collect())
}

/// Whether a path in the dataset is that of an input picture.
fn is_input_picture(path: &str) -> bool {
    path.ends_with("/views/input/rgb.exr") || path.ends_with("/views/input/rgb.png")
}

/// The first renderer in the order of [`RendererKind::ALL`] that has rendered every view of the scenes that have no
/// photo from elsewhere; none where none has, or where all scenes have one.
fn photo_renderer(root: &Path, dataset: &DatasetFile) -> Option<RendererId> {
    let mut known = RendererKind::ALL.map(RendererKind::id).into_iter();
    let rendered: Vec<SceneId> = dataset.scenes.iter().filter(|id| !is_photographed(root, id)).cloned().collect();
    known.find(|renderer| !rendered.is_empty() && rendered.iter().all(|id| is_complete(root, id, renderer)))
}

/// Whether the scene's input picture is a photo from elsewhere.
fn is_photographed(root: &Path, id: &SceneId) -> bool {
    json::read::<SceneFile>(&SceneFolder::of(root, id).scene_file()).is_ok_and(|scene| scene.photo.is_some())
}

/// The first renderer that has rendered every view of some scene.
fn any_renderer(root: &Path, scenes: &[SceneId]) -> Option<RendererId> {
    let mut known = RendererKind::ALL.map(RendererKind::id).into_iter();
    known.find(|renderer| scenes.iter().any(|id| is_complete(root, id, renderer)))
}

fn is_complete(root: &Path, id: &SceneId, renderer: &RendererId) -> bool {
    let folder = SceneFolder::of(root, id);
    json::read::<SceneFile>(&folder.scene_file())
        .is_ok_and(|scene| scene.views.iter().all(|view| folder.render(renderer, &view.id).join(RENDER_FILE).is_file()))
}

/// Every view of every scene: scenes differ in the wide views that they have a place for.
fn targets(root: &Path, dataset: &DatasetFile) -> Result<TargetsFile, PrepError> {
    let mut targets = Vec::new();
    for id in &dataset.scenes {
        let scene: SceneFile = json::read(&SceneFolder::of(root, id).scene_file())?;
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

/// Rewrites the dataset in `root` from [`PREVIOUS_FORMAT`] to [`FORMAT`] and renews its manifest; pictures, meshes and
/// textures keep their bytes. Returns whether there was anything to do. Fails, before anything of a scene is written,
/// where one of its files is not the one that is listed.
pub fn bring_up_to_date(root: &Path, progress: Progress<'_>) -> Result<bool, PrepError> {
    let path = root.join(DATASET);
    let bytes = std::fs::read(&path).map_err(FileError::io("read", &path))?;
    if format_of(&bytes).as_deref() != Some(PREVIOUS_FORMAT) {
        return Ok(false);
    }
    let text = raised(&path, &bytes)?.replacen(r#""scored_renderer":"#, r#""photo_renderer":"#, 1);
    let dataset: DatasetFile = json::parse_format(&path, text.as_bytes(), FORMAT)?;
    check_can_change(root, &dataset)?;
    for (at, id) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {id}"), at, dataset.scenes.len()));
        raise_scene(root, id)?;
    }
    raise_file(&root.join(TARGETS))?;
    // From here on this version opens the dataset, and asks to finish it if this run is killed.
    write_whole(&path, text.as_bytes()).map_err(SceneError::from)?;
    finish_again(root, progress)?;
    Ok(true)
}

/// Fails where scenes are missing, where the geometry is not the true one, or where a file outside of scenes is not the
/// one that the manifest lists. Those of scenes are checked scene by scene.
fn check_can_change(root: &Path, dataset: &DatasetFile) -> Result<(), PrepError> {
    check_whole(root, dataset)?;
    if dataset.geometry.is_some() {
        let what = "perturbed geometry in an old format; run `mateval prep perturb` on the dataset with the true geometry, \
                    whose identity changes too";
        return Err(SceneError::Unsupported { path: root.to_owned(), what: what.to_owned() }.into());
    }
    let found = sha256_of_file(&root.join(MANIFEST))?;
    if found != dataset.manifest_sha256 {
        let what = format!("manifest_sha256 is {}, but MANIFEST.sha256 hashes to {found}", dataset.manifest_sha256);
        return Err(SceneError::Unsupported { path: root.join(DATASET), what }.into());
    }
    let mut findings = manifest::check_those(root, |file| !file.starts_with("scenes/"))?;
    let listed = manifest::entries(root)?;
    let is_raised = |file: &str| {
        listed
            .iter()
            .any(|entry| entry.file == file && JsonState::of(&root.join(file), &entry.sha256) == JsonState::Raised)
    };
    findings.retain(|finding| !is_raised(&finding.file));
    match findings.is_empty() {
        true => Ok(()),
        false => Err(SceneError::Invalid { path: root.to_owned(), findings }.into()),
    }
}

/// Rewrites the JSON files of a scene and removes its companions, which are no longer part of the format.
fn raise_scene(root: &Path, id: &SceneId) -> Result<(), PrepError> {
    let is_companion = |file: &str| file.starts_with(&format!("scenes/{id}/ground_truth/companions/"));
    let list = SceneHashes::open(root, id)?;
    let json_files = list.entries().filter(|(file, _)| file.ends_with(".json") && !is_companion(file));
    let states: Vec<(String, JsonState)> =
        json_files.map(|(file, sha256)| (file.to_owned(), JsonState::of(&root.join(file), sha256))).collect();
    let companions = SceneFolder::of(root, id).truth().join("companions");
    if !companions.exists() && states.iter().all(|(_, state)| *state == JsonState::Other) {
        return Ok(());
    }
    let is_ours = |path: &str| {
        is_companion(path) || states.iter().any(|(file, state)| file == path && *state != JsonState::Other)
    };
    change_scene(root, id, is_ours, || {
        for (file, _) in states.iter().filter(|(_, state)| *state == JsonState::Previous) {
            raise_file(&root.join(file))?;
        }
        Ok(work_folder::remove(&companions)?)
    })
}

/// What a JSON file is, compared with the hash that is listed for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum JsonState {
    /// The listed file, in the previous format.
    Previous,
    /// Was the listed file until a run that was killed rewrote it.
    Raised,
    /// The listed file, in a format of its own; or changed or missing, which the check of the hashes reports.
    Other,
}

impl JsonState {
    fn of(path: &Path, listed: &str) -> Self {
        let Ok(bytes) = std::fs::read(path) else { return Self::Other };
        let before = || String::from_utf8_lossy(&bytes).replacen(&quoted(FORMAT), &quoted(PREVIOUS_FORMAT), 1);
        match format_of(&bytes).as_deref() {
            Some(PREVIOUS_FORMAT) if sha256_of_bytes(&bytes) == listed => Self::Previous,
            Some(FORMAT) if sha256_of_bytes(before().as_bytes()) == listed => Self::Raised,
            _ => Self::Other,
        }
    }
}

/// Rewrites a file that has the previous format; leaves any other.
fn raise_file(path: &Path) -> Result<(), PrepError> {
    let bytes = std::fs::read(path).map_err(FileError::io("read", path))?;
    if format_of(&bytes).as_deref() == Some(PREVIOUS_FORMAT) {
        write_whole(path, raised(path, &bytes)?.as_bytes()).map_err(SceneError::from)?;
    }
    Ok(())
}

/// The text with the new format in place of the previous one. Only that word is replaced, so that numbers keep their
/// digits.
fn raised(path: &Path, bytes: &[u8]) -> Result<String, PrepError> {
    let text = String::from_utf8_lossy(bytes).replacen(&quoted(PREVIOUS_FORMAT), &quoted(FORMAT), 1);
    if format_of(text.as_bytes()).as_deref() == Some(FORMAT) {
        return Ok(text);
    }
    let what =
        format!("expected 'format' as the first key with the value '{PREVIOUS_FORMAT}'; build the dataset again");
    Err(SceneError::Unsupported { path: path.to_owned(), what }.into())
}

fn quoted(format: &str) -> String {
    format!("\"{format}\"")
}

/// The value of the key `format`; absent if the file has no such key or is no JSON.
fn format_of(bytes: &[u8]) -> Option<String> {
    #[derive(Deserialize)]
    struct Head {
        format: String,
    }
    serde_json::from_slice::<Head>(bytes).ok().map(|head| head.format)
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use mateval_dataset::open::Dataset;
    use mateval_testkit::sample_dataset;
    use mateval_testkit::{copy_folder, kept_folder};

    use crate::render::{RenderOptions, render};

    use super::*;

    fn hashes(root: &Path) -> BTreeMap<String, String> {
        let files = manifest::list_files(root).unwrap().into_iter().chain([DATASET.to_owned(), MANIFEST.to_owned()]);
        files.map(|file| (file.clone(), sha256_of_file(&root.join(file)).unwrap())).collect()
    }

    /// Replaces a text in a file once, which must hold it.
    fn replace(path: &Path, from: &str, to: &str) {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains(from), "{}", path.display());
        std::fs::write(path, text.replacen(from, to, 1)).unwrap();
    }

    fn list_again(root: &Path) {
        let path = root.join(DATASET);
        let known = json::read::<serde_json::Value>(&path).unwrap()["manifest_sha256"].as_str().unwrap().to_owned();
        let sha256 = manifest::write(root).unwrap();
        replace(&path, &known, &sha256);
    }

    /// A rendered dataset of this format, and the same one as the previous version wrote it.
    fn both_formats() -> (PathBuf, PathBuf) {
        let new = kept_folder("up_to_date").join("dataset");
        copy_folder(&sample_dataset::built(), &new);
        render(&new, &RenderOptions { samples: Some(1), ..RenderOptions::default() }, &|_| ()).unwrap();
        let old = new.with_file_name("previous");
        copy_folder(&new, &old);
        let mut count = 0;
        for file in manifest::list_files(&old).unwrap().into_iter().chain([DATASET.to_owned()]) {
            let path = old.join(file);
            if std::fs::read(&path).is_ok_and(|bytes| format_of(&bytes).as_deref() == Some(FORMAT)) {
                replace(&path, &quoted(FORMAT), &quoted(PREVIOUS_FORMAT));
                count += 1;
            }
        }
        assert!(count >= 8, "dataset.json, targets.json and at least three files of each scene: {count}");
        replace(&old.join(DATASET), "\"photo_renderer\":", "\"scored_renderer\":");
        let dataset = Dataset::open(&new).unwrap();
        for scene in &dataset.scenes {
            let companions = SceneFolder::of(&old, &scene.id).truth().join("companions/turned");
            std::fs::create_dir_all(&companions).unwrap();
            std::fs::write(companions.join("companions.json"), r#"{"format": "mateval-companions/2"}"#).unwrap();
        }
        list_again(&old);
        (new, old)
    }

    #[test]
    fn the_previous_format_becomes_this_one_byte_for_byte() {
        let (new, old) = both_formats();
        let error = Dataset::open(&old).unwrap_err().to_string();
        assert!(error.contains("mateval prep render --only scorer DATASET"), "{error}");
        // Another version's list of hashes must not be needed.
        let whole = old.with_file_name("whole");
        copy_folder(&old, &whole);
        std::fs::remove_dir_all(whole.join(".build")).unwrap();
        assert!(bring_up_to_date(&whole, &|_| ()).unwrap());
        assert_eq!(hashes(&whole), hashes(&new));
        assert!(!bring_up_to_date(&whole, &|_| ()).unwrap(), "nothing is left to do");
        Dataset::open(&whole).unwrap();

        // A run that was killed between two files of a scene.
        let scene = Dataset::open(&new).unwrap().scenes[1].id.clone();
        let scene_file = SceneFolder::of(&old, &scene).scene_file();
        SceneHashes::open(&old, &scene).unwrap().note_change().unwrap();
        raise_file(&scene_file).unwrap();
        raise_file(&old.join(TARGETS)).unwrap();
        assert!(bring_up_to_date(&old, &|_| ()).unwrap());
        assert_eq!(hashes(&old), hashes(&new));
    }

    #[test]
    fn a_changed_file_is_refused() {
        let (_, old) = both_formats();
        let dataset: serde_json::Value = json::read(&old.join(DATASET)).unwrap();
        let picture = format!("scenes/{}/views/input/depth.exr", dataset["scenes"][0].as_str().unwrap());
        std::fs::write(old.join(&picture), "changed").unwrap();
        let before = hashes(&old);
        let error = bring_up_to_date(&old, &|_| ()).unwrap_err().to_string();
        assert!(error.contains("changed_file") && error.contains(&picture), "{error}");
        assert_eq!(hashes(&old), before);
    }
}
