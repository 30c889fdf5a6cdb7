//! `compare.json`: how far two renderers' pictures of a dataset agree; the kinds of material by how far two renderers
//! may differ on them; and the bounds, with the reason of each.

use mateval_dataset::dataset::DatasetVersion;
use mateval_dataset::material::MaterialModel;
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::{SceneId, ViewId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The value of `format` in this version of the file.
pub const COMPARE_FORMAT: &str = "mateval-compare/4";

/// `compare.json`, and what `mateval prep compare --format json` prints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareFile {
    /// Always `mateval-compare/4`.
    pub format: String,
    /// The program that compared and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The dataset that was compared.
    pub dataset: DatasetVersion,
    /// The renderer whose pictures are compared with the built-in tracer's: `blender`.
    pub renderer: String,
    /// The bounds that decide whether a check agrees.
    pub bounds: Bounds,
    /// Whether every check that could be decided agrees, and every picture could be read.
    pub agrees: bool,
    /// Number of checks that decide nothing: too noisy, of too few samples, or without a pixel to compare.
    pub undecided: usize,
    /// The scenes, in the dataset's order.
    pub scenes: Vec<SceneComparison>,
}

/// One scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SceneComparison {
    /// The scene.
    pub scene: SceneId,
    /// The kinds of material that its surfaces have, sorted.
    pub kinds: Vec<MaterialKind>,
    /// How far a tile of light may be off, as a share of the built-in tracer's mean in `means`; smaller where all
    /// surfaces are Lambertian.
    pub tile_bound: f64,
    /// Samples per pixel of each half that the built-in tracer rendered in each pass. Each half is the mean of its
    /// passes, weighted by their samples. Empty where no view was compared.
    pub passes: Vec<u32>,
    /// Seeds of the halves of the first pass, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// The views, in the scene's order.
    pub views: Vec<ViewComparison>,
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
    /// Within its bound, and so precise that a fault of the stated size would have been found.
    Agrees,
    /// Outside its bound, by more than noise explains.
    Differs,
    /// Neither: the noise may hide a fault.
    TooNoisy,
    /// A picture has fewer samples per pixel of a half than `bounds.least_samples`, which do not state how noisy it is.
    TooFew,
    /// Nothing was left to compare, for example because every tile shows glass or metal.
    Undecided,
    /// The file does not exist; for a whole view the picture is `render`.
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
    /// Share of the pixels whose ids are equal: away from edges, or, of the picture `silhouette`, at the edge of the
    /// instance for which it is lowest. Agrees where it is at least the bound.
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
    /// The samples that would decide the check; null where it is decided, or where no number would.
    pub to_decide: Option<SamplesToDecide>,
    /// What was found, as a sentence.
    pub message: String,
}

/// Samples per pixel of each half with which a check would be decided, if the difference stays what it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SamplesToDecide {
    /// Of the built-in tracer's pictures.
    pub ours: u32,
    /// Of the other renderer's pictures: as many as they have where more of the built-in tracer's would do.
    pub theirs: u32,
}

/// A picture of light, compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightComparison {
    /// `rgb`, or `group_00` and so on.
    pub picture: String,
    /// The group's name; null for RGB.
    pub light: Option<String>,
    /// Mean of each channel, first the built-in tracer's and then the other renderer's, over the valid pixels of the
    /// tiles that decide, or over all of their pixels where none is valid. Every difference is relative to the first.
    pub means: [[f64; 3]; 2],
    /// The difference of these means; null where no tile decides.
    pub mean: Option<MeanDifference>,
    /// The tiles that decide.
    pub tiles: TilesCompared,
    /// Tiles that show materials that are known to differ, by the kind of material. They do not count for the verdict.
    pub apart: Vec<TilesApart>,
}

/// The difference of two means, in the channel where it is largest in proportion to what is allowed there. All numbers
/// are relative to the built-in tracer's mean in that channel.
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
    /// Median of the absolute value of each tile's largest relative difference; null without tiles, or in a black
    /// picture.
    pub median: Option<f64>,
    /// Number of tiles that are not over the bound, and so noisy that a fault of the stated size could hide in them.
    pub open: usize,
    /// Median of three standard errors divided by the bound; null as above.
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

/// Tiles that show a kind of material that is known to differ. A tile that shows several such kinds counts for the last
/// of them in the order of [`MaterialKind`].
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

impl SceneComparison {
    /// Samples per pixel of each half of the built-in tracer's pictures; 0 where no view was compared.
    pub fn samples_each_half(&self) -> u32 {
        self.passes.iter().fold(0, |all, pass| all.saturating_add(*pass))
    }
}

impl ViewComparison {
    /// The check of this quantity of this picture; absent if it was not made.
    pub fn check(&self, picture: &str, quantity: Quantity) -> Option<&Check> {
        self.checks.iter().find(|check| check.picture == picture && check.quantity == quantity)
    }
}

impl State {
    /// All states, in the order in which they are counted.
    pub const ALL: [Self; 7] =
        [Self::Agrees, Self::Differs, Self::Missing, Self::Unreadable, Self::TooNoisy, Self::TooFew, Self::Undecided];

    /// Whether it decides nothing, so that it speaks neither for nor against the pictures.
    pub fn is_open(self) -> bool {
        matches!(self, Self::TooNoisy | Self::TooFew | Self::Undecided)
    }

    /// Whether it speaks against the pictures.
    pub fn is_fault(self) -> bool {
        self != Self::Agrees && !self.is_open()
    }

    /// The word for it in tables and messages.
    pub fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs => "DIFFERS",
            Self::TooNoisy => "too noisy",
            Self::TooFew => "too few samples",
            Self::Undecided => "undecided",
            Self::Missing => "missing",
            Self::Unreadable => "unreadable",
        }
    }
}

/// A check of the file itself, which has no number.
pub(super) fn file_check(picture: &str, state: State, message: String) -> Check {
    let picture = picture.to_owned();
    Check { picture, quantity: Quantity::File, state, measured: None, bound: None, count: 0, to_decide: None, message }
}

impl std::fmt::Display for Check {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} {}: {}", self.picture, self.state.word(), self.message)
    }
}

/// A kind of material. The first two mean the same to both renderers. For the others Blender has only an approximation;
/// they are ordered by how far it is off.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MaterialKind {
    /// Diffuse.
    Lambert,
    /// Blender's own principled material.
    Principled,
    /// Rough diffuse: several formulas share that name.
    OrenNayar,
    /// A metal.
    Conductor,
    /// A clear coat over a diffuse base.
    Plastic,
    /// Glass, thin or not.
    Dielectric,
    /// Any other material.
    Other,
}

impl MaterialKind {
    /// The kind of a model.
    pub fn of(model: &MaterialModel) -> Self {
        match model {
            MaterialModel::Diffuse { alpha: None, .. } => Self::Lambert,
            MaterialModel::Diffuse { alpha: Some(_), .. } => Self::OrenNayar,
            MaterialModel::Principled { .. } => Self::Principled,
            MaterialModel::Conductor { .. } => Self::Conductor,
            MaterialModel::Plastic { .. } => Self::Plastic,
            MaterialModel::Dielectric { .. } | MaterialModel::ThinDielectric { .. } => Self::Dielectric,
            // A new material takes no part in the verdict until it is known how well Blender approximates it.
            #[allow(unreachable_patterns, reason = "no model is left today; a new one must not need a change here")]
            _ => Self::Other,
        }
    }

    /// The kind of every surface of the scene.
    pub fn of_surfaces(scene: &ReferenceScene) -> Vec<Self> {
        scene.surfaces.iter().map(|surface| Self::of(&scene.materials[surface.material.0].model)).collect()
    }

    /// Whether it means the same to both renderers, so that a tile that shows no other kind counts for the verdict.
    pub fn decides(self) -> bool {
        self <= Self::Principled
    }

    /// The word that stands for it in JSON.
    pub fn word(self) -> &'static str {
        match self {
            Self::Lambert => "lambert",
            Self::Principled => "principled",
            Self::OrenNayar => "oren_nayar",
            Self::Conductor => "conductor",
            Self::Plastic => "plastic",
            Self::Dielectric => "dielectric",
            Self::Other => "other",
        }
    }
}

/// All bounds, as `compare.json` records them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Smallest PSNR of base colours, in decibels.
    pub base_color_psnr_db: f64,
    /// Smallest share of equal ids away from edges.
    pub equal_id_share: f64,
    /// Smallest share of equal ids at the edge of an instance.
    pub silhouette_share: f64,
    /// Largest median difference of depths, in metres.
    pub depth_median_m: f64,
    /// Largest median angle between normals, in degrees.
    pub normal_median_deg: f64,
    /// How far a tile may be off where all materials are Lambertian, as a share of the picture's mean.
    pub lambert_tile: f64,
    /// How far a tile may be off in any other scene, as a share of the picture's mean.
    pub other_tile: f64,
    /// Share of the tiles that may be over their bound.
    pub tile_share_over: f64,
    /// The fault that is found in a tile where the check agrees, as a multiple of the tile's bound.
    pub tile_fault: f64,
    /// Share of the tiles that may be too noisy for that where the check agrees.
    pub tile_share_open: f64,
    /// How far a picture's mean may be off, as a share of itself.
    pub picture_mean: f64,
    /// The fault of a picture's mean that is found where the check agrees, as a share of the mean.
    pub picture_mean_fault: f64,
    /// Number of standard errors added to the bound of a tile, and to a difference before it is compared with a fault.
    pub standard_errors: f64,
    /// Number of standard errors added to the bound of a picture's mean.
    pub standard_errors_mean: f64,
    /// The least number of samples per pixel of each half with which light is compared.
    pub least_samples: u32,
    /// How far the sum of a half's light groups may be from the half, as a share of the pixel's value.
    pub group_sum: f64,
}

/// The bounds, with the reason of each.
pub const BOUNDS: Bounds = Bounds {
    // Smallest PSNR of base colours, in decibels. An error of 1 % in every pixel gives 40 dB. Different places within
    // a pixel cause less; a texture that is mirrored, shifted by a texel or decoded by another curve causes more.
    base_color_psnr_db: 40.0,
    // Smallest share of equal ids away from edges. Both renderers look through pixel centres; the rest allows for
    // surfaces in the same plane: either may be hit first.
    equal_id_share: 0.99,
    // Smallest share of equal ids at the edge of an instance. Both renderers look through pixel centres, so that only
    // edges that pass through a centre are left to rounding. A piece that is off by a fifth of a pixel across its
    // outline loses half of a fifth of the pixels that form it.
    silhouette_share: 0.9,
    // Largest median difference of depths, in metres. Blender stores positions as 32-bit floats, which are exact to
    // microns in a room.
    depth_median_m: 1e-3,
    // Largest median angle between normals, in degrees. The dataset's normals are 16-bit floats, whose rounding turns
    // them by up to 0.04 degrees.
    normal_median_deg: 0.5,
    // How far a tile may be off where all materials are Lambertian, as a share of the picture's mean over valid
    // pixels. On such scenes the built-in tracer, Mitsuba and Blender agree to 0.02 %; what remains is how each
    // samples textures and edges.
    lambert_tile: 0.01,
    // How far a tile may be off in any other scene, as a share of the same mean. The built-in tracer approximates the
    // energy of Blender's principled material by tables, and light that was scattered by metal, plastic or glass
    // reaches all tiles.
    other_tile: 0.02,
    // Share of the tiles that may be over their bound: at edges of lamps and in corners of the room a single texel
    // decides.
    tile_share_over: 0.01,
    // The fault that is found in a tile where the check agrees, as a multiple of the tile's bound. A piece that is
    // absent, turned or of another colour changes its tiles by tens of percents.
    tile_fault: 5.0,
    // Share of the tiles that may be noisier than that. Tiles at the rims of lamps and windows, which are a hundred
    // times brighter than the room, stay noisy with any number of samples.
    tile_share_open: 0.25,
    // How far a picture's mean may be off, as a share of itself. Differences between tiles average out over a picture;
    // a lamp of a different strength does not.
    picture_mean: 0.005,
    // The fault of a picture's mean that is found where the check agrees. A lamp whose strength is off by 3 % is the
    // smallest fault that the tests plant; between 0.5 % and 2 % it depends on the noise which state a check has.
    picture_mean_fault: 0.02,
    // Number of standard errors added to the bound of a tile, and to a difference before it is compared with a fault. A
    // normal deviate is further off once in 370 times, in one direction once in 740 times.
    standard_errors: 3.0,
    // Number of standard errors added to the bound of a picture's mean. Three channels of equal expected value exceed
    // four once in 5,000 pictures, a release of 184 rooms having about 4,000.
    standard_errors_mean: 4.0,
    // The least number of samples per pixel of each half with which light is compared. Light is long-tailed: with fewer
    // samples the rare bright paths are missing from most halves, which then look less noisy than they are.
    least_samples: 16,
    // How far the sum of a half's groups may be from the half, as a share of the pixel's value, or of the picture's
    // mean where the pixel is darker. Sums of 32-bit floats over thousands of samples keep at least four digits.
    group_sum: 1e-3,
};

/// How often noise alone may make a picture count as different by its number of tiles.
pub(super) const FALSE_ALARM: f64 = 1e-4;
