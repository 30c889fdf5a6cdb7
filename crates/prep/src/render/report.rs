//! What a run of the renderer reports.

use mateval_scene::Finding;

/// The result of a run.
#[derive(Clone, Debug, Default)]
pub struct RenderReport {
    /// Number of views rendered.
    pub rendered: usize,
    /// Number of views that an earlier run had rendered.
    pub kept: usize,
    /// What a user should know, one line each.
    pub remarks: Vec<String>,
    /// Scenes that could not be rendered, and why. All other scenes were rendered.
    pub failures: Vec<Finding>,
}

impl RenderReport {
    /// Adds the report of another scene.
    pub(super) fn add(&mut self, other: Self) {
        self.rendered += other.rendered;
        self.kept += other.kept;
        self.remarks.extend(other.remarks);
        self.failures.extend(other.failures);
    }
}
