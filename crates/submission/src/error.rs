//! The one error of this crate.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use mateval_scene::Finding;

use crate::file_fault::FileFault;

/// Why a submission could not be read or checked.
#[derive(Debug, thiserror::Error)]
pub enum SubmissionError {
    /// The file system refused.
    #[error("cannot {action} '{}': {source}", path.display())]
    Io {
        /// What was tried, as in "read" or "write".
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system reported.
        source: std::io::Error,
    },
    /// Neither a folder nor an archive of a known kind.
    #[error("cannot open '{}' as a submission: expected a folder, a .zip or a .tar.gz{hint}", path.display())]
    UnknownKind {
        /// What was named.
        path: PathBuf,
        /// What it is instead, as a sentence's end; empty where that is unknown.
        hint: Cow<'static, str>,
    },
    /// An archive that is refused.
    #[error("cannot unpack '{}':{}", path.display(), Finding::list(findings))]
    Archive {
        /// The archive.
        path: PathBuf,
        /// What is wrong with it; at least one.
        findings: Vec<Finding>,
    },
    /// A file of the submission that nothing can replace.
    #[error("cannot use '{}': {fault}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        fault: FileFault,
    },
    /// The public files of the dataset contradict each other.
    #[error("cannot check against '{}': {fault}; run `mateval prep verify`", scene_file.display())]
    UnsoundScene {
        /// The scene's `scene.json`.
        scene_file: PathBuf,
        /// The contradiction.
        fault: SceneFault,
    },
    /// The dataset or the submission could not be read.
    #[error(transparent)]
    Dataset(#[from] mateval_scene::SceneError),
    /// The tracer cannot work with the scene.
    #[error(transparent)]
    Tracer(#[from] mateval_tracer::TracerError),
    /// A picture could not be read.
    #[error(transparent)]
    Image(#[from] mateval_image::ImageError),
}

impl SubmissionError {
    /// Turns an error of the file system into this one.
    pub(crate) fn io(action: &'static str, path: impl AsRef<Path>) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.as_ref().to_owned();
        move |source| Self::Io { action, path, source }
    }
}

/// What the public files of a scene contradict.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SceneFault {
    /// Every scene has one.
    #[error("expected an input view, found none")]
    NoInputView,
    /// A picture of the input view is not as large as its camera says.
    #[error("expected pictures of {}x{} pixels for the input view, found one of {}x{}", expected[0], expected[1], found[0], found[1])]
    PictureSize {
        /// Width and height by the camera.
        expected: [usize; 2],
        /// Width and height of the picture.
        found: [usize; 2],
    },
}
