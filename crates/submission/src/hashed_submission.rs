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

/// The files of a submission, each hashed once, from which the hash over any of its scenes follows.
pub struct HashedFiles {
    method: String,
    json: HashedFile,
    /// The maps of each scene, in the dataset's order.
    scenes: Vec<(SceneId, Vec<HashedFile>)>,
}

impl HashedFiles {
    /// Reads `submission.json` and the maps of these scenes; of all scenes if none is given.
    pub fn read(submission: &Path, dataset: &Dataset, scenes: &[SceneId]) -> Result<Self, SubmissionError> {
        let json = SubmissionJson::read(submission)?;
        let chosen = dataset.chosen_scenes(scenes)?;
        let scenes = chosen.into_iter().map(|scene| (scene.id.clone(), map_hashes(submission, scene))).collect();
        Ok(Self { method: json.file.method, json: json.hashed, scenes })
    }

    /// The submission as a result of the scenes for which `is_scored` holds identifies it.
    pub fn over(&self, is_scored: impl Fn(&SceneId) -> bool) -> HashedSubmission {
        let maps = self.scenes.iter().filter(|(scene, _)| is_scored(scene)).flat_map(|(_, maps)| maps);
        let files: Vec<HashedFile> = std::iter::once(&self.json).chain(maps).cloned().collect();
        HashedSubmission { method: self.method.clone(), sha256: submission_sha256(&files), maps: files.len() - 1 }
    }
}

/// Hashes `submission.json` and the maps of these scenes. A result has the same hash if it was made of the same files.
pub fn hashed_submission(
    submission: &Path,
    dataset: &Dataset,
    scenes: &[SceneId],
) -> Result<HashedSubmission, SubmissionError> {
    Ok(HashedFiles::read(submission, dataset, scenes)?.over(|_| true))
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
