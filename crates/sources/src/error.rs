//! Opens the main file of a source. A fault here means that a source could not be read at all; lesser faults are findings.

use std::path::{Path, PathBuf};

use mateval_scene::source_folder::{FileFault, SourceFolder};

use crate::bitterli::BitterliError;
use crate::front3d::HouseError;
use crate::gltf::GltfSceneError;

/// Why a source could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    /// An operation of the file system failed.
    #[error("cannot read '{}': {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// The content of a file is not that of a source, or exceeds a limit.
    #[error("'{}': {reason}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// What was expected and what was found.
        reason: InvalidSource,
    },
}

impl SourceError {
    /// A [`SourceError::Invalid`].
    pub(crate) fn invalid(path: &Path, reason: InvalidSource) -> Self {
        Self::Invalid { path: path.to_owned(), reason }
    }
}

/// Why the content of a file is not that of a source.
#[derive(Debug, thiserror::Error)]
pub enum InvalidSource {
    /// The file is too large.
    #[error("expected at most {most} bytes, found {found}")]
    TooLarge {
        /// The most bytes allowed.
        most: u64,
        /// Bytes of the file.
        found: u64,
    },
    /// The path has no file name.
    #[error("expected the path of a file")]
    NotAFile,
    /// The source's folder refused the file.
    #[error("{}", .0.message)]
    Unreadable(FileFault),
    /// The file is not text.
    #[error("expected UTF-8, found other bytes{hint}")]
    NotUtf8 {
        /// What the file is instead, and what to do; empty where that is not known.
        hint: String,
    },
    /// The file is not a Mitsuba scene.
    #[error(transparent)]
    Bitterli(BitterliError),
    /// The file is not a 3D-FRONT house.
    #[error(transparent)]
    House(HouseError),
    /// The file is not a glTF scene that can be read.
    #[error(transparent)]
    Gltf(GltfSceneError),
}

/// Reads the file at `path`, which may have at most `most` bytes. Returns its folder, its name and its bytes. Other files
/// of the folder may have at most `file_bytes`.
pub fn open(path: &Path, most: u64, file_bytes: u64) -> Result<(SourceFolder, String, Vec<u8>), SourceError> {
    let io = |source| SourceError::Io { path: path.to_owned(), source };
    let invalid = |reason| SourceError::invalid(path, reason);
    let found = std::fs::metadata(path).map_err(io)?.len();
    if found > most {
        return Err(invalid(InvalidSource::TooLarge { most, found }));
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| invalid(InvalidSource::NotAFile))?;
    let mut folder = SourceFolder::new(path.parent().unwrap_or(Path::new("")), file_bytes).map_err(io)?;
    let bytes = folder.read(&name).map_err(|fault| invalid(InvalidSource::Unreadable(fault)))?;
    Ok((folder, name, bytes))
}
