//! Keys of the textures that have been read.

use mateval_image::Wrap;

/// The aspect of a picture that a texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Aspect {
    Color,
    Luminance,
    Alpha,
}

/// Textures with equal keys are equal.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TextureKey {
    file: String,
    /// Whether it is decoded as linear.
    linear: bool,
    /// A number for each wrap mode.
    wrap: u8,
    aspect: Aspect,
}

impl TextureKey {
    pub(super) fn new(file: &str, linear: bool, wrap: Wrap, aspect: Aspect) -> Self {
        let wrap = match wrap {
            Wrap::Repeat => 0,
            Wrap::Clamp => 1,
            Wrap::Mirror => 2,
        };
        Self { file: file.to_owned(), linear, wrap, aspect }
    }
}
