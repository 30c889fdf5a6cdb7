//! What is rendered of one or several views.

use mateval_image::Picture;

use crate::light_basis::LightBasis;
use crate::render::RenderStats;

/// Views of one world.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewsRender {
    /// In the order of the cameras.
    pub views: Vec<ViewLight>,
    /// How many sets of paths were drawn a seed: 1 if the views share a centre, else one a view.
    pub passes: usize,
    /// What happened, over all passes and seeds.
    pub stats: RenderStats,
}

/// What one camera sees, in independent halves (or as many parts as there were seeds).
#[derive(Clone, Debug, PartialEq)]
pub struct ViewLight {
    /// In the order of the seeds.
    pub halves: Vec<HalfLight>,
}

/// One of several independent estimates of a view.
#[derive(Clone, Debug, PartialEq)]
pub struct HalfLight {
    /// Linear radiance, one picture a group of lights.
    pub basis: LightBasis,
    /// How many paths each pixel received.
    pub counts: Picture<u32>,
}
