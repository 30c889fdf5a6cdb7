//! `RESULT.json`: every number, what it was made of, and what is missing.

use std::collections::BTreeMap;

use mateval_metrics::Psnr;
use mateval_scene::dataset_id::DatasetId;
use mateval_scene::submission::Cost;
use mateval_scene::{Finding, InstanceId, SceneId, ViewId};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::measure::ValueNoise;
use crate::metric::Metric;
use crate::predicted_light::FittedRadiances;
use crate::protocol::Protocol;
use crate::relit::LightingName;
use crate::result_key::{PictureKind, PictureName, Region, ResultKey, Views};
use crate::word_enum::UnknownWord;

/// The word for this version of a result.
pub const RESULT_FORMAT: &str = "mateval-result/3";

/// A submission's scores on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultFile {
    /// Always `mateval-result/3`.
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
    /// Metrics that could not be computed, each with the command that makes it available.
    pub missing: Vec<MissingMetric>,
    /// What was wrong with the submission and what was scored instead, sorted.
    pub findings: Vec<Finding>,
}

/// What was scored.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmissionId {
    /// SHA-256, hex, over path and SHA-256 of submission.json and of every map of the scored scenes, in order.
    pub sha256: String,
    /// Its own description.
    pub description: String,
    /// Where to read about it, as it says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// The method's licence, as it says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// What the method takes, as it says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
}

/// The scores of one protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProtocolResult {
    /// The protocol itself.
    pub protocol: Protocol,
    /// Numbers of different fingerprints are never to be compared.
    pub fingerprint: String,
    /// Mean over scenes.
    pub summary: BTreeMap<ResultKey, f64>,
    /// Mean over pictures of each scene, by the same keys.
    pub scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    /// Standard errors of the means of PSNR in `summary` that render noise makes, in dB.
    pub summary_noise: BTreeMap<ResultKey, f64>,
    /// How sure the means of PSNR of each scene are that render noise touches, by the same keys.
    pub noise: BTreeMap<SceneId, BTreeMap<ResultKey, PsnrNoise>>,
    /// The radiances that were fitted, by scene.
    pub fits: BTreeMap<SceneId, FittedRadiances>,
    /// Every single value.
    pub pictures: Vec<PictureValue>,
    /// What each instance's texels are off by.
    pub texels: Vec<InstanceTexelErrors>,
    /// What each instance's pixels are off by.
    pub instances: Vec<InstancePixelErrors>,
}

/// How sure a scene's mean PSNR is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PsnrNoise {
    /// Standard error by all noise, in dB; null where the error is no more than noise, so that PSNR is a lower bound.
    pub standard_error_db: Option<f64>,
    /// By our own renders' noise.
    pub own_db: Option<f64>,
    /// By the truth's noise.
    pub truth_db: Option<f64>,
    /// Samples a pixel of each of our halves.
    pub samples: u32,
    /// How it ended.
    pub state: NoiseState,
}

/// How a scene's samples were enough, or not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NoiseState {
    /// Our own noise is under the protocol's bound, and the truth's too.
    Certified,
    /// The truth's noise is above the bound, and ours under the protocol's share of it.
    LimitedByTruth,
    /// The most samples were taken, and our noise is above the bound.
    SampleCap,
    /// The pilot thought that fewer samples were enough; they were not quite.
    AboveTarget,
}

/// The squared errors of one instance's texels, in means over area.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstanceTexelErrors {
    /// Its scene.
    pub scene: SceneId,
    /// The instance.
    pub instance: InstanceId,
    /// What the input view sees of it.
    pub observed: TexelErrors,
    /// What it does not see.
    pub unobserved: TexelErrors,
}

/// Means over texels by their area on the surface; null where there is no area.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TexelErrors {
    /// Square metres.
    pub area_m2: f64,
    /// Linear, mean over channels.
    pub base_color_mse: Option<f64>,
    /// Of roughness.
    pub roughness_mse: Option<f64>,
    /// Of metallic.
    pub metallic_mse: Option<f64>,
}

/// The squared error of one instance's pixels in one kind of picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstancePixelErrors {
    /// Its scene.
    pub scene: SceneId,
    /// The instance.
    pub instance: InstanceId,
    /// The source's category; of architecture what piece of it it is, as in `WallInner`; else null.
    pub category: Option<String>,
    /// The source's broader category; `Architecture` for architecture; else null.
    pub super_category: Option<String>,
    /// Albedo, aligned albedo, or light of track `true` or `fitted`.
    pub picture: PictureKind,
    /// `input`, `novel`, `unobserved`.
    pub views: Views,
    /// Valid pixels that show it, in all of these views.
    pub pixels: usize,
    /// Mean over those pixels, in the space of the protocol's MSE of that picture; of light free of noise.
    pub mse: f64,
}

/// One value of one picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PictureValue {
    /// Its scene.
    pub scene: SceneId,
    /// Its view.
    pub view: ViewId,
    /// What was compared, with `_specular` behind it where only what is metal or smooth in truth counts.
    pub picture: PictureName,
    /// The lighting of a picture of kind `rgb_relit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lighting: Option<LightingName>,
    /// Which pixels count.
    pub region: Region,
    /// The metric, by the last word of its keys.
    #[schemars(with = "String", regex(pattern = "^[a-z0-9_]+$"))]
    pub metric: Metric,
    /// Null where no pixel or window counts.
    pub value: Option<f64>,
    /// For PSNR: the MSE was exactly zero, the value is the cap.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// For MSE and PSNR of light: how uncertain it is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise: Option<ValueNoise>,
    /// Pixels (for SSIM inside a mask: windows) that the value is a mean over.
    pub count: usize,
}

/// Numbers that could not be taken.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissingMetric {
    /// Which.
    pub metric: MissingNumbers,
    /// Why.
    pub reason: String,
    /// The command that makes the metric available.
    pub fix: String,
}

/// All numbers of a metric, or all of a kind of picture; one word in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum MissingNumbers {
    /// By that metric, of any picture.
    Metric(Metric),
    /// Of that kind of picture, by any metric.
    Picture(PictureKind),
}

impl std::fmt::Display for MissingNumbers {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Metric(metric) => metric.fmt(f),
            Self::Picture(kind) => kind.fmt(f),
        }
    }
}

impl TryFrom<String> for MissingNumbers {
    type Error = UnknownWord;

    fn try_from(word: String) -> Result<Self, UnknownWord> {
        word.parse().map(Self::Metric).or_else(|_| word.parse().map(Self::Picture))
    }
}

impl From<MissingNumbers> for String {
    fn from(numbers: MissingNumbers) -> Self {
        numbers.to_string()
    }
}

impl JsonSchema for MissingNumbers {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "MissingNumbers".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({ "type": "string", "pattern": "^[a-z0-9_]+$" })
    }
}

/// Takes the means: of pictures to scenes (of texels by area), of scenes to the dataset. A value that is missing is left
/// out of its mean; a scene without any value of a key is left out of that key's.
pub fn means(
    pictures: &[PictureValue],
    texels: &[InstanceTexelErrors],
) -> (BTreeMap<SceneId, BTreeMap<ResultKey, f64>>, BTreeMap<ResultKey, f64>) {
    let mut of_scene: BTreeMap<SceneId, BTreeMap<ResultKey, Mean>> = BTreeMap::new();
    for picture in pictures {
        if let Some(value) = picture.value {
            of_scene.entry(picture.scene.clone()).or_default().entry(picture.key()).or_default().add(value);
        }
    }
    let mut scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>> = of_scene
        .into_iter()
        .map(|(scene, keys)| (scene, keys.into_iter().map(|(key, mean)| (key, mean.value())).collect()))
        .collect();
    for (scene, values) in texel_means(texels) {
        scenes.entry(scene).or_default().extend(values);
    }
    let mut of_dataset: BTreeMap<ResultKey, Mean> = BTreeMap::new();
    for (key, value) in scenes.values().flatten() {
        of_dataset.entry(*key).or_default().add(*value);
    }
    let summary = of_dataset.into_iter().map(|(key, mean)| (key, mean.value())).collect();
    (scenes, summary)
}

impl PictureValue {
    /// The mean that it counts for.
    pub fn key(&self) -> ResultKey {
        ResultKey { picture: self.picture, views: Views::of(&self.view, self.region), metric: self.metric }
    }
}

/// Texels of each map, seen or unseen, in each scene: the mean of their squared errors by area, and its PSNR.
fn texel_means(texels: &[InstanceTexelErrors]) -> BTreeMap<SceneId, BTreeMap<ResultKey, f64>> {
    type Part = (Views, fn(&InstanceTexelErrors) -> &TexelErrors);
    type Map = (PictureKind, fn(&TexelErrors) -> Option<f64>);
    let parts: [Part; 2] = [(Views::Observed, |t| &t.observed), (Views::Unobserved, |t| &t.unobserved)];
    let maps: [Map; 3] = [
        (PictureKind::TextureBaseColor, |errors| errors.base_color_mse),
        (PictureKind::TextureRoughness, |errors| errors.roughness_mse),
        (PictureKind::TextureMetallic, |errors| errors.metallic_mse),
    ];
    let mut sums: BTreeMap<(SceneId, ResultKey), [f64; 2]> = BTreeMap::new();
    for instance in texels {
        for (part, errors) in parts.map(|(part, of)| (part, of(instance))) {
            for (map, mse) in maps.map(|(map, of)| (map, of(errors))) {
                let Some(mse) = mse else { continue };
                let key = ResultKey::whole(map, part, Metric::Mse);
                let sums = sums.entry((instance.scene.clone(), key)).or_default();
                sums[0] += errors.area_m2 * mse;
                sums[1] += errors.area_m2;
            }
        }
    }
    let mut means: BTreeMap<SceneId, BTreeMap<ResultKey, f64>> = BTreeMap::new();
    for ((scene, key), [sum, area]) in sums {
        let values = means.entry(scene).or_default();
        let mse = sum / area;
        if let Ok(psnr) = Psnr::from_mse(mse) {
            values.insert(key, mse);
            values.insert(key.with(Metric::Psnr), psnr.db);
        }
    }
    means
}

/// The standard error of the dataset's mean of each key that all its scenes have one of: scenes are independent.
pub(crate) fn summary_noise(noise: &BTreeMap<SceneId, BTreeMap<ResultKey, PsnrNoise>>) -> BTreeMap<ResultKey, f64> {
    let mut sums: BTreeMap<ResultKey, (usize, Option<f64>)> = BTreeMap::new();
    for (key, of_scene) in noise.values().flatten() {
        let (count, squares) = sums.entry(*key).or_insert((0, Some(0.0)));
        *count += 1;
        *squares = squares.zip(of_scene.standard_error_db).map(|(sum, error)| sum + error * error);
    }
    sums.into_iter().filter_map(|(key, (count, squares))| Some((key, squares?.sqrt() / count as f64))).collect()
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

    fn key(text: &str) -> ResultKey {
        text.parse().unwrap()
    }

    fn value(scene: &str, view: &str, region: Region, value: Option<f64>) -> PictureValue {
        PictureValue {
            scene: SceneId::new(scene).unwrap(),
            view: ViewId::new(view).unwrap(),
            picture: PictureName::whole(PictureKind::Albedo),
            region,
            metric: Metric::Psnr,
            lighting: None,
            noise: None,
            value,
            exact: false,
            count: 1,
        }
    }

    /// Two instances of 1 and 3 square metres.
    #[test]
    fn texels_count_by_area() {
        let texels = |name: &str, area_m2: f64, mse: f64| InstanceTexelErrors {
            scene: SceneId::new("a").unwrap(),
            instance: InstanceId::new(name).unwrap(),
            observed: TexelErrors { area_m2, base_color_mse: Some(mse), ..Default::default() },
            unobserved: TexelErrors::default(),
        };
        let (scenes, summary) = means(&[], &[texels("x", 1.0, 0.04), texels("y", 3.0, 0.0)]);
        assert!((summary[&key("texture_base_color.observed.mse")] - 0.01).abs() < 1e-15);
        assert!((summary[&key("texture_base_color.observed.psnr")] - 20.0).abs() < 1e-12);
        assert_eq!(scenes.values().next().map(BTreeMap::len), Some(2));
    }

    #[test]
    fn noise_of_scenes_is_independent() {
        let noise = |error: Option<f64>| PsnrNoise {
            standard_error_db: error,
            own_db: error,
            truth_db: None,
            samples: 16,
            state: NoiseState::Certified,
        };
        let key = key("rgb_true.input.psnr");
        let scene = |name: &str, error| (SceneId::new(name).unwrap(), BTreeMap::from([(key, noise(error))]));
        let both = BTreeMap::from([scene("a", Some(0.03)), scene("b", Some(0.04))]);
        assert!((summary_noise(&both)[&key] - 0.025).abs() < 1e-15);
        assert!(summary_noise(&BTreeMap::from([scene("a", Some(0.1)), scene("b", None)])).is_empty());
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
        let (scenes, summary) = means(&all, &[]);
        assert_eq!(summary[&key("albedo.novel.psnr")], 25.0);
        assert_eq!(summary[&key("albedo.input.psnr")], 1.0);
        assert!(!summary.contains_key(&key("albedo.unobserved.psnr")));
        assert_eq!(scenes[&SceneId::new("a").unwrap()][&key("albedo.novel.psnr")], 15.0);
    }
}
