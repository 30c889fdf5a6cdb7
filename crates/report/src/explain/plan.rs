//! What to explain: one scene of one result, with the dataset and the submission that the result was made from.

use std::path::Path;

use mateval_eval::result::{ProtocolResult, ResultFile};
use mateval_scene::open::Dataset;
use mateval_scene::{Finding, SceneId};

use crate::error::ReportError;
use crate::mismatch::Mismatch;

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
        ReportError::refuse(Mismatch::of_result(self.result, self.protocol).into_iter().collect())?;
        Ok(&self.result.protocols[self.protocol])
    }

    /// The findings of the result that concern the scene.
    pub(super) fn findings(&self) -> Vec<Finding> {
        let folder = format!("scenes/{}/", self.scene);
        self.result.findings.iter().filter(|finding| finding.file.starts_with(&folder)).cloned().collect()
    }
}
