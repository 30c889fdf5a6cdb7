//! The scene that every reader makes, and what they all do while they make it: collect findings, name things apart,
//! move far scenes near to the origin, and count the JSON before it is parsed.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{DMat4, DVec3};
use mateval_dataset::material::MaterialClass;
use mateval_dataset::material::StatedParameters;
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Camera, Finding, Role, SceneLights, Severity, SourceKind, TriangleMesh};
use mateval_files::FileError;
use mateval_files::source_folder::{FileFault, SourceFolder};
use mateval_image::ImageError;

/// A licence that must be passed on with the scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LicenceText {
    /// The file's name in the scene's folder.
    pub file: String,
    pub text: String,
}

/// Facts about an instance besides its mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InstanceOrigin {
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
    /// The mesh before it was moved to its place, at its final size, where the source moves copies of a model: equal
    /// for all copies.
    pub shape: Option<Arc<TriangleMesh>>,
}

/// The names of a licence beside a scene.
const LICENCES: [&str; 3] = ["LICENSE.txt", "LICENSE", "license.txt"];

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

/// The licence beside the scene. A scene must not be passed on without it, so an unreadable licence is a finding.
pub(crate) fn read_licence(source: &mut SourceFolder, log: &mut Log) -> Option<LicenceText> {
    let file = LICENCES.into_iter().find(|name| source.path(name).is_ok())?;
    match source.read(file) {
        Ok(bytes) => Some(LicenceText { file: file.to_owned(), text: String::from_utf8_lossy(&bytes).into_owned() }),
        Err(fault) => {
            let action = "left it out; copy it by hand";
            log.push(Severity::Warning, fault.code, file, "", fault.message, action);
            None
        }
    }
}

/// The fault of a picture. Its message leaves out the path, which the finding gives.
pub(crate) fn picture_fault(code: &'static str, error: &ImageError) -> FileFault {
    let message = match error {
        ImageError::Files(FileError::Io { source, .. }) => source.to_string(),
        ImageError::Invalid { what, .. } | ImageError::Unsupported { what, .. } => what.clone(),
        ImageError::Files(_) | ImageError::PixelCount { .. } => error.to_string(),
    };
    FileFault { code, message }
}

/// A scene whose camera stands farther than this from the origin, in metres, is moved near to it before anything
/// becomes f32. Scenes in map coordinates are.
const NEAR_M: f64 = 1000.0;

/// What is subtracted from the positions of a scene with its camera here: whole metres, or nothing near the origin.
///
/// The camera decides, since positions must be exact near it, and a far background does not matter.
pub(crate) fn shift_of(camera: DVec3) -> DVec3 {
    if camera.is_finite() && camera.length() > NEAR_M { camera.round() } else { DVec3::ZERO }
}

/// Reports a shift that is not zero.
pub(crate) fn report_shift(shift: DVec3, log: &mut Log) {
    if shift != DVec3::ZERO {
        let [x, y, z] = shift.to_array();
        let message =
            format!("the scene lies {:.1} km from the origin, where 32 bits are too coarse", shift.length() / 1e3);
        log.note("far_from_origin", "", message, format!("subtracted ({x}, {y}, {z}) m from all positions"));
    }
}

/// The transform that subtracts a shift.
pub(crate) fn shift_transform(shift: DVec3) -> DMat4 {
    if shift == DVec3::ZERO { DMat4::IDENTITY } else { DMat4::from_translation(-shift) }
}

/// The findings of a scene that is being read, each once.
#[derive(Debug)]
pub struct Log {
    file: String,
    limit: usize,
    findings: BTreeSet<Finding>,
    dropped: usize,
}

impl Log {
    /// An empty log. Findings refer to `file` by default. Findings beyond `limit` are only counted.
    pub fn new(file: String, limit: usize) -> Self {
        Self { file, limit, findings: BTreeSet::new(), dropped: 0 }
    }

    /// The file that findings refer to by default.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Reports that something was left out or replaced.
    pub fn warn(&mut self, code: &str, place: &str, message: impl Into<String>, action: impl Into<String>) {
        let file = self.file.clone();
        self.push(Severity::Warning, code, &file, place, message, action);
    }

    /// Reports that something was read differently from how it is written, without loss.
    pub fn note(&mut self, code: &str, place: &str, message: impl Into<String>, action: impl Into<String>) {
        let file = self.file.clone();
        self.push(Severity::Note, code, &file, place, message, action);
    }

    /// Reports a finding about another file.
    pub fn push(
        &mut self,
        severity: Severity,
        code: &str,
        file: &str,
        place: &str,
        message: impl Into<String>,
        action: impl Into<String>,
    ) {
        if self.findings.len() >= self.limit {
            self.dropped += 1;
            return;
        }
        self.findings.insert(Finding {
            severity,
            code: code.to_owned(),
            file: file.to_owned(),
            place: place.to_owned(),
            message: message.into(),
            action: action.into(),
        });
    }

    /// All findings, sorted.
    pub fn into_findings(mut self) -> Vec<Finding> {
        if self.dropped > 0 {
            let (file, message) = (self.file.clone(), format!("{} findings are not listed", self.dropped));
            self.limit = usize::MAX;
            self.push(Severity::Warning, "too_many_findings", &file, "", message, "only counted them");
        }
        self.findings.into_iter().collect()
    }
}

/// The names given so far.
#[derive(Debug, Default)]
pub(crate) struct UniqueNames {
    taken: BTreeSet<String>,
    /// By name: the last number that was appended to it.
    numbers: BTreeMap<String, usize>,
}

impl UniqueNames {
    /// The name, with `-2`, `-3` and so on appended where it is taken.
    pub(crate) fn unique(&mut self, name: String) -> String {
        let mut unique = name.clone();
        while !self.taken.insert(unique.clone()) {
            let number = self.numbers.entry(name.clone()).or_insert(1);
            *number += 1;
            unique = format!("{name}-{number}");
        }
        unique
    }
}

/// The number of values in a JSON text. It is counted before the text is parsed, since two bytes of text can take a
/// hundred bytes of memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JsonSize {
    /// Commas and colons outside strings.
    pub(crate) values: usize,
    /// Lists and objects.
    pub(crate) containers: usize,
}

impl JsonSize {
    /// Counts the values of the text, which need not be valid.
    pub(crate) fn of(text: &[u8]) -> Self {
        let (mut size, mut in_text, mut escaped) = (Self::default(), false, false);
        for byte in text {
            if in_text {
                in_text = escaped || *byte != b'"';
                escaped = !escaped && *byte == b'\\';
                continue;
            }
            match byte {
                b'"' => in_text = true,
                b',' | b':' => size.values += 1,
                b'[' | b'{' => size.containers += 1,
                _ => {}
            }
        }
        size
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_far_scenes_are_moved_by_whole_metres() {
        assert_eq!(shift_of(DVec3::new(900.5, 0.0, 0.0)), DVec3::ZERO);
        assert_eq!(shift_of(DVec3::new(448_231.25, 120.125, -354_123.5)), DVec3::new(448_231.0, 120.0, -354_124.0));
        assert_eq!(shift_of(DVec3::NAN), DVec3::ZERO);
        assert_eq!(shift_transform(DVec3::ZERO), DMat4::IDENTITY);
    }

    #[test]
    fn findings_are_sorted_unique_and_limited() {
        let mut log = Log::new("scene.xml".into(), 2);
        for code in ["b", "a", "b", "c", "d"] {
            log.warn(code, "", "message", "action");
        }
        let codes: Vec<_> = log.into_findings().into_iter().map(|f| f.code).collect();
        assert_eq!(codes, ["a", "b", "too_many_findings"]);
    }

    #[test]
    fn later_names_are_numbered() {
        let mut names = UniqueNames::default();
        let given = ["lamp", "lamp-2", "lamp", "lamp"].map(|name| names.unique(name.to_owned()));
        assert_eq!(given, ["lamp", "lamp-2", "lamp-3", "lamp-4"]);
    }
}
