//! A sampled direction in the local frame of a BSDF.

use glam::Vec3;

/// A sampled direction in the local frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalSample {
    pub(crate) wi: Vec3,
    /// The value with the cosine, over the density.
    pub(crate) weight: Vec3,
    /// Per solid angle; for a delta sample, its probability.
    pub(crate) density: f32,
    /// Whether the direction comes from a delta distribution, which no other way of sampling can find.
    pub(crate) delta: bool,
}

impl LocalSample {
    pub(crate) fn spread(wi: Vec3, value: Vec3, density: f32) -> Self {
        Self { wi, weight: value / density, density, delta: false }
    }

    pub(crate) fn delta(wi: Vec3, weight: Vec3, probability: f32) -> Self {
        Self { wi, weight, density: probability, delta: true }
    }
}
