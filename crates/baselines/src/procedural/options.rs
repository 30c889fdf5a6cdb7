//! Choices of the procedural baseline.

use std::path::PathBuf;

use mateval_scene::PartSetId;

use crate::error::BaselineError;

/// How a graph is chosen.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FitMode {
    /// Orientation and sizes in closed form, acceptance by held-out pixels.
    #[default]
    Best,
    /// In the way of PSDR-Room, for comparison: a grid of turns and scales, then gradient descent
    /// ([`mateval_procedural::fit::paper`] states the differences).
    Paper,
}

/// How the materials of parts are found and baked.
#[derive(Clone, Debug, PartialEq)]
pub struct ProceduralOptions {
    /// The part set; `None` stands for the parts of the source.
    pub part_set: Option<PartSetId>,
    /// How graphs are chosen.
    pub mode: FitMode,
    /// Whether texels that the input view shows hold the estimate, so that graphs fill only the others.
    pub keep_seen: bool,
    /// How much of what is random in a pattern is kept, 0 to 1. Its phase cannot be known: 1 looks most alike, 0 has
    /// the least error.
    pub detail: f64,
    /// A folder of `.mtlx` files that are fitted beside the built-in graphs.
    pub graphs: Option<PathBuf>,
}

impl ProceduralOptions {
    /// Fails unless `detail` is 0 to 1.
    pub fn check(&self) -> Result<(), BaselineError> {
        if (0.0..=1.0).contains(&self.detail) { Ok(()) } else { Err(BaselineError::Detail(self.detail)) }
    }
}

impl Default for ProceduralOptions {
    fn default() -> Self {
        Self { part_set: None, mode: FitMode::Best, keep_seen: false, detail: 1.0, graphs: None }
    }
}
