//! Opens the main file of a source. A fault here means that a source could not be read at all; lesser faults are
//! findings.

use std::path::{Path, PathBuf};

use mateval_files::FileError;
use mateval_files::source_folder::{FileFault, SourceFolder};

use crate::bitterli::BitterliError;
use crate::front3d::HouseError;
use crate::gltf::GltfSceneError;

/// Why a source could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// The content of a file is not that of a source, or exceeds a limit.
    #[error("'{}': {reason}", path.display())]
    Invalid {
        path: PathBuf,
        /// What was expected and what was found.
        reason: InvalidSource,
    },
}

impl SourceError {
    pub(crate) fn invalid(path: &Path, reason: InvalidSource) -> Self {
        Self::Invalid { path: path.to_owned(), reason }
    }
}

/// Why the content of a file is not that of a source.
#[derive(Debug, thiserror::Error)]
pub enum InvalidSource {
    #[error("expected at most {most} bytes, found {found}")]
    TooLarge { most: u64, found: u64 },
    #[error("expected the path of a file")]
    NotAFile,
    #[error("{}", .0.message)]
    Unreadable(FileFault),
    #[error("expected UTF-8, found other bytes{hint}")]
    NotUtf8 {
        /// What the file is instead, and what to do; empty where that is not known.
        hint: String,
    },
    #[error(transparent)]
    Bitterli(BitterliError),
    #[error(transparent)]
    House(HouseError),
    #[error(transparent)]
    Gltf(GltfSceneError),
}

/// Reads the file at `path`, which may have at most `most` bytes. Returns its folder, its name and its bytes. Other
/// files of the folder may have at most `file_bytes`.
pub fn open(path: &Path, most: u64, file_bytes: u64) -> Result<(SourceFolder, String, Vec<u8>), SourceError> {
    let invalid = |reason| SourceError::invalid(path, reason);
    let found = std::fs::metadata(path).map_err(FileError::io("read", path))?.len();
    if found > most {
        return Err(invalid(InvalidSource::TooLarge { most, found }));
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| invalid(InvalidSource::NotAFile))?;
    let mut folder =
        SourceFolder::new(path.parent().unwrap_or(Path::new("")), file_bytes).map_err(FileError::io("read", path))?;
    let bytes = folder.read(&name).map_err(|fault| invalid(InvalidSource::Unreadable(fault)))?;
    Ok((folder, name, bytes))
}
