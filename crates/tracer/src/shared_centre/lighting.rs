//! Which pictures are made of a view's light.

use mateval_scene::reference::LightIndex;

use crate::error::RequestFault;
use crate::light_basis::LightGroups;

/// Which pictures are made of a view's light.
#[derive(Clone, Copy, Debug)]
pub enum Lighting<'a> {
    /// One a group of lights, of the scene's own radiances.
    Apart(&'a LightGroups),
    /// For each prediction the same number of mixes, a picture each.
    Mixed(&'a [Vec<LightMix>]),
}

/// For each light what its radiance is multiplied by, a channel, not negative.
pub type LightMix = Vec<[f64; 3]>;

impl Lighting<'_> {
    /// How many pictures there are of a view.
    pub(super) fn pictures(&self) -> usize {
        match self {
            Self::Apart(groups) => groups.groups().len(),
            Self::Mixed(mixes) => mixes.first().map_or(0, Vec::len),
        }
    }

    /// Fails where the lights are not `lights`, variants not `variants`, or weights make no sense.
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
