//! What a survey searches, and how.

use std::path::PathBuf;

use mateval_scene::manifest;
use mateval_sources::front3d::camera_rules::CameraRules;

use super::rules::{RejectionLists, SelectionRules};
use super::selection::SelectionGoal;
use super::survey_file::SURVEY_FORMAT;

/// What to search, and how.
#[derive(Clone, Debug)]
pub struct SurveyOptions {
    /// Folder that all paths are relative to, as in a recipe. Where absent it is the current folder or, if a path is
    /// absolute, the lowest folder that contains all of them.
    pub source: Option<PathBuf>,
    /// House files, or folders of house files.
    pub houses: Vec<PathBuf>,
    /// Folder of the 3D-FUTURE models.
    pub models: PathBuf,
    /// Folder of the textures of the architecture.
    pub textures: Option<PathBuf>,
    /// File of the designers' cameras that comes with the houses.
    pub cameras: Option<PathBuf>,
    /// Conditions that a room must meet.
    pub rules: SelectionRules,
    /// Rooms, houses and models that are known to be bad.
    pub lists: RejectionLists,
    /// The rules that drawn cameras keep.
    pub camera_rules: CameraRules,
    /// Seed of the drawn cameras.
    pub seed: u64,
    /// Number of cameras of each room; on average, where the camera rules go by floor area.
    pub cameras_per_room: u32,
    /// Width and height of the scenes' pictures, in pixels.
    pub resolution: [u32; 2],
    /// Vertical field of view of the drawn cameras, in degrees.
    pub fov_y_deg: f64,
    /// Survey these houses only, and leave the survey of all to a later run without any; each is a house's file, relative
    /// to the source's folder, or the file's name without `.json`.
    pub only: Vec<String>,
    /// The scenes to choose; every accepted room where absent.
    pub goal: Option<SelectionGoal>,
    /// Folder of the output.
    pub out: PathBuf,
    /// Replace a survey that already exists.
    pub force: bool,
}

impl SurveyOptions {
    /// The hash of everything but files that decides what is found in a house, and of the tool that searches.
    pub(super) fn sha256(&self, tool: &str) -> String {
        // Every setting is printed with all its fields. The text is read by nobody, and the tool's version stands in it.
        let Self { source: _, houses: _, models, textures, cameras, rules, lists, .. } = self;
        let Self { camera_rules, seed, cameras_per_room, resolution, fov_y_deg, only: _, goal: _, .. } = self;
        let files = format!("{models:?}\n{textures:?}\n{cameras:?}\n{rules:?}\n{lists:?}");
        let cameras = format!("{camera_rules}\n{seed}\n{cameras_per_room}\n{resolution:?}\n{fov_y_deg:?}");
        manifest::sha256_of_bytes(format!("{tool}\n{SURVEY_FORMAT}\n{files}\n{cameras}").as_bytes())
    }
}
