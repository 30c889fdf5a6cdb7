//! The public side of a dataset with other geometry: furniture moved, scaled or bent, by levels.
//!
//! The input is a dataset with its ground truth. The output is a dataset without ground truth, from which methods make
//! submissions that are scored on the true one. Topology, atlases and the photo stay; `motion` moves the vertices of
//! furniture, and `scene` writes meshes, `scene.json` and the pictures of geometry again. `levels` lists the
//! amounts, `crossing` finds furniture that passes through walls.

mod crossing;
mod levels;
mod motion;
mod scene;

use std::path::Path;

use mateval_scene::dataset::DatasetFile;
use mateval_scene::layout::{DATASET, MANIFEST, SceneFolder, is_ground_truth};
use mateval_scene::open::Dataset;
use mateval_scene::perturbation::{Perturbation, PerturbationKind, PerturbedGeometry};
use mateval_scene::work_folder::{WorkFolder, check_holds_none};
use mateval_scene::{Progress, Report, SceneError, json, manifest};

use crate::error::PrepError;
pub use levels::most_level;
pub use scene::PerturbedScene;

/// What to do with the furniture of a dataset.
#[derive(Clone, Copy, Debug)]
pub struct PerturbOptions {
    /// The kind of difference.
    pub kind: PerturbationKind,
    /// The level, at most [`most_level`]; 0 changes nothing.
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
    let most = most_level(options.kind);
    if options.level > most {
        return Err(PrepError::NoSuchLevel { kind: options.kind, found: options.level, most });
    }
    let dataset = Dataset::open(root)?;
    dataset.check_whole()?;
    if dataset.file.geometry.is_some() {
        return Err(PrepError::PerturbedAlready { path: root.to_owned() });
    }
    if let Some(scene) = dataset.scenes.iter().find(|scene| !dataset.folder(&scene.id).reference().is_dir()) {
        return Err(PrepError::NoTruth { scene: scene.id.clone() });
    }
    check_holds_none(out, &[root])?;
    progress(Report::step("hashes", 0, 1));
    let findings = manifest::check_those(root, |file| !is_ground_truth(file) || file.contains("/reference/"))?;
    if !findings.is_empty() {
        return Err(SceneError::Invalid { path: root.to_owned(), findings }.into());
    }
    // The files that stay, then those of each scene.
    let work = WorkFolder::start(out)?;
    let amount = options.level.checked_sub(1).map(|at| levels::amounts(options.kind)[at as usize]);
    let entries = manifest::entries(root)?;
    let files = entries.iter().map(|entry| entry.file.as_str()).filter(|file| !is_ground_truth(file));
    let stays = |file: &&str| amount.is_none() || !scene::is_rewritten(file);
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
        perturbed.push(scene::write(&dataset.folder(&scene.id), &to, scene, amount, options.seed)?);
    }
    if perturbed.iter().all(|scene| scene.moved == 0) {
        return Err(PrepError::NoFurniture { path: root.to_owned() });
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
        std::fs::create_dir_all(folder).map_err(PrepError::io("make", folder))?;
    }
    std::fs::copy(from.join(file), &place).map(|_| ()).map_err(PrepError::io("write", &place))
}
