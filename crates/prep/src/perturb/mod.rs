//! The public side of a dataset with other geometry: furniture moved, scaled or bent, by levels.
//!
//! The input is a dataset with its ground truth. The output is a dataset without ground truth, from which methods make
//! submissions that are scored on the true one. Topology, atlases and the photo stay; `motion` moves the vertices of
//! furniture by the amount of a level and finds furniture that passes through walls. Meshes, `scene.json` and the
//! pictures of geometry are written again.

mod motion;

use std::path::Path;
use std::sync::Arc;

use mateval_dataset::dataset::{DatasetFile, Instance, SceneFile};
use mateval_dataset::dataset::{Perturbation, PerturbationKind, PerturbedGeometry};
use mateval_dataset::glb::{self, GlbNode};
use mateval_dataset::layout::{DATASET, MANIFEST, SceneFolder, is_ground_truth, is_input_picture};
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{DatasetError, InstanceId, Progress, Report, SceneId, TriangleMesh, json, manifest, reference};
use mateval_files::FileError;
use mateval_files::work_folder::{WorkFolder, check_holds_none, make_folder};
use mateval_tracer::World;

use crate::error::PrepError;
use crate::scene_meshes::{self, Faults, Meshes};
use crate::views::{Shown, ViewScene, write_views};
use motion::{Amount, Motion, amounts, crossing};

/// What to do with the furniture of a dataset.
#[derive(Clone, Copy, Debug)]
pub struct PerturbOptions {
    pub kind: PerturbationKind,
    /// The level, at most [`PerturbationKind::most_level`]; 0 changes nothing.
    pub level: u32,
    /// The seed of directions.
    pub seed: u64,
}

/// Writes the public files of the dataset in `root` to `out`, which is replaced where it exists, with furniture
/// perturbed. At level 0 they are copies. Returns what happened in each scene.
pub fn perturb(
    root: &Path,
    out: &Path,
    options: &PerturbOptions,
    progress: Progress<'_>,
) -> Result<Vec<PerturbedScene>, PrepError> {
    // What can be refused early.
    let most = options.kind.most_level();
    if options.level > most {
        return Err(PrepError::NoSuchLevel { kind: options.kind, found: options.level, most });
    }
    let dataset = Dataset::open(root)?;
    dataset.check_whole()?;
    if dataset.file.geometry.is_some() {
        let why = "has geometry that is perturbed already; start from the dataset with the true one";
        return Err(PrepError::unusable(root, why));
    }
    if !dataset.file.twins.is_empty() {
        let why =
            "has twins, whose geometry is that of their scenes; start from a dataset that is built without `twins`";
        return Err(PrepError::unusable(root, why));
    }
    if let Some(scene) = dataset.scenes.iter().find(|scene| !dataset.folder(&scene.id).reference().is_dir()) {
        return Err(PrepError::NoTruth { scene: scene.id.clone() });
    }
    check_holds_none(out, &[root])?;
    progress(Report::step("hashes", 0, 1));
    let findings = manifest::check_those(root, |file| !is_ground_truth(file) || file.contains("/reference/"))?;
    if !findings.is_empty() {
        return Err(DatasetError::Invalid { path: root.to_owned(), findings }.into());
    }
    // The files that stay, then those of each scene.
    let work = WorkFolder::start(out)?;
    let amount = options.level.checked_sub(1).map(|at| amounts(options.kind)[at as usize]);
    let entries = manifest::entries(root)?;
    let files = entries.iter().map(|entry| entry.file.as_str()).filter(|file| !is_ground_truth(file));
    let stays = |file: &&str| amount.is_none() || !is_rewritten(file);
    files.filter(stays).try_for_each(|file| copy(root, work.path(), file))?;
    let Some(amount) = amount else {
        [MANIFEST, DATASET].into_iter().try_for_each(|file| copy(root, work.path(), file))?;
        work.finish()?;
        return Ok(dataset.scenes.iter().map(|scene| PerturbedScene::unchanged(&scene.id)).collect());
    };
    let mut perturbed = Vec::new();
    for (at, scene) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, dataset.scenes.len()));
        let to = SceneFolder::of(work.path(), &scene.id);
        perturbed.push(write_scene(&dataset.folder(&scene.id), &to, scene, amount, options.seed)?);
    }
    if perturbed.iter().all(|scene| scene.moved == 0) {
        let why = "has no scene with furniture; only 3D-FRONT rooms state which objects are furniture";
        return Err(PrepError::unusable(root, why));
    }
    // The files that describe the whole.
    let perturbation = Perturbation { kind: options.kind, level: options.level };
    let true_manifest_sha256 = dataset.file.manifest_sha256.clone();
    let file = DatasetFile {
        manifest_sha256: manifest::write(work.path())?,
        geometry: Some(PerturbedGeometry { perturbation, true_manifest_sha256 }),
        ..dataset.file
    };
    json::write(&work.path().join(DATASET), &file)?;
    work.finish()?;
    Ok(perturbed)
}

fn copy(from: &Path, to: &Path, file: &str) -> Result<(), PrepError> {
    let place = to.join(file);
    if let Some(folder) = place.parent() {
        make_folder(folder)?;
    }
    Ok(std::fs::copy(from.join(file), &place).map(|_| ()).map_err(FileError::io("write", &place))?)
}

/// What happened to a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PerturbedScene {
    pub scene: SceneId,
    /// The number of pieces of furniture that were moved.
    pub moved: usize,
    /// The pieces that pass through architecture, and did not before.
    pub crossing: Vec<InstanceId>,
}

impl PerturbedScene {
    /// A scene in which nothing was moved.
    pub(super) fn unchanged(scene: &SceneId) -> Self {
        Self { scene: scene.clone(), moved: 0, crossing: Vec::new() }
    }
}

/// Whether [`write_scene`] writes this public file of a dataset.
fn is_rewritten(file: &str) -> bool {
    let Some((_, in_scene)) = file.strip_prefix("scenes/").and_then(|rest| rest.split_once('/')) else { return false };
    let is_picture = in_scene.starts_with("views/") && !is_input_picture(file);
    in_scene == "scene.json" || in_scene.starts_with("geometry/") || is_picture
}

/// Writes meshes, `scene.json` and the pictures of geometry of the scene in `from`, moved by `amount`, to `to`.
fn write_scene(
    from: &SceneFolder,
    to: &SceneFolder,
    scene: &SceneFile,
    amount: Amount,
    seed: u64,
) -> Result<PerturbedScene, PrepError> {
    scene.check_materials_known()?;
    // The true scene, and the displacement of each instance.
    let mut reference = reference::read(from)?;
    let mut faults = Faults::default();
    let Some(meshes) = scene_meshes::check(from, scene, &mut faults) else {
        return Err(DatasetError::Invalid { path: from.path().to_owned(), findings: faults.all }.into());
    };
    let motions: Vec<Option<Motion>> = scene
        .instances
        .iter()
        .zip(&reference.surfaces)
        .map(|(instance, surface)| {
            instance.role.is_furniture().then(|| Motion::new(amount, seed, (&scene.id, &instance.id), &surface.mesh))
        })
        .collect();
    let true_scene = reference.clone();
    for (surface, motion) in reference.surfaces.iter_mut().zip(&motions) {
        surface.mesh = moved(motion.as_ref(), &surface.mesh);
    }
    // The meshes.
    let folder = to.path().join("geometry");
    make_folder(&folder)?;
    let motion_of = |id: &InstanceId| {
        let at = scene.instances.iter().position(|instance| instance.id == *id);
        at.and_then(|at| motions[at].as_ref())
    };
    let nodes = |nodes: &[GlbNode], owners: &[&InstanceId]| -> Vec<GlbNode> {
        let node = |(node, owner): (&GlbNode, &&InstanceId)| GlbNode {
            name: node.name.clone(),
            mesh: moved(motion_of(owner), &node.mesh),
        };
        nodes.iter().zip(owners).map(node).collect()
    };
    let instances: Vec<&InstanceId> = scene.instances.iter().map(|instance| &instance.id).collect();
    glb::write(&to.instances(), &nodes(&meshes.instances, &instances))?;
    for (set, parts) in scene.all_part_sets() {
        let owners: Vec<&InstanceId> = parts.iter().map(|part| &part.instance).collect();
        glb::write(&to.parts(set), &nodes(&glb::read(&from.parts(set))?, &owners))?;
    }
    // The pictures, and what follows from them.
    let crossing = new_crossings(scene, &true_scene, &reference)?;
    let shown = write_pictures(to, scene, &meshes, reference)?;
    json::write(&to.scene_file(), &with_measures(scene, &true_scene, &motions, &shown))?;
    Ok(PerturbedScene { scene: scene.id.clone(), moved: motions.iter().flatten().count(), crossing })
}

fn moved(motion: Option<&Motion>, mesh: &TriangleMesh) -> TriangleMesh {
    motion.map_or_else(|| mesh.clone(), |motion| motion.apply(mesh))
}

/// The pieces of furniture that pass through architecture in `now` and do not in `before`.
fn new_crossings(
    scene: &SceneFile,
    before: &ReferenceScene,
    now: &ReferenceScene,
) -> Result<Vec<InstanceId>, PrepError> {
    let of = |reference: &ReferenceScene| {
        let meshes = |belongs: &dyn Fn(&Instance) -> bool| -> Vec<usize> {
            (0..scene.instances.len()).filter(|at| belongs(&scene.instances[*at])).collect()
        };
        let mesh = |at: usize| &reference.surfaces[at].mesh;
        let pieces = meshes(&|instance| instance.role.is_furniture());
        let walls = meshes(&|instance| instance.role.is_architecture());
        let [pieces, walls] = [pieces, walls].map(|all| all.into_iter().map(mesh).collect::<Vec<_>>());
        crossing(&pieces, &walls)
    };
    let pieces = scene.instances.iter().filter(|instance| instance.role.is_furniture());
    let all = pieces.zip(of(before)?).zip(of(now)?);
    Ok(all.filter(|((_, before), now)| *now && !before).map(|((piece, _), _)| piece.id.clone()).collect())
}

/// Writes the pictures of geometry of every view.
fn write_pictures(
    to: &SceneFolder,
    scene: &SceneFile,
    meshes: &Meshes,
    reference: ReferenceScene,
) -> Result<Shown, PrepError> {
    let reference = Arc::new(reference);
    let world = World::new(reference.clone())?;
    let instances: Vec<u16> = scene.instances.iter().map(|instance| instance.index.0.get()).collect();
    let scored: Vec<bool> = scene.instances.iter().map(|instance| instance.atlas.is_some()).collect();
    let view_scene = ViewScene::new(&reference, &world, &instances, &scored);
    write_views(to, &view_scene, &scene.views, &meshes.part_values(scene), |_, _, _| Ok(()))
}

/// `scene.json` with the numbers that follow from the geometry: the lengths of texels and of half a pixel of the input
/// view, and what wide views show of the unseen.
fn with_measures(
    scene: &SceneFile,
    true_scene: &ReferenceScene,
    motions: &[Option<Motion>],
    shown: &Shown,
) -> SceneFile {
    let mut scene = scene.clone();
    for (view, unseen_share) in scene.views.iter_mut().zip(&shown.unseen_shares) {
        view.wide.iter_mut().for_each(|wide| wide.unseen_share = *unseen_share);
    }
    let focal = scene.views[0].camera.intrinsics.fx;
    for (at, instance) in scene.instances.iter_mut().enumerate() {
        let Some(atlas) = &mut instance.atlas else { continue };
        atlas.half_pixel_m = shown.nearest[at].map(|depth| 0.5 * depth / focal);
        if let Some(motion) = &motions[at] {
            let mesh = &true_scene.surfaces[at].mesh;
            atlas.texel_m *= (motion.apply(mesh).area() / mesh.area()).sqrt();
        }
    }
    scene
}
