//! Choices of the de-lighting baseline.

use mateval_light::joint_fit::JointFitRules;
use serde::{Deserialize, Serialize};

/// Which lights may shine.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CandidateLights {
    /// What may glow in the room, the world around it, and the lights of a stage.
    #[default]
    Room,
    /// The lights of a stage alone, as in PSDR-Room.
    Stage,
}

/// How a photo is de-lit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DelightOptions {
    /// Which lights may shine.
    pub lights: CandidateLights,
    /// Paths per pixel of the rounds; the last one's number is that of further rounds.
    pub samples: [u32; 3],
    /// Whether radiance is read from the photo where a path meets what it shows. Without, colours are assumed there
    /// too.
    pub photo_cache: bool,
    /// The largest number of rounds.
    pub most_rounds: usize,
    /// How light and colour are separated.
    pub fit: JointFitRules,
    /// The seed of all paths.
    pub seed: u64,
}

impl Default for DelightOptions {
    fn default() -> Self {
        Self {
            lights: CandidateLights::Room,
            samples: [8, 16, 64],
            photo_cache: true,
            most_rounds: 4,
            fit: JointFitRules::default(),
            seed: 0,
        }
    }
}
