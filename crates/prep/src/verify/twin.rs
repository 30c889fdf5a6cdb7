//! Checks twins: that each shows another scene of the dataset and shares its files, and that its photo is that scene
//! under the stated lighting.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::dataset::{DatasetFile, FORMAT, SceneFile, Twin};
use mateval_dataset::layout::{DATASET, INPUT, SceneFolder};
use mateval_dataset::{SceneId, ViewId, json, manifest};
use mateval_image::exr_io;

use super::scene::{check_schema, read_json};
use crate::build::twins::{is_shared, photo};
use crate::scene_meshes::Faults;

/// Checks that `dataset.json` lists each twin among its scenes, names it after what it shows, and names a scene that is
/// no twin itself.
pub(super) fn check_listed(dataset: &DatasetFile, faults: &mut Faults) {
    for (id, twin) in &dataset.twins {
        let place = format!("/twins/{id}");
        if !dataset.scenes.contains(id) {
            faults.add("dangling_reference", DATASET, &place, format!("'{id}' is not among the scenes"));
        }
        if !dataset.scenes.contains(&twin.of) || dataset.twins.contains_key(&twin.of) {
            let message = format!("'{}' is no scene of the dataset, or a twin itself", twin.of);
            faults.add("dangling_reference", DATASET, format!("{place}/of"), message);
        }
        if twin.lighting.twin_of(&twin.of).as_ref() != Ok(id) {
            let message = format!("the twin of '{}' under '{}' has another id", twin.of, twin.lighting);
            faults.add("wrong_id", DATASET, &place, message);
        }
    }
}

/// Checks the files of a twin against those of its scene, which is checked by itself.
pub(super) fn check(root: &Path, id: &SceneId, twin: &Twin, dataset: &DatasetFile, faults: &mut Faults) {
    let (folder, of) = (SceneFolder::of(root, id), SceneFolder::of(root, &twin.of));
    check_schema::<SceneFile>(folder.path(), "scene.json", faults);
    let Some(file) = read_json::<SceneFile>("scene.json", &folder.scene_file(), faults) else { return };
    // Faults of the scene's own file are reported with that scene, which may be absent here.
    let Ok(scene) = json::read_format::<SceneFile>(&of.scene_file(), FORMAT) else { return };
    if file != (SceneFile { id: id.clone(), ..scene.clone() }) {
        let message = format!("differs from the file of scene '{}' by more than its id", twin.of);
        faults.add("other_twin", "scene.json", "", message);
    }
    // A manifest that cannot be read has been reported.
    let entries = manifest::entries(root).unwrap_or_default();
    let files_of = |scene: &SceneId| -> BTreeMap<&str, &str> {
        let prefix = format!("scenes/{scene}/");
        let in_scene = entries.iter().filter_map(|entry| Some((entry.file.strip_prefix(&prefix)?, &*entry.sha256)));
        in_scene.filter(|(file, _)| is_shared(file)).collect()
    };
    let (found, expected) = (files_of(id), files_of(&twin.of));
    for file in found.keys().chain(expected.keys().filter(|file| !found.contains_key(*file))) {
        if found.get(file) != expected.get(file) {
            let message = format!("is not that of scene '{}', with which the twin shares it", twin.of);
            faults.add("other_twin", file, "", message);
        }
    }
    // Without renders, such as in the public part of a hidden split, there is nothing to compare the photo with.
    let input = ViewId::input();
    let Some(renderer) = dataset.photo_renderer.as_ref().filter(|id| of.render(id, &input).is_dir()) else { return };
    let photo_file = format!("views/{INPUT}/rgb.exr");
    let Some(made) = faults.read(&photo_file, photo(&of, &scene, renderer, twin.lighting)) else { return };
    let Some(shown) = faults.read(&photo_file, exr_io::read_linear(&folder.path().join(&photo_file))) else { return };
    if made.as_ref() != Some(&shown) {
        let message = format!("is not scene '{}' under '{}'; run `mateval prep finish`", twin.of, twin.lighting);
        faults.add("other_photo", &photo_file, "", message);
    }
}
