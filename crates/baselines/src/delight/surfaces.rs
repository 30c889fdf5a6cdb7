//! What is assumed of surfaces while light is split.

use mateval_tracer::{AssumedSurfaces, RenderSettings};

/// The perceptual roughness of surfaces of which nothing is known: the format's default.
pub(super) const USUAL_ROUGHNESS: f32 = 0.5;
/// Scatterings after which a path ends: the light of longer ones depends on assumed colours most.
const MOST_BOUNCES: u32 = 8;

/// What is known of the surfaces of the room.
pub(super) struct Surfaces {
    /// The linear base colour of each.
    pub(super) colors: Vec<[f32; 3]>,
    /// The perceptual roughness of each.
    pub(super) roughnesses: Vec<f32>,
}

impl Surfaces {
    pub(super) fn assumed(&self) -> AssumedSurfaces<'_> {
        AssumedSurfaces { colors: &self.colors, roughnesses: &self.roughnesses }
    }
}

/// The settings of a pass.
pub(super) fn settings(samples: u32, seed: u64) -> RenderSettings {
    RenderSettings { samples, seed, max_bounces: MOST_BOUNCES, ..RenderSettings::default() }
}
