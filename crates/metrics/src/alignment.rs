//! Aligned pictures: each channel multiplied by the scale that fits the truth best.
//!
//! They distinguish a method that found the right colours at the wrong brightness from one that found wrong colours.

use mateval_image::{LinearRgb, Mask, Picture};

/// The scale of each channel that brings `prediction` nearest to `reference` in the mean square over the mask, in
/// linear light: sum(gt * p) / sum(p * p); 1 where the denominator is 0. (Stanford-ORB's definition, applied to each
/// picture alone.)
pub fn channel_scales(prediction: &Picture<LinearRgb>, reference: &Picture<LinearRgb>, mask: &Mask) -> [f64; 3] {
    let mut products = [0.0_f64; 3];
    let mut squares = [0.0_f64; 3];
    let pairs = prediction.pixels().iter().zip(reference.pixels()).zip(mask.pixels());
    for ((LinearRgb(p), LinearRgb(gt)), _) in pairs.filter(|(_, counts)| **counts) {
        for channel in 0..3 {
            products[channel] += f64::from(gt[channel]) * f64::from(p[channel]);
            squares[channel] += f64::from(p[channel]) * f64::from(p[channel]);
        }
    }
    std::array::from_fn(|c| if squares[c] == 0.0 { 1.0 } else { products[c] / squares[c] })
}

/// The picture, each channel multiplied by its scale.
pub fn scaled(picture: &Picture<LinearRgb>, scales: [f64; 3]) -> Picture<LinearRgb> {
    picture.map(|LinearRgb(rgb)| LinearRgb(std::array::from_fn(|c| (f64::from(rgb[c]) * scales[c]) as f32)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn truth() -> Picture<LinearRgb> {
        Picture::from_fn(8, 4, |x, y| LinearRgb([0.1 * x as f32, 0.2 * y as f32, 0.5]))
    }

    #[test]
    fn undoes_a_scale_of_each_channel() {
        let dimmed = scaled(&truth(), [0.5, 0.25, 2.0]);
        let scales = channel_scales(&dimmed, &truth(), &Picture::filled(8, 4, true));
        for (found, expected) in scales.into_iter().zip([2.0, 4.0, 0.5]) {
            assert!((found - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn only_the_mask_counts_and_black_stays_black() {
        let mut dimmed = scaled(&truth(), [0.5; 3]);
        dimmed.set(0, 0, LinearRgb([9.0; 3]));
        let mask = Picture::from_fn(8, 4, |x, _| x > 0);
        assert!((channel_scales(&dimmed, &truth(), &mask)[2] - 2.0).abs() < 1e-6);
        let black = Picture::filled(8, 4, LinearRgb([0.0; 3]));
        assert_eq!(channel_scales(&black, &truth(), &mask), [1.0; 3]);
    }
}
