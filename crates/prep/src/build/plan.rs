//! Plans a scene before anything is written: its instances, parts and views.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use mateval_dataset::dataset::{TrueMaterials, View};
use mateval_dataset::material::StatedParameters;
use mateval_dataset::material::{ClassifiedPart, MaterialClass};
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::reference::SourceMaterials;
use mateval_dataset::{Finding, SceneLights, SourceKind, TriangleMesh};
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;
use mateval_sources::source_scene::{InstanceOrigin, SourceScene};
use mateval_tracer::World;

use super::fault::SceneFault;
use super::labels::{MAX_LABEL_BYTES, read_labels};
use super::parts::{InstanceEntry, PartEntry, PartSplit, list_instances};
use super::photo::{ScenePhoto, read_photo};
use super::source::views_of;
use super::wide_views::wide_views;
use crate::conversion::convert;
use crate::error::PrepError;
use crate::recipe::{Recipe, RecipeScene};

/// A scene with numbered instances and parts and with the cameras of all views.
pub(super) struct Plan {
    /// Where the scene came from.
    pub(super) kind: SourceKind,
    /// The house that it belongs to.
    pub(super) house: String,
    pub(super) lights: SceneLights,
    /// What was subtracted from the source's positions, in metres.
    pub(super) shift_m: DVec3,
    /// Which parameters of each instance's material the source states.
    pub(super) stated: Vec<StatedParameters>,
    /// Whether the source states roughness and metallic.
    pub(super) states_roughness: bool,
    pub(super) states_metallic: bool,
    pub(super) scene: Arc<ReferenceScene>,
    /// The source's own materials, where they were converted.
    pub(super) source_materials: Option<SourceMaterials>,
    pub(super) instances: Vec<InstanceEntry>,
    /// The shape that each instance is a copy of, where the source moves copies of a model.
    pub(super) shapes: Vec<Option<Arc<TriangleMesh>>>,
    /// The source's own parts first.
    pub(super) part_splits: Vec<PartSplit>,
    /// The class of material of each of the source's own parts, in their order, where the source's reader states
    /// classes.
    pub(super) classes: Option<Vec<ClassifiedPart>>,
    pub(super) views: Vec<View>,
    /// The input picture, where it is not rendered.
    pub(super) photo: Option<ScenePhoto>,
    pub(super) findings: Vec<Finding>,
    /// The file that findings refer to by default.
    pub(super) file: String,
    /// Every file read and its SHA-256; sorted.
    pub(super) files: Vec<(String, String)>,
}

impl Plan {
    /// The mesh before it was moved to its place, if it is known and still the same one; otherwise the mesh itself.
    pub(super) fn shape(&self, instance: usize) -> &TriangleMesh {
        let mesh = &self.scene.surfaces[instance].mesh;
        let is_same =
            |shape: &&TriangleMesh| shape.triangles == mesh.triangles && shape.positions.len() == mesh.positions.len();
        self.shapes[instance].as_deref().filter(is_same).unwrap_or(mesh)
    }
}

/// Numbers the instances and parts of a scene that was read, and places its cameras. Returns also the files that were
/// looked for but do not exist; sorted.
pub(super) fn make_plan(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    mut read: SourceScene,
) -> Result<(Plan, Vec<String>), PrepError> {
    if read.scene.surfaces.is_empty() {
        return Err(PrepError::scene(&entry.id)(SceneFault::NoSurfaces { findings: read.findings }));
    }
    let instances = list_instances(&read.scene, &read.origins).map_err(PrepError::scene(&entry.id))?;
    let own = PartSplit::own(&read.scene, &read.origins, &instances).map_err(PrepError::scene(&entry.id))?;
    let classes = classified_parts(&own, &read.origins);
    let part_splits = part_splits(entry, source, &instances, own, &mut read)?;
    let photo = read_photo(entry, source, &mut read)?;
    let mut views = views_of(recipe, read.camera);
    let SourceScene { kind, lights, states_roughness, states_metallic, file, files, absent, .. } = read;
    let mut findings = read.findings;
    let (scene, source_materials) = match recipe.materials {
        TrueMaterials::Source => (read.scene, None),
        TrueMaterials::Converted => {
            let converted = convert(read.scene, &file)?;
            findings.extend(converted.findings);
            (converted.scene, converted.source)
        }
    };
    let scene = Arc::new(scene);
    // After the scene is complete, so that wide views never add to it: the other views stay as they are.
    if let Some(wide) = &recipe.wide {
        let scored: Vec<bool> =
            scene.surfaces.iter().map(|surface| scene.materials[surface.material.0].has_appearance()).collect();
        let (found, lost) = wide_views(wide, &World::new(scene.clone())?, &read.camera, &scored, &file);
        views.extend(found);
        findings.extend(lost);
    }
    let plan = Plan {
        kind,
        house: entry.house.clone().unwrap_or(read.house),
        lights,
        shift_m: read.shift_m,
        stated: read.origins.iter().map(|origin| origin.stated).collect(),
        states_roughness,
        states_metallic,
        scene,
        source_materials,
        instances,
        shapes: read.origins.into_iter().map(|origin| origin.shape).collect(),
        part_splits,
        classes,
        views,
        photo,
        findings,
        file,
        files,
    };
    Ok((plan, absent))
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
    read: &mut SourceScene,
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
        return Err(PrepError::scene(&entry.id)(SceneFault::Labels { faults }));
    }
    let labels = folder.into_files();
    read.files.extend(labels.hashes);
    read.files.sort();
    read.absent.extend(labels.absent);
    read.absent.sort();
    splits.insert(0, own);
    Ok(splits)
}
