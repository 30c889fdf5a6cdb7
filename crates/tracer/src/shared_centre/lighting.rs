//! The choice of pictures made from a view's light.

use mateval_scene::reference::LightIndex;

use crate::error::RequestFault;
use crate::light_basis::LightGroups;

/// The pictures made from a view's light.
#[derive(Clone, Copy, Debug)]
pub enum Lighting<'a> {
    /// One per group of lights, under the scene's own radiances.
    Apart(&'a LightGroups),
    /// For each prediction (or material variant) the same number of mixes, one picture each.
    Mixed(&'a [Vec<LightMix>]),
}

/// For each light a factor on its radiance, per channel, at least 0.
pub type LightMix = Vec<[f64; 3]>;

impl Lighting<'_> {
    /// The number of pictures per view.
    pub(super) fn pictures(&self) -> usize {
        match self {
            Self::Apart(groups) => groups.groups().len(),
            Self::Mixed(mixes) => mixes.first().map_or(0, Vec::len),
        }
    }

    /// Fails unless the lights number `lights` and the mixes `variants`, with finite weights of at least 0.
    pub(super) fn check(&self, lights: usize, variants: usize) -> Result<(), RequestFault> {
        let mixes = match self {
            Self::Apart(groups) if groups.lights() == lights => return Ok(()),
            Self::Apart(groups) => {
                return Err(RequestFault::GroupedLights { found: groups.lights(), expected: lights });
            }
            Self::Mixed(mixes) => *mixes,
        };
        if mixes.len() != variants {
            return Err(RequestFault::MixedPredictions { found: mixes.len(), expected: variants });
        }
        let expected = self.pictures();
        if let Some(prediction) = mixes.iter().position(|mixes| mixes.len() != expected) {
            return Err(RequestFault::MixCount { prediction, found: mixes[prediction].len(), expected });
        }
        mixes.iter().flatten().try_for_each(|mix| check_mix(mix, lights))
    }
}

fn check_mix(mix: &LightMix, lights: usize) -> Result<(), RequestFault> {
    if mix.len() != lights {
        return Err(RequestFault::WeightCount { found: mix.len(), expected: lights });
    }
    for (light, weights) in mix.iter().enumerate() {
        if let Some(&found) = weights.iter().find(|weight| !(weight.is_finite() && **weight >= 0.0)) {
            return Err(RequestFault::Weight { light: LightIndex(light), found });
        }
    }
    Ok(())
}
