//! Sizes of atlases and of the gutters in them.

/// Texels between two charts, at the final size of the atlas.
pub const GUTTER: u32 = 4;
/// Least and most texels a side of an atlas whose size is chosen.
pub const CHOSEN_SIZES: (u32, u32) = (256, 4096);

/// The wanted size of an atlas.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SizeWish {
    /// Texels a side. If the charts do not fit, the least power of two within [`CHOSEN_SIZES`] that they fit
    /// into.
    Fixed(u32),
    /// The least power of two within [`CHOSEN_SIZES`] at which a texel's side on the surface is at most this
    /// long, in metres; the largest one if none is fine enough.
    Texel(f64),
}

impl SizeWish {
    /// Whether an atlas of this size can have been made for the wish.
    pub(super) fn allows(self, size: u32) -> bool {
        let (least, most) = CHOSEN_SIZES;
        self == Self::Fixed(size) || (least..=most).contains(&size) && size.is_power_of_two()
    }

    /// The wish as text that no other wish has.
    pub(super) fn key(self) -> String {
        match self {
            Self::Fixed(size) => format!("{size} texels"),
            Self::Texel(texel_m) => format!("texels of {:016x}", texel_m.to_bits()),
        }
    }
}
