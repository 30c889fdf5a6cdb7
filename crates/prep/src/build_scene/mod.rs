//! One scene of a recipe, from its source to its folder.

mod geometry;
mod materials;
mod source;

use std::path::Path;

use mateval_image::exr_io::{self, Precision};
use mateval_image::png_io;
use mateval_scene::Camera;
use mateval_scene::dataset::{Atlas, FORMAT, Instance, PartSet, SceneFile, SceneSource, SourceFile, View};
use mateval_scene::layout::{INPUT, SceneFolder, part_picture};
use mateval_scene::reference::{ReferenceScene, Surface};
use mateval_scene::{Finding, SceneLights, Severity, SourceKind, ViewId, json, reference_io};
use mateval_tracer::World;

use crate::error::PrepError;
use crate::instances::{self, InstanceEntry};
use crate::part_labels;
use crate::part_split::PartSplit;
use crate::recipe::{Recipe, RecipeScene};
use crate::views::{GeometryPictures, SeenTriangle, TruthPictures, ViewScene};
use materials::InstanceAtlas;
use mateval_scene::Progress;
use mateval_scene::source_folder::SourceFolder;
use mateval_sources::source_scene::{LicenceText, SourceScene};

/// A scene, its instances numbered and its cameras placed.
struct Plan {
    scene: std::sync::Arc<ReferenceScene>,
    instances: Vec<InstanceEntry>,
    /// The source's own parts first.
    part_splits: Vec<PartSplit>,
    views: Vec<View>,
    findings: Vec<Finding>,
    file: String,
    /// Every file read and its SHA-256; sorted.
    files: Vec<(String, String)>,
}

/// What a scene leaves beside its folder.
#[derive(Clone, Debug)]
pub struct Built {
    /// The licence that came with it.
    pub licence: Option<LicenceText>,
    /// Files that were looked for and were not there, as `scene.json` would tell them; sorted.
    pub absent: Vec<String>,
}

/// Makes the scene in `folder`, from its source below `source`.
pub fn build(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    folder: &SceneFolder,
    progress: Progress<'_>,
) -> Result<Built, PrepError> {
    progress("read the source", 0, 1);
    let read = source::read(recipe, entry, source)?;
    let licence = read.licence.clone();
    let house = entry.house.clone().unwrap_or_else(|| read.house.clone());
    let (kind, lights) = (read.kind, read.lights);
    let (mut plan, absent) = plan(recipe, entry, source, read)?;
    check_inputs(entry, &plan.files)?;
    make_folders(folder, &plan)?;

    let has_appearance = |surface: &Surface| plan.scene.materials[surface.material.0].has_appearance();
    let hoped: Vec<bool> = plan.scene.surfaces.iter().map(has_appearance).collect();
    let mut seen = write_views(&plan, folder, &hoped, progress)?.or_refuse(entry)?;
    let atlas_size = entry.atlas_size.or(recipe.atlas_size);
    let atlases = materials::write(&mut plan, folder, atlas_size, &seen.nearest, progress)?;
    let scored: Vec<bool> = atlases.iter().map(|atlas| atlas.unwrapped.is_some()).collect();
    if scored != hoped {
        // An instance without an atlas cannot be scored: its pixels must not be valid.
        seen = write_views(&plan, folder, &scored, progress)?.or_refuse(entry)?;
    }
    plan.findings.extend(seen.findings);
    geometry::write(&plan, folder, &atlases)?;
    reference_io::write(folder, &plan.scene)?;
    write_scene_file(plan, entry, (kind, house, lights), &atlases, folder)?;
    Ok(Built { licence, absent })
}

/// Every file read must be what the recipe pins, if it pins any.
fn check_inputs(entry: &RecipeScene, files: &[(String, String)]) -> Result<(), PrepError> {
    if entry.inputs.is_empty() {
        return Ok(());
    }
    let differs = |(path, sha256): &(String, String)| match entry.inputs.get(path) {
        Some(pinned) if pinned == sha256 => None,
        Some(pinned) => Some(format!("'{path}' is {sha256}, `inputs` says {pinned}")),
        None => Some(format!("'{path}' was read, and `inputs` does not list it")),
    };
    let mut faults: Vec<String> = files.iter().filter_map(differs).collect();
    let read = |path: &String| files.iter().any(|file| file.0 == *path);
    let unread = entry.inputs.keys().filter(|path| !read(path));
    faults.extend(unread.map(|path| format!("'{path}' is in `inputs`, and nothing reads it")));
    if faults.is_empty() {
        return Ok(());
    }
    let what = format!("it is not made of what the recipe pins: {}", faults.join("; "));
    Err(PrepError::Scene { scene: entry.id.to_string(), what })
}

fn plan(
    recipe: &Recipe,
    entry: &RecipeScene,
    source: &Path,
    mut read: SourceScene,
) -> Result<(Plan, Vec<String>), PrepError> {
    let fault = |what: String| PrepError::Scene { scene: entry.id.to_string(), what };
    if read.scene.surfaces.is_empty() {
        let what = format!("not one surface could be read of it:{}", Finding::list(&read.findings));
        return Err(fault(what));
    }
    let instances = instances::list(&read.scene, &read.origins).map_err(|error| fault(error.to_string()))?;
    let own = instances::own_parts(&read.scene, &read.origins, &instances).map_err(|error| fault(error.to_string()))?;
    let part_splits = part_splits(entry, source, &instances, own, &mut read)?;
    let views = views_of(recipe, read.camera);
    let scene = std::sync::Arc::new(read.scene);
    let SourceScene { findings, file, files, absent, .. } = read;
    Ok((Plan { scene, instances, part_splits, views, findings, file, files }, absent))
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
    let mut folder = SourceFolder::new(&root, part_labels::MAX_FILE_BYTES).map_err(PrepError::io("open", &root))?;
    let (mut splits, mut faults) = (Vec::new(), Vec::new());
    for (id, labels) in &entry.part_labels {
        let own = (instances, &own);
        match part_labels::read(id, labels, &mut folder, &read.scene, own, &mut read.findings) {
            Ok(split) => splits.push(split),
            Err(of_set) => faults.extend(of_set),
        }
    }
    if !faults.is_empty() {
        return Err(PrepError::Scene { scene: entry.id.to_string(), what: faults.join("; ") });
    }
    let labels = folder.into_files();
    read.files.extend(labels.hashes);
    read.files.sort();
    read.absent.extend(labels.absent);
    read.absent.sort();
    splits.insert(0, own);
    Ok(splits)
}

/// The input view and its turns.
fn views_of(recipe: &Recipe, camera: Camera) -> Vec<View> {
    let input = View { id: ViewId::new(INPUT).expect("our own id is an id"), x_deg: 0.0, y_deg: 0.0, camera };
    let turned = recipe.views.iter().map(|offset| View {
        id: offset.id.clone(),
        x_deg: offset.x_deg,
        y_deg: offset.y_deg,
        camera: camera.turned(offset.x_deg, offset.y_deg),
    });
    std::iter::once(input).chain(turned).collect()
}

fn make_folders(folder: &SceneFolder, plan: &Plan) -> Result<(), PrepError> {
    let views = plan.views.iter().flat_map(|view| [folder.view(&view.id), folder.truth_view(&view.id)]);
    let geometry = folder.path().join("geometry");
    for path in views.chain([geometry]) {
        std::fs::create_dir_all(&path).map_err(PrepError::io("make", path))?;
    }
    Ok(())
}

/// What the pictures of all views showed.
#[derive(Default)]
struct Seen {
    /// The nearest depth in metres at which each instance is seen: in the input view, or where that does not show it in any
    /// other.
    nearest: Vec<Option<f64>>,
    /// Why there is nothing to score in the input view, if there is nothing.
    nothing_in_input: Option<String>,
    /// Of views that are hardly of use.
    findings: Vec<Finding>,
}

impl Seen {
    /// Without anything to score in the input view there is no scene.
    fn or_refuse(self, entry: &RecipeScene) -> Result<Self, PrepError> {
        match self.nothing_in_input {
            Some(what) => Err(PrepError::Scene { scene: entry.id.to_string(), what }),
            None => Ok(self),
        }
    }
}

/// Nearer than this many metres a surface fills the picture with its texels, and one that the camera lies in with noise.
const TOO_NEAR_M: f64 = 0.001;

/// Writes the pictures of every view.
fn write_views(plan: &Plan, folder: &SceneFolder, scored: &[bool], progress: Progress<'_>) -> Result<Seen, PrepError> {
    let world = World::new(plan.scene.clone())?;
    let instances: Vec<u16> = plan.instances.iter().map(|entry| entry.index.0.get()).collect();
    let parts: Vec<(String, Vec<Vec<u16>>)> =
        plan.part_splits.iter().map(|split| (part_picture(split.id.as_ref()), split.values())).collect();
    let scene = ViewScene::new(&plan.scene, &world, &instances, scored);
    let mut seen = Seen::default();
    let mut in_input = vec![None; plan.instances.len()];
    let mut elsewhere = vec![None; plan.instances.len()];
    for (at, view) in plan.views.iter().enumerate() {
        progress("views", at, plan.views.len());
        let (geometry, truth) = scene.pictures(&view.camera, &plan.views[0].camera);
        note_nearest(&geometry, if at == 0 { &mut in_input } else { &mut elsewhere });
        note_use(plan, &view.id, &geometry, &mut seen);
        write_view(folder, &view.id, &geometry, &truth)?;
        write_parts(&folder.view(&view.id), &geometry, &parts)?;
    }
    progress("views", plan.views.len(), plan.views.len());
    seen.nearest = in_input.into_iter().zip(elsewhere).map(|(first, other)| first.or(other)).collect();
    Ok(seen)
}

/// Notes what makes a view of little use: nothing in it counts, or something is all but in the camera.
fn note_use(plan: &Plan, view: &ViewId, geometry: &GeometryPictures, seen: &mut Seen) {
    let mut warn = |code: &str, message: String, action: &str| {
        seen.findings.push(Finding {
            severity: Severity::Warning,
            code: code.to_owned(),
            file: plan.file.clone(),
            place: format!("view '{view}'"),
            message,
            action: action.to_owned(),
        });
    };
    let nearest = geometry.depth.pixels().iter().copied().filter(|depth| *depth > 0.0).reduce(f32::min);
    if let Some(nearest) = nearest.filter(|nearest| f64::from(*nearest) < TOO_NEAR_M) {
        let message = format!("something is {nearest:.1e} m in front of the camera, expected {TOO_NEAR_M} m or more");
        warn("camera_too_near", message, "kept; choose another camera, what is so near may be noise");
    }
    if geometry.valid.pixels().contains(&true) {
        return;
    }
    let what = "the camera sees nothing that is scored: no pixel is valid";
    if view.as_str() == INPUT {
        seen.nothing_in_input = Some(format!("{what} in the input view; name another camera"));
    } else {
        warn("nothing_seen", what.to_owned(), "kept; it adds nothing to any score");
    }
}

fn note_nearest(geometry: &GeometryPictures, nearest: &mut [Option<f64>]) {
    for (instance, depth) in geometry.instance.pixels().iter().zip(geometry.depth.pixels()) {
        if let Some(place) = usize::from(*instance).checked_sub(1) {
            let depth = f64::from(*depth);
            nearest[place] = Some(nearest[place].map_or(depth, |other: f64| other.min(depth)));
        }
    }
}

fn write_view(
    folder: &SceneFolder,
    view: &ViewId,
    geometry: &GeometryPictures,
    truth: &TruthPictures,
) -> Result<(), PrepError> {
    let shown = folder.view(view);
    exr_io::write_scalar(&shown.join("depth.exr"), &geometry.depth, Precision::Float)?;
    exr_io::write_normal(&shown.join("normal.exr"), &geometry.normal, Precision::Half)?;
    png_io::write_ids(&shown.join("instance.png"), &geometry.instance)?;
    png_io::write_mask(&shown.join("valid.png"), &geometry.valid)?;
    if view.as_str() != INPUT {
        png_io::write_mask(&shown.join("unobserved.png"), &geometry.unobserved)?;
    }
    let hidden = folder.truth_view(view);
    exr_io::write_linear(&hidden.join("albedo.exr"), &truth.albedo, Precision::Float)?;
    exr_io::write_linear(&hidden.join("diffuse_albedo.exr"), &truth.diffuse_albedo, Precision::Float)?;
    exr_io::write_scalar(&hidden.join("roughness.exr"), &truth.roughness, Precision::Float)?;
    exr_io::write_scalar(&hidden.join("metallic.exr"), &truth.metallic, Precision::Float)?;
    png_io::write_mask(&hidden.join("specular_region.png"), &truth.specular_region)?;
    Ok(())
}

/// Writes the picture of each set of parts: its file, and its value for every triangle.
fn write_parts(shown: &Path, geometry: &GeometryPictures, parts: &[(String, Vec<Vec<u16>>)]) -> Result<(), PrepError> {
    for (file, values) in parts {
        let picture = geometry.triangle.map(|seen| SeenTriangle::value_in(seen, values));
        png_io::write_ids(&shown.join(file), &picture)?;
    }
    Ok(())
}

fn write_scene_file(
    plan: Plan,
    entry: &RecipeScene,
    (kind, house, lights): (SourceKind, String, SceneLights),
    atlases: &[InstanceAtlas],
    folder: &SceneFolder,
) -> Result<(), PrepError> {
    let instances = plan.instances.iter().zip(&plan.scene.surfaces).zip(atlases);
    let instances = instances
        .map(|((instance, surface), atlas)| Instance {
            id: instance.id.clone(),
            index: instance.index,
            name: surface.name.clone(),
            role: instance.role.clone(),
            category: instance.category.clone(),
            super_category: instance.super_category.clone(),
            triangles: surface.mesh.triangles.len(),
            atlas: atlas.unwrapped.as_ref().map(|unwrapped| Atlas {
                size: unwrapped.size,
                charts: unwrapped.charts,
                coverage: unwrapped.coverage,
                texel_m: unwrapped.texel_m,
                half_pixel_m: atlas.half_pixel_m,
            }),
        })
        .collect();
    let mut parts = Vec::new();
    let mut part_sets = Vec::new();
    for split in &plan.part_splits {
        match &split.id {
            None => parts = split.listed(&plan.instances),
            Some(id) => part_sets.push(PartSet { id: id.clone(), parts: split.listed(&plan.instances) }),
        }
    }
    let files = plan.files.into_iter().map(|(path, sha256)| SourceFile { path, sha256 }).collect();
    let mut findings = plan.findings;
    findings.sort();
    let file = SceneFile {
        format: FORMAT.to_owned(),
        id: entry.id.clone(),
        source: SceneSource { kind, house, files },
        lights,
        exposure: entry.exposure,
        views: plan.views,
        instances,
        parts,
        part_sets,
        findings,
    };
    Ok(json::write(&folder.scene_file(), &file)?)
}
