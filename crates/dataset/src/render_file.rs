//! The files beside pictures: `render.json` (how a view's pictures were made), `scorer.json` (the scorer's own render
//! of the true maps, with which predictions under light are compared) and `compare.json` (whether the tracer and the
//! photo renderer show the same scenes).

use std::collections::BTreeMap;
use std::path::Path;

use mateval_image::{LinearRgb, Picture};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::layout::{BuildFolder, COMPARE, is_rendered};
use crate::manifest::SceneHashes;
use crate::{RendererId, SceneError, SceneId, ViewId, json};
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
pub fn light_inputs_sha256(root: &Path, scene: &SceneId) -> Result<String, SceneError> {
    let hashes = SceneHashes::open(root, scene)?;
    // The input picture is a copy of a render.
    let is_input = |file: &str| !is_rendered(file) && !file.contains("/views/input/rgb.");
    let inputs = hashes.entries().filter(|(file, _)| is_input(file));
    let lines: String = inputs.map(|(file, sha256)| format!("{sha256}  {file}\n")).collect();
    Ok(sha256_of_bytes(lines.as_bytes()))
}

/// The version in the dataset's `compare.json`.
pub const VERDICT_FORMAT: &str = "mateval-compare/1";

/// A dataset's `compare.json`, which `mateval prep compare` writes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VerdictFile {
    /// Always `mateval-compare/1`.
    pub format: String,
    /// The program that compared and its version, as in `mateval 0.1.0`.
    pub tool: String,
    /// SHA-256, hex, of the manifest of the dataset that was compared. After a change of the dataset the verdict is
    /// void.
    pub manifest_sha256: String,
    /// The scenes that were compared.
    pub scenes: BTreeMap<SceneId, CompareCounts>,
}

/// The outcomes of a scene's checks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CompareCounts {
    /// Number of checks within their bounds.
    pub agree: usize,
    /// Number of checks outside their bounds, or whose pictures are missing or unreadable.
    pub differ: usize,
    /// Number of checks that decide nothing: too noisy, or without a pixel to compare.
    pub too_noisy: usize,
}

impl VerdictFile {
    /// The file of the dataset in `root`; absent if it does not exist. It may be about an earlier state of the dataset.
    pub fn read_beside(root: &Path) -> Result<Option<Self>, SceneError> {
        let path = root.join(COMPARE);
        if !path.exists() {
            return Ok(None);
        }
        json::read_format(&path, VERDICT_FORMAT).map(Some)
    }

    /// Adds the scenes to the file of the dataset in `root`, and replaces those that it lists. Scenes that were
    /// compared by another version, or before the dataset changed, are dropped. Several processes may compare scenes of
    /// one dataset.
    pub fn add_beside(self, root: &Path) -> Result<(), SceneError> {
        let _lease = BuildFolder::of(root).lease_of_verdict()?;
        let mut file = self;
        // A file that cannot be read is replaced: it can be made again.
        let earlier = Self::read_beside(root).ok().flatten();
        if let Some(earlier) =
            earlier.filter(|earlier| earlier.manifest_sha256 == file.manifest_sha256 && earlier.tool == file.tool)
        {
            let added = std::mem::replace(&mut file.scenes, earlier.scenes);
            file.scenes.extend(added);
        }
        json::write(&root.join(COMPARE), &file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest;

    #[test]
    fn known_values() {
        let flat = |value: f32| Picture::filled(4, 3, LinearRgb([value; 3]));
        let noise = RenderNoise::of([&flat(1.0), &flat(3.0)], &flat(2.0));
        assert_eq!(noise, RenderNoise { mean_of_halves_mse: 1.0, denoised_mse: -1.0 });
        assert_eq!(RenderNoise::of([&flat(1.0), &flat(1.0)], &flat(1.5)).denoised_mse, 0.25);
    }

    fn verdict(manifest: &str, scenes: &[(&str, usize)]) -> VerdictFile {
        let counts = |&(id, agree): &(&str, usize)| {
            (SceneId::new(id).unwrap(), CompareCounts { agree, ..CompareCounts::default() })
        };
        VerdictFile {
            format: VERDICT_FORMAT.to_owned(),
            tool: "test".to_owned(),
            manifest_sha256: manifest.to_owned(),
            scenes: scenes.iter().map(counts).collect(),
        }
    }

    #[test]
    fn scenes_are_added_until_the_dataset_changes() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir(root.join("scenes")).unwrap();
        std::fs::write(root.join("scenes/a"), "a").unwrap();
        let identity = manifest::write(root).unwrap();
        assert_eq!(VerdictFile::read_beside(root).unwrap(), None);
        verdict("one", &[("hall", 1), ("room", 2)]).add_beside(root).unwrap();
        verdict("one", &[("room", 3), ("attic", 4)]).add_beside(root).unwrap();
        let all = verdict("one", &[("attic", 4), ("hall", 1), ("room", 3)]);
        assert_eq!(VerdictFile::read_beside(root).unwrap(), Some(all));
        verdict("two", &[("room", 5)]).add_beside(root).unwrap();
        assert_eq!(VerdictFile::read_beside(root).unwrap(), Some(verdict("two", &[("room", 5)])));
        assert_eq!(manifest::check(root).unwrap(), [], "the manifest does not concern it");
        assert_eq!(manifest::write(root).unwrap(), identity);
        std::fs::write(root.join(COMPARE), "{").unwrap();
        VerdictFile::read_beside(root).unwrap_err();
    }
}
