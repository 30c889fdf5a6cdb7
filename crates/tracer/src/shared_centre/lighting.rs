//! Which pictures are made of a view's light.

use crate::error::TracerError;
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
    pub(super) fn check(&self, lights: usize, variants: usize) -> Result<(), TracerError> {
        let mixes = match self {
            Self::Apart(groups) if groups.lights() == lights => return Ok(()),
            Self::Apart(groups) => {
                let found = groups.lights();
                return Err(TracerError::Invalid(format!("groups of {found} lights for a scene of {lights}")));
            }
            Self::Mixed(mixes) => *mixes,
        };
        let fit = mixes.len() == variants
            && mixes.iter().all(|of| of.len() == self.pictures() && of.iter().all(|mix| mix.len() == lights));
        let weights = mixes.iter().flatten().flatten().flatten();
        if fit && { weights }.all(|weight| weight.is_finite() && *weight >= 0.0) {
            return Ok(());
        }
        let what = format!("mixes that do not fit {variants} predictions and {lights} lights, or are negative");
        Err(TracerError::Invalid(what))
    }
}
