//! What a survey searches, and how.

use std::path::PathBuf;

use super::rules::{RejectionLists, SelectionRules};

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
    /// Seed of the drawn cameras.
    pub seed: u64,
    /// Number of cameras drawn in each room.
    pub cameras_per_room: u32,
    /// Width and height of the scenes' pictures, in pixels.
    pub resolution: [u32; 2],
    /// Vertical field of view of the drawn cameras, in degrees.
    pub fov_y_deg: f64,
    /// Folder of the output.
    pub out: PathBuf,
    /// Replace a survey that already exists.
    pub force: bool,
}
