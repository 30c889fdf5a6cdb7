//! Opens the main file of a source within limits, and the error of this crate: a source could not be read at all. Lesser
//! faults are findings.

use std::path::{Path, PathBuf};

use mateval_dataset::DatasetError;
use mateval_dataset::gltf_file::GltfError;
use mateval_files::FileError;
use mateval_files::source_folder::SourceFolder;

/// Why a source could not be read.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    #[error(transparent)]
    Files(#[from] FileError),
    /// What Blender has made of its own file cannot be read.
    #[error(transparent)]
    Baked(#[from] DatasetError),
    /// The content of a file is not that of a source, or exceeds a limit.
    #[error("'{}': {what}", path.display())]
    Invalid {
        path: PathBuf,
        /// What was expected and what was found.
        what: String,
    },
}

/// What was expected of a file or a value in it, and what was found. It becomes a [`SourceError`] or a finding.
#[derive(Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub(crate) struct Invalid(pub(crate) String);

impl Invalid {
    pub(crate) fn new(what: &str) -> Self {
        Self(what.to_owned())
    }

    pub(crate) fn in_file(self, path: &Path) -> SourceError {
        SourceError::Invalid { path: path.to_owned(), what: self.0 }
    }
}

impl From<GltfError> for Invalid {
    fn from(error: GltfError) -> Self {
        Self(error.to_string())
    }
}

/// Reads the file at `path`, which may have at most `most` bytes. Returns its folder, its name and its bytes. Other
/// files of the folder may have at most `file_bytes`.
pub(crate) fn open(path: &Path, most: u64, file_bytes: u64) -> Result<(SourceFolder, String, Vec<u8>), SourceError> {
    let invalid = |what: String| Invalid(what).in_file(path);
    let found = std::fs::metadata(path).map_err(FileError::io("read", path))?.len();
    if found > most {
        return Err(invalid(format!("expected at most {most} bytes, found {found}")));
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| invalid("expected the path of a file".to_owned()))?;
    let parent = path.parent().unwrap_or(Path::new(""));
    let mut folder = SourceFolder::new(parent, file_bytes).map_err(FileError::io("read", path))?;
    let bytes = folder.read(&name).map_err(|fault| invalid(fault.message))?;
    Ok((folder, name, bytes))
}

/// Fails where a JSON text, which need not be valid, has more values (numbers, texts, lists, objects) or lists and objects
/// than these. They are counted before the text is parsed, since two bytes of text can take a hundred bytes of memory.
pub(crate) fn check_json(text: &[u8], most_values: usize, most_containers: usize) -> Result<(), Invalid> {
    // Commas and colons outside strings, and opening brackets.
    let (mut values, mut containers, mut in_text, mut escaped) = (0, 0, false, false);
    for byte in text {
        if in_text {
            in_text = escaped || *byte != b'"';
            escaped = !escaped && *byte == b'\\';
            continue;
        }
        match byte {
            b'"' => in_text = true,
            b',' | b':' => values += 1,
            b'[' | b'{' => containers += 1,
            _ => {}
        }
    }
    if values <= most_values && containers <= most_containers {
        return Ok(());
    }
    Err(Invalid(format!(
        "expected JSON of at most {most_values} values and {most_containers} lists and objects, found {values} and \
         {containers}"
    )))
}
