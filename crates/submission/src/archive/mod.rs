//! Submissions as archives: `.zip` and `.tar.gz`, unpacked to a folder of their own within limits.
//!
//! An archive is untrusted input. Nothing is written outside its folder: absolute names, names that lead out, links,
//! devices and repeated names all refuse the archive. Bytes are counted while they are unpacked; the sizes that the
//! archive states are not relied on. Memory does not grow with the archive.

mod tar_gz;
mod unpacked;
mod zip;

use std::borrow::Cow;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use mateval_dataset::submission::SUBMISSION;
use mateval_files::FileError;
use mateval_files::untrusted::hint;

use crate::error::SubmissionError;
pub use tar_gz::unpack_tar_gz;
pub use unpacked::{ALWAYS_ALLOWED, Fault, MAX_ENTRIES, MAX_RATIO, MAX_UNPACKED};
pub use zip::unpack_zip;

/// A submission's folder. If it was unpacked from an archive, it is removed when this is dropped.
#[derive(Debug)]
pub struct Opened {
    root: PathBuf,
    _unpacked: Option<tempfile::TempDir>,
}

impl Opened {
    /// The folder that holds `submission.json` and `scenes/`.
    pub fn root(&self) -> &Path {
        &self.root
    }
}

/// Opens a submission: a folder as it is, an archive after unpacking it to a new folder in `work`. An archive may hold
/// the submission itself, or one folder that holds it.
pub fn open(path: &Path, work: &Path) -> Result<Opened, SubmissionError> {
    let data = std::fs::metadata(path).map_err(FileError::io("read", path))?;
    if data.is_dir() {
        return Ok(Opened { root: path.to_owned(), _unpacked: None });
    }
    let unpack = kind_of(path, &data)?;
    let folder = tempfile::Builder::new()
        .prefix("mateval-unpacked-")
        .tempdir_in(work)
        .map_err(FileError::io("make a folder in", work))?;
    let file = std::fs::File::open(path).map_err(FileError::io("read", path))?;
    unpack(file, folder.path()).map_err(|fault| refused(fault, path, folder.path()))?;
    Ok(Opened { root: root_of(folder.path()), _unpacked: Some(folder) })
}

/// The first block of a tar, whose magic is `ustar` at [`TAR_MAGIC_AT`] (POSIX.1-2017, pax, "ustar Interchange
/// Format").
const START_BYTES: u64 = 512;
const TAR_MAGIC_AT: usize = 257;

type Unpack = fn(std::fs::File, &Path) -> Result<(), Fault>;

/// The kind of an archive by its first bytes; its name proves nothing.
fn kind_of(path: &Path, data: &std::fs::Metadata) -> Result<Unpack, SubmissionError> {
    let mut start = Vec::new();
    // Something that may be endless, such as a pipe, is not opened.
    if data.is_file() {
        let file = std::fs::File::open(path).map_err(FileError::io("read", path))?;
        file.take(START_BYTES).read_to_end(&mut start).map_err(FileError::io("read", path))?;
    }
    match start.as_slice() {
        [b'P', b'K', 3, 4, ..] | [b'P', b'K', 5, 6, ..] => Ok(unpack_zip),
        [0x1f, 0x8b, ..] => Ok(unpack_tar_gz),
        _ => {
            let hint = match start.get(TAR_MAGIC_AT..) {
                _ if !data.is_file() => Cow::Borrowed(""),
                Some(magic) if magic.starts_with(b"ustar") => Cow::Borrowed("; it is a .tar; compress it with `gzip`"),
                _ => hint(&start),
            };
            Err(SubmissionError::UnknownKind { path: path.to_owned(), hint })
        }
    }
}

/// The folder with `submission.json`: the unpacked one, or the only one in it that holds that file.
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

fn refused(fault: Fault, archive: &Path, folder: &Path) -> SubmissionError {
    match fault {
        Fault::Refused(findings) => SubmissionError::Archive { path: archive.to_owned(), findings },
        Fault::Io(source) => FileError::io("unpack to", folder)(source).into(),
    }
}
