//! How far two renderers' pictures may differ and still agree, and why.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// All bounds, as `compare.json` records them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Smallest PSNR of base colours, in decibels.
    pub base_color_psnr_db: f64,
    /// Smallest share of equal ids away from edges.
    pub equal_id_share: f64,
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
    /// How far a picture's mean may be off, as a share of itself.
    pub picture_mean: f64,
    /// Number of standard errors added to every bound of light.
    pub standard_errors: f64,
    /// Where the added standard errors exceed the bound by this factor, a picture is too noisy.
    pub noise_over_bound: f64,
    /// How far the sum of a half's light groups may be from the half, as a share of the pixel's value.
    pub group_sum: f64,
}

/// The bounds in force.
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

/// Smallest PSNR of base colours, in decibels. An error of 1 % in every pixel gives 40 dB. Different places within a pixel
/// cause less; a texture that is mirrored, shifted by a texel or decoded by another curve causes more.
pub const BASE_COLOR_PSNR_DB: f64 = 40.0;

/// Smallest share of equal ids away from edges. Both renderers look through pixel centres; the rest allows for surfaces in
/// the same plane, either of which may be hit first.
pub const EQUAL_ID_SHARE: f64 = 0.99;

/// Largest median difference of depths, in metres. Blender stores positions as 32-bit floats, which are exact to microns in
/// a room.
pub const DEPTH_MEDIAN_M: f64 = 1e-3;

/// Largest median angle between normals, in degrees. The dataset's normals are 16-bit floats, whose rounding turns them by
/// up to 0.04 degrees.
pub const NORMAL_MEDIAN_DEG: f64 = 0.5;

/// How far a tile may be off where all materials are Lambertian, as a share of the picture's mean over valid pixels. On such
/// scenes the built-in tracer, Mitsuba and Blender agree to 0.02 %; what remains is how each samples textures and edges.
pub const LAMBERT_TILE: f64 = 0.01;

/// How far a tile may be off in any other scene, as a share of the same mean. The built-in tracer approximates the energy of
/// Blender's principled material by tables, and light that was scattered by metal, plastic or glass reaches all tiles.
pub const OTHER_TILE: f64 = 0.02;

/// Share of the tiles that may be over their bound: at edges of lamps and in corners of the room a single texel decides.
pub const TILE_SHARE_OVER: f64 = 0.01;

/// How far a picture's mean may be off, as a share of itself. Differences between tiles average out over a picture; a lamp
/// of a different strength does not.
pub const PICTURE_MEAN: f64 = 0.005;

/// Number of standard errors added to every bound of light. A normal deviate is further off once in 370 times.
pub const STANDARD_ERRORS: f64 = 3.0;

/// Where the added standard errors exceed the bound by this factor, agreement has no meaning.
pub const NOISE_OVER_BOUND: f64 = 5.0;

/// How far the sum of a half's groups may be from the half, as a share of the pixel's value, or of the picture's mean where
/// the pixel is darker. Sums of 32-bit floats over thousands of samples keep at least four digits.
pub const GROUP_SUM: f64 = 1e-3;

/// How often noise alone may make a picture count as different by its number of tiles.
pub(super) const FALSE_ALARM: f64 = 1e-3;
