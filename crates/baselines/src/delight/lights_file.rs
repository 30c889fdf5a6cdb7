//! `lights.json` of a de-lit photo.

use serde::{Deserialize, Serialize};

use super::options::CandidateLights;
use super::possible_light::FittedLight;

/// The format's name.
pub(super) const LIGHTS_FORMAT: &str = "mateval-fitted-lights/2";

/// The fitted lights of a scene.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct LightsFile {
    /// [`LIGHTS_FORMAT`].
    pub(super) format: String,
    /// Which lights were given the chance to shine.
    pub(super) candidates: CandidateLights,
    /// Candidates of the room first, then the lights of the stage.
    pub(super) lights: Vec<FittedLight>,
}

impl LightsFile {
    /// The names of the lights.
    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.lights.iter().map(|fitted| fitted.light.name.as_str())
    }
}
