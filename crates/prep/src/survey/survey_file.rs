//! `survey.json`: every room that was searched, and the cameras offered in it.

use mateval_dataset::FindingCount;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The value of `format` in this version of the file.
pub const SURVEY_FORMAT: &str = "mateval-survey/2";

/// The file's name in the output's folder.
pub const SURVEY: &str = "survey.json";

/// The name of the folder of thumbnails beside it.
pub(super) const THUMBNAILS: &str = "thumbnails";

/// `survey.json`: every room that was searched.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SurveyFile {
    /// Always `mateval-survey/2`.
    pub format: String,
    /// The program that made the survey and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// Seed of the drawn cameras.
    pub seed: u64,
    /// The rules that drawn cameras keep: `blenderproc` or `3dlg`.
    pub camera_rules: String,
    /// The choice of scenes; null where every accepted room is in the recipe.
    pub selection: Option<Selection>,
    /// Houses in the order of their files.
    pub houses: Vec<SurveyedHouse>,
}

/// Which scenes were chosen, and what they are like on average.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Selection {
    /// Number of scenes that were asked for.
    pub wanted: usize,
    /// Number of rooms that were accepted.
    pub candidates: usize,
    /// Number of scenes that were chosen: fewer where the houses offer no more.
    pub chosen: usize,
    /// The most scenes of one house.
    pub per_house: usize,
    /// The mean number of objects and its target; null where nothing was chosen.
    pub objects: TargetedMean,
    /// The same of super-categories.
    pub super_categories: TargetedMean,
    /// Every room type of the candidates, sorted; the target is an equal number of each.
    pub room_types: Vec<ChosenType>,
}

/// A mean over the chosen scenes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TargetedMean {
    /// The value aimed at.
    pub target: f64,
    /// The value reached; null where nothing was chosen.
    pub mean: Option<f64>,
}

/// A room type and its scenes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ChosenType {
    /// The type, as in `LivingDiningRoom`.
    pub room_type: String,
    /// Number of accepted rooms of this type.
    pub candidates: usize,
    /// Number of them that were chosen.
    pub chosen: usize,
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
    /// Pairs of pieces that intersect, whether they may or not; not searched for in a room with more than `max_objects`
    /// pieces.
    pub intersecting: Vec<IntersectingPair>,
    /// Number of valid pieces whose model or texture is missing.
    pub missing: usize,
    /// Why the room is not offered as a scene; empty where it is offered.
    pub rejections: Vec<Rejection>,
    /// Its place among all accepted rooms by the score of its best camera, from 1; null where it is not accepted.
    pub rank: Option<usize>,
    /// Whether it was chosen as a scene, and why; null where nothing was to be chosen, or it is not accepted.
    pub choice: Option<Choice>,
    /// Cameras to choose from, the best score first.
    pub cameras: Vec<CandidateCamera>,
}

/// Whether an accepted room became a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// Its place in the order of choice, from 1; null where it was not chosen.
    pub place: Option<usize>,
    /// Why.
    pub reason: String,
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
    /// BlenderProc's coverage score of the input view, with the weights of the camera rules.
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

/// Two pieces of furniture that intersect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntersectingPair {
    /// Their names.
    pub pieces: [String; 2],
    /// The shortest way that separates them, in metres, at most 0.5.
    pub depth_m: f64,
    /// The part of the smaller one's volume that lies in the other, 0 to 1.
    pub volume_share: f64,
}

impl std::fmt::Display for IntersectingPair {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [a, b] = &self.pieces;
        write!(f, "'{a}' in '{b}' ({:.3} m, {:.1} %)", self.depth_m, 100.0 * self.volume_share)
    }
}

/// A rule that a room breaks.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rejection {
    /// The key of the rule, or `no_camera`.
    pub rule: String,
    /// What was expected and what was found.
    pub reason: String,
}

impl Rejection {
    pub(super) fn new(rule: &str, reason: impl Into<String>) -> Self {
        Self { rule: rule.to_owned(), reason: reason.into() }
    }
}
