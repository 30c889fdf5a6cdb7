//! Settings of a render.

use crate::error::RequestFault;

/// How paths find light. All strategies have the same mean and differ in noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSampling {
    /// Samples emitters and the BSDF, weighted by the power heuristic.
    #[default]
    Both,
    /// Samples emitters. Light that a scattered ray meets counts only after a mirror or clear glass.
    Emitters,
    /// Samples the BSDF alone.
    Bsdf,
}

/// Settings of a render.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Paths per pixel.
    pub samples: u32,
    /// Different seeds give independent pictures.
    pub seed: u64,
    /// The largest number of scatterings after the first before the last direct light of a path: Blender's "max
    /// bounces". Mitsuba's `max_depth` is larger by 2.
    pub max_bounces: u32,
    /// The first bounce at which Russian roulette may end a path.
    pub roulette_start: u32,
    /// The probability that a path survives Russian roulette, above 0 and at most 1.
    pub roulette_survival: f32,
    /// How paths find light.
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
    /// Fails if a setting is out of range.
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
