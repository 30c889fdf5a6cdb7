//! What has rows of its own in a table.

/// What has rows of its own, one for each method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grouping {
    /// The whole dataset: means over scenes.
    Dataset,
    /// Each scene: means over its pictures.
    Scene,
    /// Each category of instances: errors pooled over pixels.
    Category,
    /// Each broader category, in the same way.
    SuperCategory,
}
