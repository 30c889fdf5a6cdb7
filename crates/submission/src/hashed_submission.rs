//! The hash of a submission's files without a look at what they hold: enough to see whether a result belongs to it.

use std::path::Path;

use mateval_scene::SceneId;
use mateval_scene::dataset::SceneFile;
use mateval_scene::open::Dataset;
use mateval_scene::submission::Map;

use crate::error::SubmissionError;
use crate::hashed_file::{HashedFile, submission_sha256};
use crate::map_file::MAX_MAP_BYTES;
use crate::map_folder::MapFolder;
use crate::submission_json::SubmissionJson;
use crate::submitted_file::SubmittedFile;

/// What identifies a submission.
pub struct HashedSubmission {
    /// The method's name, from `submission.json`.
    pub method: String,
    /// As results of the same scenes have it; see [`submission_sha256`].
    pub sha256: String,
    /// How many maps the hash is over.
    pub maps: usize,
}

/// Hashes `submission.json` and the maps of these scenes. A result has the same hash if it was made of the same files.
pub fn hashed_submission(
    submission: &Path,
    dataset: &Dataset,
    scenes: &[SceneId],
) -> Result<HashedSubmission, SubmissionError> {
    let json = SubmissionJson::read(submission)?;
    let mut files = vec![json.hashed];
    files.extend(dataset.chosen_scenes(scenes)?.into_iter().flat_map(|scene| map_hashes(submission, scene)));
    Ok(HashedSubmission { method: json.file.method, sha256: submission_sha256(&files), maps: files.len() - 1 })
}

/// The maps of a scene in the order of [`crate::prediction::PredictedScene::files`]; those that cannot be read have no
/// hash.
fn map_hashes(submission: &Path, scene: &SceneFile) -> Vec<HashedFile> {
    let with_atlas = scene.instances.iter().filter(|instance| instance.atlas.is_some());
    let paths = with_atlas.flat_map(|instance| {
        let folder = MapFolder { submission, scene: &scene.id, instance: &instance.id };
        Map::ALL.into_iter().flat_map(move |map| folder.present(map))
    });
    let read = paths.filter_map(|path| SubmittedFile::read(submission, &path, MAX_MAP_BYTES).ok());
    read.map(|file| file.hashed().clone()).collect()
}
