//! The faults for which a scene of a recipe is refused while it is made.

use mateval_dataset::{Finding, Severity};
use mateval_files::source_folder::FileFault;
use mateval_image::ImageError;
use mateval_image::photo::CameraExposure;
use mateval_sources::blend::BakeFault;
use mateval_sources::front3d::camera_sampler::CameraError;

use super::labels::LabelFault;
use super::parts::TooMany;
use crate::recipe::fault::RecipeSceneFault;

/// Why a scene cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum BuildFault {
    /// The recipe's entry of the scene is not valid.
    #[error(transparent)]
    Recipe(#[from] RecipeSceneFault),
    #[error("the source has no surface that could be read{}", causes(findings))]
    NoSurfaces {
        /// Everything that was wrong with the source.
        findings: Vec<Finding>,
    },
    /// The scene has more instances or parts than pictures can hold.
    #[error(transparent)]
    TooMany(#[from] TooMany),
    #[error("its files differ from the recipe's `inputs`: {}", joined(faults))]
    Pins { faults: Vec<PinFault> },
    #[error("{}", joined(faults))]
    Labels {
        /// Each file that does not fit.
        faults: Vec<LabelFault>,
    },
    /// The Blender file cannot be read.
    #[error(transparent)]
    Bake(#[from] BakeFault),
    #[error("photo: {0}")]
    Photo(PhotoFault),
    #[error("measured: {0}")]
    Measured(RegionFault),
    /// The input view shows no instance that has an atlas.
    #[error(
        "the camera sees nothing that is scored: no pixel is valid in the input view; choose another camera{}{}",
        if *captured { ", or check that mesh and cameras share a world, a unit and a convention of axes" } else { "" },
        causes(findings)
    )]
    NothingSeen {
        /// Whether the camera is that of a captured room.
        captured: bool,
        findings: Vec<Finding>,
    },
    #[error("{message}; at most {:.0} % may be {allowed}{}", 100.0 * most, causes(findings))]
    TooMuch {
        message: String,
        /// The largest share that is accepted.
        most: f64,
        /// What it is a share of, and how to have more accepted.
        allowed: &'static str,
        findings: Vec<Finding>,
    },
    #[error(
        "none of the scene's {lights} lights reaches the input view, or too little of it for its exposure: its picture would \
         be black; add a light, raise `exposure`, or state a photo{}",
        causes(findings)
    )]
    NoLight {
        /// Groups of lights.
        lights: usize,
        findings: Vec<Finding>,
    },
    #[error("the source's film is {width}x{height}; state a resolution of {least} to {most} a side in the recipe")]
    FilmSize { width: u32, height: u32, least: u32, most: u32 },
    /// A camera by position and target looks nowhere, or straight up or down.
    #[error("camera: position and target must differ, and not only in height")]
    CameraDirection,
    /// A glTF has no camera, and neither has the recipe.
    #[error(
        "the file has no perspective camera; add one, or state it in the recipe, as in \
         `camera = {{ position = [4.0, 1.5, 3.0], target = [1.0, 0.8, 0.5], fov_y_deg = 50 }}`{}",
        causes(findings)
    )]
    NoCameraInFile { findings: Vec<Finding> },
    /// The house has no such room, or no such designer's camera.
    #[error("the house has no {wanted}; it has {known}")]
    NotInHouse { wanted: String, known: String },
    /// No drawn camera was accepted.
    #[error(transparent)]
    DrawnCamera(#[from] CameraError),
}

/// Why a photo cannot be the input picture.
#[derive(Debug, thiserror::Error)]
pub enum PhotoFault {
    /// The file lies outside the folder, cannot be read or is too large.
    #[error(transparent)]
    File(#[from] FileFault),
    /// The file is not a valid photo.
    #[error(transparent)]
    Picture(#[from] ImageError),
    #[error(
        "'{file}' is black: its largest number is {largest:?}, with the exposure {exposure}; expected a photo whose brightest \
         pixels are near 1 with it; state another `exposure`, or fix the photo"
    )]
    Black { file: String, largest: f32, exposure: f64 },
    #[error(
        "'{file}' is {}x{}, and its camera states {}x{}; use the photo that the cameras were computed from, and no thumbnail \
         or enlarged copy of it",
        found[0], found[1], stated[0], stated[1]
    )]
    OtherSize { file: String, found: [u32; 2], stated: [u32; 2] },
    #[error(
        "'{file}' is {}x{}, and its camera's principal point {point:?}, in pixels: expected a point in the middle half; use \
         the photo that the cameras were computed from, and no thumbnail or enlarged copy of it",
        found[0], found[1]
    )]
    PrincipalPoint { file: String, found: [u32; 2], point: [f64; 2] },
    #[error(
        "'{file}' cannot be undistorted over its whole picture: k1, k2, p1, p2 are {k:?}; undistort or crop it with the \
         program that computed its camera"
    )]
    Lens { file: String, k: [f64; 4] },
    #[error(
        "'{file}' holds integers, which are clipped at their largest number; leave out `white`, which is for photos of \
         floating-point numbers"
    )]
    White { file: String },
    #[error(
        "nearly all pixels of '{file}' reach `white`, {white}; expected the number at which its bright pixels are cut off"
    )]
    Clipped { file: String, white: f64 },
    #[error(
        "'{file}': `exposures` states {table}, and the EXIF data of the photo {exif}; correct the one that is wrong, \
         or remove the EXIF data"
    )]
    Exposures { file: String, table: CameraExposure, exif: CameraExposure },
    #[error(
        "'{file}' states no exposure in its EXIF data (time, ISO and f-number), as `exif` expects; state it in \
         `exposures`, or leave `exif` out"
    )]
    NoExposure { file: String },
    /// The photo shows more or less than the camera, or is smaller than its picture.
    #[error(
        "'{file}' is {}x{}, expected the proportions of the camera's picture, {}x{}, and at least its size; \
         crop the photo, or state another `resolution`",
        found[0], found[1], expected[0], expected[1]
    )]
    Size {
        file: String,
        /// Columns and rows of the photo.
        found: [u32; 2],
        /// Columns and rows of the camera's picture.
        expected: [u32; 2],
    },
}

/// Why measured colours cannot be scored.
#[derive(Debug, thiserror::Error)]
pub enum RegionFault {
    #[error(transparent)]
    File(#[from] FileFault),
    #[error(transparent)]
    Picture(#[from] ImageError),
    #[error("no region is of the photo '{photo}'; there are those of {known}")]
    OtherPhotos { photo: String, known: String },
    #[error("'{mask}' is {}x{}, and the photo {}x{}: expected a pixel for each of the photo's", found[0], found[1], expected[0], expected[1])]
    Size { mask: String, found: [u32; 2], expected: [u32; 2] },
    #[error("'{mask}' does not show the region '{name}', the value {value}")]
    Absent { mask: String, name: String, value: String },
    #[error("{count} regions; expected at most {}", u16::MAX)]
    TooMany { count: usize },
    #[error(
        "none of the {count} regions shows a valid pixel of the input view: they lie outside of it, or the mesh has holes there"
    )]
    NoneSeen { count: usize },
}

/// A file that differs from those that the recipe pins.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PinFault {
    #[error("'{file}' has the hash {found}, expected {pinned}")]
    Changed { file: String, found: String, pinned: String },
    #[error("'{file}' was read but is not in `inputs`")]
    Unlisted { file: String },
    #[error("'{file}' is in `inputs` but was not read")]
    Unread { file: String },
}

/// The findings that may be the cause of a fault.
pub(super) fn above_notes(findings: &[Finding]) -> Vec<Finding> {
    let mut causes: Vec<Finding> = findings.iter().filter(|found| found.severity != Severity::Note).cloned().collect();
    causes.sort();
    causes
}

/// What was found before a fault, which may be its cause.
fn causes(findings: &[Finding]) -> String {
    const MOST: usize = 8;
    let shown = &findings[..findings.len().min(MOST)];
    let more = match findings.len() - shown.len() {
        0 => String::new(),
        more => format!("\n  and {more} more"),
    };
    if shown.is_empty() {
        return String::new();
    }
    format!("\nfound before, and perhaps the cause:{}{more}", Finding::list(shown))
}

fn joined<T: std::fmt::Display>(faults: &[T]) -> String {
    faults.iter().map(T::to_string).collect::<Vec<_>>().join("; ")
}
