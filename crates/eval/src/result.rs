//! The types of `RESULT.json`: every number, its inputs, and what is missing; and its means, of pictures to scenes and
//! of scenes to the dataset.

use std::collections::BTreeMap;

use mateval_dataset::dataset::Perturbation;
use mateval_dataset::lighting::LightingName;
use mateval_dataset::open::DatasetId;
use mateval_dataset::submission::Cost;
use mateval_dataset::word_enum::UnknownWord;
use mateval_dataset::{Finding, InstanceId, SceneId, ViewId, by_text};
use mateval_light::light_fit::FittedRadiances;
use mateval_metrics::Psnr;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::metric::{HALF_A_BYTE, Metric, PictureKind};
use crate::protocol::Protocol;
use crate::result::key::{PictureName, Region, ResultKey, Views};

pub mod key;

pub const RESULT_FORMAT: &str = "mateval-result/6";

/// A submission's scores on a dataset.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ResultFile {
    /// Always `mateval-result/6`.
    pub format: String,
    /// Program and version, as in `mateval 0.1.0`.
    pub tool: String,
    /// The method's name, from submission.json.
    pub method: String,
    /// The submission that was scored.
    pub submission: SubmissionId,
    /// The dataset and the scored scenes.
    pub dataset: DatasetId,
    /// SHA-256 of the weights of each network; null where they were missing.
    pub lpips_weights: BTreeMap<String, Option<String>>,
    /// By name, the scores under each protocol.
    pub protocols: BTreeMap<String, ProtocolResult>,
    /// How far the answers to a scene and to its twins lie apart, for each scored scene whose twins it answers; absent
    /// where there is none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub constancy: Vec<Constancy>,
    /// Maps that the submission holds for no instance of any scored scene, by their words in its files. They have no
    /// values; under light they are the default.
    pub not_predicted: Vec<String>,
    /// How far the scorer's tracer and Blender agree on this dataset, by `prep compare`; null where that was not run.
    pub tracer_check: Option<TracerCheck>,
    /// Metrics that could not be computed, each with the command that makes it available.
    pub missing: Vec<MissingMetric>,
    /// Faults of the submission and what was scored instead, sorted.
    pub findings: Vec<Finding>,
}

impl ResultFile {
    /// The method's name with the geometry that it was given, as in `nn (pose 2)`.
    pub fn shown_method(&self) -> String {
        match &self.submission.geometry {
            None => self.method.clone(),
            Some(perturbation) => format!("{} ({perturbation})", self.method),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SubmissionId {
    /// SHA-256, hex, over path and SHA-256 of submission.json and of every map of the scored scenes, in order.
    pub sha256: String,
    /// Its description, as stated by the submission.
    pub description: String,
    /// Where to read about it, as stated by the submission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub url: Option<String>,
    /// The method's licence, as stated by the submission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub licence: Option<String>,
    /// What the method costs to run, as stated by the submission.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<Cost>,
    /// Datasets that the method was trained on, as stated by the submission.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub trained_on: Vec<String>,
    /// Whether the submission states that it was made from the ground truth.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub oracle: bool,
    /// How the geometry that it was made from differs from the true one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub geometry: Option<Perturbation>,
}

/// The constancy of a submission's base colours in one family.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Constancy {
    /// The scene that the family shows.
    pub scene: SceneId,
    /// The lightings of its twins.
    pub lightings: Vec<LightingName>,
    /// The area of the texels that the input view shows, in square metres.
    pub area_m2: f64,
    /// Of the base colours as they are.
    pub raw: Deviation,
    /// Of the base colours of each scene and twin after one scale a channel, which brings their mean to that of the
    /// family.
    pub aligned: Deviation,
    /// The mean squared error of the family's mean of raw base colours, linear, mean over channels.
    pub mean_mse: f64,
    /// The mean CIEDE2000 difference of the family's mean of raw base colours from the truth.
    pub mean_delta_e: f64,
}

/// How far the answers to a family lie from their mean. Root mean squares over texels, by area, and over the family.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Deviation {
    /// Linear, also over channels.
    pub linear: f64,
    /// In CIEDE2000, of colours clipped to 0..1.
    pub delta_e: f64,
    /// Of the luminance.
    pub luminance: PartSpread,
    /// Of what remains of a colour without its luminance, also over channels.
    pub chroma: PartSpread,
    /// The deviations of luminance and of chroma, each divided by its contrast: their root mean square. Null where one
    /// of both contrasts is at most 0.505/255, which counts as none.
    pub relative: Option<f64>,
}

/// Of one part of the colours, linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PartSpread {
    /// How far the answers to a family lie from their mean.
    pub deviation: f64,
    /// How far the texels of the family's mean lie from the mean of all its texels.
    pub contrast: f64,
}

impl Deviation {
    /// The value of [`Self::relative`].
    pub(crate) fn guarded(&self) -> Option<f64> {
        let has_contrast = [self.luminance, self.chroma].iter().all(|part| part.contrast > f64::from(HALF_A_BYTE));
        let square = |part: PartSpread| (part.deviation / part.contrast).powi(2);
        has_contrast.then(|| ((square(self.luminance) + square(self.chroma)) / 2.0).sqrt())
    }
}

/// The scores of one protocol.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ProtocolResult {
    /// The rules.
    pub protocol: Protocol,
    /// Numbers of different fingerprints must not be compared.
    pub fingerprint: String,
    /// Mean over scenes. A PSNR that is a lower bound in a picture counts like any other.
    pub summary: BTreeMap<ResultKey, f64>,
    /// Mean over pictures of each scene, by the same keys.
    pub scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    /// Standard errors of the means of PSNR of light in `summary` due to render noise, in dB. Left out unless every scene
    /// with a value has one in `noise`.
    pub summary_noise: BTreeMap<ResultKey, f64>,
    /// Standard errors of each scene's mean PSNR of light due to render noise, in dB, by the same keys. Left out where
    /// a picture has `lower_bound`.
    pub noise: BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    /// By scene, the radiances that were fitted; only under `paper` and `capture-1`.
    pub fits: BTreeMap<SceneId, FittedRadiances>,
    /// The values of every picture over every region.
    pub pictures: Vec<PictureValues>,
    /// The errors of each instance's texels.
    pub texels: Vec<InstanceTexelErrors>,
    /// The errors of each instance's pixels.
    pub instances: Vec<InstancePixelErrors>,
    /// The regions whose colour was measured; only under `capture-1`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub measured: Vec<MeasuredValues>,
}

/// Whether two renderers show the same rooms.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TracerCheck {
    /// Checks that were precise enough to say something.
    pub informative: usize,
    /// Those of them in which both agree.
    pub agree: usize,
}

/// The mean squared errors of one instance's texels, weighted by area.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstanceTexelErrors {
    /// The scene's id.
    pub scene: SceneId,
    /// The instance's id.
    pub instance: InstanceId,
    /// Texels that the input view sees.
    pub observed: TexelErrors,
    /// All other texels.
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
}

/// The squared error of one instance's pixels in one kind of picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct InstancePixelErrors {
    /// The scene's id.
    pub scene: SceneId,
    /// The instance's id.
    pub instance: InstanceId,
    /// The source's category; for architecture the kind of piece, as in `WallInner`; else null.
    pub category: Option<String>,
    /// The source's broader category; `Architecture` for architecture; else null.
    pub super_category: Option<String>,
    /// Albedo, aligned albedo, or light of track `true` or `fitted`.
    pub picture: PictureKind,
    /// `input`, `novel`, `unobserved`, `wide`, `wide_unobserved`.
    pub views: Views,
    /// Valid pixels that show it, in all of these views.
    pub pixels: usize,
    /// Mean over those pixels, in the colour space of the protocol's MSE of that picture; for light without render
    /// noise.
    pub mse: f64,
}

/// What a submission predicts for a region whose colour was measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredValues {
    /// The scene's id.
    pub scene: SceneId,
    /// The view's id.
    pub view: ViewId,
    /// The region's name.
    pub region: String,
    /// The pixels whose mean `predicted` is.
    pub pixels: usize,
    /// The mean predicted base colour, linear Rec. 709.
    pub predicted: [f64; 3],
    /// The measured colour, linear Rec. 709.
    pub measured: [f64; 3],
    /// CIEDE2000 between both, without any scale.
    pub delta_e: f64,
    /// How far the measurement itself may be off, as CIEDE2000; absent where its error is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measurement_delta_e: Option<f64>,
}

/// The values of one picture over one region.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PictureValues {
    /// The scene's id.
    pub scene: SceneId,
    /// The view's id.
    pub view: ViewId,
    /// What was compared; ends with `_specular` where only pixels that are metal or smooth in truth count.
    pub picture: PictureName,
    /// The lighting of a picture of kind `rgb_relit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lighting: Option<LightingName>,
    /// The pixels that count.
    pub region: Region,
    /// Their number. SSIM of a mask is a mean over the windows that lie wholly inside.
    pub pixels: usize,
    /// Of photos of a captured room: the share of the region's pixels that do not count, 0 to 1, because they are clipped
    /// or the depth jumps beside them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<f64>,
    /// The value of each metric; those are left out for which no pixel or window counts.
    #[schemars(with = "BTreeMap<String, f64>")]
    pub values: BTreeMap<Metric, f64>,
    /// Of light: the standard error of the MSE due to noise of the paths of prediction and truth. The noise
    /// of R, which `scorer.json` states, is not in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mse_error: Option<f64>,
    /// The MSE was exactly zero, and its PSNR is the cap.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub exact: bool,
    /// Of light: the error may be noise alone; the PSNR is that of 1.645 standard errors of the MSE.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lower_bound: bool,
}

/// Numbers that could not be computed.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MissingMetric {
    /// The metric, or the kind of picture.
    pub metric: MissingNumbers,
    /// Why.
    pub reason: String,
    /// The command that makes it available.
    pub fix: String,
}

/// The numbers that are missing: all of one metric, or all of one kind of picture. A single word in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum MissingNumbers {
    Metric(Metric),
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

impl std::str::FromStr for MissingNumbers {
    type Err = UnknownWord;

    fn from_str(word: &str) -> Result<Self, UnknownWord> {
        word.parse().map(Self::Metric).or_else(|_| word.parse().map(Self::Picture))
    }
}

by_text!(MissingNumbers, UnknownWord, "^[a-z0-9_]+$");

impl PictureValues {
    /// A picture without values yet.
    pub fn new(scene: SceneId, view: ViewId, picture: PictureName, region: Region, pixels: usize) -> Self {
        Self {
            scene,
            view,
            picture,
            lighting: None,
            region,
            pixels,
            left_out: None,
            values: BTreeMap::new(),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }

    /// The mean that one of its values counts for.
    pub fn key(&self, metric: Metric) -> ResultKey {
        ResultKey { picture: self.picture, views: Views::of(&self.view, self.region), metric }
    }
}

/// The means of each scene, over its pictures and over its texels weighted by area, and the means of the dataset over
/// its scenes. PSNRs are averaged in dB. A mean skips missing values; the dataset's mean of a key skips scenes without a
/// value of that key.
pub fn means(
    pictures: &[PictureValues],
    texels: &[InstanceTexelErrors],
) -> (BTreeMap<SceneId, BTreeMap<ResultKey, f64>>, BTreeMap<ResultKey, f64>) {
    let of_picture = |picture: &PictureValues| {
        let key = |metric: &Metric| (picture.scene.clone(), picture.key(*metric));
        picture.values.iter().map(|(metric, value)| (key(metric), *value)).collect::<Vec<_>>()
    };
    let mut scenes: BTreeMap<SceneId, BTreeMap<ResultKey, f64>> = BTreeMap::new();
    for ((scene, key), mean) in means_of(pictures.iter().flat_map(of_picture)).into_iter().chain(texel_means(texels)) {
        scenes.entry(scene).or_default().insert(key, mean);
    }
    let summary = means_of(scenes.values().flatten().map(|(key, value)| (*key, *value)));
    (scenes, summary)
}

/// The mean of each key's values, which are summed in their order.
fn means_of<K: Ord>(values: impl Iterator<Item = (K, f64)>) -> BTreeMap<K, f64> {
    let mut sums: BTreeMap<K, (f64, usize)> = BTreeMap::new();
    for (key, value) in values {
        let (sum, count) = sums.entry(key).or_default();
        *sum += value;
        *count += 1;
    }
    sums.into_iter().map(|(key, (sum, count))| (key, sum / count as f64)).collect()
}

/// For each scene, of observed and of unobserved texels: the mean squared error weighted by area, and its PSNR.
fn texel_means(texels: &[InstanceTexelErrors]) -> Vec<((SceneId, ResultKey), f64)> {
    let mut sums: BTreeMap<(SceneId, ResultKey), [f64; 2]> = BTreeMap::new();
    for instance in texels {
        for (views, errors) in [(Views::Observed, &instance.observed), (Views::Unobserved, &instance.unobserved)] {
            let Some(mse) = errors.base_color_mse else { continue };
            let key = ResultKey::whole(PictureKind::TextureBaseColor, views, Metric::Mse);
            let sums = sums.entry((instance.scene.clone(), key)).or_default();
            sums[0] += errors.area_m2 * mse;
            sums[1] += errors.area_m2;
        }
    }
    let of = |((scene, key), [sum, area]): ((SceneId, ResultKey), [f64; 2])| {
        let psnr = Psnr::from_mse(sum / area).ok()?;
        Some([((scene.clone(), key), sum / area), ((scene, key.with(Metric::Psnr)), psnr.db)])
    };
    sums.into_iter().filter_map(of).flatten().collect()
}

/// The standard error of the dataset's mean of each key, where every scene with a value has one. The noise of different
/// scenes is independent, since a scene's id is part of its seeds. `scenes` are the scenes' means.
pub fn summary_noise(
    noise: &BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
    scenes: &BTreeMap<SceneId, BTreeMap<ResultKey, f64>>,
) -> BTreeMap<ResultKey, f64> {
    let mut sums: BTreeMap<ResultKey, (usize, f64)> = BTreeMap::new();
    for (key, error) in noise.values().flatten() {
        let (count, squares) = sums.entry(*key).or_default();
        *count += 1;
        *squares += error * error;
    }
    let valued = |key: &ResultKey| scenes.values().filter(|values| values.contains_key(key)).count();
    let whole = sums.into_iter().filter(|(key, (count, _))| *count == valued(key));
    whole.map(|(key, (count, squares))| (key, squares.sqrt() / count as f64)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(text: &str) -> ResultKey {
        text.parse().unwrap()
    }

    fn value(scene: &str, view: &str, region: Region, value: Option<f64>) -> PictureValues {
        let (scene, view) = (SceneId::new(scene).unwrap(), ViewId::new(view).unwrap());
        let picture = PictureValues::new(scene, view, PictureName::whole(PictureKind::Albedo), region, 1);
        PictureValues { values: value.map(|value| (Metric::Psnr, value)).into_iter().collect(), ..picture }
    }

    /// Two instances of 1 and 3 square metres.
    #[test]
    fn texels_count_by_area() {
        let texels = |name: &str, area_m2: f64, mse: f64| InstanceTexelErrors {
            scene: SceneId::new("a").unwrap(),
            instance: InstanceId::new(name).unwrap(),
            observed: TexelErrors { area_m2, base_color_mse: Some(mse) },
            unobserved: TexelErrors::default(),
        };
        let (scenes, summary) = means(&[], &[texels("x", 1.0, 0.04), texels("y", 3.0, 0.0)]);
        assert!((summary[&key("texture_base_color.observed.mse")] - 0.01).abs() < 1e-15);
        assert!((summary[&key("texture_base_color.observed.psnr")] - 20.0).abs() < 1e-12);
        assert_eq!(scenes.values().next().map(BTreeMap::len), Some(2));
    }

    /// Without the error of one scene, that of the mean is not known.
    #[test]
    fn noise_of_scenes_is_independent() {
        let key = key("rgb_true.input.psnr");
        let scene = |name: &str, error| (SceneId::new(name).unwrap(), BTreeMap::from([(key, error)]));
        let scenes = BTreeMap::from([scene("a", 20.0), scene("b", 25.0)]);
        let both = BTreeMap::from([scene("a", 0.03), scene("b", 0.04)]);
        assert!((summary_noise(&both, &scenes)[&key] - 0.025).abs() < 1e-15);
        assert!(summary_noise(&BTreeMap::from([scene("a", 0.1)]), &scenes).is_empty());
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
