//! Submissions as archives: `.zip` and `.tar.gz`, unpacked to a folder of their own within limits.
//!
//! A stranger made the archive. So nothing is written outside that folder: names that are absolute or lead out, links and
//! devices refuse the archive, as do names that are there twice. What is unpacked is counted while it is unpacked; it is not
//! believed what the archive says of its own size. Memory does not grow with the archive.

mod entry;
mod limits;
mod tar_gz;
mod zip;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use mateval_scene::submission::SUBMISSION;
use mateval_scene::{Finding, Severity};

pub use limits::{ALWAYS_ALLOWED, MAX_ENTRIES, MAX_RATIO, MAX_UNPACKED};
pub use tar_gz::unpack_tar_gz;
pub use zip::unpack_zip;

use crate::error::SubmissionError;

/// A submission's folder; one that was unpacked is removed when this is dropped.
#[derive(Debug)]
pub struct Opened {
    root: PathBuf,
    _unpacked: Option<tempfile::TempDir>,
}

impl Opened {
    /// Where `submission.json` and `scenes/` are.
    pub fn root(&self) -> &Path {
        &self.root
    }
}

/// Opens a submission: a folder as it is, an archive unpacked below `work`. An archive may hold the submission in one folder
/// of its own.
pub fn open(path: &Path, work: &Path) -> Result<Opened, SubmissionError> {
    let data = std::fs::metadata(path).map_err(SubmissionError::io("read", path))?;
    if data.is_dir() {
        return Ok(Opened { root: path.to_owned(), _unpacked: None });
    }
    let unpack = kind_of(path, &data)?;
    let folder = tempfile::Builder::new()
        .prefix("mateval-unpacked-")
        .tempdir_in(work)
        .map_err(SubmissionError::io("make a folder in", work))?;
    let file = std::fs::File::open(path).map_err(SubmissionError::io("read", path))?;
    unpack(file, folder.path()).map_err(|fault| fault.of(path, folder.path()))?;
    Ok(Opened { root: root_of(folder.path()), _unpacked: Some(folder) })
}

type Unpack = fn(std::fs::File, &Path) -> Result<(), Fault>;

/// By the first bytes; the name may say anything.
fn kind_of(path: &Path, data: &std::fs::Metadata) -> Result<Unpack, SubmissionError> {
    let mut start = Vec::new();
    // What has no end, as a pipe, is not begun.
    if data.is_file() {
        let file = std::fs::File::open(path).map_err(SubmissionError::io("read", path))?;
        file.take(4).read_to_end(&mut start).map_err(SubmissionError::io("read", path))?;
    }
    match start.as_slice() {
        [b'P', b'K', 3, 4] | [b'P', b'K', 5, 6] => Ok(unpack_zip),
        [0x1f, 0x8b, ..] => Ok(unpack_tar_gz),
        _ => Err(SubmissionError::UnknownKind { path: path.to_owned() }),
    }
}

/// The folder with `submission.json`: the archive's own, or the only one in it that has it.
fn root_of(folder: &Path) -> PathBuf {
    if folder.join(SUBMISSION).exists() {
        return folder.to_owned();
    }
    let inside = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let holding: Vec<PathBuf> = inside.filter(|path| path.join(SUBMISSION).is_file()).take(2).collect();
    match holding.as_slice() {
        [only] => only.clone(),
        _ => folder.to_owned(),
    }
}

/// Why an archive is not unpacked.
#[derive(Debug)]
pub enum Fault {
    /// What is wrong with it; at least one.
    Refused(Vec<Finding>),
    /// The file system refused.
    Io(std::io::Error),
}

impl Fault {
    /// An archive that is refused as a whole.
    fn refused(code: &str, message: impl Into<String>, action: &str) -> Self {
        Self::Refused(vec![refusal(code, "", message, action)])
    }

    fn of(self, archive: &Path, folder: &Path) -> SubmissionError {
        match self {
            Self::Refused(findings) => SubmissionError::Archive { path: archive.to_owned(), findings },
            Self::Io(source) => SubmissionError::io("unpack to", folder)(source),
        }
    }
}

impl From<std::io::Error> for Fault {
    fn from(error: std::io::Error) -> Self {
        Self::Io(error)
    }
}

/// A finding about one entry, or about the whole archive where `entry` is empty.
fn refusal(code: &str, entry: &str, message: impl Into<String>, action: &str) -> Finding {
    Finding {
        severity: Severity::Error,
        code: code.to_owned(),
        file: mateval_scene::findings::shortened(entry),
        place: String::new(),
        message: message.into(),
        action: action.to_owned(),
    }
}
