//! The one error of this crate.

use std::path::PathBuf;

use mateval_image::store::Owner;

use crate::dataset::{FORMAT, PREVIOUS_FORMAT};
use crate::findings::Finding;
use crate::ids::{SceneId, quoted};

/// Why a dataset or a part of it could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was attempted, as in "read" or "write".
        action: &'static str,
        path: PathBuf,
        source: std::io::Error,
    },
    /// The path is not the folder of a finished dataset.
    #[error("'{}' is not a dataset: {reason}", path.display())]
    NotADataset {
        path: PathBuf,
        /// What was found, and what to do.
        reason: String,
    },
    /// A folder that did not exist when work on it began exists now.
    #[error("'{}' was made by another process meanwhile; it stays as it is, and this run's result is removed", path.display())]
    MadeMeanwhile { path: PathBuf },
    /// An output that may be replaced holds an input.
    #[error("'{}' holds '{}', which would be deleted with it; choose another output", path.display(), input.display())]
    HoldsInput { path: PathBuf, input: PathBuf },
    /// Another process works on the same scene or dataset.
    #[error(
        "process {} on {} is at work on {what}, and gave its last sign of life {} seconds ago; wait for it, or, if it is \
         gone, remove '{}'",
        holder.process, holder.host, silence.as_secs(), path.display()
    )]
    InUse {
        /// What is being worked on, as in "scene 'room'".
        what: String,
        holder: Box<Owner>,
        /// How long it has given no sign of life.
        silence: std::time::Duration,
        /// The file that states it.
        path: PathBuf,
    },
    /// Scenes were changed apart, and the dataset does not list the changes yet.
    #[error(
        "'{}' is not finished: {} changed since its manifest was written; run `mateval prep finish {}`",
        path.display(), if scenes.len() == 1 { format!("scene {}", quoted(scenes)) } else { format!("scenes {}", quoted(scenes)) }, path.display()
    )]
    Unfinished { path: PathBuf, scenes: Vec<SceneId> },
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
    /// A file of another version than the one that is read here.
    #[error(
        "'{}' has the format '{found}', and this version of MatEval reads '{expected}': {}",
        path.display(), remedy(found, expected)
    )]
    Format {
        path: PathBuf,
        /// Its format, shortened.
        found: String,
        /// The format that this version reads.
        expected: &'static str,
    },
    /// A file that is valid, but of a kind that is not read here.
    #[error("'{}': unsupported: {what}", path.display())]
    Unsupported {
        path: PathBuf,
        /// What was found and what is supported.
        what: String,
    },
    /// Scenes were requested that the dataset does not have.
    #[error("'{}' has no scene {}; it has {}", dataset.display(), quoted(unknown), quoted(known))]
    UnknownScenes {
        dataset: PathBuf,
        /// The scenes that it does not have.
        unknown: Vec<SceneId>,
        /// All scenes that it has.
        known: Vec<SceneId>,
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
    /// An output exists and replacing it was not allowed.
    #[error("'{}' already exists; choose another {place}, or add --force to overwrite it", path.display())]
    Exists {
        path: PathBuf,
        /// The argument of the command that names the output, as in `--out`.
        place: &'static str,
    },
    /// A picture could not be read or written.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl SceneError {
    /// A constructor of [`SceneError::Io`] for `map_err`.
    pub fn io(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.into();
        move |source| Self::Io { action, path, source }
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
