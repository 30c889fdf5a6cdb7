//! The files of a submission: where they lie, their bytes, and the hashes of these same bytes.
//!
//! Scoring, verification and `eval lint` read a submission's files here and nowhere else, each once. If a file is
//! replaced during a run, the result therefore has the hash of the bytes that were scored, never that of the other
//! version.
//!
//! The files are untrusted input: nothing outside the submission's folder is read, and no more than a given size.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::submission::{MAX_SUBMISSION_BYTES, Map, SUBMISSION, SubmissionFile, instance_folder};
use mateval_dataset::{InstanceId, SceneId};
use mateval_files::FileError;
use mateval_files::source_folder::slashed;
use mateval_files::untrusted::{read_at_most, sha256_of_bytes};
use serde::Serialize;

use crate::error::{FileFault, SubmissionError};

/// Largest file of a map, in bytes.
pub const MAX_MAP_BYTES: u64 = 512 << 20;

/// A file of a submission and the hash of the bytes that were read from it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct HashedFile {
    /// Relative to the submission's folder, with forward slashes.
    pub path: String,
    /// SHA-256, hex.
    pub sha256: String,
}

/// The hash of a submission: SHA-256 over a line `<sha256>  <path>` for each file, in the order given. Results list
/// `submission.json` first, then the maps scene by scene.
pub fn submission_sha256(files: &[HashedFile]) -> String {
    let lines: String = files.iter().map(|file| format!("{}  {}\n", file.sha256, file.path)).collect();
    sha256_of_bytes(lines.as_bytes())
}

/// The bytes of a file and their hash.
pub struct SubmittedFile {
    /// Where it was read; its ending says what kind of file it should be.
    pub path: PathBuf,
    pub hashed: HashedFile,
    pub bytes: Vec<u8>,
}

impl SubmittedFile {
    /// Reads a file of at most `most` bytes that lies in the folder `submission`.
    pub fn read(submission: &Path, path: &Path, most: u64) -> Result<Self, FileFault> {
        let place = place_inside(submission, path)?;
        let bytes = read_at_most(&place, most).map_err(|error| match error.kind() {
            ErrorKind::FileTooLarge => {
                let action = "save it with compression, or with fewer texels";
                FileFault::new("file_too_large", format!("more than {most} bytes"), action)
            }
            _ => FileFault::unreadable(&error),
        })?;
        Ok(Self::from_bytes(submission, path, bytes))
    }

    pub fn from_bytes(submission: &Path, path: &Path, bytes: Vec<u8>) -> Self {
        let hashed = HashedFile { path: relative(submission, path), sha256: sha256_of_bytes(&bytes) };
        Self { path: path.to_owned(), hashed, bytes }
    }
}

/// The instance that maps belong to, in one submission.
#[derive(Clone, Copy)]
pub(crate) struct MapFolder<'a> {
    pub(crate) submission: &'a Path,
    pub(crate) scene: &'a SceneId,
    pub(crate) instance: &'a InstanceId,
}

impl MapFolder<'_> {
    /// The two places of a map: as PNG, as EXR.
    pub(crate) fn candidates(&self, map: Map) -> [PathBuf; 2] {
        let folder = instance_folder(self.submission, self.scene, self.instance);
        ["png", "exr"].map(|ending| folder.join(map.stem()).with_extension(ending))
    }

    /// Those of the two that exist.
    pub(crate) fn present(&self, map: Map) -> Vec<PathBuf> {
        self.candidates(map).into_iter().filter(|path| exists(path)).collect()
    }

    /// The file of a map.
    pub(crate) fn read(&self, path: &Path) -> Result<SubmittedFile, FileFault> {
        SubmittedFile::read(self.submission, path, MAX_MAP_BYTES)
    }
}

/// A path relative to the submission's folder, with forward slashes.
pub(crate) fn relative(submission: &Path, path: &Path) -> String {
    slashed(path.strip_prefix(submission).unwrap_or(path))
}

/// Where a file lies once links are followed. Fails where that is outside the submission's folder, or no ordinary file.
fn place_inside(submission: &Path, path: &Path) -> Result<PathBuf, FileFault> {
    let unreadable = |error: std::io::Error| FileFault::unreadable(&error);
    let place = path.canonicalize().map_err(|error| match error.kind() {
        ErrorKind::NotFound => {
            FileFault::new("broken_link", "a link to a file that does not exist", "replace the link by the file itself")
        }
        _ => unreadable(error),
    })?;
    if !place.starts_with(submission.canonicalize().map_err(unreadable)?) {
        let message = "a link that leads out of the submission's folder; it is not followed";
        return Err(FileFault::new("link_leads_out", message, "replace the link by the file itself"));
    }
    if !place.metadata().map_err(unreadable)?.is_file() {
        return Err(FileFault::new("not_a_file", "not an ordinary file", "replace it by an ordinary file"));
    }
    Ok(place)
}

/// What `submission.json` states, and the hash of its bytes.
#[derive(Clone, Debug)]
pub struct SubmissionJson {
    pub file: SubmissionFile,
    /// Of the bytes that [`SubmissionJson::file`] was parsed from.
    pub hashed: HashedFile,
}

impl SubmissionJson {
    /// Reads it from a submission's folder. Fails where it is missing, a link that leads out, or of another format.
    pub fn read(submission: &Path) -> Result<Self, SubmissionError> {
        let path = submission.join(SUBMISSION);
        path.symlink_metadata().map_err(FileError::io("read", &path))?;
        let source = SubmittedFile::read(submission, &path, MAX_SUBMISSION_BYTES)
            .map_err(|fault| SubmissionError::File { path: path.clone(), fault })?;
        Ok(Self { file: SubmissionFile::parse(&path, &source.bytes)?, hashed: source.hashed })
    }
}

/// Whether anything exists at a path, a link that leads nowhere included.
pub(crate) fn exists(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// What identifies a submission: enough to see whether a result belongs to it, without a look at what its files hold.
pub struct HashedSubmission {
    pub method: String,
    /// As results of the same scenes have it; see [`submission_sha256`].
    pub sha256: String,
    pub maps: usize,
}

/// The files of a submission, each hashed once, from which the hash over any of its scenes follows.
pub struct HashedFiles {
    method: String,
    json: HashedFile,
    /// The maps of each scene with those of its twins, in the dataset's order.
    scenes: Vec<(SceneId, Vec<HashedFile>)>,
}

impl HashedFiles {
    /// Reads `submission.json` and the maps of these scenes; of all scenes if none is given.
    pub fn read(submission: &Path, dataset: &Dataset, scenes: &[SceneId]) -> Result<Self, SubmissionError> {
        let json = SubmissionJson::read(submission)?;
        let chosen = dataset.chosen_scenes(scenes)?;
        let with_twins = |scene: &SceneFile| {
            let all = std::iter::once(scene).chain(dataset.twins_of(&scene.id));
            (scene.id.clone(), all.flat_map(|scene| map_hashes(submission, scene)).collect())
        };
        let scenes = chosen.into_iter().map(with_twins).collect();
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

/// The maps of a scene in the order in which scoring reads them; those that cannot be read have no hash.
fn map_hashes(submission: &Path, scene: &SceneFile) -> Vec<HashedFile> {
    let with_atlas = scene.instances.iter().filter(|instance| instance.atlas.is_some());
    let read = with_atlas.flat_map(|instance| {
        let folder = MapFolder { submission, scene: &scene.id, instance: &instance.id };
        let paths = Map::ALL.into_iter().flat_map(move |map| folder.present(map));
        paths.filter_map(move |path| folder.read(&path).ok())
    });
    read.map(|file| file.hashed).collect()
}
