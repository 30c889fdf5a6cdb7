//! What to explain: one scene of one result, with the dataset and the submission that the result was made from.

use std::path::Path;

use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_scene::open::Dataset;
use mateval_scene::{Finding, SceneId};

use crate::error::ReportError;

/// How many of the worst instances are listed and shown.
pub const WORST: usize = 10;

/// What to explain.
pub struct ExplainPlan<'a> {
    /// The result.
    pub result: &'a ResultFile,
    /// The protocol whose scores are explained.
    pub protocol: &'a str,
    /// The dataset that the result was scored on.
    pub dataset: &'a Dataset,
    /// Folder of the submission that was scored.
    pub submission: &'a Path,
    /// The scene to explain.
    pub scene: &'a SceneId,
    /// Name and version of the tool, for the file.
    pub tool: String,
}

impl<'a> ExplainPlan<'a> {
    /// The result's scores under the plan's protocol.
    pub(super) fn scores(&self) -> Result<&'a ProtocolResult, ReportError> {
        self.result.protocols.get(self.protocol).ok_or_else(|| {
            let known: Vec<&str> = self.result.protocols.keys().map(String::as_str).collect();
            ReportError::Invalid(format!(
                "the result has no scores under protocol '{}'; it has: {}; choose one by --protocol",
                self.protocol,
                known.join(", ")
            ))
        })
    }

    /// The findings of the result that concern the scene.
    pub(super) fn findings(&self) -> Vec<Finding> {
        let folder = format!("scenes/{}/", self.scene);
        self.result.findings.iter().filter(|finding| finding.file.starts_with(&folder)).cloned().collect()
    }
}
