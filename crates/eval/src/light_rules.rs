//! The part of a protocol that defines the light under which predictions are compared, and the precision of the numbers.

use std::collections::BTreeMap;

use mateval_light::rules::{FitRules, StageRules};
use mateval_metrics::NoiseFreeMse;
use mateval_scene::material::PrincipledFlavour;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::result_key::PictureKind;

/// The light under which a prediction is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Track {
    /// The paper's track: radiances fitted to the input view, of a light stage (3D-FRONT) or the scene's own emitters (Bitterli).
    Fitted,
    /// The reference's own emitters.
    True,
    /// The same emitters with weights that no method has seen.
    Relit,
}

impl Track {
    /// The kind of its pictures.
    pub fn picture(self) -> PictureKind {
        match self {
            Self::Fitted => PictureKind::RgbFitted,
            Self::True => PictureKind::RgbTrue,
            Self::Relit => PictureKind::RgbRelit,
        }
    }
}

/// How predictions are rendered.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightRules {
    /// The lights.
    pub tracks: Vec<Track>,
    /// The renderer whose `principled` material predictions use, with specular 0.5, two-sided and without bumps.
    pub flavour: PrincipledFlavour,
    /// The largest number of scatterings after the first hit.
    pub max_bounces: u32,
    /// The first bounce at which Russian roulette may end a path.
    pub roulette_start: u32,
    /// The probability that a path survives Russian roulette.
    pub roulette_survival: f32,
    /// The positions of a stage's lights: constants by name, which `PROTOCOL.md` defines.
    #[schemars(with = "BTreeMap<String, f64>")]
    pub stage: StageRules,
    /// The fit of radiances.
    pub fit: FitRules,
    /// The weights of track `relit`.
    pub relit: RelitRules,
    /// The numbers of samples.
    pub noise: NoiseRules,
}

/// The weights of track `relit`. Groups are ordered by the luminance of the truth's input view under each alone, over valid
/// pixels, brightest first; groups that bring less than [`Self::least_share`] of it are left out of the order. Every lighting
/// is then scaled so that the truth's input view has the mean luminance of the photo.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelitRules {
    /// Lighting `warm_cool`: the weights of the first, third, ... group, by channel.
    pub warm: [f64; 3],
    /// Lighting `warm_cool`: the weights of the second, fourth, ... group.
    pub cool: [f64; 3],
    /// The largest number of lightings `alone_1`, `alone_2`, ..., in which one group has weight 1 and all others 0. Scenes of
    /// one group have none.
    pub alone_at_most: usize,
    /// The smallest share of the light of a group that takes part.
    pub least_share: f64,
    /// The largest variance that noise causes in the truth's encoded input view (the mean of both halves; averaged over valid
    /// pixels and channels) in a lighting that is scored. In a noisier picture the bias that encoding leaves would keep the
    /// true material from scoring best.
    pub most_truth_variance: f64,
}

/// The numbers of samples, which follow from a pilot render with samples of its own. All are per pixel of each half; the
/// quarters of a half take half as many.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseRules {
    /// First word of the texts whose hashes seed the paths.
    pub seed: String,
    /// Samples of the pilot, per pixel of its own.
    pub pilot_samples: u32,
    /// Side of the pilot's pixels, in pixels of a view.
    pub pilot_pixels: u32,
    /// The smallest number of samples; doubled until the noise is small enough or `most_samples` is reached.
    pub least_samples: u32,
    /// The largest number of samples.
    pub most_samples: u32,
    /// The smallest number of samples of the converged pictures of the companions, which have as many as the truth: with
    /// fewer their noise would lower SSIM, and with more the truth's noise would decide.
    pub least_companion_samples: u32,
    /// The largest number of samples of these pictures.
    pub most_companion_samples: u32,
    /// The largest standard error of a scene's mean PSNR that the noise of our own paths may cause, in dB.
    pub target_db: f64,
    /// Where the noise of truth and companions is larger than that, ours may be this share of it; the state in a result counts
    /// the noise of the fit too.
    pub truth_share: f64,
    /// A standard error of a picture's MSE that is small enough, whatever the MSE: predictions that are nearly the truth need
    /// not be distinguished to `target_db`.
    pub target_mse: f64,
    /// Side of the blocks of pixels within which noise counts as correlated, in pixels of the input view.
    pub block_pixels: u32,
}

impl NoiseRules {
    /// The number of samples of the companions' converged pictures, where the truth's halves have `truth` samples.
    pub fn companion_samples(&self, truth: u32) -> u32 {
        truth.max(self.least_companion_samples).min(self.most_companion_samples)
    }

    /// The largest standard error of the mean PSNR of some pictures that is small enough, in dB: to first order that of
    /// `target_mse`, and at least `target_db`.
    pub fn allowed_db(&self, pictures: &[NoiseFreeMse]) -> f64 {
        let of_mse = |picture: &NoiseFreeMse| self.target_mse / picture.bounded().max(f64::MIN_POSITIVE);
        let mean = pictures.iter().map(of_mse).sum::<f64>() / pictures.len().max(1) as f64;
        self.target_db.max(10.0 / std::f64::consts::LN_10 * mean)
    }
}

impl LightRules {
    /// Rules with the values that all protocols share.
    pub fn new(tracks: Vec<Track>, flavour: PrincipledFlavour) -> Self {
        let settings = mateval_tracer::RenderSettings::default();
        Self {
            tracks,
            flavour,
            max_bounces: settings.max_bounces,
            roulette_start: settings.roulette_start,
            roulette_survival: settings.roulette_survival,
            stage: StageRules::default(),
            fit: FitRules::default(),
            relit: RelitRules {
                warm: [1.3, 1.0, 0.6],
                cool: [0.6, 0.9, 1.3],
                alone_at_most: 3,
                least_share: 0.05,
                most_truth_variance: 5e-4,
            },
            noise: NoiseRules {
                seed: "mateval".to_owned(),
                pilot_samples: 2,
                pilot_pixels: 2,
                least_samples: 4,
                most_samples: 64,
                least_companion_samples: 128,
                most_companion_samples: 256,
                target_db: 0.02,
                truth_share: 1.0,
                target_mse: 2e-5,
                block_pixels: 16,
            },
        }
    }

    /// Settings of a render with `samples` per pixel.
    pub fn settings(&self, samples: u32) -> mateval_tracer::RenderSettings {
        mateval_tracer::RenderSettings {
            samples,
            max_bounces: self.max_bounces,
            roulette_start: self.roulette_start,
            roulette_survival: self.roulette_survival,
            ..Default::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::protocol::Protocol;

    #[test]
    fn companions_have_as_many_samples_as_the_truth_within_bounds() {
        let noise = Protocol::named("mateval-2").unwrap().light.noise;
        assert_eq!([24, 200, 1000].map(|truth| noise.companion_samples(truth)), [128, 200, 256]);
    }
}
