//! Checks a dataset against the rules of its format. Every fault is reported, none is fixed.

mod pictures;
mod renders;
mod scene;
mod twin;

use std::path::Path;
use std::sync::Arc;

use mateval_dataset::dataset::{DatasetFile, SceneFile, TargetsFile};
use mateval_dataset::ids::quoted;
use mateval_dataset::layout::{BuildFolder, DATASET, MANIFEST, SceneFolder, TARGETS};
use mateval_dataset::manifest::is_withheld;
use mateval_dataset::material::MaterialClassesFile;
use mateval_dataset::open::{absent_scenes, is_below, read_dataset_file};
use mateval_dataset::{Finding, Progress, Report, SceneId, Severity, changes, manifest, reference};
use mateval_files::untrusted::sha256_of_file;
use mateval_tracer::World;

use self::scene::{check_scene_file, check_schema, read_json};
use crate::error::PrepError;
use crate::scene_meshes::{self, Faults};

/// Checks hashes, schemas, cameras, meshes, ids, masks and reprojection, and returns all faults, sorted. A sound
/// dataset has no finding of severity `error`. Fails where the folder contains no dataset.
pub fn verify(root: &Path, progress: Progress<'_>) -> Result<Vec<Finding>, PrepError> {
    let dataset_path = root.join(DATASET);
    if !dataset_path.is_file() {
        // Only for its error, which names what was found.
        read_dataset_file(root)?;
    }
    let mut faults = Faults::default();
    progress(Report::step("hashes", 0, 1));
    for scene in BuildFolder::of(root).changed() {
        let command = changes::finishing_command(root, std::slice::from_ref(&scene));
        faults.all.push(Finding::new(
            Severity::Error,
            "unfinished",
            format!("scenes/{scene}"),
            "",
            "the scene was made or rendered apart since the manifest was written",
            format!("run `{command}`"),
        ));
    }
    check_schema::<DatasetFile>(root, DATASET, &mut faults);
    check_schema::<TargetsFile>(root, TARGETS, &mut faults);
    let dataset = read_json::<DatasetFile>(DATASET, &dataset_path, &mut faults);
    // A manifest that cannot be read is reported by the next step.
    let absent = dataset.as_ref().and_then(|dataset| absent_scenes(root, dataset).ok()).unwrap_or_default();
    check_manifest(root, &absent, &mut faults);
    if let Some(dataset) = &dataset {
        check_dataset(root, dataset, &mut faults);
        if !absent.is_empty() {
            faults.all.push(absence(&absent, dataset.scenes.len()));
        }
        for (at, id) in dataset.scenes.iter().enumerate().filter(|(_, id)| !absent.contains(id)) {
            progress(Report::part(&format!("scene {id}"), at, dataset.scenes.len()));
            let folder = SceneFolder::of(root, id);
            faults.prefix = format!("scenes/{id}/");
            match dataset.twins.get(id) {
                Some(twin) => twin::check(root, id, twin, dataset, &mut faults),
                None => check_scene(root, &folder, dataset, id.as_str(), &mut faults),
            }
            faults.prefix.clear();
        }
        check_targets(root, dataset, &absent, &mut faults);
    }
    faults.all.sort();
    Ok(faults.all)
}

fn check_manifest(root: &Path, absent: &[SceneId], faults: &mut Faults) {
    let found = manifest::check_those(root, |path| !is_below(path, absent));
    if let Some(found) = faults.read(MANIFEST, found) {
        faults.all.extend(found.into_iter().filter(|finding| !is_withheld(root, finding)));
    }
}

/// A dataset may be used scene by scene, so that absent scenes are no fault; but nothing was checked of them.
fn absence(absent: &[SceneId], total: usize) -> Finding {
    Finding::new(
        Severity::Warning,
        "absent_scenes",
        DATASET,
        "/scenes",
        format!("{} of {total} scenes have no folder here: {}", absent.len(), quoted(absent)),
        "they were not checked",
    )
}

fn check_dataset(root: &Path, dataset: &DatasetFile, faults: &mut Faults) {
    match sha256_of_file(&root.join(MANIFEST)) {
        Ok(found) if found != dataset.manifest_sha256 => {
            let message = format!("'{}', but the SHA-256 of MANIFEST.sha256 is '{found}'", dataset.manifest_sha256);
            faults.add("wrong_manifest", DATASET, "/manifest_sha256", message);
        }
        // A missing manifest has been reported already.
        _ => {}
    }
    twin::check_listed(dataset, faults);
    for (at, licence) in dataset.licences.iter().enumerate() {
        if !dataset.scenes.contains(&licence.scene) {
            let message = format!("the dataset has no scene '{}'", licence.scene);
            faults.add("dangling_reference", DATASET, format!("/licences/{at}/scene"), message);
        }
    }
}

fn check_targets(root: &Path, dataset: &DatasetFile, absent: &[SceneId], faults: &mut Faults) {
    let Some(file) = read_json::<TargetsFile>(TARGETS, &root.join(TARGETS), faults) else { return };
    let mut seen = std::collections::BTreeSet::new();
    let scored = dataset.scenes.iter().filter(|id| !dataset.twins.contains_key(*id));
    for scene in scored.filter(|id| !file.targets.iter().any(|target| target.scene == **id)) {
        faults.add("no_target", TARGETS, "/targets", format!("no view of scene '{scene}' is scored"));
    }
    for (at, target) in file.targets.iter().enumerate() {
        let place = format!("/targets/{at}");
        if !seen.insert(target) {
            faults.add(
                "duplicate_target",
                TARGETS,
                &place,
                format!("view '{}' of scene '{}' is listed twice", target.view, target.scene),
            );
        }
        if dataset.twins.contains_key(&target.scene) {
            faults.add(
                "twin_target",
                TARGETS,
                &place,
                format!("'{}' is a twin, and no view of a twin is scored", target.scene),
            );
        }
        let view_exists =
            absent.contains(&target.scene) || SceneFolder::of(root, &target.scene).view(&target.view).is_dir();
        if !dataset.scenes.contains(&target.scene) || !view_exists {
            let message = format!("the dataset has no view '{}' of a scene '{}'", target.view, target.scene);
            faults.add("dangling_reference", TARGETS, &place, message);
        }
    }
}

/// Checks the source's own materials, where there are any. `count` is the number of the scene's materials.
fn check_source_materials(folder: &SceneFolder, count: usize, faults: &mut Faults) {
    if folder.source_materials().join(reference::SOURCE_MATERIALS).exists() {
        check_schema::<reference::SourceMaterialsFile>(&folder.source_materials(), reference::SOURCE_MATERIALS, faults);
    }
    faults.read("ground_truth/reference/source", reference::read_source_materials(folder, count));
}

/// Checks the classes of materials, where there are any: one for each of the source's own parts.
fn check_material_classes(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
    const FILE: &str = "ground_truth/material_classes.json";
    if !folder.material_classes().exists() {
        return;
    }
    check_schema::<MaterialClassesFile>(folder.path(), FILE, faults);
    let Some(file) = read_json::<MaterialClassesFile>(FILE, &folder.material_classes(), faults) else { return };
    if !file.parts.iter().map(|part| &part.part).eq(scene.parts.iter().map(|part| &part.id)) {
        faults.add("wrong_parts", FILE, "/parts", "expected the parts of scene.json in their order");
    }
}

fn check_scene(root: &Path, folder: &SceneFolder, dataset: &DatasetFile, id: &str, faults: &mut Faults) {
    check_schema::<SceneFile>(folder.path(), "scene.json", faults);
    let Some(scene) = read_json::<SceneFile>("scene.json", &folder.scene_file(), faults) else { return };
    if scene.id.as_str() != id {
        faults.add("wrong_id", "scene.json", "/id", format!("'{}', but its folder is '{id}'", scene.id));
    }
    check_scene_file(&scene, faults);
    renders::check_scorer(root, folder, dataset, &scene, faults);
    let Some(meshes) = scene_meshes::check(folder, &scene, faults) else { return };
    let world = match folder.truth().is_dir() {
        true => {
            check_schema::<reference::ReferenceFile>(&folder.reference(), "reference.json", faults);
            check_schema::<reference::LightsFile>(&folder.truth(), "lights.json", faults);
            let Some(reference) = faults.read("ground_truth/reference", reference::read(folder)) else { return };
            check_source_materials(folder, reference.materials.len(), faults);
            check_material_classes(folder, &scene, faults);
            scene::check_materials(folder, &scene, faults);
            scene::check_measured(folder, &scene, faults);
            if !scene::matches_reference(&reference, &meshes, faults) {
                return;
            }
            World::new(Arc::new(reference))
        }
        false => World::new(Arc::new(scene::opaque(&meshes))),
    };
    let Some(world) = faults.read("ground_truth/reference", world) else { return };
    pictures::check(folder, &scene, &meshes, &world, faults);
    match (&dataset.photo_renderer, &scene.photo) {
        (_, Some(photo)) => renders::check_photos(folder, &scene, photo, faults),
        (Some(renderer), None) => renders::check_renders(folder, &scene, renderer, faults),
        (None, None) => {}
    }
}
