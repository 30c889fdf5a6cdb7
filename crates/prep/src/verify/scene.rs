//! Checks what the files of a scene state: JSON files against the schemas generated from the Rust types, whether
//! `scene.json` is consistent (indices, references, cameras), the meshes against the reference geometry, and baked
//! materials against their atlases.

use std::collections::BTreeSet;
use std::path::Path;

use glam::DMat3;
use mateval_dataset::dataset::{FORMAT, Flash, Part, SceneFile, View, WideView};
use mateval_dataset::glb::GlbNode;
use mateval_dataset::layout::{INPUT, SceneFolder};
use mateval_dataset::material::{ColorInput, Material, MaterialModel};
use mateval_dataset::measured::{MeasuredFile, color_fault};
use mateval_dataset::reference::{MaterialIndex, ReferenceScene, Surface};
use mateval_dataset::submission::Map;
use mateval_dataset::{Camera, DatasetError, SourceKind, ViewId, json};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Wrap, png_io};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::scene_meshes::{Faults, Meshes};

/// Checks `folder/file` against the schema of `T`. Every violation is a fault with its JSON pointer.
pub(super) fn check_schema<T: JsonSchema>(folder: &Path, file: &str, faults: &mut Faults) {
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

/// A file of the dataset; or none, after adding the reason why it could not be read.
pub(super) fn read_json<T: DeserializeOwned>(name: &str, path: &Path, faults: &mut Faults) -> Option<T> {
    match json::read_format(path, FORMAT) {
        Err(error @ DatasetError::Format { .. }) => {
            faults.add("wrong_format", name, "/format", error.to_string());
            None
        }
        read => faults.read(name, read),
    }
}

const SCENE_FILE: &str = "scene.json";
/// Largest deviation of a camera's rotation from orthonormality, and of a view's camera from the turned input camera.
const CAMERA_SLACK: f64 = 1e-9;

/// Checks the views, and the instances with their parts.
pub(super) fn check_scene_file(scene: &SceneFile, faults: &mut Faults) {
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
        // A novel photo has a place and a lens of its own.
        if !scene.novel_photos.contains_key(&view.id) {
            check_place(view, &input.camera, at, faults);
        }
    }
    if !scene.novel_photos.is_empty() && (scene.source.kind != SourceKind::Capture || scene.photo.is_none()) {
        let message = "expected none, since only a captured room with an input photo has others";
        faults.add("unexpected_photo", SCENE_FILE, "/novel_photos", message);
    }
    for view in scene.novel_photos.keys().filter(|id| scene.view(id.as_str()).is_none() || id.as_str() == INPUT) {
        let message = format!("the scene has no novel view '{view}'");
        faults.add("dangling_reference", SCENE_FILE, format!("/novel_photos/{view}"), message);
    }
    if let Some(flash) = &scene.flash {
        check_flash(scene, flash, faults);
    }
}

/// Checks that a flash is in range, and that the views that it lights have photos.
fn check_flash(scene: &SceneFile, flash: &Flash, faults: &mut Faults) {
    if scene.source.kind != SourceKind::Capture {
        let message = "expected none, since only a captured room has a flash";
        faults.add("unexpected_flash", SCENE_FILE, "/flash", message);
    }
    if let Some((key, found, expected)) = flash.fault() {
        faults.add("bad_flash", SCENE_FILE, format!("/flash/{key}"), format!("found {found}, expected {expected}"));
    }
    let is_photo = |view: &ViewId| view.as_str() == INPUT || scene.novel_photos.contains_key(view);
    for (at, view) in flash.views.iter().enumerate().filter(|(_, view)| !is_photo(view)) {
        let message = format!("the scene has no photo of a view '{view}'");
        faults.add("dangling_reference", SCENE_FILE, format!("/flash/views/{at}"), message);
    }
    let is_lit = |view: &ViewId| flash.views.contains(view);
    if flash.only_light && !scene.views.iter().map(|view| &view.id).all(is_lit) {
        let message = "the photos of some views are without the flash, and would be black";
        faults.add("bad_flash", SCENE_FILE, "/flash/only_light", message);
    }
    if flash.intensity.is_none() && !flash.views.iter().any(|view| view.as_str() == INPUT) {
        let message = "expected an intensity, since the input photo is without the flash";
        faults.add("bad_flash", SCENE_FILE, "/flash/intensity", message);
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
    let instances = scene.instances.iter().map(|instance| (Some(instance.index.0.get()), instance.id.as_str()));
    check_ids("/instances", instances, faults);
    check_parts(scene, &scene.parts, "/parts", faults);
    check_ids("/part_sets", scene.part_sets.iter().map(|set| (None, set.id.as_str())), faults);
    for (at, set) in scene.part_sets.iter().enumerate() {
        check_parts(scene, &set.parts, &format!("/part_sets/{at}/parts"), faults);
    }
}

/// Checks that the ids of the list at `pointer` differ, and that its indices, where it has them, count from 1.
fn check_ids<'a>(pointer: &str, items: impl Iterator<Item = (Option<u16>, &'a str)>, faults: &mut Faults) {
    let mut ids = BTreeSet::new();
    for (at, (index, id)) in items.enumerate() {
        if index.is_some_and(|index| usize::from(index) != at + 1) {
            faults.add("bad_index", SCENE_FILE, format!("{pointer}/{at}/index"), format!("expected {}", at + 1));
        }
        if !ids.insert(id) {
            faults.add("duplicate_id", SCENE_FILE, format!("{pointer}/{at}/id"), format!("'{id}' is listed twice"));
        }
    }
}

/// Checks one set of parts, whose JSON pointer is `pointer`.
fn check_parts(scene: &SceneFile, parts: &[Part], pointer: &str, faults: &mut Faults) {
    check_ids(pointer, parts.iter().map(|part| (Some(part.index.0.get()), part.id.as_str())), faults);
    let instances: BTreeSet<_> = scene.instances.iter().map(|instance| &instance.id).collect();
    for (at, part) in parts.iter().enumerate() {
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
pub(super) fn matches_reference(reference: &ReferenceScene, meshes: &Meshes, faults: &mut Faults) -> bool {
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
pub(super) fn check_materials(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
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

/// Checks the measured colours of a captured scene, and that each region of a view is one of the scene's.
pub(super) fn check_measured(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
    const FILE: &str = "ground_truth/measured.json";
    if !folder.has_measured() {
        return;
    }
    if scene.source.kind.states_materials() {
        faults.add("unexpected_measured", FILE, "", "expected none, since only a captured scene has this file");
        return;
    }
    check_schema::<MeasuredFile>(folder.path(), FILE, faults);
    let Some(MeasuredFile { regions, .. }) = faults.read(FILE, json::read::<MeasuredFile>(&folder.measured())) else {
        return;
    };
    for (at, region) in regions.iter().enumerate() {
        if let Some(fault) = color_fault(&region.color, region.standard_error.as_ref()) {
            faults.add("bad_color", FILE, format!("/regions/{at}"), fault);
        }
        if usize::from(region.index) != at + 1 {
            faults.add("bad_index", FILE, format!("/regions/{at}/index"), format!("expected {}", at + 1));
        }
        if scene.view(region.view.as_str()).is_none() {
            let message = format!("the scene has no view '{}'", region.view);
            faults.add("dangling_reference", FILE, format!("/regions/{at}/view"), message);
        }
    }
    for view in scene.views.iter().filter(|view| regions.iter().any(|region| region.view == view.id)) {
        let file = format!("ground_truth/views/{}/measured.png", view.id);
        let picture = faults.read(&file, png_io::read_ids(&folder.measured_regions(&view.id)));
        let valid = png_io::read_mask(&folder.view(&view.id).join("valid.png"));
        // What is wrong with valid.png is reported with the other pictures.
        let (Some(picture), Ok(valid)) = (picture, valid) else { continue };
        if (picture.width(), picture.height()) != (valid.width(), valid.height()) {
            let (width, height) = (picture.width(), picture.height());
            let message = format!("{width}x{height} pixels, expected {}x{}", valid.width(), valid.height());
            faults.add("wrong_size", &file, "", message);
            continue;
        }
        let is_own = |index: u16| regions.iter().any(|region| region.index == index && region.view == view.id);
        let wrong = picture
            .pixels()
            .iter()
            .zip(valid.pixels())
            .filter(|(index, valid)| **index > 0 && !(**valid && is_own(**index)));
        let count = wrong.count();
        if count > 0 {
            let message = format!("{count} pixels show a region that the scene does not list, or are not valid");
            faults.add("wrong_region", &file, "", message);
        }
    }
}

/// The instances as opaque surfaces, against which pictures are checked where the ground truth is withheld.
pub(super) fn opaque(meshes: &Meshes) -> ReferenceScene {
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
