//! `compare.json`: how far two renderers' pictures of a dataset agree.

use mateval_scene::{SceneId, ViewId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::bounds::Bounds;
use super::kind::MaterialKind;

/// The value of `format` in this version of the file.
pub const COMPARE_FORMAT: &str = "mateval-compare/2";

/// `compare.json`, and what `mateval prep compare --format json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareFile {
    /// Always `mateval-compare/2`.
    pub format: String,
    /// The program that compared and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The dataset that was compared.
    pub dataset: ComparedDataset,
    /// The renderer whose pictures are compared with the built-in tracer's: `blender`.
    pub renderer: String,
    /// The bounds that decide whether a check agrees.
    pub bounds: Bounds,
    /// Whether every check of every view agrees.
    pub agrees: bool,
    /// The scenes, in the dataset's order.
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
    /// SHA-256 of its manifest, in hexadecimal.
    pub manifest_sha256: String,
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneComparison {
    /// The scene.
    pub scene: SceneId,
    /// The kinds of material that its surfaces have, sorted.
    pub kinds: Vec<MaterialKind>,
    /// How far a tile of light may be off, as a share of the built-in tracer's mean in `means`; smaller where all surfaces are
    /// Lambertian.
    pub tile_bound: f64,
    /// Samples per pixel of each half that the built-in tracer rendered; 0 where no view was compared.
    pub samples_each_half: u32,
    /// Seeds of the built-in tracer's halves, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// How far the converted materials, which the pictures show, are from the source's own; null where they were not
    /// converted, or where no view was compared. It is information and no check.
    pub source_materials: Option<SourceComparison>,
    /// The views, in the scene's order.
    pub views: Vec<ViewComparison>,
}

/// The built-in tracer's pictures of converted materials, compared with its pictures of the source's own.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SourceComparison {
    /// The view, the first that was compared.
    pub view: ViewId,
    /// PSNR of the source's picture over valid pixels, times `exposure`, clipped and sRGB-encoded, in decibels, from the
    /// product of both halves' errors, in which their noise cancels; null where that is not above 0.
    pub psnr_db: Option<f64>,
    /// RGB, first with the converted materials and then with the source's. Both are rendered with the same seeds, so that the
    /// noise of the difference is at most what the standard errors state.
    pub light: LightComparison,
}

/// One view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ViewComparison {
    /// The view.
    pub view: ViewId,
    /// The checks, picture by picture; one check of state `missing` where the view was not rendered.
    pub checks: Vec<Check>,
    /// The measurements behind the checks of RGB and of each light group.
    pub light: Vec<LightComparison>,
}

/// The outcome of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum State {
    /// Within its bound. The only state that passes.
    Agrees,
    /// Outside its bound.
    Differs,
    /// Within its bound, but so noisy that it would be within it in any case.
    TooNoisy,
    /// Nothing was left to compare.
    Undecided,
    /// The file does not exist.
    Missing,
    /// The file cannot be read, or has another size.
    Unreadable,
}

/// What was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Whether the picture exists and can be read; has no number.
    File,
    /// PSNR over valid pixels, linear, peak 1, in decibels. Agrees where it is at least the bound.
    PsnrDb,
    /// Share of the pixels away from edges whose ids are equal. Agrees where it is at least the bound.
    EqualShare,
    /// Median absolute difference, in metres.
    MedianM,
    /// Median angle, in degrees.
    MedianDeg,
    /// Number of tiles over the tile bound. Agrees where it is at most the bound, which is a number of tiles too.
    TilesOver,
    /// Relative difference of the means in the worst channel. The bound includes the noise.
    MeanDifference,
    /// Largest difference between a half and the sum of its groups, relative to the pixel.
    GroupSum,
}

/// One check of one picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Check {
    /// The picture, by the name of its file: `rgb`, `group_00`, `base_color`, ...
    pub picture: String,
    /// What was measured.
    pub quantity: Quantity,
    /// The outcome.
    pub state: State,
    /// The number measured; null where there is none.
    pub measured: Option<f64>,
    /// The bound that decides; null where there is no number.
    pub bound: Option<f64>,
    /// Number of pixels or tiles that were measured.
    pub count: usize,
    /// What was found, as a sentence.
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
    /// Mean of each channel, first the built-in tracer's and then the other renderer's, over the valid pixels of the tiles
    /// that decide, or over all of their pixels where none is valid. Every difference is relative to the first.
    pub means: [[f64; 3]; 2],
    /// The difference of these means; null where no tile decides.
    pub mean: Option<MeanDifference>,
    /// The tiles that decide.
    pub tiles: TilesCompared,
    /// Tiles that show materials that are known to differ, by the kind of material. They do not count for the verdict.
    pub apart: Vec<TilesApart>,
}

/// The difference of two means, in the channel where it is largest in proportion to what is allowed there. All numbers are
/// relative to the built-in tracer's mean in that channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeanDifference {
    /// 0 red, 1 green, 2 blue.
    pub channel: usize,
    /// The other renderer's mean minus the built-in tracer's; null where only the latter is black.
    pub difference: Option<f64>,
    /// Its standard error, from the halves of both renderers.
    pub standard_error: Option<f64>,
}

/// The tiles that decide.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TilesCompared {
    /// Number of tiles.
    pub count: usize,
    /// Number of tiles that are over the bound in a channel.
    pub over: usize,
    /// Number of tiles that may be over the bound: 1 %, and those that noise alone may cause.
    pub allowed: usize,
    /// Number of tiles that noise alone puts over the bound on average.
    pub expected_by_noise: f64,
    /// Median of the absolute value of each tile's largest relative difference; null without tiles, or in a black picture.
    pub median: Option<f64>,
    /// Median of three standard errors divided by the bound; null as above. Above 5 the picture is too noisy for a verdict.
    pub noise: Option<f64>,
    /// The tile that is furthest over the bound, or nearest to it where none is over.
    pub worst: Option<WorstTile>,
}

/// One tile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WorstTile {
    /// The tile's left column.
    pub x: usize,
    /// The tile's upper row.
    pub y: usize,
    /// The channel with the largest difference, and the difference.
    pub off: MeanDifference,
}

/// Tiles that show a kind of material that is known to differ. A tile that shows several such kinds counts for the last of
/// them in the order of [`MaterialKind`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TilesApart {
    /// The kind.
    pub kind: MaterialKind,
    /// Number of tiles.
    pub count: usize,
    /// Number of these tiles that are over the bound.
    pub over: usize,
    /// Median of the absolute value of each tile's largest relative difference; null in a black picture.
    pub median: Option<f64>,
    /// The largest of these differences, with its sign; null in a black picture.
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
    /// The check of this quantity of this picture; none where it was not made.
    pub fn check(&self, picture: &str, quantity: Quantity) -> Option<&Check> {
        self.checks.iter().find(|check| check.picture == picture && check.quantity == quantity)
    }
}

impl State {
    /// The word for it in tables and messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "DIFFERS",
            Self::TooNoisy => "too noisy",
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
