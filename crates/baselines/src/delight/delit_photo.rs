//! What is left of a photo, and what was taken out.

use mateval_image::{LinearRgb, Mask, Picture};

use super::possible_light::FittedLight;
use crate::estimate::Estimate;

/// A photo without its light. Pixels that are not valid are black; their roughness is 0.5 and their confidence 0.
#[derive(Clone, Debug)]
pub struct DelitPhoto {
    /// Linear, 0 to 1.
    pub base_color: Picture<LinearRgb>,
    /// Perceptual: the usual 0.5, another one that explains the part better, or a mirror's.
    pub roughness: Picture<f32>,
    /// 1 for mirrors, else 0.
    pub metallic: Picture<f32>,
    /// The radiance that a white surface would show, apart from what it mirrors, linear, before exposure. Divided by
    /// the base weight of the surface it is irradiance over pi.
    pub shading: Picture<LinearRgb>,
    /// The radiance that does not depend on base colour, linear, before exposure.
    pub gloss: Picture<LinearRgb>,
    /// How well the base colour is known, 0 to 1: a half where its standard error is 0.05.
    pub confidence: Picture<f32>,
    /// The possible lights: candidates of the room first, then those of the stage.
    pub lights: Vec<FittedLight>,
    /// The photo, linear, before exposure.
    pub photo: Picture<LinearRgb>,
    /// The pixels that are known.
    pub valid: Mask,
    /// Rounds of splitting and fitting.
    pub rounds: usize,
}

impl DelitPhoto {
    /// The photo as an estimate.
    pub fn estimate(self) -> Estimate {
        Estimate {
            base_color: Some(self.base_color),
            roughness: Some(self.roughness),
            metallic: Some(self.metallic),
            placement: None,
        }
    }
}
