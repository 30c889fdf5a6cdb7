//! `survey.json`: every room that was searched, and the cameras offered in it.

use mateval_scene::FindingCount;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::rules::Rejection;

/// The value of `format` in this version of the file.
pub const SURVEY_FORMAT: &str = "mateval-survey/1";

/// The file's name in the output's folder.
pub const SURVEY: &str = "survey.json";

/// The name of the folder of thumbnails beside it.
pub(super) const THUMBNAILS: &str = "thumbnails";

/// `survey.json`: every room that was searched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyFile {
    /// Always `mateval-survey/1`.
    pub format: String,
    /// The program that made the survey and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// Seed of the drawn cameras.
    pub seed: u64,
    /// Houses in the order of their files.
    pub houses: Vec<SurveyedHouse>,
}

/// A house.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyedHouse {
    /// Its file, relative to the source's folder.
    pub file: String,
    /// Its uid; null where the house could not be read.
    pub uid: Option<String>,
    /// Why the house could not be read; null where it could.
    pub error: Option<String>,
    /// Faults of the house, counted by severity and code.
    pub findings: Vec<FindingCount>,
    /// Its rooms, in the file's order.
    pub rooms: Vec<SurveyedRoom>,
}

/// A room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyedRoom {
    /// Its `instanceid` in the house.
    pub room: String,
    /// Its type.
    pub room_type: String,
    /// Number of pieces of furniture placed.
    pub objects: usize,
    /// Number of different super-categories of the furniture.
    pub super_categories: usize,
    /// Sides of the bounding box of the floor, in metres; zeros without a floor.
    pub size_m: [f64; 2],
    /// Pairs of pieces that intersect; not searched for in a room with more than `max_objects` pieces.
    pub intersecting: Vec<[String; 2]>,
    /// Number of valid pieces whose model or texture is missing.
    pub missing: usize,
    /// Why the room is not offered as a scene; empty where it is offered.
    pub rejections: Vec<Rejection>,
    /// Cameras to choose from, the best score first.
    pub cameras: Vec<CandidateCamera>,
}

/// A camera to choose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CandidateCamera {
    /// The scene's id in the recipe.
    pub scene: String,
    /// Where the camera comes from: `seed 3` or `designer 5`.
    pub origin: String,
    /// Position, in metres.
    pub position: [f64; 3],
    /// A point at the middle of the picture, in metres.
    pub target: [f64; 3],
    /// Vertical field of view, in degrees.
    pub fov_y_deg: f64,
    /// BlenderProc's coverage score of the input view.
    pub score: f64,
    /// Distance to the nearest surface in the input view, in metres.
    pub nearest_m: f64,
    /// Share of the pixels of the five views that see the outside.
    pub outside: f64,
    /// Number of pieces of furniture that the input view sees.
    pub seen_objects: usize,
    /// The file of its picture, relative to `survey.json`.
    pub thumbnail: String,
}
