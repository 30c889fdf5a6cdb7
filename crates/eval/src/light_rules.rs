//! The part of a protocol that says by what light predictions are looked at, and how sure the numbers are to be.

use mateval_light::rules::{FitRules, StageRules};
use mateval_scene::material::PrincipledFlavour;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::result_key::PictureKind;

/// Under what light a prediction is rendered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Track {
    /// The paper's: radiances fitted to the input view, of a light stage (3D-FRONT) or the scene's own emitters (Bitterli).
    Fitted,
    /// The reference's own emitters.
    True,
    /// The same emitters under weights that no method saw.
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
    /// Under what light.
    pub tracks: Vec<Track>,
    /// Whose `principled` predictions are made of; specular 0.5, two-sided, without bumps.
    pub flavour: PrincipledFlavour,
    /// Scatterings after the first hit after which a path is cut.
    pub max_bounces: u32,
    /// From this bounce on paths end by chance.
    pub roulette_start: u32,
    /// The probability to go on then.
    pub roulette_survival: f32,
    /// Where the lights of a stage are.
    pub stage: StageRules,
    /// How radiances are fitted.
    pub fit: FitRules,
    /// The weights of track `relit`.
    pub relit: RelitRules,
    /// How many samples are taken.
    pub noise: NoiseRules,
}

/// The weights of track `relit`. Groups are ordered by the luminance of the truth's input view under each alone, over valid
/// pixels, brightest first; groups that light nothing there take no part.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelitRules {
    /// Lighting `dim`: of all groups.
    pub dim: f64,
    /// Lighting `warm_cool`: of the first, third, ... group, by channel.
    pub warm: [f64; 3],
    /// Of the second, fourth, ... group.
    pub cool: [f64; 3],
    /// Lightings `alone_1`, `alone_2`, ...: that group alone, 1; at most so many, and none in scenes of one group.
    pub alone_at_most: usize,
}

/// How many samples are taken, by a pilot of its own samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoiseRules {
    /// Samples a pixel of each of the pilot's halves.
    pub pilot_samples: u32,
    /// The least samples a pixel of each half; doubled until `target_db` or `most_samples`.
    pub least_samples: u32,
    /// The most samples a pixel of each half.
    pub most_samples: u32,
    /// What the standard error of a scene's mean PSNR by our own noise shall be at most.
    pub target_db: f64,
    /// Where the truth's own noise is larger than `target_db`, ours need only be this share of it.
    pub truth_share: f64,
    /// Side of the blocks of pixels within which noise is taken to be correlated, in pixels of the input view.
    pub block_pixels: u32,
}

impl LightRules {
    /// What both protocols have in common.
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
            relit: RelitRules { dim: 0.3, warm: [1.3, 1.0, 0.6], cool: [0.6, 0.9, 1.3], alone_at_most: 3 },
            noise: NoiseRules {
                pilot_samples: 4,
                least_samples: 16,
                most_samples: 32,
                target_db: 0.02,
                truth_share: 1.0,
                block_pixels: 16,
            },
        }
    }

    /// Settings of a picture of `samples` a pixel.
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
