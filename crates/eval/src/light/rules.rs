//! The part of a protocol that defines the light under which predictions are compared, and the precision of the numbers.

use std::collections::BTreeMap;

use mateval_light::rules::{FitRules, StageRules};
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
    /// The samples of predictions.
    pub samples: SampleRules,
}

/// The weights of track `relit`. Groups are ordered by the luminance of R's input view under each alone, over valid pixels,
/// brightest first; groups that bring less than [`Self::least_share`] of it are left out of the order. Every lighting is then
/// scaled so that R's input view has the mean luminance that it has under the scene's own lights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelitRules {
    /// Lighting `warm_cool`: the weights of the first, third, ... group, by channel.
    pub warm: [f64; 3],
    /// Lighting `warm_cool`: the weights of the second, fourth, ... group.
    pub cool: [f64; 3],
    /// The number of lightings `alone_1`, `alone_2`, ..., in which one group has weight 1 and all others 0. Scenes of one group
    /// have none.
    pub alone_at_most: usize,
    /// The smallest share of the light of a group that takes part.
    pub least_share: f64,
}

/// The samples of predictions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SampleRules {
    /// First word of the texts whose hashes seed the paths.
    pub seed: String,
    /// Samples per pixel of each half of a view of 320x240 pixels; inversely as many as a view has pixels, rounded to an even
    /// number.
    pub at_320x240: u32,
    pub least: u32,
    pub most: u32,
    /// Side of the blocks of pixels within which noise counts as correlated, in pixels of the input view.
    pub block_pixels: u32,
}

impl SampleRules {
    /// Samples per pixel of each half of views of `pixels` pixels.
    pub fn each_half(&self, pixels: u64) -> u32 {
        let exact = f64::from(self.at_320x240) * (320.0 * 240.0) / pixels.max(1) as f64;
        (2 * (exact / 2.0).round() as u32).min(self.most).max(self.least)
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
            relit: RelitRules { warm: [1.3, 1.0, 0.6], cool: [0.6, 0.9, 1.3], alone_at_most: 1, least_share: 0.05 },
            samples: SampleRules { seed: "mateval".to_owned(), at_320x240: 32, least: 16, most: 64, block_pixels: 16 },
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
    fn samples_fall_with_the_number_of_pixels() {
        let samples = Protocol::named("mateval-3").unwrap().light.samples;
        let sizes = [(64, 48), (160, 120), (240, 180), (320, 240), (400, 300), (480, 270), (640, 480)];
        let found = sizes.map(|(width, height): (u64, u64)| samples.each_half(width * height));
        assert_eq!(found, [64, 64, 56, 32, 20, 18, 16]);
    }
}
