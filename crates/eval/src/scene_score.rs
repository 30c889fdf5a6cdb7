//! Scores of one submission in one scene under one protocol, and what they are made of while the scene is being scored.

use std::collections::BTreeMap;

use mateval_image::{Mask, Picture};
use mateval_scene::dataset::SceneFile;
use serde::{Deserialize, Serialize};

use crate::light::error::LightMse;
use crate::light::lighting::FittedRadiances;
use crate::result::{InstancePixelErrors, InstanceTexelErrors, PictureValues};
use crate::result_key::{PictureKind, ResultKey, Views};

/// What one submission scored in one scene under one protocol.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneScore {
    pub(crate) pictures: Vec<PictureValues>,
    pub(crate) texels: Vec<InstanceTexelErrors>,
    pub(crate) instances: Vec<InstancePixelErrors>,
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
    /// The errors of light by the mean that they count for.
    pub(crate) light_errors: BTreeMap<ResultKey, Vec<LightMse>>,
}

/// Sums of squared errors of a scene's pixels by picture, views and instance.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceErrors(BTreeMap<(PictureKind, Views, u16), (f64, usize)>);

impl InstanceErrors {
    /// Adds `error(k)`, a mean over channels, of every pixel k in the mask to the instance that it shows.
    pub(crate) fn add(
        &mut self,
        picture: PictureKind,
        views: Views,
        instances: &Picture<u16>,
        mask: &Mask,
        error: impl Fn(usize) -> f64,
    ) {
        let mut sums: BTreeMap<u16, (f64, usize)> = BTreeMap::new();
        for (pixel, instance) in instances.pixels().iter().enumerate().filter(|(pixel, _)| mask.pixels()[*pixel]) {
            let (sum, count) = sums.entry(*instance).or_default();
            *sum += error(pixel);
            *count += 1;
        }
        for (instance, (sum, count)) in sums {
            let all = self.0.entry((picture, views, instance)).or_default();
            all.0 += sum;
            all.1 += count;
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
