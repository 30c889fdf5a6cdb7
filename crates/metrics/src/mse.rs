//! Squared and absolute errors of pixels, PSNR, and the scale of each channel that fits the truth best. Errors with and
//! without that scale distinguish wrong brightness from wrong colours.

use mateval_image::{LinearRgb, Mask, Picture};

use crate::MetricError;
use crate::pixel::{Pixel, check_pair};

/// The mean of (prediction - reference)² over all channels of the pixels of the mask, or of all pixels without a mask.
///
/// Lower is better: 0 for equal pictures, at most 1 where both lie in 0..1. The unit is that of the values, squared, in
/// the colour space of the pictures' type. `None` where no pixel counts. Fails if sizes differ or a value inside the
/// mask is not finite.
///
/// ```
/// use mateval_image::Picture;
///
/// let prediction = Picture::new(2, 1, vec![0.5_f32, 0.9])?;
/// let reference = Picture::new(2, 1, vec![0.0_f32, 0.9])?;
/// assert_eq!(mateval_metrics::mse(&prediction, &reference, None)?, Some(0.125));
///
/// let right_half = Picture::new(2, 1, vec![false, true])?;
/// assert_eq!(mateval_metrics::mse(&prediction, &reference, Some(&right_half))?, Some(0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn mse<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: Option<&Mask>,
) -> Result<Option<f64>, MetricError> {
    mean(prediction, reference, mask, |difference| difference.powi(2))
}

/// The mean of |prediction - reference|, as [`mse`].
pub fn mae<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: Option<&Mask>,
) -> Result<Option<f64>, MetricError> {
    mean(prediction, reference, mask, f64::abs)
}

fn mean<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: Option<&Mask>,
    error: impl Fn(f64) -> f64,
) -> Result<Option<f64>, MetricError> {
    check_pair(prediction, reference, mask)?;
    let (mut sum, mut count) = (0.0_f64, 0_usize);
    for (index, (p, r)) in prediction.pixels().iter().zip(reference.pixels()).enumerate() {
        if mask.is_none_or(|mask| mask.pixels()[index]) {
            let pairs = p.channels().iter().zip(r.channels());
            // By pixel first: a sum in another order has other last bits.
            sum += pairs.map(|(&p, &r)| error(f64::from(p) - f64::from(r))).sum::<f64>();
            count += p.channels().len();
        }
    }
    Ok((count > 0).then(|| sum / count as f64))
}

/// 10 log10(1 / MSE) decibels for values whose peak is 1, capped at [`Psnr::CAP_DB`]. Higher is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Psnr {
    /// Decibels; at most [`Psnr::CAP_DB`], below 0 where the MSE is above 1.
    pub db: f64,
    /// The MSE was exactly 0, which has no finite ratio; `db` is the cap.
    pub exact: bool,
}

impl Psnr {
    /// The largest ratio, which an MSE of 1e-10 or less gets.
    pub const CAP_DB: f64 = 100.0;

    /// The ratio of a mean squared error. Fails if the error is negative or not finite.
    pub fn from_mse(mse: f64) -> Result<Self, MetricError> {
        if !(mse.is_finite() && mse >= 0.0) {
            return Err(MetricError::InvalidMse { mse });
        }
        // The `libm` crate's logarithm gives the same bits on every machine; at 0 it is minus infinity, and the cap
        // applies.
        let db = (-10.0 * libm::log10(mse)).min(Self::CAP_DB);
        Ok(Self { db, exact: mse == 0.0 })
    }
}

/// The scale of each channel that brings `prediction` nearest to `reference` in the mean square over the mask, in
/// linear light: sum(r * p) / sum(p * p); 1 where the denominator is 0. (Stanford-ORB's definition, applied to each
/// picture alone.)
pub fn channel_scales(prediction: &Picture<LinearRgb>, reference: &Picture<LinearRgb>, mask: &Mask) -> [f64; 3] {
    let mut products = [0.0_f64; 3];
    let mut squares = [0.0_f64; 3];
    let pairs = prediction.pixels().iter().zip(reference.pixels()).zip(mask.pixels());
    for ((LinearRgb(p), LinearRgb(r)), _) in pairs.filter(|(_, counts)| **counts) {
        for channel in 0..3 {
            products[channel] += f64::from(r[channel]) * f64::from(p[channel]);
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
    use mateval_image::SrgbRgb;
    use proptest::prelude::*;

    use super::*;

    /// Computed by hand: ((0.5)² + 0 + 0 + (0.25)² + 0 + 0) / 6.
    #[test]
    fn a_small_number_by_hand() {
        let p = Picture::new(2, 1, vec![LinearRgb([1.0, 0.0, 0.0]), LinearRgb([0.25, 0.5, 0.5])]).unwrap();
        let r = Picture::new(2, 1, vec![LinearRgb([0.5, 0.0, 0.0]), LinearRgb([0.0, 0.5, 0.5])]).unwrap();
        assert_eq!(mse(&p, &r, None).unwrap(), Some(0.3125 / 6.0));
        let left = Picture::new(2, 1, vec![true, false]).unwrap();
        assert_eq!(mse(&p, &r, Some(&left)).unwrap(), Some(0.25 / 3.0));
    }

    #[test]
    fn nothing_counts_is_none() {
        let picture = Picture::filled(2, 2, 0.5_f32);
        assert_eq!(mse(&picture, &picture, Some(&Picture::filled(2, 2, false))).unwrap(), None);
        let empty = Picture::filled(0, 0, 0.5_f32);
        assert_eq!(mse(&empty, &empty, None).unwrap(), None);
    }

    #[test]
    fn a_value_that_is_not_finite_is_an_error_where_it_counts() {
        let good = Picture::filled(2, 1, SrgbRgb([0.5; 3]));
        for value in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut bad = good.clone();
            bad.set(1, 0, SrgbRgb([0.5, 0.5, value]));
            let error = mse(&bad, &good, None).unwrap_err();
            assert!(matches!(error, MetricError::NotFinite { picture: "prediction", x: 1, y: 0, channel: 2, .. }));
            assert!(matches!(mse(&good, &bad, None), Err(MetricError::NotFinite { picture: "reference", .. })));
            let left = Picture::new(2, 1, vec![true, false]).unwrap();
            assert_eq!(mse(&bad, &good, Some(&left)).unwrap(), Some(0.0));
        }
    }

    #[test]
    fn sizes_must_agree() {
        let (wide, high) = (Picture::filled(2, 1, 0.5_f32), Picture::filled(1, 2, 0.5_f32));
        let error = mse(&wide, &high, None).unwrap_err();
        assert_eq!(error.to_string(), "the reference has 1x2 pixels; expected 2x1 like the prediction");
    }

    fn rgb(count: usize) -> impl Strategy<Value = Vec<LinearRgb>> {
        prop::collection::vec(prop::array::uniform3(0.0_f32..4.0).prop_map(LinearRgb), count)
    }

    proptest! {
        #[test]
        fn identity_symmetry_full_mask_and_order(
            (a, b) in (rgb(12), rgb(12)),
            mask in prop::collection::vec(any::<bool>(), 12),
        ) {
            let mask = Picture::new(4, 3, mask).unwrap();
            let (p, r) = (Picture::new(4, 3, a.clone()).unwrap(), Picture::new(4, 3, b.clone()).unwrap());
            prop_assert_eq!(mse(&p, &p, None).unwrap(), Some(0.0));
            prop_assert_eq!(mse(&p, &r, Some(&mask)).unwrap(), mse(&r, &p, Some(&mask)).unwrap());
            let whole = mse(&p, &r, None).unwrap().unwrap();
            prop_assert_eq!(mse(&p, &r, Some(&Picture::filled(4, 3, true))).unwrap(), Some(whole));
            // Independent of the order of pixels, up to rounding.
            let turned = |mut pixels: Vec<LinearRgb>| { pixels.reverse(); Picture::new(4, 3, pixels).unwrap() };
            let reversed = mse(&turned(a), &turned(b), None).unwrap().unwrap();
            prop_assert!((reversed - whole).abs() <= 1e-14 * whole);
        }
    }

    /// 0.01 is 20 dB by the definition; 8-bit pictures that differ by one step everywhere have 48.1308 dB (Wikipedia,
    /// "Peak signal-to-noise ratio": 20 log10 255).
    #[test]
    fn known_values() {
        assert!((Psnr::from_mse(0.01).unwrap().db - 20.0).abs() < 1e-12);
        let one_step = Psnr::from_mse((1.0_f64 / 255.0).powi(2)).unwrap();
        assert!((one_step.db - 48.130_803_608_679_1).abs() < 1e-9);
        assert!(!one_step.exact);
    }

    #[test]
    fn the_cap_and_what_is_exact() {
        assert_eq!(Psnr::from_mse(0.0).unwrap(), Psnr { db: 100.0, exact: true });
        assert_eq!(Psnr::from_mse(1e-30).unwrap(), Psnr { db: 100.0, exact: false });
        assert!(Psnr::from_mse(1.1e-10).unwrap().db < 100.0);
    }

    #[test]
    fn what_is_no_mse_is_refused() {
        for mse in [-1e-9, f64::NAN, f64::INFINITY] {
            assert!(matches!(Psnr::from_mse(mse), Err(MetricError::InvalidMse { .. })));
        }
    }

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
