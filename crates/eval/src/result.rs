//! `RESULT.json`: every number, what it was made of, and what is missing.

use std::collections::BTreeMap;

use mateval_scene::{Finding, SceneId, ViewId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::protocol::Protocol;

/// The word for this version of a result.
pub const RESULT_FORMAT: &str = "mateval-result/1";

/// A submission's scores on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultFile {
    /// Always `mateval-result/1`.
    pub format: String,
    /// What made it, as in `mateval 0.1.0`.
    pub tool: String,
    /// The method's name, from submission.json.
    pub method: String,
    /// What was scored.
    pub submission: SubmissionId,
    /// What it was scored on.
    pub dataset: DatasetId,
    /// SHA-256 of the weights of each network; null where they were missing.
    pub lpips_weights: BTreeMap<String, Option<String>>,
    /// The scores, by protocol.
    pub protocols: BTreeMap<String, ProtocolResult>,
    /// Metrics that could not be taken, with the command that mends it.
    pub missing: Vec<MissingMetric>,
    /// What was wrong with the submission and what was scored instead, sorted.
    pub findings: Vec<Finding>,
}

/// What was scored.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmissionId {
    /// SHA-256, hex, over path and SHA-256 of submission.json and of every map of the scored scenes, in order.
    pub sha256: String,
    /// Its own description.
    pub description: String,
}

/// What it was scored on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct DatasetId {
    /// Its name.
    pub name: String,
    /// Its version.
    pub version: String,
    /// SHA-256 of its manifest, hex.
    pub manifest_sha256: String,
    /// The scenes that were scored, in the dataset's order.
    pub scenes: Vec<SceneId>,
    /// How many scenes it has.
    pub scenes_in_all: usize,
}

/// The scores of one protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProtocolResult {
    /// The protocol itself.
    pub protocol: Protocol,
    /// Numbers of different fingerprints are never to be compared.
    pub fingerprint: String,
    /// Mean over scenes, by `<picture>.<views>.<metric>`.
    pub summary: BTreeMap<String, f64>,
    /// Mean over pictures of each scene, by the same keys.
    pub scenes: BTreeMap<SceneId, BTreeMap<String, f64>>,
    /// Every single value.
    pub pictures: Vec<PictureValue>,
}

/// One value of one picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PictureValue {
    /// Its scene.
    pub scene: SceneId,
    /// Its view.
    pub view: ViewId,
    /// What was compared: `albedo`, `albedo_aligned`.
    pub picture: String,
    /// Which pixels: `valid` or `unobserved`.
    pub region: Region,
    /// `mse`, `psnr`, `ssim`, `lpips_alex`.
    pub metric: String,
    /// Null where no pixel or window counts.
    pub value: Option<f64>,
    /// For PSNR: the MSE was exactly zero, the value is the cap.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// Pixels (for SSIM inside a mask: windows) that the value is a mean over.
    pub count: usize,
}

/// Which pixels of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Region {
    /// All that `valid.png` holds.
    Valid,
    /// Those that the input view did not see.
    Unobserved,
}

/// A metric that could not be taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissingMetric {
    /// Its key.
    pub metric: String,
    /// Why.
    pub reason: String,
    /// The command that mends it.
    pub mend: String,
}

/// Takes the means: of pictures to scenes, of scenes to the dataset. A value that is missing is left out of its mean; a
/// scene without any value of a key is left out of that key's.
pub fn means(pictures: &[PictureValue]) -> (BTreeMap<SceneId, BTreeMap<String, f64>>, BTreeMap<String, f64>) {
    let mut of_scene: BTreeMap<SceneId, BTreeMap<String, Mean>> = BTreeMap::new();
    for picture in pictures {
        if let Some(value) = picture.value {
            of_scene.entry(picture.scene.clone()).or_default().entry(key(picture)).or_default().add(value);
        }
    }
    let scenes: BTreeMap<SceneId, BTreeMap<String, f64>> = of_scene
        .into_iter()
        .map(|(scene, keys)| (scene, keys.into_iter().map(|(key, mean)| (key, mean.value())).collect()))
        .collect();
    let mut of_dataset: BTreeMap<String, Mean> = BTreeMap::new();
    for (key, value) in scenes.values().flatten() {
        of_dataset.entry(key.clone()).or_default().add(*value);
    }
    let summary = of_dataset.into_iter().map(|(key, mean)| (key, mean.value())).collect();
    (scenes, summary)
}

/// `<picture>.<views>.<metric>`.
fn key(picture: &PictureValue) -> String {
    let views = match picture.region {
        Region::Unobserved => "unobserved",
        Region::Valid if picture.view.as_str() == mateval_scene::layout::INPUT => "input",
        Region::Valid => "novel",
    };
    format!("{}.{views}.{}", picture.picture, picture.metric)
}

#[derive(Default)]
struct Mean {
    sum: f64,
    count: usize,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1;
    }

    fn value(&self) -> f64 {
        self.sum / self.count as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(scene: &str, view: &str, region: Region, value: Option<f64>) -> PictureValue {
        PictureValue {
            scene: SceneId::new(scene).unwrap(),
            view: ViewId::new(view).unwrap(),
            picture: "albedo".to_owned(),
            region,
            metric: "psnr".to_owned(),
            value,
            exact: false,
            count: 1,
        }
    }

    /// Scene a has two novel views, scene b one: each scene weighs the same.
    #[test]
    fn pictures_then_scenes() {
        let all = [
            value("a", "up_left", Region::Valid, Some(10.0)),
            value("a", "up_right", Region::Valid, Some(20.0)),
            value("b", "up_left", Region::Valid, Some(35.0)),
            value("a", "up_left", Region::Unobserved, None),
            value("a", "input", Region::Valid, Some(1.0)),
        ];
        let (scenes, summary) = means(&all);
        assert_eq!(summary["albedo.novel.psnr"], 25.0);
        assert_eq!(summary["albedo.input.psnr"], 1.0);
        assert!(!summary.contains_key("albedo.unobserved.psnr"));
        assert_eq!(scenes[&SceneId::new("a").unwrap()]["albedo.novel.psnr"], 15.0);
    }
}
