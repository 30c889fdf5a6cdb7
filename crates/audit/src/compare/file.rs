//! `compare.json`: what two renderers' pictures of a dataset have in common.

use mateval_scene::{SceneId, ViewId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::kind::MaterialKind;

/// The word for this version of the file.
pub const COMPARE_FORMAT: &str = "mateval-compare/1";

/// `compare.json`, and what `mateval prep compare --format json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareFile {
    /// Always `mateval-compare/1`.
    pub format: String,
    /// What compared, as in `mateval 0.1.0`.
    pub tool: String,
    /// What was compared.
    pub dataset: ComparedDataset,
    /// Whose pictures are held against our own tracer's: `blender`.
    pub renderer: String,
    /// What agreement means.
    pub bounds: Bounds,
    /// Whether every check of every view agrees.
    pub agrees: bool,
    /// In the dataset's order.
    pub scenes: Vec<SceneComparison>,
}

/// The dataset that was compared.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ComparedDataset {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its manifest, hex.
    pub manifest_sha256: String,
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneComparison {
    /// The scene.
    pub scene: SceneId,
    /// The kinds of material that its surfaces are of, sorted.
    pub kinds: Vec<MaterialKind>,
    /// How far a tile of light may be off, as a share of the mean ([`LightComparison::means`]): less where all is Lambert.
    pub tile_bound: f64,
    /// Samples a pixel of each of our halves; 0 where no view was compared.
    pub samples_each_half: u32,
    /// Seeds of our halves, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// In the scene's order.
    pub views: Vec<ViewComparison>,
}

/// One view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewComparison {
    /// The view.
    pub view: ViewId,
    /// What was checked, picture by picture; one check of state `missing` where the view was not rendered.
    pub checks: Vec<Check>,
    /// What stands behind the checks of RGB and of each group of lights.
    pub light: Vec<LightComparison>,
}

/// What came of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Within its bound. The only state that passes.
    Agrees,
    /// Outside of its bound.
    Differs,
    /// Within its bound, but so noisy that it would be anyway.
    TooNoisy,
    /// Nothing was left to compare.
    Undecided,
    /// There is no such file.
    Missing,
    /// The file cannot be read, or is of another size.
    Unreadable,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Whether the picture is there: no number.
    File,
    /// PSNR over valid pixels, linear, peak 1, decibels; at least the bound.
    PsnrDb,
    /// Share of pixels away from edges with equal ids; at least the bound.
    EqualShare,
    /// Median absolute difference, metres.
    MedianM,
    /// Median angle, degrees.
    MedianDeg,
    /// Tiles over the tile bound; at most the bound, which is a number of tiles.
    TilesOver,
    /// Relative difference of the means in the worst channel. The bound has the noise in it.
    MeanDifference,
    /// Largest difference of a half's groups, summed, from the half, relative to the pixel.
    GroupSum,
}

/// One check of one picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// The picture, as its file is named: `rgb`, `group_00`, `base_color`, ...
    pub picture: String,
    /// What was measured.
    pub quantity: Quantity,
    /// What came of it.
    pub state: State,
    /// The number; null where there is none.
    pub measured: Option<f64>,
    /// Where agreement ends; null where there is no number.
    pub bound: Option<f64>,
    /// Pixels, or tiles, that the number is of.
    pub count: usize,
    /// What was found, for people.
    pub message: String,
}

/// A picture of light, compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightComparison {
    /// `rgb`, or `group_00` and so on.
    pub picture: String,
    /// The group's name; null for RGB.
    pub light: Option<String>,
    /// Mean of each channel, ours and theirs, over the valid pixels of the tiles that decide (over all of their pixels where
    /// none is valid). Ours is what every difference is relative to.
    pub means: [[f64; 3]; 2],
    /// How far those means are apart; null where no tile decides.
    pub mean: Option<MeanDifference>,
    /// The tiles that decide.
    pub tiles: TilesCompared,
    /// Tiles that show what is known to differ, by the kind of it. They decide nothing.
    pub apart: Vec<TilesApart>,
}

/// How far means are apart, for the channel where that is most against what is allowed. All relative to our mean in that
/// channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeanDifference {
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// Theirs minus ours; null where ours is black and theirs is not.
    pub difference: Option<f64>,
    /// Its standard error, from the halves of both.
    pub standard_error: Option<f64>,
}

/// The tiles that decide.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TilesCompared {
    /// How many there are.
    pub count: usize,
    /// How many are over the bound in a channel.
    pub over: usize,
    /// How many may be: 1 %, and what noise alone puts there.
    pub allowed: usize,
    /// How many noise alone puts there, on the average.
    pub expected_by_noise: f64,
    /// Median of the tiles' largest relative difference, without a sign; null without tiles, or in a black picture.
    pub median: Option<f64>,
    /// Median of three standard errors over the bound; null as above. Above 5 the picture is too noisy to tell.
    pub noise: Option<f64>,
    /// The tile that is furthest over, or nearest to it.
    pub worst: Option<WorstTile>,
}

/// One tile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorstTile {
    /// Its left column.
    pub x: usize,
    /// Its upper row.
    pub y: usize,
    /// In which channel, and by how much.
    pub off: MeanDifference,
}

/// Tiles that show one kind of material that is known to differ. A tile that shows several counts with the last of them
/// in the order of [`MaterialKind`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TilesApart {
    /// The kind.
    pub kind: MaterialKind,
    /// How many tiles.
    pub count: usize,
    /// How many of them would be over the bound.
    pub over: usize,
    /// Median of their largest relative difference, without a sign; null in a black picture.
    pub median: Option<f64>,
    /// The largest of them, with its sign; null in a black picture.
    pub largest: Option<f64>,
}

impl CompareFile {
    /// Every check, with its scene and view.
    pub fn checks(&self) -> impl Iterator<Item = (&SceneId, &ViewId, &Check)> {
        let views = self.scenes.iter().flat_map(|scene| scene.views.iter().map(move |view| (&scene.scene, view)));
        views.flat_map(|(scene, view)| view.checks.iter().map(move |check| (scene, &view.view, check)))
    }
}

impl ViewComparison {
    /// The check of a picture and a quantity.
    pub fn check(&self, picture: &str, quantity: Quantity) -> Option<&Check> {
        self.checks.iter().find(|check| check.picture == picture && check.quantity == quantity)
    }
}

impl State {
    /// As people read it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "DIFFERS",
            Self::TooNoisy => "too noisy to tell",
            Self::Undecided => "undecided",
            Self::Missing => "missing",
            Self::Unreadable => "unreadable",
        }
    }
}

impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}: {}", self.picture, self.state.word(), self.message)
    }
}
