//! `render.json`: how a view's pictures were made.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::RendererId;
use crate::render_noise::RenderNoise;

/// The name of the file. It is written last, so its presence means that a view's pictures are complete.
pub const RENDER_FILE: &str = "render.json";

/// `render.json` beside a view's pictures: how they were made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderFile {
    /// The renderer's name, which is also the name of its folder, as in `builtin`.
    pub renderer: RendererId,
    /// The renderer's own version; null for `builtin`, whose version is that of the dataset's tool.
    pub renderer_version: Option<String>,
    /// Samples per pixel of each of the two halves.
    pub samples_each_half: u32,
    /// Seeds of `rgb_a` and `rgb_b`, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// Number of scatterings after which a path is cut.
    pub max_bounces: u32,
    /// The throughput that cut paths still carried, averaged over all paths. Multiplied by the radiance around, it is the
    /// light that is missing. Null where the renderer does not report it.
    pub capped_throughput: Option<f64>,
    /// The denoiser that made `rgb` from the mean of the halves.
    pub denoiser: String,
    /// How noisy the pictures are.
    pub noise: RenderNoise,
    /// What the renderer only approximates of the source's meaning, one line per material.
    pub approximations: Vec<String>,
}
