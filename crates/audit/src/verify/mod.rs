//! Checks a dataset against the rules of its format. Every fault is reported, none is fixed.
//!
//! This file checks the manifest, JSON files against the schemas generated from the Rust types, whether `scene.json` is
//! consistent, and the meshes against the reference geometry. `pictures` checks every view's pictures against the meshes,
//! and `renders` what was rendered.

mod pictures;
mod renders;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use glam::DMat3;
use mateval_image::Wrap;
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_prep::faults::Faults;
use mateval_prep::scene_meshes::{self, Meshes};
use mateval_scene::build_folder::BuildFolder;
use mateval_scene::dataset::{DatasetFile, FORMAT, Part, SceneFile, TargetsFile, View, WideView};
use mateval_scene::glb::GlbNode;
use mateval_scene::ids::quoted;
use mateval_scene::layout::{DATASET, INPUT, MANIFEST, SceneFolder, TARGETS};
use mateval_scene::material::{ColorInput, Material, MaterialModel};
use mateval_scene::material_class::MaterialClassesFile;
use mateval_scene::open::{absent_scenes, is_below};
use mateval_scene::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_scene::submission::Map;
use mateval_scene::{
    Camera, Finding, Progress, Report, SceneError, SceneId, Severity, ViewId, json, manifest, reference_io,
};
use mateval_tracer::World;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::AuditError;

/// Checks hashes, schemas, cameras, meshes, ids, masks and reprojection, and returns all faults, sorted. A sound dataset has
/// no finding of severity `error`. Fails where the folder contains no dataset.
pub fn verify(root: &Path, progress: Progress<'_>) -> Result<Vec<Finding>, AuditError> {
    let dataset_path = root.join(DATASET);
    if !dataset_path.is_file() {
        return Err(AuditError::NotADataset { path: root.to_owned() });
    }
    let mut faults = Faults::default();
    progress(Report::step("hashes", 0, 1));
    for scene in BuildFolder::of(root).changed() {
        faults.all.push(Finding {
            severity: Severity::Error,
            code: "unfinished".to_owned(),
            file: format!("scenes/{scene}"),
            place: String::new(),
            message: "the scene was made or rendered apart since the manifest was written".to_owned(),
            action: "run `mateval prep finish`".to_owned(),
        });
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
            check_scene(root, &folder, dataset, id.as_str(), &mut faults);
            faults.prefix.clear();
        }
        check_targets(root, dataset, &absent, &mut faults);
    }
    faults.all.sort();
    Ok(faults.all)
}

/// A file of the dataset; or none, after adding the reason why it could not be read.
fn read_json<T: DeserializeOwned>(name: &str, path: &Path, faults: &mut Faults) -> Option<T> {
    match json::read_format(path, FORMAT) {
        Err(error @ SceneError::Format { .. }) => {
            faults.add("wrong_format", name, "/format", error.to_string());
            None
        }
        read => faults.read(name, read),
    }
}

fn check_manifest(root: &Path, absent: &[SceneId], faults: &mut Faults) {
    let found = manifest::check_those(root, |path| !is_below(path, absent));
    if let Some(found) = faults.read(MANIFEST, found) {
        faults.all.extend(found.into_iter().filter(|finding| !is_withheld(root, finding)));
    }
}

/// A dataset may be used scene by scene, so that absent scenes are no fault; but nothing was checked of them.
fn absence(absent: &[SceneId], total: usize) -> Finding {
    Finding {
        severity: Severity::Warning,
        code: "absent_scenes".to_owned(),
        file: DATASET.to_owned(),
        place: "/scenes".to_owned(),
        message: format!("{} of {total} scenes have no folder here: {}", absent.len(), quoted(absent)),
        action: "they were not checked".to_owned(),
    }
}

/// Whether a file is missing because the whole ground truth of its scene is withheld, which is not a fault.
fn is_withheld(root: &Path, finding: &Finding) -> bool {
    let inside = finding.file.split_once("/ground_truth/").map(|(scene, _)| root.join(scene).join("ground_truth"));
    finding.code == "missing_file" && inside.is_some_and(|folder| !folder.exists())
}

fn check_dataset(root: &Path, dataset: &DatasetFile, faults: &mut Faults) {
    match manifest::sha256_of_file(&root.join(MANIFEST)) {
        Ok(found) if found != dataset.manifest_sha256 => {
            let message = format!("'{}', but the SHA-256 of MANIFEST.sha256 is '{found}'", dataset.manifest_sha256);
            faults.add("wrong_manifest", DATASET, "/manifest_sha256", message);
        }
        // A missing manifest has been reported already.
        _ => {}
    }
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
    for scene in dataset.scenes.iter().filter(|id| !file.targets.iter().any(|target| target.scene == **id)) {
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
    if folder.source_materials().join(reference_io::SOURCE_MATERIALS).exists() {
        check_schema::<reference_io::SourceMaterialsFile>(
            &folder.source_materials(),
            reference_io::SOURCE_MATERIALS,
            faults,
        );
    }
    faults.read("ground_truth/reference/source", reference_io::read_source_materials(folder, count));
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
            check_schema::<reference_io::ReferenceFile>(&folder.reference(), "reference.json", faults);
            check_schema::<reference_io::LightsFile>(&folder.truth(), "lights.json", faults);
            let Some(reference) = faults.read("ground_truth/reference", reference_io::read(folder)) else { return };
            check_source_materials(folder, reference.materials.len(), faults);
            check_material_classes(folder, &scene, faults);
            check_materials(folder, &scene, faults);
            if !matches_reference(&reference, &meshes, faults) {
                return;
            }
            World::new(Arc::new(reference))
        }
        false => World::new(Arc::new(opaque(&meshes))),
    };
    let Some(world) = faults.read("ground_truth/reference", world) else { return };
    pictures::check(folder, &scene, &meshes, &world, faults);
    match (&dataset.photo_renderer, &scene.photo) {
        (_, Some(photo)) => renders::check_photo(folder, &scene, photo, faults),
        (Some(renderer), None) => renders::check_renders(folder, &scene, renderer, faults),
        (None, None) => {}
    }
}

const SCENE_FILE: &str = "scene.json";
/// Largest deviation of a camera's rotation from orthonormality, and of a view's camera from the turned input camera.
const CAMERA_SLACK: f64 = 1e-9;

/// Checks the views, and the instances with their parts.
fn check_scene_file(scene: &SceneFile, faults: &mut Faults) {
    check_views(scene, faults);
    check_numbers(scene, faults);
}

fn check_views(scene: &SceneFile, faults: &mut Faults) {
    let Some(input) = scene.views.first().filter(|view| view.id.as_str() == INPUT) else {
        faults.add("bad_view", SCENE_FILE, "/views/0", "the first view must be 'input'");
        return;
    };
    let mut ids = BTreeSet::new();
    for (at, view) in scene.views.iter().enumerate() {
        let place = format!("/views/{at}/camera");
        if !ids.insert(&view.id) {
            faults.add("bad_view", SCENE_FILE, format!("/views/{at}/id"), format!("'{}' is listed twice", view.id));
        }
        let rotation = view.camera.rotation();
        let turned_back = rotation.transpose() * rotation;
        let is_rotation = turned_back.abs_diff_eq(DMat3::IDENTITY, CAMERA_SLACK) && rotation.determinant() > 0.0;
        if !is_rotation || view.camera.world_from_camera[3] != [0.0, 0.0, 0.0, 1.0] {
            faults.add("bad_camera", SCENE_FILE, &place, "world_from_camera is not a rotation and a translation");
        }
        let k = view.camera.intrinsics;
        let is_valid = k.fx > 0.0 && k.fy > 0.0 && k.cx.is_finite() && k.cy.is_finite() && k.width > 0 && k.height > 0;
        if !is_valid {
            faults.add(
                "bad_camera",
                SCENE_FILE,
                format!("{place}/intrinsics"),
                "expected focal lengths and a size above 0, and a finite principal point",
            );
        }
        check_place(view, &input.camera, at, faults);
    }
}

/// Checks that a turned view is the input camera turned, and that a wide view is as far from it as it states.
fn check_place(view: &View, input: &Camera, at: usize, faults: &mut Faults) {
    let place = format!("/views/{at}/camera");
    if view.camera.intrinsics != input.intrinsics {
        faults.add("bad_camera", SCENE_FILE, format!("{place}/intrinsics"), "differ from those of the input camera");
    }
    match &view.wide {
        _ if view.wide.is_some() != view.id.is_wide() => {
            let message = format!("a view has this key if and only if its id begins with '{}'", ViewId::WIDE);
            faults.add("bad_view", SCENE_FILE, format!("/views/{at}/wide"), message);
        }
        None => {
            let expected = input.turned(view.x_deg, view.y_deg);
            if !view.camera.matrix().abs_diff_eq(expected.matrix(), CAMERA_SLACK) {
                let (x_deg, y_deg) = (view.x_deg, view.y_deg);
                let message = format!("differs from the input camera turned by {x_deg} and {y_deg} degrees");
                faults.add("bad_camera", SCENE_FILE, &place, message);
            }
        }
        Some(WideView { distance_m, unseen_share }) => {
            let found = view.camera.position().distance(input.position());
            // Also refuses numbers that are not finite.
            let is_stated = (found - distance_m).abs() <= CAMERA_SLACK;
            if !is_stated {
                let message = format!("is {found} m from the input camera, and the view states {distance_m} m");
                faults.add("bad_camera", SCENE_FILE, &place, message);
            }
            if !(0.0..=1.0).contains(unseen_share) {
                let message = format!("found {unseen_share}, expected 0 to 1");
                faults.add("bad_view", SCENE_FILE, format!("/views/{at}/wide/unseen_share"), message);
            }
        }
    }
}

fn check_numbers(scene: &SceneFile, faults: &mut Faults) {
    let mut ids = BTreeSet::new();
    for (at, instance) in scene.instances.iter().enumerate() {
        if usize::from(instance.index.0.get()) != at + 1 {
            faults.add("bad_index", SCENE_FILE, format!("/instances/{at}/index"), format!("expected {}", at + 1));
        }
        if !ids.insert(&instance.id) {
            faults.add(
                "duplicate_id",
                SCENE_FILE,
                format!("/instances/{at}/id"),
                format!("'{}' is listed twice", instance.id),
            );
        }
    }
    check_parts(scene, &scene.parts, "/parts", faults);
    let mut sets = BTreeSet::new();
    for (at, set) in scene.part_sets.iter().enumerate() {
        if !sets.insert(&set.id) {
            faults.add(
                "duplicate_id",
                SCENE_FILE,
                format!("/part_sets/{at}/id"),
                format!("'{}' is listed twice", set.id),
            );
        }
        check_parts(scene, &set.parts, &format!("/part_sets/{at}/parts"), faults);
    }
}

/// Checks one set of parts, whose JSON pointer is `pointer`.
fn check_parts(scene: &SceneFile, parts: &[Part], pointer: &str, faults: &mut Faults) {
    let instances: BTreeSet<_> = scene.instances.iter().map(|instance| &instance.id).collect();
    let mut ids = BTreeSet::new();
    for (at, part) in parts.iter().enumerate() {
        if usize::from(part.index.0.get()) != at + 1 {
            faults.add("bad_index", SCENE_FILE, format!("{pointer}/{at}/index"), format!("expected {}", at + 1));
        }
        if !ids.insert(&part.id) {
            faults.add(
                "duplicate_id",
                SCENE_FILE,
                format!("{pointer}/{at}/id"),
                format!("'{}' is listed twice", part.id),
            );
        }
        if !instances.contains(&part.instance) {
            let message = format!("the scene has no instance '{}'", part.instance);
            faults.add("dangling_reference", SCENE_FILE, format!("{pointer}/{at}/instance"), message);
        }
    }
    for (at, instance) in scene.instances.iter().enumerate() {
        let of_parts: usize = parts.iter().filter(|part| part.instance == instance.id).map(|part| part.triangles).sum();
        if of_parts != instance.triangles {
            let message = format!("{} triangles, but its parts in {pointer} have {of_parts}", instance.triangles);
            faults.add("bad_parts", SCENE_FILE, format!("/instances/{at}"), message);
        }
    }
}

/// Whether the reference has exactly the triangles of `instances.glb`. Every difference is reported as a fault.
fn matches_reference(reference: &ReferenceScene, meshes: &Meshes, faults: &mut Faults) -> bool {
    let before = faults.all.len();
    const FILE: &str = "ground_truth/reference/geometry.glb";
    if reference.surfaces.len() != meshes.instances.len() {
        let message = format!(
            "{} surfaces, expected one for each of {} instances",
            reference.surfaces.len(),
            meshes.instances.len()
        );
        faults.add("wrong_nodes", FILE, "", message);
        return false;
    }
    for (surface, node) in reference.surfaces.iter().zip(&meshes.instances) {
        let (a, b) = (&surface.mesh, &node.mesh);
        let same = a.triangles.len() == b.triangles.len()
            && (0..a.triangles.len()).all(|triangle| a.corners(triangle) == b.corners(triangle));
        if !same {
            let message = "its triangles differ from those of instances.glb";
            faults.add("wrong_geometry", FILE, format!("node '{}'", node.name), message);
        }
    }
    faults.all.len() == before
}

/// Checks that every atlas has its three baked maps, at the size of the atlas.
fn check_materials(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
    for instance in &scene.instances {
        let Some(atlas) = &instance.atlas else { continue };
        for map in Map::ALL {
            let file = format!("ground_truth/materials/{}/{}.png", instance.id, map.stem());
            let path = folder.truth_material(&instance.id).join(map.stem()).with_extension("png");
            let read = read_texture(&path, Encoding::Linear, Wrap::Clamp);
            let Some(picture) = faults.read(&file, read) else { continue };
            let size = atlas.size as usize;
            if (picture.width(), picture.height()) != (size, size) {
                let message = format!("{}x{} texels, expected {size}x{size}", picture.width(), picture.height());
                faults.add("wrong_size", &file, "", message);
            }
        }
    }
}

/// The instances as opaque surfaces, against which pictures are checked where the ground truth is withheld.
fn opaque(meshes: &Meshes) -> ReferenceScene {
    let material = Material {
        name: String::new(),
        model: MaterialModel::Diffuse { reflectance: ColorInput::Constant([0.5; 3]), alpha: None },
        two_sided: true,
        opacity: None,
        bump: None,
    };
    let surface =
        |node: &GlbNode| Surface { name: node.name.clone(), mesh: node.mesh.clone(), material: MaterialIndex(0) };
    ReferenceScene {
        surfaces: meshes.instances.iter().map(surface).collect(),
        materials: vec![material],
        ..ReferenceScene::default()
    }
}

/// Checks `folder/file` against the schema of `T`. Every violation is a fault with its JSON pointer.
fn check_schema<T: JsonSchema>(folder: &Path, file: &str, faults: &mut Faults) {
    let Some(text) = faults.read(file, std::fs::read(folder.join(file))) else { return };
    let Some(value) = faults.read(file, serde_json::from_slice::<serde_json::Value>(&text)) else { return };
    let schema = serde_json::to_value(schemars::schema_for!(T)).expect("a schema can be written as JSON");
    let validator = jsonschema::validator_for(&schema).expect("schemars generates valid schemas");
    for error in validator.iter_errors(&value) {
        let message = error.to_string();
        // The message quotes the value, which may be long.
        let short: String = message.chars().take(300).collect();
        faults.add("breaks_schema", file, error.instance_path().to_string(), short);
    }
}
