//! The scene that every reader makes, its licence, what is missing of it, and how a far one is moved near to the origin.

use std::sync::Arc;

use glam::{DMat4, DVec3};
use mateval_dataset::lens::Lens;
use mateval_dataset::material::MaterialClass;
use mateval_dataset::material::StatedParameters;
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{Camera, Finding, Role, SceneLights, Severity, SourceKind, TriangleMesh};
use mateval_files::FileError;
use mateval_files::source_folder::{FileFault, LookedFor, SourceFolder};
use mateval_image::photo::PhotoFile;
use mateval_image::texture_io::{FewerBits, is_turned};
use mateval_image::{ImageError, Texels, Texture};

use crate::capture::cameras::CapturedCamera;
use crate::log::Log;

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
    pub files: Vec<String>,
}

impl Missing {
    /// Of the files that a scene names, those that do not exist.
    pub(crate) fn files(looked_for: &LookedFor) -> Self {
        let files: Vec<String> = looked_for.absent.iter().filter(|file| !is_optional(file)).cloned().collect();
        Self {
            what: "files that the scene names",
            wanted: looked_for.hashes.len().saturating_sub(1) + files.len(),
            files,
        }
    }
}

/// A scene as its reader gives it.
#[derive(Clone, Debug, PartialEq)]
pub struct FileScene {
    /// Surfaces, materials, textures and lights, in world space.
    pub scene: ReferenceScene,
    /// Facts about each surface, in the order of `scene.surfaces`.
    pub origins: Vec<InstanceOrigin>,
    /// Whether the file has lights of its own.
    pub lights: SceneLights,
    /// The first camera that can be used; a Mitsuba scene always has one. glTF states no picture size: a glTF's
    /// camera gets 480 columns.
    pub camera: Option<Camera>,
    /// Width over height that a glTF's camera states, where it does.
    pub aspect: Option<f64>,
    /// What was subtracted from the file's positions, in metres.
    pub shift_m: DVec3,
    /// Everything that was left out, replaced or approximated; sorted.
    pub findings: Vec<Finding>,
    /// The licence file beside the scene, if any.
    pub licence: Option<LicenceText>,
    /// The files, relative to the scene's folder with forward slashes.
    pub files: LookedFor,
    /// What the scene cannot do without and is missing.
    pub missing: Missing,
}

/// A scene read from any source, with the camera of a recipe.
#[derive(Clone, Debug)]
pub struct SourceScene {
    pub kind: SourceKind,
    /// Whether the source states the roughness of its materials; otherwise it is a constant of the reader.
    pub states_roughness: bool,
    /// Whether the source states which materials are metallic; otherwise none is.
    pub states_metallic: bool,
    /// The house; scenes with the same house are not independent of each other.
    pub house: String,
    /// The file that findings refer to by default.
    pub file: String,
    /// What was read. Each surface becomes an instance.
    pub read: FileScene,
    pub camera: Camera,
    /// The input photo of a captured room.
    pub captured: Option<CapturedPhoto>,
    /// The photos of other views of a captured room, relative to the source's folder, and their cameras.
    pub novel: Vec<(String, CapturedCamera)>,
    /// The poses of a captured room's input camera by other conventions, each with the change to the stated pose in words.
    pub other_poses: Vec<(&'static str, CapturedCamera)>,
}

/// The photo that the camera of a captured room took.
#[derive(Clone, Debug)]
pub struct CapturedPhoto {
    /// Its path in the folder of the source.
    pub file: String,
    pub photo: PhotoFile,
    /// Its size is that of the photo.
    pub lens: Lens,
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

/// Reports a texture that viewers of photos turn. Blender and Mitsuba do not; browsers do.
pub(crate) fn report_turned(bytes: &[u8], file: &str, place: &str, log: &mut Log) {
    if is_turned(bytes) {
        let message = "its EXIF data states that it should be turned or mirrored";
        let action = "used it as it is stored, as Blender and Mitsuba do; save it without EXIF data";
        log.push(Severity::Warning, "turned_texture", file, place, message, action);
    }
}

/// Beyond this, a number of a colour texture is no reflectance, and below 0 it is none either.
const MOST_REFLECTANCE: f32 = 1.05;
/// A texture of floats whose largest number is smaller is black by mistake.
const LEAST_REFLECTANCE: f32 = 1e-4;
/// A larger share of texels that are no reflectance is no noise of a filter or a codec.
const MOST_STRAY: f64 = 0.01;

/// Why a colour texture cannot be that of a material as it is: its numbers have another range. None for a sound one.
pub(crate) fn other_range(texture: &Texture) -> Option<String> {
    if let Some(words) = FewerBits::of(texture) {
        let FewerBits { bits, largest } = words;
        return Some(format!("16-bit integers that reach only {largest} of 65535, as those of {bits} bits do"));
    }
    let Texels::Linear(texels) = texture.texels() else { return None };
    let numbers = || texels.iter().flatten().copied();
    let stray = texels.iter().filter(|rgb| rgb.iter().any(|value| !(0.0..=MOST_REFLECTANCE).contains(value))).count();
    let share = stray as f64 / texels.len().max(1) as f64;
    let (least, largest) = (numbers().fold(f32::INFINITY, f32::min), numbers().fold(f32::NEG_INFINITY, f32::max));
    if share > MOST_STRAY {
        let percent = 100.0 * share;
        return Some(format!(
            "expected 0 to 1, found {least:?} to {largest:?}, and {percent:.0} % of the texels beyond"
        ));
    }
    let is_tiny = 0.0 < largest && largest < LEAST_REFLECTANCE;
    is_tiny.then(|| format!("expected 0 to 1, found no number above {largest:?}"))
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

#[cfg(test)]
mod tests {
    use mateval_testkit::packed::{turned_jpeg, upright_jpeg};

    use super::*;

    #[test]
    fn textures_of_another_range_are_found() {
        let of = |texels: Texels| other_range(&Texture::new(2, 1, texels, mateval_image::Wrap::Clamp).unwrap());
        let floats = |a: f32, b: f32| of(Texels::Linear(vec![[0.0, a, 0.0], [b; 3]]));
        assert!(floats(0.0, 200.0).unwrap().contains("found 0.0 to 200.0, and 50 %"));
        assert!(floats(0.5, -1.0).unwrap().contains("found -1.0 to 0.5"));
        assert!(floats(0.0, 1e-30).unwrap().contains("1e-30"));
        assert!(of(Texels::Srgb16(vec![[4095; 3], [9; 3]])).unwrap().contains("12 bits"));
        // Twins: reflectances, with the ringing of a codec, and black.
        assert_eq!(
            [floats(0.3, 1.0), floats(0.3, 1.04), floats(0.0, 0.0), floats(0.001, 0.0)],
            [None, None, None, None]
        );
        assert_eq!([of(Texels::Srgb8(vec![[1; 3]; 2])), of(Texels::Srgb16(vec![[65535; 3]; 2]))], [None, None]);
    }

    #[test]
    fn textures_that_viewers_turn_are_found() {
        let found = |bytes: &[u8]| {
            let mut log = Log::new("a.gltf".to_owned(), 10);
            report_turned(bytes, "a.jpg", "/images/0", &mut log);
            log.into_findings().into_iter().map(|finding| (finding.code, finding.file)).collect::<Vec<_>>()
        };
        assert_eq!(found(&turned_jpeg()), [("turned_texture".to_owned(), "a.jpg".to_owned())]);
        assert_eq!(found(&upright_jpeg()), []);
    }

    #[test]
    fn only_far_scenes_are_moved_by_whole_metres() {
        assert_eq!(shift_of(DVec3::new(900.5, 0.0, 0.0)), DVec3::ZERO);
        assert_eq!(shift_of(DVec3::new(448_231.25, 120.125, -354_123.5)), DVec3::new(448_231.0, 120.0, -354_124.0));
        assert_eq!(shift_of(DVec3::NAN), DVec3::ZERO);
        assert_eq!(shift_transform(DVec3::ZERO), DMat4::IDENTITY);
    }
}
