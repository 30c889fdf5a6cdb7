//! The files beside pictures: `render.json` (how a view's pictures were made) and `scorer.json` (the scorer's own render
//! of the true maps, with which predictions under light are compared).

use std::collections::BTreeMap;
use std::path::Path;

use mateval_image::{LinearRgb, Picture};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::changes::SceneHashes;
use crate::layout::{WHOLE_SCENE, is_input_picture, is_rendered};
use crate::{DatasetError, RendererId, SceneId, ViewId, word_enum};
use mateval_files::untrusted::sha256_of_bytes;

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
    /// The graphics card that rendered; absent where the processor did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub device: Option<RenderDevice>,
    /// Samples per pixel of each of the two halves.
    pub samples_each_half: u32,
    /// Seeds of `rgb_a` and `rgb_b`, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// Number of scatterings after which a path is cut.
    pub max_bounces: u32,
    /// The throughput that cut paths still carried, averaged over all paths. Multiplied by the radiance around, it is
    /// the light that is missing. Null where the renderer does not report it.
    pub capped_throughput: Option<f64>,
    /// The denoiser that made `rgb` from the mean of the halves.
    pub denoiser: String,
    /// How noisy the pictures are.
    pub noise: RenderNoise,
    /// What the renderer only approximates of the source's meaning, one line per material.
    pub approximations: Vec<String>,
}

word_enum! {
    /// The way in which Cycles uses a graphics card. `auto` takes the first one that has a card.
    DeviceKind, a "kind of device":
    /// NVIDIA's, with its ray-tracing cores.
    Optix = "optix",
    /// NVIDIA's.
    Cuda = "cuda",
    /// AMD's.
    Hip = "hip",
    /// Intel's.
    Oneapi = "oneapi",
    /// Apple's.
    Metal = "metal",
}

/// A graphics card that rendered. Pictures of two kinds of devices differ by more than noise, so all views of a scene
/// come from one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderDevice {
    pub kind: DeviceKind,
    /// The card's name, as its driver states it.
    pub name: String,
    /// Version of the driver; null where the system does not state it.
    pub driver: Option<String>,
}

impl std::fmt::Display for RenderDevice {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} ({}", self.name, self.kind)?;
        self.driver.iter().try_for_each(|driver| write!(f, ", driver {driver}"))?;
        f.write_str(")")
    }
}

/// How noisy a picture is: means over all pixels and channels, linear, before exposure.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RenderNoise {
    /// Mean of ((a - b) / 2)²: the expected squared error of the plain mean of both halves.
    pub mean_of_halves_mse: f64,
    /// Mean of (rgb - a) (rgb - b): the squared error of the denoised picture, without the noise of the halves, so that
    /// it may be slightly below 0.
    pub denoised_mse: f64,
}

impl RenderNoise {
    /// Measures the noise of two halves and of the picture denoised from their mean.
    pub fn of([a, b]: [&Picture<LinearRgb>; 2], denoised: &Picture<LinearRgb>) -> Self {
        let halves = || values(a).zip(values(b));
        let squares = halves().map(|(a, b)| (a - b) * (a - b) / 4.0);
        let count = 3.0 * a.pixels().len() as f64;
        let products = values(denoised).zip(halves()).map(|(rgb, (a, b))| (rgb - a) * (rgb - b));
        Self { mean_of_halves_mse: squares.sum::<f64>() / count, denoised_mse: products.sum::<f64>() / count }
    }
}

fn values(picture: &Picture<LinearRgb>) -> impl Iterator<Item = f64> {
    picture.pixels().iter().flat_map(|pixel| pixel.0.map(f64::from))
}

/// The version in `scorer.json`.
pub const SCORER_FORMAT: &str = "mateval-scorer/1";

/// `ground_truth/renders/scorer/scorer.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ScorerFile {
    /// Always `mateval-scorer/1`.
    pub format: String,
    /// Rises whenever the pictures could change for the same inputs.
    pub version: u32,
    /// SHA-256, hex, of names and hashes of the scene's files from which the pictures were made, as the manifest listed
    /// them.
    pub inputs_sha256: String,
    /// Samples per pixel of each of the two halves whose mean the pictures are.
    pub samples_each_half: u32,
    /// Seeds of both halves, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// The light groups in the order of `lights.json`; each view has a picture of each, `group_00.exr` first.
    pub lights: Vec<String>,
    /// How noisy the pictures are, by view: the variance that noise causes in the sum of the groups, encoded, averaged
    /// over valid pixels and channels.
    pub variance: BTreeMap<ViewId, f64>,
    /// SHA-256, hex, of each picture by its path in `renders/scorer`.
    pub files: BTreeMap<String, String>,
}

/// SHA-256, hex, of names and hashes of all files of a scene from which light is rendered, as the manifest lists them,
/// or, of a scene that was built since, as it was built.
pub fn light_inputs_sha256(root: &Path, scene: &SceneId) -> Result<String, DatasetError> {
    let hashes = SceneHashes::open(root, scene)?;
    // In a hidden split that is whole, the scene's file as it was before it was split counts.
    let [scene_file, whole_file] = ["scene.json", WHOLE_SCENE].map(|file| format!("scenes/{scene}/{file}"));
    let whole = hashes.entries().find(|(file, _)| **file == *whole_file).map(|(_, sha256)| sha256);
    // The input picture is a copy of a render.
    let is_input = |file: &str| !is_rendered(file) && !is_input_picture(file) && file != whole_file;
    let line = |(file, sha256): (&str, &str)| {
        let sha256 = whole.filter(|_| file == scene_file).unwrap_or(sha256);
        format!("{sha256}  {file}\n")
    };
    let lines: String = hashes.entries().filter(|(file, _)| is_input(file)).map(line).collect();
    Ok(sha256_of_bytes(lines.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values() {
        let flat = |value: f32| Picture::filled(4, 3, LinearRgb([value; 3]));
        let noise = RenderNoise::of([&flat(1.0), &flat(3.0)], &flat(2.0));
        assert_eq!(noise, RenderNoise { mean_of_halves_mse: 1.0, denoised_mse: -1.0 });
        assert_eq!(RenderNoise::of([&flat(1.0), &flat(1.0)], &flat(1.5)).denoised_mse, 0.25);
    }
}
