//! Begins a build in a new folder, or resumes one that was begun there.

use std::path::Path;

use mateval_scene::build_folder::{BUILD, BuildFolder};
use mateval_scene::layout::{DATASET, SceneFolder};
use mateval_scene::work_folder::{check_holds_none, put_aside, remove, remove_abandoned};
use mateval_scene::{SceneId, json};
use serde::{Deserialize, Serialize};

use super::options::BuildOptions;
use super::scene_mark::{SceneMark, finished_scene, settings_sha256};
use crate::error::PrepError;
use crate::recipe::Recipe;

const KEY_FORMAT: &str = "mateval-build/1";

/// States that a `.build` is ours: other tools use folders of that name too.
#[derive(Serialize, Deserialize)]
struct BuildKey {
    format: String,
}

/// What the output's folder holds.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// Nothing.
    New,
    /// A build, begun or finished.
    Build,
    /// A dataset without its build, such as one that was downloaded.
    Dataset,
    /// Anything else.
    Other,
}

impl Place {
    fn of(out: &Path) -> Self {
        if is_build(out) {
            Self::Build
        } else if out.join(DATASET).is_file() {
            Self::Dataset
        } else if !out.exists() || holds_only(out, &[BUILD]) {
            // A build that was killed before it wrote its key has written nothing else.
            Self::New
        } else {
            Self::Other
        }
    }
}

/// Whether the folder holds a build, begun or finished.
pub(crate) fn is_build(root: &Path) -> bool {
    json::read::<BuildKey>(&BuildFolder::of(root).key()).is_ok_and(|key| key.format == KEY_FORMAT)
}

/// Prepares the output's folder for the recipe as written, whose text is kept there. Fails where the folder holds
/// something else, or scenes that the recipe would make otherwise or not at all, unless they may be replaced.
pub(super) fn begin(
    options: &BuildOptions,
    recipe: &Recipe,
    text: &str,
    tool: &str,
    source: &Path,
) -> Result<(), PrepError> {
    let out = &options.out;
    // Before the lease, which is a file in the folder.
    check_place(options, Place::of(out))?;
    let build = BuildFolder::of(out);
    std::fs::create_dir_all(build.path()).map_err(PrepError::io("make", build.path()))?;
    let _lease = build.lease_of_start()?;
    let place = Place::of(out);
    check_place(options, place)?;
    if place == Place::Build && (!options.force || !options.scenes.is_empty()) {
        check_scenes(options, recipe, tool, source)?;
        return Ok(mateval_image::store::write_whole(&build.recipe(), text.as_bytes())?);
    }
    if place != Place::New {
        check_holds_none(out, &[&options.recipe, source])?;
        let _whole = build.lease_of_all()?;
        let old = put_aside(out)?;
        std::fs::create_dir_all(build.path()).map_err(PrepError::io("make", build.path()))?;
        old.as_deref().map_or(Ok(()), remove)?;
    }
    remove_abandoned(out)?;
    mateval_image::store::write_whole(&build.recipe(), text.as_bytes())?;
    json::write(&build.key(), &BuildKey { format: KEY_FORMAT.to_owned() })?;
    Ok(())
}

/// Fails where the folder must not be written to.
fn check_place(options: &BuildOptions, place: Place) -> Result<(), PrepError> {
    let path = || options.out.clone();
    match place {
        Place::Other => Err(PrepError::NotADataset { path: path() }),
        Place::Dataset if !options.force || !options.scenes.is_empty() => {
            Err(PrepError::FinishedDataset { path: path() })
        }
        _ => Ok(()),
    }
}

/// Fails where scenes that are to be made were made otherwise than the recipe says, or scenes are not in it and all are to
/// be made: of the others, `prep finish` says so. Scenes of a build that never finished are made again where only their
/// files have changed: nobody can have rendered them.
fn check_scenes(options: &BuildOptions, recipe: &Recipe, tool: &str, source: &Path) -> Result<(), PrepError> {
    let build = BuildFolder::of(&options.out);
    let is_finished = options.out.join(DATASET).is_file();
    let is_changed = |id: &SceneId| {
        let Some(entry) = recipe.scenes.iter().find(|entry| entry.id == *id) else { return false };
        // A mark that cannot be read is of a scene that is made again.
        let Ok(mark) = json::read::<SceneMark>(&build.mark(id)) else { return false };
        mark.settings_sha256 != settings_sha256(recipe, id, tool)
            || is_finished
                && SceneFolder::of(&options.out, id).path().exists()
                && finished_scene(&options.out, entry, source).is_none()
    };
    let is_apart = !options.scenes.is_empty();
    let is_kept = |id: &SceneId| is_apart && (options.force || !options.scenes.contains(id));
    let (known, dropped): (Vec<SceneId>, Vec<SceneId>) =
        marked(&build).into_iter().partition(|id| recipe.scenes.iter().any(|entry| entry.id == *id));
    let changed: Vec<SceneId> = known.into_iter().filter(|id| !is_kept(id) && is_changed(id)).collect();
    match changed.is_empty() && (dropped.is_empty() || is_apart) {
        true => Ok(()),
        false => Err(PrepError::OtherBuild { path: options.out.clone(), changed, dropped }),
    }
}

/// The scenes that have a mark.
fn marked(build: &BuildFolder) -> Vec<SceneId> {
    let Ok(entries) = std::fs::read_dir(build.marks()) else { return Vec::new() };
    let id = |name: std::ffi::OsString| SceneId::new(name.to_str()?.strip_suffix(".json")?).ok();
    let mut ids: Vec<SceneId> = entries.flatten().filter_map(|entry| id(entry.file_name())).collect();
    ids.sort();
    ids
}

/// Whether every entry of the folder has one of these names; false where the folder cannot be read.
pub(crate) fn holds_only(folder: &Path, names: &[&str]) -> bool {
    std::fs::read_dir(folder)
        .and_then(|entries| entries.collect::<Result<Vec<_>, _>>())
        .is_ok_and(|entries| entries.iter().all(|entry| names.iter().any(|name| entry.file_name() == *name)))
}
