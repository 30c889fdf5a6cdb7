//! Where agreement ends, and why there.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// All bounds, as `compare.json` carries them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// See [`BASE_COLOR_PSNR_DB`].
    pub base_color_psnr_db: f64,
    /// See [`EQUAL_ID_SHARE`].
    pub equal_id_share: f64,
    /// See [`DEPTH_MEDIAN_M`].
    pub depth_median_m: f64,
    /// See [`NORMAL_MEDIAN_DEG`].
    pub normal_median_deg: f64,
    /// See [`LAMBERT_TILE`].
    pub lambert_tile: f64,
    /// See [`OTHER_TILE`].
    pub other_tile: f64,
    /// See [`TILE_SHARE_OVER`].
    pub tile_share_over: f64,
    /// See [`PICTURE_MEAN`].
    pub picture_mean: f64,
    /// See [`STANDARD_ERRORS`].
    pub standard_errors: f64,
    /// See [`NOISE_OVER_BOUND`].
    pub noise_over_bound: f64,
    /// See [`GROUP_SUM`].
    pub group_sum: f64,
}

/// All of them.
pub const BOUNDS: Bounds = Bounds {
    base_color_psnr_db: BASE_COLOR_PSNR_DB,
    equal_id_share: EQUAL_ID_SHARE,
    depth_median_m: DEPTH_MEDIAN_M,
    normal_median_deg: NORMAL_MEDIAN_DEG,
    lambert_tile: LAMBERT_TILE,
    other_tile: OTHER_TILE,
    tile_share_over: TILE_SHARE_OVER,
    picture_mean: PICTURE_MEAN,
    standard_errors: STANDARD_ERRORS,
    noise_over_bound: NOISE_OVER_BOUND,
    group_sum: GROUP_SUM,
};

/// Least PSNR of base colours, decibels. One error of 1 % everywhere is 40 dB: sub-pixels of different places differ by
/// less, a texture that is mirrored, shifted by a texel or decoded by another curve by more.
pub const BASE_COLOR_PSNR_DB: f64 = 40.0;

/// Least share of equal ids away from edges. Both look through pixel centres; the rest is for surfaces in one plane,
/// where either may be first.
pub const EQUAL_ID_SHARE: f64 = 0.99;

/// Largest median difference of depths, metres. Blender holds positions as 32-bit floats: a room's are exact to microns.
pub const DEPTH_MEDIAN_M: f64 = 1e-3;

/// Largest median angle between normals, degrees. Ours are stored as 16-bit floats, which turns them by up to 0.04.
pub const NORMAL_MEDIAN_DEG: f64 = 0.5;

/// How far a tile may be off, of the picture's mean over valid pixels, where all materials are Lambert: there our tracer, Mitsuba and Blender agree to 0.02 %, so
/// that what is left is how each samples textures and edges.
pub const LAMBERT_TILE: f64 = 0.01;

/// How far a tile may be off in any other scene: both have Blender's principled, ours by tables of its energy, and light
/// that comes by way of metal, plastic or glass reaches all tiles.
pub const OTHER_TILE: f64 = 0.02;

/// Share of tiles that may be over: edges of lamps and of the room's corners, where one texel decides.
pub const TILE_SHARE_OVER: f64 = 0.01;

/// How far a picture's mean may be off: what differs in tiles evens out over a picture, a lamp of other strength does not.
pub const PICTURE_MEAN: f64 = 0.005;

/// Standard errors that are granted on top of every bound of light. A normal deviate is further off once in 370 times.
pub const STANDARD_ERRORS: f64 = 3.0;

/// Where the granted standard errors are this many times the bound, agreement says nothing.
pub const NOISE_OVER_BOUND: f64 = 5.0;

/// How far a half's groups may be from the half, of the pixel's value (of the picture's mean in pixels that are darker).
/// Sums of 32-bit floats over thousands of samples keep four digits and more.
pub const GROUP_SUM: f64 = 1e-3;

/// How often noise alone may call a picture different by its number of tiles.
pub(super) const FALSE_ALARM: f64 = 1e-3;
