//! A change of one scene of a dataset, by one process at a time and without hiding other changes.

use std::path::Path;

use crate::build_folder::BuildFolder;
use crate::layout::SceneFolder;
use crate::scene_hashes::SceneHashes;
use crate::{SceneError, SceneId, manifest};

/// Lets `work` write files of the scene, while no other process may, and lists all its files anew. `is_ours` accepts those
/// that `work` may write, by their paths in the dataset. Fails where any other file is not the one that is listed, since a
/// later manifest would list it as it is.
pub fn change_scene<T, E: From<SceneError>>(
    root: &Path,
    scene: &SceneId,
    is_ours: impl Fn(&str) -> bool,
    work: impl FnOnce() -> Result<T, E>,
) -> Result<T, E> {
    let _lease = BuildFolder::of(root).lease_of_scene(scene)?;
    manifest::remove_unfinished(SceneFolder::of(root, scene).path())?;
    let mut hashes = SceneHashes::open(root, scene)?;
    let findings = hashes.check(|path| !is_ours(path))?;
    if !findings.is_empty() {
        return Err(SceneError::Invalid { path: root.to_owned(), findings }.into());
    }
    hashes.note_change()?;
    let done = work()?;
    hashes.update()?;
    Ok(done)
}
