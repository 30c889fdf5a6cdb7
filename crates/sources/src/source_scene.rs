//! What readers of all kinds of source share: findings, files of strangers, and the scene that comes of it.

use std::path::Path;

use crate::error::SourceError;

use mateval_scene::reference::ReferenceScene;
use mateval_scene::source_folder::SourceFolder;
use mateval_scene::{Camera, Finding};

/// A licence that must travel with the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LicenceText {
    /// The file's name in the scene's folder.
    pub file: String,
    /// What it says.
    pub text: String,
}

/// What a source says of an instance beside its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceOrigin {
    /// What it is, as in `Dining Chair`.
    pub category: Option<String>,
    /// The broader category, as in `Chair`.
    pub super_category: Option<String>,
    /// The part of each triangle, 0, 1, ...; none: connected components are its parts.
    pub part_of_triangle: Option<Vec<usize>>,
}

/// A scene from any source, ready to be numbered, unwrapped and looked at.
#[derive(Clone, Debug)]
pub struct SourceScene {
    /// `bitterli` or `front3d`.
    pub kind: &'static str,
    /// What scenes that are not independent of each other have in common.
    pub house: String,
    /// The file that findings are about unless they say otherwise.
    pub file: String,
    /// World space; surface k becomes instance k.
    pub scene: ReferenceScene,
    /// One a surface.
    pub origins: Vec<InstanceOrigin>,
    /// The input view's.
    pub camera: Camera,
    /// What was wrong; sorted.
    pub findings: Vec<Finding>,
    /// The licence that came with it.
    pub licence: Option<LicenceText>,
    /// Every file read and its SHA-256 in hex; sorted.
    pub files: Vec<(String, String)>,
    /// Every file that was looked for and was not there; sorted.
    pub absent: Vec<String>,
}

/// The folder of the file at `path`, that file's name and its bytes; it may have at most `most_bytes`, others of the
/// folder `file_bytes`.
pub fn open(path: &Path, most_bytes: u64, file_bytes: u64) -> Result<(SourceFolder, String, Vec<u8>), SourceError> {
    let io = |source| SourceError::Io { path: path.to_owned(), source };
    let invalid = |what: String| SourceError::Invalid { path: path.to_owned(), what };
    let size = std::fs::metadata(path).map_err(io)?.len();
    if size > most_bytes {
        return Err(invalid(format!("expected at most {most_bytes} bytes, found {size}")));
    }
    let name = path.file_name().map(|name| name.to_string_lossy().into_owned());
    let name = name.ok_or_else(|| invalid("expected the path of a file".to_owned()))?;
    let mut folder = SourceFolder::new(path.parent().unwrap_or(Path::new("")), file_bytes).map_err(io)?;
    let bytes = folder.read(&name).map_err(|fault| invalid(fault.message))?;
    Ok((folder, name, bytes))
}
