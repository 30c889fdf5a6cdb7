//! One scene while it is scored: the inputs of the task, the regions of its views, and the sheets on which scores are
//! collected.

use std::collections::BTreeMap;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::INPUT;
use mateval_dataset::lighting::LightingName;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, RendererId, SceneId, ViewId};
use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_light::light_fit::FittedRadiances;
use mateval_metrics::pixel::pixel_count;
use mateval_metrics::{Lpips, MetricError};
use mateval_submission::prediction::PredictedScene;
use serde::{Deserialize, Serialize};

use crate::error::EvalError;
use crate::light::difference::{LightDifference, base_color_ratio};
use crate::light::mse::{LightMse, mean_psnr_error};
use crate::light::reference::StoredReference;
use crate::metric::{ColorPicture, PictureKind};
use crate::pictures_dir::PicturesDir;
use crate::protocol::{Protocol, Track};
use crate::result::key::{PictureName, Region, ResultKey, Surfaces, Views};
use crate::result::{InstancePixelErrors, InstanceTexelErrors, MeasuredValues, PictureValues};
use crate::truth::{OpenScene, ViewSet, ViewTruth};

/// The inputs for scoring all submissions in one set of views of a scene.
#[derive(Clone)]
pub(crate) struct SceneTask<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) scene: &'a SceneFile,
    pub(crate) open: &'a OpenScene,
    pub(crate) views: Vec<&'a View>,
    pub(crate) set: ViewSet,
    pub(crate) predictions: &'a [PredictedScene],
    pub(crate) protocols: &'a [Protocol],
    pub(crate) lpips: Option<&'a Lpips>,
    /// R. Without it, light of the scene's own emitters is not scored.
    pub(crate) reference: Option<&'a StoredReference>,
    /// The photo's renderer. Without it, fitted light is not scored.
    pub(crate) renderer: Option<&'a RendererId>,
    /// Where pictures are kept for whoever recomputes the numbers.
    pub(crate) pictures: Option<&'a PicturesDir>,
    pub(crate) seen: Option<&'a SeenSink<'a>>,
    pub(crate) progress: Progress<'a>,
}

/// A view of a submission under light as SSIM compares it, clipped and encoded: for pages.
pub struct SeenLight<'a> {
    /// The submission's place in the plan.
    pub submission: usize,
    pub scene: &'a SceneId,
    pub view: &'a ViewId,
    pub kind: PictureKind,
    pub valid: &'a Mask,
    pub reference: &'a Picture<SrgbRgb>,
    pub prediction: &'a Picture<SrgbRgb>,
}

pub type SeenSink<'a> = dyn Fn(&SeenLight<'_>) -> Result<(), EvalError> + Sync + 'a;

/// The views of a prediction under one light, compared with the reference.
pub(crate) struct LitViews<'a> {
    pub(crate) track: Track,
    pub(crate) lighting: Option<LightingName>,
    /// What it is compared with, by view.
    pub(crate) references: &'a [ColorPicture],
    pub(crate) views: Vec<LightDifference>,
    /// For fitted lights, the views under the lights of each of two fits.
    pub(crate) of_fits: Option<[Vec<LightDifference>; 2]>,
    pub(crate) fit: Option<FittedRadiances>,
    /// Contributions of light that were not finite and count as none.
    pub(crate) not_finite: u64,
}

/// Takes the views of a prediction, by its number.
pub(crate) type LitSink<'a> = dyn FnMut(usize, LitViews<'_>) -> Result<(), EvalError> + 'a;

pub(crate) struct BaseColors {
    /// Looked up in the true atlases as predictions are in theirs, unlike [`ViewTruth::albedo`], which the dataset
    /// holds.
    pub(crate) truth: Vec<Picture<LinearRgb>>,
    pub(crate) predicted: Vec<Vec<Picture<LinearRgb>>>,
}

impl BaseColors {
    /// The ratio r of a submission's base colour to the truth's, in every view.
    pub(crate) fn ratios(&self, submission: usize) -> Vec<Picture<LinearRgb>> {
        self.predicted[submission].iter().zip(&self.truth).map(|(p, t)| base_color_ratio(p, t)).collect()
    }
}

/// A region of a view on some of its surfaces, with the mask of its pixels.
pub(crate) struct MaskedRegion {
    pub(crate) region: Region,
    pub(crate) surfaces: Surfaces,
    pub(crate) mask: Mask,
    /// Of photos: the share of the region's pixels that do not count and are not in the mask; absent if it has none.
    pub(crate) left_out: Option<f64>,
}

impl SceneTask<'_> {
    /// The same task over one set of its views; absent if the set is empty.
    pub(crate) fn over(&self, set: ViewSet) -> Option<Self> {
        let views = set.of(&self.views);
        (!views.is_empty()).then(|| Self { views, set, ..self.clone() })
    }

    pub(crate) fn truths(&self) -> Result<Vec<ViewTruth>, EvalError> {
        self.views.iter().map(|view| ViewTruth::read(&self.open.folder, view)).collect()
    }

    pub(crate) fn input_view(&self) -> Result<&View, EvalError> {
        self.scene.view(INPUT).ok_or_else(|| EvalError::no_input_view(&self.scene.id))
    }

    /// Pixels of each view.
    pub(crate) fn pixels(&self) -> impl Iterator<Item = u64> + '_ {
        let of = |view: &&View| u64::from(view.camera.intrinsics.width) * u64::from(view.camera.intrinsics.height);
        self.views.iter().map(of)
    }

    /// Adds scene and view to an error of a metric.
    pub(crate) fn locate_error<T>(&self, view: &View, found: Result<T, MetricError>) -> Result<T, EvalError> {
        found.map_err(|source| EvalError::Metric { scene: self.scene.id.clone(), view: view.id.clone(), source })
    }
}

/// The regions of a view over which metrics are computed: all valid pixels first.
pub(crate) fn regions(truth: &ViewTruth) -> Vec<MaskedRegion> {
    let all = [
        (Region::Valid, Surfaces::All, Some(&truth.valid)),
        (Region::Unobserved, Surfaces::All, truth.unobserved.as_ref()),
        (Region::Valid, Surfaces::Specular, truth.specular.as_ref()),
    ];
    let masked = |(region, surfaces, mask): (_, _, Option<&Mask>)| {
        Some(MaskedRegion { region, surfaces, mask: mask?.clone(), left_out: None })
    };
    all.into_iter().filter_map(masked).collect()
}

impl MaskedRegion {
    /// Whether it holds all valid pixels of its view, so that metrics with windows are taken over it.
    pub(crate) fn is_whole(&self) -> bool {
        (self.region, self.surfaces) == (Region::Valid, Surfaces::All)
    }

    /// The region without the pixels that are not `counted`.
    pub(crate) fn narrowed(self, counted: &Mask) -> Self {
        let mask = Mask::from_fn(counted.width(), counted.height(), |x, y| self.mask.get(x, y) && counted.get(x, y));
        let [all, left] = [&self.mask, &mask].map(pixel_count);
        Self { mask, left_out: (all > 0).then(|| 1.0 - left as f64 / all as f64), ..self }
    }

    /// A picture over this region, without values yet.
    pub(crate) fn values(
        &self,
        scene: &SceneId,
        view: &ViewId,
        kind: PictureKind,
        lighting: Option<LightingName>,
    ) -> PictureValues {
        let picture = PictureName { kind, surfaces: self.surfaces };
        let (left_out, pixels) = (self.left_out, pixel_count(&self.mask));
        let blank = PictureValues::new(scene.clone(), view.clone(), picture, self.region, pixels);
        PictureValues { lighting, left_out, ..blank }
    }
}

/// What one submission scored in one scene under one protocol.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneScore {
    pub(crate) pictures: Vec<PictureValues>,
    pub(crate) texels: Vec<InstanceTexelErrors>,
    pub(crate) instances: Vec<InstancePixelErrors>,
    #[serde(default)]
    pub(crate) measured: Vec<MeasuredValues>,
    /// Standard errors of the scene's mean PSNRs of light, in dB.
    pub(crate) noise: BTreeMap<ResultKey, f64>,
    pub(crate) fit: Option<FittedRadiances>,
    /// Number of contributions of light that were not finite and count as none.
    pub(crate) not_finite: u64,
}

/// Scores of one submission and protocol while a scene is being scored.
#[derive(Default)]
pub(crate) struct ScoreSheet {
    pub(crate) score: SceneScore,
    pub(crate) errors: InstanceErrors,
    /// The MSEs of light by the mean that they count for.
    pub(crate) light_mses: BTreeMap<ResultKey, Vec<LightMse>>,
}

impl ScoreSheet {
    /// States the noise of the scene's mean PSNRs, once all pictures have been measured. Where one is a lower bound, a
    /// standard error would say nothing.
    pub(crate) fn state_noise(&mut self) {
        for (key, mses) in std::mem::take(&mut self.light_mses) {
            if mses.iter().any(LightMse::is_lower_bound) {
                continue;
            }
            self.score.noise.extend(mean_psnr_error(&mses).map(|error| (key, error)));
        }
    }
}

/// Sums of squared errors of a scene's pixels by picture, views and instance.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceErrors(BTreeMap<(PictureKind, Views, u16), (f64, usize)>);

impl InstanceErrors {
    /// Adds `error(k)`, a mean over channels, of every pixel k of the view's regions on all surfaces to the instance
    /// that it shows.
    pub(crate) fn add(
        &mut self,
        picture: PictureKind,
        view: &ViewId,
        instances: &Picture<u16>,
        regions: &[MaskedRegion],
        error: impl Fn(usize) -> f64,
    ) {
        for MaskedRegion { region, mask, .. } in regions.iter().filter(|region| region.surfaces == Surfaces::All) {
            let mut sums: BTreeMap<u16, (f64, usize)> = BTreeMap::new();
            for (pixel, instance) in instances.pixels().iter().enumerate().filter(|(pixel, _)| mask.pixels()[*pixel]) {
                let (sum, count) = sums.entry(*instance).or_default();
                *sum += error(pixel);
                *count += 1;
            }
            for (instance, (sum, count)) in sums {
                let all = self.0.entry((picture, Views::of(view, *region), instance)).or_default();
                all.0 += sum;
                all.1 += count;
            }
        }
    }

    /// The means, by picture, views and index. Pixels that show no instance are left out.
    pub(crate) fn finish(self, scene: &SceneFile) -> Vec<InstancePixelErrors> {
        let means = self.0.into_iter().filter_map(|((picture, views, index), (sum, pixels))| {
            let instance = scene.instances.iter().find(|instance| instance.index.0.get() == index)?;
            Some(InstancePixelErrors {
                scene: scene.id.clone(),
                instance: instance.id.clone(),
                category: instance.listed_category().map(str::to_owned),
                super_category: instance.listed_super_category().map(str::to_owned),
                picture,
                views,
                pixels,
                mse: sum / pixels as f64,
            })
        });
        means.collect()
    }
}
