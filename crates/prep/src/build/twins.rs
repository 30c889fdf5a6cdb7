//! Twins: a rendered scene shown again under another light, from whose answers constancy is scored.
//!
//! A twin is a folder beside its scene's, `<scene>--<lighting>`. Geometry, atlases, pictures of geometry and true maps
//! are those of the scene, as hard links. Its photo is the weighted sum of the photo renderer's denoised pictures of
//! each light group, so that nothing is rendered. It has no lights and no renders of its own.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::changes::SceneHashes;
use mateval_dataset::dataset::{DatasetFile, FORMAT, Licence, SceneFile, Twin};
use mateval_dataset::layout::{INPUT, SceneFolder, WHOLE_SCENE, is_input_picture, is_rendered};
use mateval_dataset::lighting::{LightingName, RelitRules, light_of, lightings, parse_twin, weighted};
use mateval_dataset::reference::LightsFile;
use mateval_dataset::{DatasetError, Progress, RendererId, Report, SceneId, ViewId, json};
use mateval_files::FileError;
use mateval_files::untrusted::sha256_of_file;
use mateval_files::work_folder::{WorkFolder, make_folder, remove};
use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};

use crate::error::PrepError;
use crate::views::{map_of, write_preview};

/// Fails where the id would be too long.
fn id(root: &Path, twin: &Twin) -> Result<SceneId, PrepError> {
    let too_long = |_| PrepError::unusable(root.join("scenes").join(twin.of.as_str()), "has too long an id for a twin");
    twin.lighting.twin_of(&twin.of).map_err(too_long)
}

/// Makes the wanted twins of a scene, of whose files `list` is the list, and returns those that exist then. A twin that
/// is what it would be stays as it is. A lighting that the scene does not have, since too few of its light groups
/// matter, makes none, which is reported.
pub(super) fn make(
    root: &Path,
    wanted: &[Twin],
    renderer: &RendererId,
    list: &SceneHashes,
    progress: Progress<'_>,
) -> Result<Vec<Twin>, PrepError> {
    let mut made = Vec::new();
    for twin in wanted {
        let of = SceneFolder::of(root, &twin.of);
        let scene: SceneFile = json::read_format(&of.scene_file(), FORMAT)?;
        let Some(photo) = photo(&of, &scene, renderer, twin.lighting)? else {
            let (of, lighting) = (&twin.of, twin.lighting);
            let why = "too few of its light groups bring their share of the light";
            progress(Report::Message(&format!("scene '{of}' has no twin '{lighting}': {why}")));
            continue;
        };
        make_one(root, &scene, &photo, &id(root, twin)?, list)?;
        made.push(twin.clone());
    }
    Ok(made)
}

/// Those of the wanted twins that exist. Fails where a file of one was changed.
pub(super) fn keep(root: &Path, wanted: Vec<Twin>) -> Result<Vec<Twin>, PrepError> {
    let (mut kept, mut findings) = (Vec::new(), Vec::new());
    for twin in wanted {
        let id = id(root, &twin)?;
        if SceneFolder::of(root, &id).path().is_dir() {
            findings.extend(SceneHashes::open(root, &id)?.check(|_| true)?);
            kept.push(twin);
        }
    }
    let path = root.to_owned();
    if findings.is_empty() { Ok(kept) } else { Err(DatasetError::Invalid { path, findings }.into()) }
}

fn make_one(
    root: &Path,
    scene: &SceneFile,
    photo: &Picture<LinearRgb>,
    id: &SceneId,
    list: &SceneHashes,
) -> Result<(), PrepError> {
    let place = SceneFolder::of(root, id);
    let work = WorkFolder::start(place.path())?;
    let at = SceneFolder::at(work.path().to_owned());
    // What is its own.
    let input = at.view(&scene.views[0].id);
    make_folder(&input)?;
    exr_io::write_linear(&input.join("rgb.exr"), photo, Precision::Float)?;
    write_preview(&input, photo, scene.exposure)?;
    json::write(&at.scene_file(), &SceneFile { id: id.clone(), ..scene.clone() })?;
    let own = ["scene.json", "views/input/rgb.exr", "views/input/rgb.png"];
    let mut expected = BTreeMap::new();
    for file in own {
        expected.insert(format!("scenes/{id}/{file}"), sha256_of_file(&work.path().join(file))?);
    }
    // Files that it shares with the scene, as hard links.
    let prefix = format!("scenes/{}/", scene.id);
    let shared: Vec<(&str, &str)> = list
        .entries()
        .filter_map(|(file, sha256)| Some((file.strip_prefix(&prefix)?, sha256)))
        .filter(|(file, _)| is_shared(file))
        .collect();
    expected.extend(shared.iter().map(|(file, sha256)| (format!("scenes/{id}/{file}"), (*sha256).to_owned())));
    if place.path().is_dir() {
        let mut found = SceneHashes::open(root, id)?;
        let is_same = found.entries().eq(expected.iter().map(|(file, sha256)| (file.as_str(), sha256.as_str())));
        if is_same && found.check(|_| true)?.is_empty() {
            return Ok(());
        }
    }
    for (file, _) in shared {
        let (from, to) = (root.join(&prefix).join(file), work.path().join(file));
        let parent = to.parent().unwrap_or(work.path());
        make_folder(parent)?;
        // Some file systems have no hard links.
        if std::fs::hard_link(&from, &to).is_err() {
            std::fs::copy(&from, &to).map_err(FileError::io("copy", &from))?;
        }
    }
    SceneHashes::empty(root, id).note_change()?;
    Ok(work.finish()?)
}

/// Whether twins share this file of their scene, by its path in the scene's folder.
pub(crate) fn is_shared(file: &str) -> bool {
    let is_of_light = is_rendered(file)
        || file == "ground_truth/lights.json"
        || file.starts_with("ground_truth/reference/")
        || file == WHOLE_SCENE;
    // The path of an input picture begins with its scene's.
    file != "scene.json" && !is_of_light && !is_input_picture(&format!("/{file}"))
}

/// The photo of a scene under a lighting, linear, before exposure; absent if the scene does not have that lighting.
pub(crate) fn photo(
    folder: &SceneFolder,
    scene: &SceneFile,
    renderer: &RendererId,
    lighting: LightingName,
) -> Result<Option<Picture<LinearRgb>>, PrepError> {
    let id = ViewId::input();
    let view = scene.view(INPUT).ok_or_else(|| PrepError::unusable(folder.scene_file(), "has no input view"))?;
    let lights: LightsFile = json::read_format(&folder.lights(), FORMAT)?;
    let rendered = folder.render(renderer, &id);
    let group = |at: usize| map_of(view, &rendered.join(format!("group_{at:02}.exr")), exr_io::read_linear);
    let groups = (0..lights.groups.len()).map(group).collect::<Result<Vec<_>, _>>()?;
    let valid = map_of(view, &folder.view(&id).join("valid.png"), png_io::read_mask)?;
    let sums: Vec<[f64; 3]> = groups.iter().map(|group| light_of(group, &valid)).collect();
    let mut all = lightings(&RelitRules::with_alone(groups.len()), &sums).into_iter();
    let size = [valid.width(), valid.height()];
    Ok(all.find(|found| found.name == lighting).map(|found| weighted(&groups, &found.weights, 1.0, size)))
}

/// Lists a twin in the dataset, behind its scene and that scene's earlier twins, with its scene's licence. Returns the
/// hashes of its files.
pub(super) fn list(root: &Path, dataset: &mut DatasetFile, twin: Twin) -> Result<SceneHashes, PrepError> {
    let id = id(root, &twin)?;
    let mut list = SceneHashes::open(root, &id)?;
    list.update()?;
    let is_before = |other: &SceneId| *other == twin.of || dataset.twins.get(other).is_some_and(|t| t.of == twin.of);
    let place = dataset.scenes.iter().rposition(is_before).map_or(dataset.scenes.len(), |at| at + 1);
    dataset.scenes.insert(place, id.clone());
    let licence = dataset.licences.iter().find(|licence| licence.scene == twin.of).cloned();
    dataset.licences.extend(licence.map(|licence| Licence { scene: id.clone(), ..licence }));
    dataset.twins.insert(id, twin);
    Ok(list)
}

/// Removes the folders of twins of these scenes but those that are `listed`.
pub(super) fn remove_others(root: &Path, scenes: &[SceneId], listed: &[SceneId]) -> Result<(), FileError> {
    let folder = root.join("scenes");
    // A dataset whose first scene is being made has no such folder yet.
    let Ok(entries) = std::fs::read_dir(&folder) else { return Ok(()) };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_listed = listed.iter().any(|id| id.as_str() == name);
        if !is_listed && parse_twin(&name).is_some_and(|(of, _)| scenes.contains(&of)) {
            remove(&entry.path())?;
        }
    }
    Ok(())
}
