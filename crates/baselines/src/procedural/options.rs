//! Choices of the procedural baseline.

use std::path::PathBuf;

use mateval_scene::PartSetId;

/// How the materials of parts are found and baked.
#[derive(Clone, Debug, PartialEq)]
pub struct ProceduralOptions {
    /// The part set; `None` stands for the parts of the source.
    pub part_set: Option<PartSetId>,
    /// Whether texels that the input view shows hold the estimate, so that graphs fill only those that it does not show.
    pub keep_seen: bool,
    /// How much of what is random in a pattern is kept, 0 to 1. Its phase cannot be known, so that 1 looks most alike
    /// and 0 has the least error.
    pub detail: f64,
    /// A folder of `.mtlx` files that are fitted beside the built-in graphs.
    pub graphs: Option<PathBuf>,
}

impl Default for ProceduralOptions {
    fn default() -> Self {
        Self { part_set: None, keep_seen: false, detail: 1.0, graphs: None }
    }
}
