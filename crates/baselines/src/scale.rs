//! Whether the values of an estimate are known absolutely, and the scaling of those that are not.

use mateval_image::{LinearRgb, Picture};
use serde::Deserialize;

/// After a picture of free scale is scaled, this share of its pixels has its largest channel at or below 1.
const FREE_SCALE_SHARE: f64 = 0.99;

/// Whether values are known absolutely.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scale {
    /// The values are used as they are.
    #[default]
    Absolute,
    /// The values are known up to one factor: they are scaled so that the 99th percentile of the pixels' largest
    /// channel is 1.
    Free,
    /// The values of each channel are known up to a factor of its own: each is scaled so that its 99th percentile is 1.
    PerChannel,
}

impl Scale {
    /// The picture, scaled. A channel or picture whose percentile is 0 stays as it is.
    pub(crate) fn apply(self, picture: Picture<LinearRgb>) -> Picture<LinearRgb> {
        let pixels = picture.pixels();
        let whites = match self {
            Self::Absolute => return picture,
            Self::Free => [white(pixels.iter().map(|LinearRgb([r, g, b])| r.max(*g).max(*b))); 3],
            Self::PerChannel => [0, 1, 2].map(|channel: usize| white(pixels.iter().map(|pixel| pixel.0[channel]))),
        };
        let scaled = |value: f32, white: f32| if white > 0.0 { value / white } else { value };
        picture.map(|LinearRgb(rgb)| LinearRgb(std::array::from_fn(|channel| scaled(rgb[channel], whites[channel]))))
    }
}

/// The value that [`FREE_SCALE_SHARE`] of all values do not exceed; 0 without values.
fn white(values: impl Iterator<Item = f32>) -> f32 {
    let mut values: Vec<f32> = values.collect();
    values.sort_by(f32::total_cmp);
    let at = (FREE_SCALE_SHARE * (values.len().saturating_sub(1)) as f64).round() as usize;
    values.get(at).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_free_scale_is_set_by_the_brightest() {
        let ramp = Picture::from_fn(101, 1, |x, _| LinearRgb([x as f32, x as f32 / 2.0, 0.0]));
        assert_eq!(Scale::Free.apply(ramp.clone()).get(99, 0).0, [1.0, 0.5, 0.0]);
        // Twin: with a factor for each channel the second becomes as bright as the first, and black stays black.
        assert_eq!(Scale::PerChannel.apply(ramp.clone()).get(99, 0).0, [1.0, 1.0, 0.0]);
        assert_eq!(Scale::Absolute.apply(ramp.clone()), ramp);
        let black = Picture::filled(3, 1, LinearRgb([0.0; 3]));
        assert_eq!(Scale::Free.apply(black.clone()), black);
    }

    /// A picture whose channels were multiplied by different factors is the same picture after scaling.
    #[test]
    fn factors_of_channels_cancel() {
        let picture =
            Picture::from_fn(50, 2, |x, y| LinearRgb([x as f32 + 1.0, 2.0 * y as f32 + 1.0, 50.0 - x as f32]));
        let tinted = picture.map(|LinearRgb([r, g, b])| LinearRgb([0.5 * r, 2.0 * g, 4.0 * b]));
        assert_eq!(Scale::PerChannel.apply(tinted.clone()), Scale::PerChannel.apply(picture.clone()));
        // Twin: one factor for all three does not undo it.
        assert_ne!(Scale::Free.apply(tinted), Scale::Free.apply(picture));
    }
}
