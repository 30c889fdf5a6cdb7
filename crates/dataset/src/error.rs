//! The one error of this crate.

use std::path::{Path, PathBuf};

use mateval_files::FileError;

use crate::dataset::{FORMAT, PREVIOUS_FORMAT};
use crate::findings::{Finding, Severity};
use crate::ids::{SceneId, quoted};

/// Why a dataset or a part of it could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The path is not the folder of a finished dataset.
    #[error("'{}' is not a dataset: {reason}", path.display())]
    NotADataset {
        path: PathBuf,
        /// What was found, and what to do.
        reason: String,
    },
    /// Scenes were changed apart, and the dataset does not list the changes yet.
    #[error(
        "'{}' is not finished: scene{} {} changed since its manifest was written; run `{}`",
        path.display(), if scenes.len() == 1 { "" } else { "s" }, quoted(scenes), command
    )]
    Unfinished {
        path: PathBuf,
        scenes: Vec<SceneId>,
        /// What makes the manifest list the changes.
        command: String,
    },
    /// A file breaks the format; every fault is listed.
    #[error("'{}' is not valid:{}", path.display(), Finding::list(findings))]
    Invalid { path: PathBuf, findings: Vec<Finding> },
    /// Files of the ground truth are missing, and nothing else is wrong: the public part of a dataset. Use the whole
    /// dataset.
    #[error(
        "'{}' lacks {files} files of the ground truth ('{first}' first), like the public part of a dataset: this needs \
         the whole dataset, which its keeper has; a submission can be checked without it: mateval eval lint",
        path.display()
    )]
    TruthWithheld {
        path: PathBuf,
        files: usize,
        /// The first of them, relative to the dataset.
        first: String,
    },
    /// The ground truth of a hidden split would be passed on.
    #[error(
        "'{}' holds the ground truth of a hidden split, which would be passed on: give the public part of `mateval prep \
         publish --withhold`, or add --with-ground-truth",
        path.display()
    )]
    SecretTruth { path: PathBuf },
    /// A captured scene has no true materials.
    #[error(
        "scene '{scene}' is captured: its true materials are not known, and the files of ground_truth hold placeholders; \
         leave it out, or score it by its measured colours: mateval eval score --protocol capture-1"
    )]
    Captured { scene: SceneId },
    /// A file of another version than the one that is read here.
    #[error(
        "'{}' has the format '{found}', and this version of MatEval reads '{expected}': {}",
        path.display(), remedy(found, expected)
    )]
    Format {
        path: PathBuf,
        /// Its format, shortened.
        found: String,
        expected: &'static str,
    },
    /// A file that is valid, but of a kind that is not read here.
    #[error("'{}': unsupported: {what}", path.display())]
    Unsupported {
        path: PathBuf,
        /// What was found and what is supported.
        what: String,
    },
    #[error("'{}' has no scene {}; it has {}", dataset.display(), quoted(unknown), quoted(known))]
    UnknownScenes { dataset: PathBuf, unknown: Vec<SceneId>, known: Vec<SceneId> },
    /// Twins are named for work that is done on the scene that they show.
    #[error(
        "'{}': {} shares the truth of another scene and has no renders or scores of its own; name {} instead, which \
         takes its twins along",
        dataset.display(), quoted(twins), quoted(of)
    )]
    Twins { dataset: PathBuf, twins: Vec<SceneId>, of: Vec<SceneId> },
    #[error(
        "'{}' would lie in the dataset '{}', whose manifest does not list it; choose another {place}",
        path.display(), dataset.display()
    )]
    OutputInDataset {
        path: PathBuf,
        dataset: PathBuf,
        /// The argument that names the output, as in `--out`.
        place: &'static str,
    },
    /// Scenes that the dataset lists are needed and their folders are missing: download them.
    #[error(
        "the folders of {} of the {total} scenes that '{}' lists are missing: unpack {} in the dataset's folder",
        absent.len(), dataset.join("dataset.json").display(), tars(absent)
    )]
    AbsentScenes {
        dataset: PathBuf,
        /// The scenes that are needed and absent.
        absent: Vec<SceneId>,
        /// The number of scenes that the dataset lists.
        total: usize,
    },
    /// A file or folder could not be read, written or guarded.
    #[error(transparent)]
    Files(#[from] FileError),
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl DatasetError {
    /// One fault of the file at `path`.
    pub(crate) fn invalid(path: &Path, code: &str, place: String, message: String, action: &str) -> Self {
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        let finding = Finding::new(Severity::Error, code, file, place, message, action);
        Self::Invalid { path: path.to_owned(), findings: vec![finding] }
    }
}

/// What helps where a file has another format than the one that is read.
fn remedy(found: &str, expected: &str) -> &'static str {
    match (found, expected) {
        (PREVIOUS_FORMAT, FORMAT) => "`mateval prep render --only scorer DATASET` brings the dataset up to date",
        _ => "make the file again, or use the version that made it",
    }
}

/// `'a.tar', 'b.tar'`: the files in which scenes are published.
fn tars(scenes: &[SceneId]) -> String {
    const SHOWN: usize = 5;
    let mut tars: Vec<String> = scenes.iter().take(SHOWN).map(|scene| format!("'scenes/{scene}.tar'")).collect();
    if scenes.len() > SHOWN {
        tars.push(format!("and {} more", scenes.len() - SHOWN));
    }
    tars.join(", ")
}
