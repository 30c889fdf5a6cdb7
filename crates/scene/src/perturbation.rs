//! Geometry that differs from the true one: its kind and level, as datasets, submissions and results record them.

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A way in which the furniture that methods see differs from the true one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum PerturbationKind {
    /// Every piece is moved in the plane of the floor and turned about the vertical.
    Pose,
    /// Every piece is enlarged or reduced.
    Scale,
    /// The surface of every piece is bent.
    Shape,
}

impl PerturbationKind {
    /// Every kind.
    pub const ALL: [Self; 3] = [Self::Pose, Self::Scale, Self::Shape];
}

/// The word that JSON files and commands use.
impl fmt::Display for PerturbationKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// A kind and a level, as in `pose 2`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Perturbation {
    /// The kind.
    pub kind: PerturbationKind,
    /// The level, from 1. True geometry has no perturbation.
    #[schemars(range(min = 1))]
    pub level: u32,
}

impl fmt::Display for Perturbation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.kind, self.level)
    }
}

/// Of a dataset with perturbed geometry: the perturbation, and the dataset on which submissions made from it are
/// scored.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PerturbedGeometry {
    /// How its geometry differs from the true one.
    pub perturbation: Perturbation,
    /// `manifest_sha256` of the dataset with true geometry.
    pub true_manifest_sha256: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_print_as_in_json() {
        for kind in PerturbationKind::ALL {
            assert_eq!(serde_json::to_value(kind).unwrap(), kind.to_string());
        }
        assert_eq!(Perturbation { kind: PerturbationKind::Pose, level: 2 }.to_string(), "pose 2");
    }
}
