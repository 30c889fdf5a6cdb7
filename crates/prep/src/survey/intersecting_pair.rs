//! Two pieces of furniture that intersect, as rules judge them and `survey.json` lists them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Two pieces of furniture that intersect.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct IntersectingPair {
    /// Their names.
    pub pieces: [String; 2],
    /// The shortest way that separates them, in metres, at most 0.5.
    pub depth_m: f64,
    /// The part of the smaller one's volume that lies in the other, 0 to 1.
    pub volume_share: f64,
}

impl std::fmt::Display for IntersectingPair {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [a, b] = &self.pieces;
        write!(f, "'{a}' in '{b}' ({:.3} m, {:.1} %)", self.depth_m, 100.0 * self.volume_share)
    }
}
