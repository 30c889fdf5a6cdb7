//! What one reading of an instance's maps yields, for findings about the whole scene.

use mateval_scene::Finding;

use super::copies::CopyCount;
use super::looks::{Look, ScalarLook};
use super::unobserved::Fill;

/// The findings about one instance, and what the scene's findings need of it.
#[derive(Default)]
pub(super) struct InstanceFacts {
    /// Its folder in the submission.
    pub(super) folder: String,
    /// Findings about its maps alone.
    pub(super) findings: Vec<Finding>,
    /// How many of its maps could be decoded.
    pub(super) maps: usize,
    /// Memory that its maps take while a scene is scored.
    pub(super) bytes: usize,
    pub(super) looks: Vec<Look>,
    pub(super) scalars: Vec<ScalarLook>,
    pub(super) fill: Option<Fill>,
    pub(super) copies: CopyCount,
    /// The hash of the base colour's file, and whether that is a PNG.
    pub(super) base_color: Option<(String, bool)>,
}
