//! `scorer.json`: the scorer's own render of the true maps, with which predictions under light are compared.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::layout::is_rendered;
use crate::manifest::sha256_of_bytes;
use crate::scene_hashes::SceneHashes;
use crate::{SceneError, SceneId, ViewId};

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
    /// SHA-256, hex, of names and hashes of the scene's files from which the pictures were made, as the manifest listed them.
    pub inputs_sha256: String,
    /// Samples per pixel of each of the two halves whose mean the pictures are.
    pub samples_each_half: u32,
    /// Seeds of both halves, 16 hexadecimal digits each.
    pub seeds: [String; 2],
    /// The light groups in the order of `lights.json`; each view has a picture of each, `group_00.exr` first.
    pub lights: Vec<String>,
    /// How noisy the pictures are, by view: the variance that noise causes in the sum of the groups, encoded, averaged over
    /// valid pixels and channels.
    pub variance: BTreeMap<ViewId, f64>,
    /// SHA-256, hex, of each picture by its path in `renders/scorer`.
    pub files: BTreeMap<String, String>,
}

/// SHA-256, hex, of names and hashes of all files of a scene from which light is rendered, as the manifest lists them, or, of
/// a scene that was built since, as it was built.
pub fn light_inputs_sha256(root: &Path, scene: &SceneId) -> Result<String, SceneError> {
    let hashes = SceneHashes::open(root, scene)?;
    // The input picture is a copy of a render.
    let is_input = |file: &str| !is_rendered(file) && !file.contains("/views/input/rgb.");
    let inputs = hashes.entries().filter(|(file, _)| is_input(file));
    let lines: String = inputs.map(|(file, sha256)| format!("{sha256}  {file}\n")).collect();
    Ok(sha256_of_bytes(lines.as_bytes()))
}
