//! Plans a scene before anything is written: its instances, parts and views.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use mateval_dataset::dataset::{Redressed, SceneSource, SourceFile, TrueMaterials, View};
use mateval_dataset::material::{ClassifiedPart, MaterialClass};
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::reference::SourceMaterials;
use mateval_dataset::{Camera, Finding, SceneLights, ViewId};
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;
use mateval_sources::source_scene::{FileScene, InstanceOrigin, SourceScene};
use mateval_tracer::World;

use super::fault::BuildFault;
use super::labels::{MAX_LABEL_BYTES, read_labels};
use super::measured::{SceneRegions, read_regions};
use super::parts::{InstanceEntry, PartEntry, PartSplit, list_instances};
use super::photo::{ScenePhoto, read_novel_photos, read_photo};
use super::poses::other_convention;
use super::source::{placed_view, views_of};
use super::wide_views::wide_views;
use crate::conversion::convert_materials;
use crate::error::PrepError;
use crate::recipe::{Availability, Recipe, RecipeScene};

/// A scene with numbered instances and parts and with the cameras of all views.
pub(super) struct Plan {
    pub(super) source: SceneSource,
    pub(super) lights: SceneLights,
    /// Facts about each instance.
    pub(super) origins: Vec<InstanceOrigin>,
    pub(super) scene: Arc<ReferenceScene>,
    /// The source's own materials, where they were converted.
    pub(super) source_materials: Option<SourceMaterials>,
    pub(super) instances: Vec<InstanceEntry>,
    /// The source's own parts first.
    pub(super) part_splits: Vec<PartSplit>,
    /// The class of material of each of the source's own parts, in their order, where the source's reader states
    /// classes.
    pub(super) classes: Option<Vec<ClassifiedPart>>,
    pub(super) views: Vec<View>,
    /// The input picture, where it is not rendered.
    pub(super) photo: Option<ScenePhoto>,
    /// The photos of a captured scene's other views.
    pub(super) novel_photos: BTreeMap<ViewId, ScenePhoto>,
    /// The measured colours of a captured scene.
    pub(super) measured: Option<SceneRegions>,
    /// What is public of a redressed scene.
    pub(super) redressed: Option<Redressed>,
    pub(super) findings: Vec<Finding>,
    /// The file that findings refer to by default.
    pub(super) file: String,
}

/// Numbers the instances and parts of a scene that was read, and places its cameras. Returns also the files that were
/// looked for but do not exist; sorted.
pub(super) fn make_plan(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    mut source_scene: SourceScene,
) -> Result<(Plan, Vec<String>), PrepError> {
    if source_scene.read.scene.surfaces.is_empty() {
        return Err(PrepError::scene(&entry.id)(BuildFault::NoSurfaces { findings: source_scene.read.findings }));
    }
    let instances =
        list_instances(&source_scene.read.scene, &source_scene.read.origins).map_err(PrepError::scene(&entry.id))?;
    let own = PartSplit::own(&source_scene.read.scene, &source_scene.read.origins, &instances)
        .map_err(PrepError::scene(&entry.id))?;
    let classes = classified_parts(&own, &source_scene.read.origins);
    let part_splits = part_splits(entry, source, &instances, own, &mut source_scene.read)?;
    let photo = read_photo(entry, source, &mut source_scene)?;
    let novel = read_novel_photos(entry, source, &mut source_scene)?;
    let mut views = views_of(recipe, source_scene.camera);
    if source_scene.captured.is_some() {
        // Turned views have no photo, so no score could compare with them.
        views.truncate(1);
    }
    let mut novel_photos = BTreeMap::new();
    for ((camera, photo), number) in novel.into_iter().zip(1..) {
        let view = placed_view(&format!("novel_{number}"), camera);
        novel_photos.insert(view.id.clone(), photo);
        views.push(view);
    }
    let measured = read_regions(entry, source, &mut source_scene, &views[0])?;
    let SourceScene { kind, states_roughness, states_metallic, house, file, read, camera, captured, .. } = source_scene;
    let mut findings = read.findings;
    let (scene, source_materials) = match recipe.materials {
        TrueMaterials::Source => (read.scene, None),
        TrueMaterials::Converted => {
            let converted = convert_materials(read.scene, &file)?;
            findings.extend(converted.findings);
            (converted.scene, converted.source)
        }
    };
    let scene = Arc::new(scene);
    // A pose of the wrong convention would score every method against the wrong pixels.
    if let (Some(room), Some(photo)) = (&entry.capture, &photo) {
        let others = source_scene
            .other_poses
            .iter()
            .map(|(what, pose)| (*what, Camera::from_rotation(pose.rotation, pose.position, camera.intrinsics)));
        let world = World::new(scene.clone())?;
        let file = room.cameras.to_string_lossy();
        findings.extend(other_convention(&world, photo.picture(), &camera, others, &file));
    }
    // After the scene is complete, so that wide views never add to it: the other views stay as they are.
    if let Some(wide) = recipe.wide.as_ref().filter(|_| captured.is_none()) {
        let scored: Vec<bool> =
            scene.surfaces.iter().map(|surface| scene.materials[surface.material.0].has_appearance()).collect();
        let (found, lost) = wide_views(wide, &World::new(scene.clone())?, &camera, &scored, &file);
        views.extend(found);
        findings.extend(lost);
    }
    let source = SceneSource {
        kind,
        house: entry.house.clone().unwrap_or(house),
        private: entry.availability == Availability::Private,
        states_roughness,
        states_metallic,
        shift_m: read.shift_m.to_array(),
        files: read.files.hashes.into_iter().map(|(path, sha256)| SourceFile { path, sha256 }).collect(),
    };
    let plan = Plan {
        source,
        lights: read.lights,
        origins: read.origins,
        scene,
        source_materials,
        instances,
        part_splits,
        classes,
        views,
        photo,
        novel_photos,
        measured,
        redressed: None,
        findings,
        file,
    };
    Ok((plan, read.files.absent))
}

/// The classes of the source's own parts; absent if its reader states none.
fn classified_parts(own: &PartSplit, origins: &[InstanceOrigin]) -> Option<Vec<ClassifiedPart>> {
    let mut all = Vec::new();
    for (instance, origin) in own.instances.iter().zip(origins) {
        let classes = origin.class_of_part.as_ref()?;
        let classified = |(part, class): (&PartEntry, &Option<MaterialClass>)| ClassifiedPart {
            part: part.id.clone(),
            class: *class,
        };
        all.extend(instance.parts.iter().zip(classes).map(classified));
    }
    Some(all)
}

/// The source's own parts, then those of the recipe's labels.
fn part_splits(
    entry: &RecipeScene,
    source: &Path,
    instances: &[InstanceEntry],
    own: PartSplit,
    read: &mut FileScene,
) -> Result<Vec<PartSplit>, PrepError> {
    let root = entry.root(source);
    let mut folder = SourceFolder::new(&root, MAX_LABEL_BYTES).map_err(FileError::io("open", &root))?;
    let (mut splits, mut faults) = (Vec::new(), Vec::new());
    for (id, labels) in &entry.part_labels {
        let own = (instances, &own);
        match read_labels(id, labels, &mut folder, &read.scene, own, &mut read.findings) {
            Ok(split) => splits.push(split),
            Err(of_set) => faults.extend(of_set),
        }
    }
    if !faults.is_empty() {
        return Err(PrepError::scene(&entry.id)(BuildFault::Labels { faults }));
    }
    read.files.extend(folder.into_files());
    splits.insert(0, own);
    Ok(splits)
}
