//! Scores of one submission in one scene under one protocol, nested by view and picture until the result is written.

use std::collections::BTreeMap;

use mateval_scene::ViewId;
use serde::{Deserialize, Serialize};

use crate::fitted_radiances::FittedRadiances;
use crate::instance_errors::InstanceErrors;
use crate::measure::Measured;
use crate::relit::LightingName;
use crate::result::{InstancePixelErrors, InstanceTexelErrors, PsnrNoise};
use crate::result_key::{PictureKind, PictureName, Region, Views};
use crate::scene_task::MaskedRegion;
use crate::truth_noise::NoisyLighting;

/// What one submission scored in one scene under one protocol.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneScore {
    /// In the order of measuring; a view comes again under each light.
    pub(crate) views: Vec<ViewScore>,
    pub(crate) texels: Vec<InstanceTexelErrors>,
    pub(crate) instances: Vec<InstancePixelErrors>,
    pub(crate) noise: Vec<NoiseScore>,
    /// SHA-256, hex, of the `companions.json` of each pass.
    pub(crate) companions: BTreeMap<String, String>,
    pub(crate) noisy_lightings: Vec<NoisyLighting>,
    pub(crate) fit: Option<FittedRadiances>,
    /// Number of contributions of light that were not finite and count as none.
    pub(crate) not_finite: u64,
}

/// Pictures of one view.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct ViewScore {
    pub(crate) view: ViewId,
    pub(crate) pictures: Vec<PictureScore>,
}

/// The metrics of one picture over one of its regions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct PictureScore {
    pub(crate) picture: PictureName,
    /// For pictures of kind `rgb_relit`.
    pub(crate) lighting: Option<LightingName>,
    pub(crate) region: Region,
    pub(crate) metrics: Vec<Measured>,
}

/// The noise in the mean PSNR of a picture over some views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct NoiseScore {
    pub(crate) picture: PictureName,
    pub(crate) views: Views,
    pub(crate) noise: PsnrNoise,
}

/// Scores of one submission and protocol while a scene is being scored.
#[derive(Default)]
pub(crate) struct ScoreSheet {
    pub(crate) score: SceneScore,
    pub(crate) errors: InstanceErrors,
}

impl ScoreSheet {
    /// Adds the numbers of wide views from a sheet that holds the input view's too.
    pub(crate) fn add_wide(&mut self, sheet: Self) {
        let is_wide = |views: Views| matches!(views, Views::Wide | Views::WideUnobserved);
        let SceneScore { views, noise, companions, not_finite, .. } = sheet.score;
        self.score.views.extend(views.into_iter().filter(|score| score.view.is_wide()));
        self.score.noise.extend(noise.into_iter().filter(|score| is_wide(score.views)));
        self.score.companions.extend(companions);
        self.score.not_finite += not_finite;
        self.errors.extend_where(sheet.errors, is_wide);
    }
}

impl SceneScore {
    /// Adds pictures of a view.
    pub(crate) fn add(&mut self, view: &ViewId, pictures: Vec<PictureScore>) {
        match self.views.last_mut().filter(|last| last.view == *view) {
            Some(last) => last.pictures.extend(pictures),
            None => self.views.push(ViewScore { view: view.clone(), pictures }),
        }
    }
}

impl MaskedRegion {
    /// What was measured of a kind of picture over this region.
    pub(crate) fn score(
        &self,
        kind: PictureKind,
        lighting: Option<LightingName>,
        metrics: Vec<Measured>,
    ) -> PictureScore {
        let picture = PictureName { kind, surfaces: self.surfaces };
        PictureScore { picture, lighting, region: self.region, metrics }
    }
}
