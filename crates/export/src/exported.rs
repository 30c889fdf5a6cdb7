//! What an export wrote.

/// What was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of scenes.
    pub scenes: usize,
    /// Number of views that are described; `None` for tars, which hold whole scenes.
    pub views: Option<usize>,
    /// Number of views that were left out, or described without a picture, because their pictures are withheld.
    pub without_picture: usize,
}
