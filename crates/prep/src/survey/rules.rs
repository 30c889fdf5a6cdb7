//! What a survey is asked for, and which rooms become scenes.
//!
//! The conditions are limits in a TOML file.

use std::path::{Path, PathBuf};

use mateval_files::untrusted::sha256_of_bytes;
use mateval_sources::front3d::camera_rules::CameraRules;
use schemars::JsonSchema;
use serde::Deserialize;

use super::selection::SelectionGoal;
use super::survey_file::{IntersectingPair, Rejection, SURVEY_FORMAT};
use crate::error::PrepError;
use crate::recipe::{Redress, read_text};

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
    /// Survey these houses only, and leave the survey of all to a later run without any; each is a house's file,
    /// relative to the source's folder, or the file's name without `.json`.
    pub only: Vec<String>,
    /// The scenes to choose; every accepted room where absent.
    pub goal: Option<SelectionGoal>,
    /// What the recipe's scenes are redressed with; they are not where absent. Its paths are relative to the current
    /// folder, not to the source's.
    pub redress: Option<Redress>,
    pub out: PathBuf,
    /// Replace a survey that already exists.
    pub force: bool,
}

impl SurveyOptions {
    /// The hash of everything but files that decides what is found in a house, and of the tool that searches.
    pub(super) fn sha256(&self, tool: &str) -> String {
        // Every setting is printed with all its fields. The text is read by nobody, and the tool's version stands in
        // it.
        let Self { source: _, houses: _, models, textures, cameras, rules, .. } = self;
        let Self { camera_rules, seed, cameras_per_room, resolution, fov_y_deg, only: _, goal: _, .. } = self;
        let files = format!("{models:?}\n{textures:?}\n{cameras:?}\n{rules:?}");
        let cameras = format!("{camera_rules}\n{seed}\n{cameras_per_room}\n{resolution:?}\n{fov_y_deg:?}");
        sha256_of_bytes(format!("{tool}\n{SURVEY_FORMAT}\n{files}\n{cameras}").as_bytes())
    }
}

/// The TOML file of the rules of a survey: conditions that a room must meet.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SelectionRules {
    /// Accepted room types, as in `LivingDiningRoom`; any type if absent or empty.
    pub room_types: Vec<String>,
    /// Smallest number of pieces of furniture placed.
    pub min_objects: usize,
    /// Largest number of pieces of furniture placed.
    pub max_objects: usize,
    /// Smallest number of super-categories that the furniture belongs to.
    pub min_super_categories: usize,
    /// Longest sides of the bounding box of the floor, along X and along Z.
    pub max_size_m: [f64; 2],
    /// Largest number of pairs of pieces that intersect beyond `max_intersection_depth_m` or `max_intersection_volume`.
    pub max_intersecting: usize,
    /// How deep a piece may stand in another: the shortest way that separates them.
    pub max_intersection_depth_m: f64,
    /// How much of the smaller piece's volume may lie in the other, 0 to 1.
    pub max_intersection_volume: f64,
    /// Largest number of valid pieces whose model or texture is missing.
    pub max_missing: usize,
    /// Largest share of the pixels of the five views that see the outside, 0 to 1.
    pub max_outside: f64,
    /// Smallest number of pieces that the input view sees.
    pub min_seen_objects: usize,
    /// Smallest distance from the camera to a surface that any of the five views sees. Designers place cameras close to
    /// objects, while drawn cameras keep a metre away; but some of the designers' cameras lie in the plane of a wall,
    /// and half of such a picture is noise.
    pub min_nearest_m: f64,
}

impl Default for SelectionRules {
    /// The sizes are those that ATISS uses for living rooms.
    fn default() -> Self {
        Self {
            room_types: Vec::new(),
            min_objects: 3,
            max_objects: 60,
            min_super_categories: 2,
            max_size_m: [12.0, 12.0],
            max_intersecting: 0,
            max_intersection_depth_m: 0.1,
            max_intersection_volume: 0.1,
            max_missing: 0,
            max_outside: 0.2,
            min_seen_objects: 2,
            min_nearest_m: 0.01,
        }
    }
}

/// The properties of a room that are known before cameras are tried.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct RoomFacts {
    pub(super) kind: String,
    pub(super) objects: usize,
    pub(super) super_categories: usize,
    pub(super) size_m: [f64; 2],
    pub(super) intersecting: Vec<IntersectingPair>,
    pub(super) missing: usize,
}

impl SelectionRules {
    /// Reads the rules from a TOML file.
    pub fn read(path: &Path) -> Result<Self, PrepError> {
        let text = read_text(path)?;
        toml::from_str(&text).map_err(|source| PrepError::Rules { path: path.to_owned(), source: Box::new(source) })
    }

    /// Whether the pieces intersect beyond either of the limits.
    fn is_beyond(&self, pair: &IntersectingPair) -> bool {
        pair.depth_m > self.max_intersection_depth_m || pair.volume_share > self.max_intersection_volume
    }

    /// Every rule that the room breaks.
    pub(super) fn check(&self, room: &RoomFacts) -> Vec<Rejection> {
        let mut broken = Vec::new();
        let mut check = |holds: bool, rule: &str, reason: String| {
            if !holds {
                broken.push(Rejection::new(rule, reason));
            }
        };
        let known_type = self.room_types.is_empty() || self.room_types.contains(&room.kind);
        check(
            known_type,
            "room_types",
            format!("its type is '{}', expected one of: {}", room.kind, self.room_types.join(", ")),
        );
        let least = format!("{} pieces of furniture, expected at least {}", room.objects, self.min_objects);
        check(room.objects >= self.min_objects, "min_objects", least);
        let most = format!("{} pieces of furniture, expected at most {}", room.objects, self.max_objects);
        check(room.objects <= self.max_objects, "max_objects", most);
        let kinds = room.super_categories;
        let reason = format!("furniture of {kinds} super-categories, expected at least {}", self.min_super_categories);
        check(kinds >= self.min_super_categories, "min_super_categories", reason);
        let fits = room.size_m.iter().zip(&self.max_size_m).all(|(size, most)| size <= most);
        let [width, depth] = room.size_m;
        check(
            fits,
            "max_size_m",
            format!("its floor is {width:.2} by {depth:.2} m, expected at most {:?}", self.max_size_m),
        );
        let pairs: Vec<String> =
            room.intersecting.iter().filter(|pair| self.is_beyond(pair)).map(ToString::to_string).collect();
        let reason = format!(
            "furniture stands in other furniture by more than {} m or {} % of the smaller, expected at most {}: {}",
            self.max_intersection_depth_m,
            100.0 * self.max_intersection_volume,
            self.max_intersecting,
            pairs.join(", ")
        );
        check(pairs.len() <= self.max_intersecting, "max_intersecting", reason);
        let reason =
            format!("{} pieces lack their model or texture, expected at most {}", room.missing, self.max_missing);
        check(room.missing <= self.max_missing, "max_missing", reason);
        broken
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good() -> RoomFacts {
        RoomFacts { kind: "Bedroom".into(), objects: 5, super_categories: 3, size_m: [4.0, 3.0], ..Default::default() }
    }

    #[test]
    fn each_broken_rule_is_reported_under_its_key() {
        let rules = SelectionRules { room_types: vec!["Bedroom".into()], ..Default::default() };
        assert_eq!(rules.check(&good()), []);
        let broken = |room: RoomFacts| rules.check(&room).into_iter().map(|r| r.rule).collect::<Vec<_>>().join(" ");
        assert_eq!(broken(RoomFacts { kind: "Kitchen".into(), ..good() }), "room_types");
        assert_eq!(broken(RoomFacts { objects: 2, ..good() }), "min_objects");
        assert_eq!(broken(RoomFacts { objects: 61, ..good() }), "max_objects");
        assert_eq!(broken(RoomFacts { super_categories: 1, ..good() }), "min_super_categories");
        assert_eq!(broken(RoomFacts { size_m: [4.0, 12.5], ..good() }), "max_size_m");
        let pair = |depth_m, volume_share| {
            let pair = IntersectingPair { pieces: ["a".into(), "b".into()], depth_m, volume_share };
            broken(RoomFacts { intersecting: vec![pair], ..good() })
        };
        assert_eq!((pair(0.2, 0.01).as_str(), pair(0.02, 0.2).as_str()), ("max_intersecting", "max_intersecting"));
        assert_eq!(pair(0.1, 0.1), "");
        assert_eq!(broken(RoomFacts { missing: 1, ..good() }), "max_missing");
        assert_eq!(broken(RoomFacts { missing: 1, objects: 0, ..good() }), "min_objects max_missing");
    }

    #[test]
    fn rules_are_toml_and_unknown_keys_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rules.toml");
        std::fs::write(&path, "min_objects = 7\n").unwrap();
        assert_eq!(SelectionRules::read(&path).unwrap(), SelectionRules { min_objects: 7, ..Default::default() });
        assert!(cfg!(not(unix)) || SelectionRules::read(Path::new("/dev/zero")).is_err());
        std::fs::write(&path, "min_object = 7\n").unwrap();
        assert!(SelectionRules::read(&path).unwrap_err().to_string().contains("min_object"));
    }
}
