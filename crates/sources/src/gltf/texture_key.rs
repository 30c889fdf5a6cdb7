//! Keys of the textures that have been read.

use mateval_image::Wrap;

/// The aspect of an image that a texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Aspect {
    /// The sRGB colour, times a linear factor for each channel, given by its bits.
    Color([u32; 3]),
    /// The linear values of all channels.
    Values,
    /// One channel's linear values, times a factor, given by its bits.
    Channel(usize, u32),
    /// The alpha channel, times a factor, given by its bits.
    Alpha(u32),
    /// 1 where the alpha channel, times a factor, reaches a threshold, else 0; both are given by their bits.
    Mask(u32, u32),
}

/// Textures with equal keys are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct TextureKey {
    /// The image's index in the file.
    image: usize,
    /// A number for each wrap mode.
    wrap: u8,
    aspect: Aspect,
}

impl TextureKey {
    pub(super) fn new(image: usize, wrap: Wrap, aspect: Aspect) -> Self {
        let wrap = match wrap {
            Wrap::Repeat => 0,
            Wrap::Clamp => 1,
            Wrap::Mirror => 2,
        };
        Self { image, wrap, aspect }
    }
}
