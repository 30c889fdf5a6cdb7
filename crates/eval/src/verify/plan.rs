//! What to verify.

use std::path::Path;

use mateval_scene::open::Dataset;

use crate::score::LpipsWeights;

/// What to verify.
pub struct VerifyPlan<'a> {
    /// RESULT.json.
    pub result: &'a Path,
    /// The submission folder that it states.
    pub submission: &'a Path,
    /// The dataset that it was made on.
    pub dataset: &'a Dataset,
    /// The network of LPIPS; not needed where the result has no LPIPS.
    pub lpips: LpipsWeights,
    /// Name and version of this tool.
    pub tool: String,
    /// A folder in which the converged pictures of companions are kept between runs.
    pub companion_cache: Option<&'a Path>,
    /// Number of scenes that are scored at once.
    pub jobs: usize,
}

/// The last part of a path, for findings.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |name| name.to_string_lossy().into_owned())
}
