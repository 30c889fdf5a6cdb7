//! The scene that every reader makes, and the opening of a source's main file.

use std::path::Path;
use std::sync::Arc;

use crate::error::{InvalidSource, SourceError};

use glam::DVec3;
use mateval_scene::material::StatedParameters;
use mateval_scene::material_class::MaterialClass;
use mateval_scene::reference::ReferenceScene;
use mateval_scene::source_folder::SourceFolder;
use mateval_scene::{Camera, Finding, Role, SceneLights, SourceKind, TriangleMesh};

/// A licence that must be passed on with the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LicenceText {
    /// The file's name in the scene's folder.
    pub file: String,
    /// The file's text.
    pub text: String,
}

/// Facts about an instance besides its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceOrigin {
    /// Its role in the scene.
    pub role: Role,
    /// Its category, as in `Dining Chair`.
    pub category: Option<String>,
    /// Its broader category, as in `Chair`.
    pub super_category: Option<String>,
    /// The part of each triangle, numbered from 0. Without it, connected components are the parts.
    pub part_of_triangle: Option<Vec<usize>>,
    /// The class of material of each part, by its number in `part_of_triangle`, where the reader states it; none of a
    /// part whose triangles belong to several.
    pub class_of_part: Option<Vec<Option<MaterialClass>>>,
    /// Which parameters of its material the source states.
    pub stated: StatedParameters,
    /// The mesh before it was moved to its place, at its final size, where the source moves copies of a model: equal for all
    /// copies.
    pub shape: Option<Arc<TriangleMesh>>,
}

/// The names of a licence beside a scene.
pub(crate) const LICENCES: [&str; 3] = ["LICENSE.txt", "LICENSE", "license.txt"];

/// Whether a scene that lacks this file lacks nothing.
pub(crate) fn is_optional(file: &str) -> bool {
    LICENCES.contains(&file)
}

/// What a scene names and its folder does not hold.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Missing {
    /// As in `models and textures`.
    pub what: &'static str,
    /// How many of them the scene names.
    pub wanted: usize,
    /// The paths of the missing ones.
    pub files: Vec<String>,
}

impl Missing {
    /// Of the files that a scene names, those that do not exist.
    pub fn files(read: &[(String, String)], absent: &[String]) -> Self {
        let files: Vec<String> = absent.iter().filter(|file| !is_optional(file)).cloned().collect();
        Self { what: "files that the scene names", wanted: read.len().saturating_sub(1) + files.len(), files }
    }
}

/// A scene read from any source.
#[derive(Clone, Debug)]
pub struct SourceScene {
    /// The kind of source.
    pub kind: SourceKind,
    /// Whether the source describes the scene's lights.
    pub lights: SceneLights,
    /// Whether the source states the roughness of its materials; otherwise it is a constant of the reader.
    pub states_roughness: bool,
    /// Whether the source states which materials are metallic; otherwise none is.
    pub states_metallic: bool,
    /// The house; scenes with the same house are not independent of each other.
    pub house: String,
    /// The file that findings refer to by default.
    pub file: String,
    /// Geometry, materials and lights in world space. Each surface becomes an instance.
    pub scene: ReferenceScene,
    /// Facts about each surface, in the order of `scene.surfaces`.
    pub origins: Vec<InstanceOrigin>,
    /// The camera of the input view.
    pub camera: Camera,
    /// What was subtracted from the source's positions, in metres.
    pub shift_m: DVec3,
    /// Faults of the input; sorted.
    pub findings: Vec<Finding>,
    /// The licence beside the source, if any.
    pub licence: Option<LicenceText>,
    /// Every file that was read and its SHA-256 in hex; sorted.
    pub files: Vec<(String, String)>,
    /// Every file that was looked for but is missing; sorted.
    pub absent: Vec<String>,
    /// What the scene cannot do without and is missing.
    pub missing: Missing,
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
