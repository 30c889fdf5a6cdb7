//! The companions' pictures that a dataset carries, so that its users need not render them.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_scene::build_folder::BuildFolder;
use mateval_scene::companions_file::{COMPANIONS_JSON, light_inputs_sha256};
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::SceneFolder;
use mateval_scene::manifest;
use mateval_scene::open::Dataset;
use mateval_scene::scene_change::change_scene;
use mateval_scene::scene_cost::{self, Step, TimedStep};
use mateval_scene::{Progress, Report, SceneError, SceneId};

use crate::companion_store::{MadeIn, UNFINISHED};
use crate::error::EvalError;
use crate::light_score::keep_companions;
use crate::open_scene::{OpenScene, scored_views};
use crate::protocol::Protocol;
use crate::scene_task::SceneTask;
use crate::view_set::ViewSet;

/// What [`make_companions`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CompanionsReport {
    /// The number of passes whose pictures were rendered.
    pub made: usize,
    /// The number of passes whose pictures were there already.
    pub kept: usize,
}

/// Renders the companions' pictures of these scenes (of all, if none is named) into the dataset in `root`, for every pass of
/// the protocol that has companions. Scenes with a photo from elsewhere have none. The manifest lists them once the dataset is finished again (`prep finish`).
///
/// Pictures of the same inputs and rules are kept, so that a killed run resumes where it ended; others are replaced. As the
/// manifest changes, results made before belong to another dataset. Several processes may work on different scenes at once.
pub fn make_companions(
    root: &Path,
    scenes: &[SceneId],
    protocol: &Protocol,
    progress: Progress<'_>,
) -> Result<CompanionsReport, EvalError> {
    protocol.check()?;
    let dataset = Dataset::open(root)?;
    // The new manifest lists the files that exist.
    dataset.check_whole()?;
    let mut report = CompanionsReport::default();
    let changed = BuildFolder::of(root).changed();
    if dataset.file.scored_renderer.is_none() && !changed.is_empty() {
        return Err(SceneError::Unfinished { path: root.to_owned(), scenes: changed }.into());
    }
    let mut chosen = dataset.chosen_scenes(scenes)?;
    for scene in chosen.extract_if(.., |scene| scene.photo.is_some()) {
        let what = format!("{}: no companions, since the light of its photo is not known", scene.id);
        progress(Report::Message(&what));
    }
    for (at, scene) in chosen.iter().enumerate() {
        progress(Report::part(&format!("scene {}", scene.id), at, chosen.len()));
        let work = || {
            let folder = dataset.folder(&scene.id);
            remove_unfinished(&folder)?;
            Ok::<_, EvalError>((lists(&folder)?, of_scene(&dataset, scene, protocol, progress)?))
        };
        let step = TimedStep { step: Step::Companions, renderer: None, is_alone: true };
        let work = || scene_cost::timed(root, &scene.id, &step, work);
        let (before, after) = change_scene(root, &scene.id, |path| path.contains("/companions/"), work)?;
        let kept = after.iter().filter(|(pass, sha256)| before.get(*pass) == Some(sha256)).count();
        report.kept += kept;
        report.made += after.len() - kept;
    }
    Ok(report)
}

fn of_scene(
    dataset: &Dataset,
    scene: &SceneFile,
    protocol: &Protocol,
    progress: Progress<'_>,
) -> Result<BTreeMap<String, String>, EvalError> {
    let renderer = dataset.file.scored_renderer.as_ref();
    let renderer = renderer.ok_or_else(|| EvalError::NoScoredRenderer { dataset: dataset.root.clone() })?;
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene, Some(renderer))?;
    let task = SceneTask {
        scene,
        folder: &folder,
        world: &world,
        atlases: &atlases,
        views: scored_views(dataset, scene)?,
        set: ViewSet::Turned,
        predictions: &[],
        protocols: std::slice::from_ref(protocol),
        lpips: None,
        renderer: Some(renderer),
        companions_made_in: MadeIn::Dataset,
        inputs_sha256: light_inputs_sha256(&dataset.root, &scene.id)?,
        progress,
    };
    let mut lists = BTreeMap::new();
    for task in [ViewSet::Turned, ViewSet::Wide].into_iter().filter_map(|set| task.of(set)) {
        if task.set == ViewSet::Turned || protocol.wide_views {
            lists.extend(keep_companions(&task, renderer, &task.truths()?, 0)?);
        }
    }
    Ok(lists)
}

/// The hash of each pass's list of pictures.
fn lists(folder: &SceneFolder) -> Result<BTreeMap<String, String>, EvalError> {
    let mut lists = BTreeMap::new();
    for (name, path) in folders(folder)? {
        let list = path.join(COMPANIONS_JSON);
        if list.is_file() {
            lists.insert(name, manifest::sha256_of_file(&list)?);
        }
    }
    Ok(lists)
}

/// Removes what killed runs left.
fn remove_unfinished(folder: &SceneFolder) -> Result<(), EvalError> {
    for (name, path) in folders(folder)? {
        if name.starts_with(UNFINISHED) {
            std::fs::remove_dir_all(&path).map_err(|source| EvalError::Io { action: "remove", path, source })?;
        }
    }
    Ok(())
}

/// Name and path of every folder of companions.
fn folders(folder: &SceneFolder) -> Result<Vec<(String, std::path::PathBuf)>, EvalError> {
    let companions = folder.companions();
    if !companions.exists() {
        return Ok(Vec::new());
    }
    let io = |source| EvalError::Io { action: "read", path: companions.clone(), source };
    let entry = |entry: std::io::Result<std::fs::DirEntry>| {
        let entry = entry.map_err(io)?;
        Ok((entry.file_name().to_string_lossy().into_owned(), entry.path()))
    };
    std::fs::read_dir(&companions).map_err(io)?.map(entry).collect()
}
