//! The results of rendering several views.

use mateval_image::Picture;

use crate::light_basis::LightBasis;
use crate::render::RenderStats;

/// The views of one world.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsRender {
    /// In the order of the cameras.
    pub views: Vec<ViewLight>,
    /// The number of path sets per seed: 1 if the views share a centre, otherwise one per view.
    pub passes: usize,
    /// Counts over all passes and seeds.
    pub stats: RenderStats,
}

/// The light that one camera sees, in independent halves (or as many parts as there were seeds).
#[derive(Clone, Debug, PartialEq)]
pub struct ViewLight {
    /// In the order of the seeds.
    pub halves: Vec<HalfLight>,
}

/// One of several independent estimates of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfLight {
    /// Linear radiance: one picture per group of lights, or per mix of lights, by [`Lighting`](super::Lighting).
    pub basis: LightBasis,
    /// The number of paths that each pixel received.
    pub counts: Picture<u32>,
}
