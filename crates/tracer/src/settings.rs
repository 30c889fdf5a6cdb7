//! How a picture is made.

use crate::error::RequestFault;

/// How light is looked for. All three have the same mean; they differ in noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSampling {
    /// Emitters are sampled and surfaces too, weighed by the power heuristic.
    #[default]
    Both,
    /// Emitters are sampled; what a scattered ray meets counts only after a mirror or clear glass.
    Emitters,
    /// Emitters are found by scattered rays alone.
    Bsdf,
}

/// How a picture is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Paths a pixel.
    pub samples: u32,
    /// Two seeds make two independent pictures.
    pub seed: u64,
    /// Scatterings beyond the first that a path may have before its last piece of direct light: Blender's "max bounces";
    /// Mitsuba's `max_depth` is 2 more.
    pub max_bounces: u32,
    /// From this bounce on, paths end by chance.
    pub roulette_start: u32,
    /// The probability to go on then, above 0 and up to 1.
    pub roulette_survival: f32,
    /// How light is looked for.
    pub light_sampling: LightSampling,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self {
            samples: 64,
            seed: 0,
            max_bounces: 16,
            roulette_start: 4,
            roulette_survival: 0.8,
            light_sampling: LightSampling::Both,
        }
    }
}

impl RenderSettings {
    /// Fails for settings that make no sense.
    pub(crate) fn check(&self) -> Result<(), RequestFault> {
        let Self { samples, roulette_survival, .. } = *self;
        if samples == 0 {
            return Err(RequestFault::Samples(samples));
        }
        if !(roulette_survival > 0.0 && roulette_survival <= 1.0) {
            return Err(RequestFault::RouletteSurvival(roulette_survival));
        }
        Ok(())
    }
}
