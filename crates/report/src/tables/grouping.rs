//! How the rows of a table are grouped.

/// How the rows of a table are grouped; every group has one row for each method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grouping {
    /// One group for the whole dataset: means over scenes.
    Dataset,
    /// One group for each scene: means over its pictures.
    Scene,
    /// One group for each category of instances: errors pooled over pixels.
    Category,
    /// One group for each broader category, in the same way.
    SuperCategory,
}
