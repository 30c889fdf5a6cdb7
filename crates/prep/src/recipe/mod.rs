//! A recipe: the scenes that a dataset consists of, and the settings of their views, pictures and atlases.
//!
//! Paths are relative to the recipe's folder, or to the folder that `--source` names.

pub mod fault;
mod scene;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::RangeInclusive;
use std::path::Path;

use mateval_dataset::dataset::{Licence, TrueMaterials};
use mateval_dataset::lighting::parse_twin;
use mateval_dataset::{SceneId, SourceKind, ViewId};
use mateval_files::FileError;
use mateval_files::untrusted::{hint, mistaken_for, read_at_most, without_mark};
use mateval_sources::front3d::camera_rules::CameraRules;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::error::PrepError;
pub(crate) use fault::RESOLUTION;
use fault::{ATLAS_SIZES, RecipeFault, RecipeSceneFault, ValueFault, check_sizes};
pub(crate) use scene::SourcePath;
pub use scene::{
    AppearanceWord, Availability, CapturedFlash, CapturedRoom, Front3dRoom, GivenCamera, RecipeCamera, RecipeScene,
    RecipeSource, Redress,
};

/// The name of the recipe in the dataset.
pub const RECIPE: &str = "recipe.toml";

/// The most samples a pixel.
pub const MOST_SAMPLES: u32 = 1 << 16;

/// The TOML file that a dataset is built from: the scenes, and the settings of their views, pictures and atlases.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// The dataset's name; not empty.
    pub name: String,
    /// The dataset's version.
    #[serde(default = "default_version")]
    pub version: String,
    /// Width and height of pictures in pixels; if absent, the source's own, and for `front3d` those of the
    /// `camera_rules`.
    #[schemars(inner(range(min = *RESOLUTION.start(), max = *RESOLUTION.end())))]
    pub resolution: Option<[u32; 2]>,
    /// The novel views, as turns of the input camera; if absent, the four of format/dataset.md, "Camera". An empty list
    /// makes a dataset of input views only.
    #[serde(default = "default_views")]
    pub views: Vec<Offset>,
    /// Novel views from other places, in every scene; none if absent. Either `count` and `distance_m`, for places that
    /// are drawn, or `views`.
    pub wide: Option<WideViews>,
    /// Texels a side of every atlas; if absent, chosen by what the input view shows: format/dataset.md, "Atlas".
    #[schemars(range(min = *ATLAS_SIZES.start(), max = *ATLAS_SIZES.end()))]
    pub atlas_size: Option<u32>,
    /// The materials of the truth.
    #[serde(default)]
    pub materials: TrueMaterials,
    /// The rules of cameras that are drawn.
    #[serde(default, deserialize_with = "camera_rules")]
    pub camera_rules: CameraRules,
    /// Samples a pixel of **each** half of a rendered picture.
    #[serde(default = "default_samples")]
    #[schemars(range(min = 1, max = MOST_SAMPLES))]
    pub samples: u32,
    /// By the key of a source, the licence of all its scenes, as its name or its text. `dataset.json` states it beside
    /// the text of a file `LICENSE` or `LICENSE.txt` in the folder of a scene; exports warn if a scene has neither.
    #[serde(default)]
    pub licences: BTreeMap<SourceKind, String>,
    /// The scenes, at least one.
    // A recipe without scenes is read, so that this fault is reported together with others.
    #[serde(default, rename = "scene")]
    #[schemars(!default, length(min = 1))]
    pub scenes: Vec<RecipeScene>,
}

fn default_version() -> String {
    "0.1.0".to_owned()
}

fn default_samples() -> u32 {
    64
}

fn camera_rules<'de, D: serde::Deserializer<'de>>(words: D) -> Result<CameraRules, D::Error> {
    String::deserialize(words)?.parse().map_err(serde::de::Error::custom)
}

/// Reads a recipe. Returns also its text, which the dataset keeps. An error lists every fault of the recipe.
pub fn read(path: &Path) -> Result<(Recipe, String), PrepError> {
    let fault = |faults| PrepError::Recipe { path: path.to_owned(), faults };
    let text = read_text(path)?;
    let recipe: Recipe = toml::from_str(&text).map_err(|error| fault(vec![RecipeFault::Syntax(Box::new(error))]))?;
    let faults = recipe.faults();
    if faults.is_empty() { Ok((recipe, text)) } else { Err(fault(faults)) }
}

impl Recipe {
    fn faults(&self) -> Vec<RecipeFault> {
        let mut faults = Vec::new();
        let is_shown = |text: &str| !text.trim().is_empty() && !text.chars().any(char::is_control);
        if !is_shown(&self.name) {
            let expected = "a name of at least one letter, without control characters";
            faults.push(ValueFault::new("name", format!("{:?}", self.name), expected).into());
        }
        if !is_shown(&self.version) {
            let expected = "a version such as `0.1.0`, without control characters";
            faults.push(ValueFault::new("version", format!("{:?}", self.version), expected).into());
        }
        for (kind, _) in self.licences.iter().filter(|(_, text)| text.trim().is_empty()) {
            let expected = "the name of a licence, or its text";
            faults.push(ValueFault::new(format!("licences.{kind}"), "an empty text".to_owned(), expected).into());
        }
        if self.scenes.is_empty() {
            faults.push(RecipeFault::NoScenes);
        }
        if self.samples == 0 || self.samples > MOST_SAMPLES {
            let expected = format!("1 to {MOST_SAMPLES}");
            faults.push(ValueFault::new("samples", self.samples.to_string(), expected).into());
        }
        self.check_views(&mut faults);
        check_sizes("the recipe", self.resolution, self.atlas_size, &mut faults);
        let mut ids = BTreeSet::new();
        for scene in &self.scenes {
            if !ids.insert(&scene.id) {
                faults.push(RecipeFault::RepeatedScene { scene: scene.id.clone() });
            }
            scene.check(&mut faults);
            if let Some((of, lighting)) = parse_twin(scene.id.as_str())
                && self.scenes.iter().any(|other| other.id == of)
            {
                let fault = RecipeSceneFault::TwinId { of, lighting };
                faults.push(RecipeFault::Scene { scene: scene.id.clone(), fault });
            }
        }
        faults
    }

    /// The licence that the recipe states for the source of a scene.
    pub fn licence_of(&self, id: &SceneId) -> Option<Licence> {
        let kind = self.scenes.iter().find(|scene| scene.id == *id)?.source().ok()?.kind();
        let text = self.licences.get(&kind)?.clone();
        Some(Licence { scene: id.clone(), file: RECIPE.to_owned(), text })
    }

    fn check_views(&self, faults: &mut Vec<RecipeFault>) {
        let mut seen = BTreeSet::from([mateval_dataset::layout::INPUT]);
        let wide = self.wide.iter().flat_map(WideViews::given_ids);
        for id in self.views.iter().map(|view| &view.id).chain(wide) {
            if !seen.insert(id.as_str()) {
                faults.push(RecipeFault::RepeatedView { id: id.clone() });
            }
        }
        for view in &self.views {
            if view.id.is_wide() {
                faults.push(RecipeFault::TurnedId { id: view.id.clone() });
            }
            if !(view.x_deg.abs() <= 90.0 && view.y_deg.abs() <= 180.0) {
                let found = format!("[{}, {}]", view.x_deg, view.y_deg);
                let expected = "at most 90 degrees about X and 180 about Y";
                faults.push(ValueFault::new(format!("view '{}': [x_deg, y_deg]", view.id), found, expected).into());
            }
        }
        self.wide.iter().for_each(|wide| wide.check(faults));
    }
}

/// A novel view: the input camera turned about its own axes.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Offset {
    /// The view's id, which does not begin with `wide_`.
    pub id: ViewId,
    /// The turn about X; up is positive.
    #[schemars(range(min = -90, max = 90))]
    pub x_deg: f64,
    /// The turn about Y, after X; left is positive.
    #[schemars(range(min = -180, max = 180))]
    pub y_deg: f64,
}

/// The paper's four views, turned by five degrees about each axis.
pub(crate) fn default_views() -> Vec<Offset> {
    [("up_left", 5.0, 5.0), ("up_right", 5.0, -5.0), ("down_left", -5.0, 5.0), ("down_right", -5.0, -5.0)]
        .map(|(id, x_deg, y_deg)| Offset { id: ViewId::new(id).expect("our own ids are ids"), x_deg, y_deg })
        .to_vec()
}

/// Number of wide views of a scene that may be drawn.
const COUNTS: RangeInclusive<u32> = 1..=16;
/// Distances from the input camera that may be asked for, in metres: less is no other place, more is another room.
const DISTANCES_M: RangeInclusive<f64> = 0.05..=10.0;

/// The wide views of every scene of a recipe.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "WideWords")]
#[schemars(with = "WideWords")]
pub enum WideViews {
    Drawn(DrawnViews),
    /// At the same offsets in each scene.
    Given(Vec<WideOffset>),
}

/// Wide views that are drawn until they stand in free space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnViews {
    pub count: u32,
    /// The distances of the first and the last from the input camera, in metres; those of the others lie evenly in
    /// between.
    pub distance_m: [f64; 2],
    pub seed: u64,
}

/// A wide view at a given place. It looks at the same point as all wide views.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WideOffset {
    /// The view's id, which begins with `wide_`.
    pub id: ViewId,
    /// From the input camera along its own axes: right, up, and away from what it looks at.
    pub offset_m: [f64; 3],
}

/// The keys as they are in the file.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct WideWords {
    /// The number of views that are drawn, `wide_1` and so on.
    #[schemars(range(min = *COUNTS.start(), max = *COUNTS.end()))]
    count: Option<u32>,
    /// How far the first and the last drawn view are from the input camera, the nearer first; the distances of the
    /// others lie evenly in between.
    #[schemars(inner(range(min = *DISTANCES_M.start(), max = *DISTANCES_M.end())))]
    distance_m: Option<[f64; 2]>,
    /// The seed by which places are drawn; 0 if absent.
    seed: Option<u64>,
    /// Views at given places, in place of drawn ones.
    views: Option<Vec<WideOffset>>,
}

/// The keys fit together in neither of the two ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("wide: expected {{ count, distance_m }} (with or without seed), or {{ views }}")]
struct UnfitKeys;

impl TryFrom<WideWords> for WideViews {
    type Error = UnfitKeys;

    fn try_from(words: WideWords) -> Result<Self, UnfitKeys> {
        match words {
            WideWords { count: Some(count), distance_m: Some(distance_m), seed, views: None } => {
                Ok(Self::Drawn(DrawnViews { count, distance_m, seed: seed.unwrap_or(0) }))
            }
            WideWords { count: None, distance_m: None, seed: None, views: Some(views) } => Ok(Self::Given(views)),
            _ => Err(UnfitKeys),
        }
    }
}

impl WideViews {
    /// Adds a fault for every number that is out of range.
    pub(super) fn check(&self, faults: &mut Vec<RecipeFault>) {
        let (least, most) = DISTANCES_M.into_inner();
        match self {
            Self::Drawn(DrawnViews { count, distance_m: [near, far], .. }) => {
                if !COUNTS.contains(count) {
                    let expected = format!("{} to {}", COUNTS.start(), COUNTS.end());
                    faults.push(ValueFault::new("wide: count", count.to_string(), expected).into());
                }
                if !(DISTANCES_M.contains(near) && DISTANCES_M.contains(far) && near <= far) {
                    let expected = format!("two rising numbers from {least} to {most}");
                    faults.push(ValueFault::new("wide: distance_m", format!("{:?}", [near, far]), expected).into());
                }
            }
            Self::Given(views) => {
                for WideOffset { id, offset_m } in views {
                    let distance = glam::DVec3::from_array(*offset_m).length();
                    if !DISTANCES_M.contains(&distance) {
                        let key = format!("wide: view '{id}': offset_m");
                        let expected = format!("a length of {least} to {most} m");
                        faults.push(ValueFault::new(key, format!("{offset_m:?}"), expected).into());
                    }
                    if !id.is_wide() {
                        faults.push(RecipeFault::WideId { id: id.clone() });
                    }
                }
            }
        }
    }

    /// The ids of views whose places are given.
    fn given_ids(&self) -> impl Iterator<Item = &ViewId> {
        let given = match self {
            Self::Drawn(_) => &[],
            Self::Given(views) => views.as_slice(),
        };
        given.iter().map(|view| &view.id)
    }
}

/// The largest file that is read, in bytes.
const MAX_BYTES: u64 = 16 << 20;

/// The text of an ordinary file of at most [`MAX_BYTES`].
pub(crate) fn read_text(path: &Path) -> Result<String, PrepError> {
    let bytes = read_at_most(path, MAX_BYTES).map_err(FileError::io("read", path))?;
    let not_text = |_| {
        let message = format!("expected UTF-8, found other bytes{}", hint(&bytes));
        std::io::Error::new(std::io::ErrorKind::InvalidData, message)
    };
    let text = std::str::from_utf8(without_mark(&bytes)).map_err(not_text).map_err(FileError::io("read", path))?;
    // Text of another kind, such as a Git LFS pointer. TOML may begin like one, as in `#usda`.
    if mistaken_for(&bytes).is_some() && text.parse::<toml::Table>().is_err() {
        let message = format!("expected TOML, found another file{}", hint(&bytes));
        return Err(FileError::io("read", path)(std::io::Error::new(std::io::ErrorKind::InvalidData, message)).into());
    }
    Ok(text.to_owned())
}

#[cfg(test)]
mod tests {
    use mateval_sources::front3d::AppearanceRule;

    use super::*;

    #[test]
    fn a_file_of_another_kind_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recipe.toml");
        let read = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            read_text(&path)
        };
        for (bytes, words) in [
            (b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n".as_slice(), "git lfs pull"),
            (b"<!DOCTYPE html>\n", "web page"),
            (b"n\0a\0m\0e\0", "UTF-16"),
            (b"\xff\xfen\0", "UTF-16"),
        ] {
            let error = read(bytes).unwrap_err().to_string();
            assert!(error.contains("recipe.toml") && error.contains(words), "{error}");
        }
        assert_eq!(read(b"\xef\xbb\xbfname = 'x'").unwrap(), "name = 'x'");
        // TOML, though a USD file begins like it, and what its reader says more about.
        for sound in ["#usda kitchens\nname = 'x'", "", "no TOML"] {
            assert_eq!(read(sound.as_bytes()).unwrap(), sound);
        }
    }

    fn recipe_of(text: &str) -> Result<Recipe, PrepError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("recipe.toml");
        std::fs::write(&path, text).unwrap();
        read(&path).map(|(recipe, _)| recipe)
    }

    #[test]
    fn absent_keys_have_their_defaults() {
        let recipe = recipe_of("name = 'mini'\n[[scene]]\nid = 'a'\nbitterli = 'a/scene.xml'").unwrap();
        assert_eq!(recipe.views.len(), 4);
        assert_eq!(
            (recipe.views[1].id.as_str(), recipe.views[1].x_deg, recipe.views[1].y_deg),
            ("up_right", 5.0, -5.0)
        );
        assert_eq!((recipe.samples, recipe.scenes[0].exposure), (64, 1.0));
    }

    #[test]
    fn camera_rules_have_names() {
        let with = |words: &str| recipe_of(&format!("name = 'x'\n{words}\n[[scene]]\nid = 'a'\nbitterli = 'a'\n"));
        let name = |recipe: Recipe| recipe.camera_rules.word();
        assert_eq!(name(with("camera_rules = '3dlg'").unwrap()), "3dlg");
        assert_eq!(name(with("").unwrap()), "blenderproc");
        let error = with("camera_rules = 'mine'").unwrap_err().to_string();
        assert!(error.contains("expected one of: blenderproc, 3dlg"), "{error}");
    }

    #[test]
    fn all_faults_are_reported_together() {
        let text = "name = ' '\nversion = ''\nresolution = [4, 9]\nsamples = 0\n\
        [[scene]]\nid = 'a'\nbitterli = 'a'\nexposure = 0.0\n[[scene]]\nid = 'a'\nbitterli = 'b'\natlas_size = 9";
        let error = recipe_of(text).unwrap_err().to_string();
        for part in [
            "name = \" \"",
            "version = \"\"",
            "resolution = [4, 9]",
            "samples = 0",
            "'a' is listed twice",
            "exposure = 0",
            "atlas_size = 9",
        ] {
            assert!(error.contains(part), "{part} not in {error}");
        }
    }

    #[test]
    fn wide_views_have_ids_and_distances_of_their_own() {
        let with = |words: &str| recipe_of(&format!("name = 'x'\n{words}\n[[scene]]\nid = 'a'\nbitterli = 'a'\n"));
        let recipe = with("wide = { count = 4, distance_m = [0.3, 1.0] }").unwrap();
        let drawn = DrawnViews { count: 4, distance_m: [0.3, 1.0], seed: 0 };
        assert_eq!(recipe.wide, Some(WideViews::Drawn(drawn)));
        with("wide = { views = [{ id = 'wide_left', offset_m = [-0.5, 0, 0] }] }").unwrap();
        for (words, expected) in [
            ("wide = { count = 0, distance_m = [0.3, 1.0] }", "count = 0: expected 1 to 16"),
            ("wide = { count = 17, distance_m = [0.3, 1.0] }", "count = 17: expected 1 to 16"),
            ("wide = { count = 1, distance_m = [1.0, 0.3] }", "distance_m = [1.0, 0.3]: expected two rising numbers"),
            ("wide = { count = 1, distance_m = [nan, 1.0] }", "distance_m = [NaN, 1.0]"),
            ("wide = { count = 1 }", "expected { count, distance_m }"),
            ("wide = { views = [{ id = 'left', offset_m = [1, 0, 0] }] }", "the id must begin with 'wide_'"),
            ("wide = { views = [{ id = 'wide_1', offset_m = [0, 0, 0] }] }", "expected a length of 0.05 to 10 m"),
            ("views = [{ id = 'wide_1', x_deg = 1, y_deg = 1 }]", "choose another id"),
            (
                "wide = { views = [{ id = 'wide_1', offset_m = [1, 0, 0] }, { id = 'wide_1', offset_m = [2, 0, 0] }] }",
                "'wide_1' is listed twice",
            ),
        ] {
            let error = with(words).unwrap_err().to_string();
            assert!(error.contains(expected), "{words}: {error}");
        }
    }

    #[test]
    fn cameras_are_within_a_million_metres() {
        let at = |x: &str| {
            let text = "name = 'x'\n[[scene]]\nid = 'a'\nbitterli = 'a'\n";
            recipe_of(&format!("{text}camera = {{ position = [{x}, 0, 0], target = [0, 0, 0], fov_y_deg = 40 }}"))
        };
        at("1e6").unwrap();
        for far in ["1.1e6", "-1e300", "inf", "nan"] {
            assert!(at(far).unwrap_err().to_string().contains("camera: expected coordinates"), "{far}");
        }
    }

    #[test]
    fn inputs_are_hashes_of_files_below() {
        let with = |file: &str, hash: &str| {
            recipe_of(&format!("name = 'x'\n[[scene]]\nid = 'a'\nbitterli = 'a'\ninputs = {{ '{file}' = '{hash}' }}"))
        };
        with("b/c.obj", &"0a".repeat(32)).unwrap();
        for hash in ["", "0a", &"0A".repeat(32), &"0g".repeat(32), &"0a".repeat(33)] {
            assert!(
                with("c.obj", hash).unwrap_err().to_string().contains("64 lower-case hexadecimal digits"),
                "{hash}"
            );
        }
        for file in ["/dev/zero", "../c.obj"] {
            assert!(
                with(file, &"0a".repeat(32)).unwrap_err().to_string().contains("below the scene's folder"),
                "{file}"
            );
        }
    }

    #[test]
    fn labels_lie_below_the_scenes_folder() {
        let with = |folder: &str| {
            let text = "name = 'x'\n[[scene]]\nid = 'a'\nbitterli = 'a/scene.xml'\npart_labels = { one = ";
            recipe_of(&format!("{text}'{folder}' }}"))
        };
        with("labels/one").unwrap();
        with("labels/../one").unwrap();
        for bad in ["/labels", "../labels", "labels/../..", "."] {
            let error = with(bad).unwrap_err().to_string();
            assert!(error.contains(&format!("part_labels.one = '{bad}'")) && error.contains("XML's folder"), "{error}");
        }
    }

    #[test]
    fn a_seed_of_roughnesses_needs_stated_ones() {
        let with = |words: &str| {
            let room = "front3d = { house = 'h.json', room = 'R-1', models = 'm', ";
            recipe_of(&format!("name = 'x'\n[[scene]]\nid = 'a'\n{room}{words} }}\ncamera = {{ seed = 1 }}"))
        };
        let rule = |recipe: Recipe| recipe.scenes[0].front3d.as_ref().unwrap().appearance_rule(false);
        assert_eq!(rule(with("textures = 't'").unwrap()), AppearanceRule::Constant);
        assert_eq!(rule(with("appearance = 'stated'").unwrap()), AppearanceRule::Stated { seed: 0 });
        assert_eq!(
            rule(with("appearance = 'stated', appearance_seed = 7").unwrap()),
            AppearanceRule::Stated { seed: 7 }
        );
        let error = with("appearance_seed = 7").unwrap_err().to_string();
        assert!(error.contains("`appearance_seed` needs"), "{error}");
    }

    #[test]
    fn unknown_words_are_refused_with_their_line() {
        let error = recipe_of("name = 'x'\nresolutoin = [4, 9]").unwrap_err().to_string();
        assert!(error.contains("resolutoin") && error.contains("line 2"), "{error}");
    }

    /// Every kind refuses an integer by its type; an unknown key would be refused by its name.
    #[test]
    fn every_kind_of_source_is_a_key() {
        for kind in SourceKind::ALL {
            let error = recipe_of(&format!("name = 'x'\n[[scene]]\nid = 'a'\n{kind} = 7")).unwrap_err().to_string();
            assert!(error.contains("invalid type: integer"), "{kind}: {error}");
        }
    }

    #[test]
    fn a_gltf_is_a_source() {
        let with = |words: &str| recipe_of(&format!("name = 'x'\n[[scene]]\nid = 'a'\ngltf = 'rooms/a.glb'\n{words}"));
        let recipe = with("").unwrap();
        assert_eq!(recipe.scenes[0].source().unwrap(), RecipeSource::Gltf(Path::new("rooms/a.glb")));
        assert_eq!(recipe.scenes[0].root(Path::new("all")), Path::new("all/rooms"));
        for (words, message) in [
            ("bitterli = 'b.xml'", "exactly one of the keys `bitterli`, `front3d`, `gltf`"),
            ("camera = { seed = 1 }", "`seed` and `designer` are for `front3d`"),
            ("part_labels = { one = '../labels' }", "glTF's folder"),
        ] {
            assert!(with(words).unwrap_err().to_string().contains(message), "{words}");
        }
    }
}
