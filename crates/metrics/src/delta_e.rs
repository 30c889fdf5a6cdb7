//! The mean CIEDE2000 colour difference.
//!
//! Sharma, Wu, Dalal: "The CIEDE2000 color-difference formula: implementation notes, supplementary test data, and
//! mathematical observations", 2005. The library `palette` computes Lab and the formula; without its feature `std` it
//! takes cube roots and angles from the `libm` crate, so every machine computes the same bits. scikit-image computes
//! the same with `deltaE_ciede2000(rgb2lab(...))` up to 5e-6 of the mean: its matrix to XYZ has one digit less, and its
//! greys are not quite neutral.

use mateval_image::{LinearRgb, Mask, Picture};
use palette::color_difference::Ciede2000;
use palette::convert::FromColorUnclamped;
use palette::white_point::D65;
use palette::{Lab, LinSrgb};
use rayon::prelude::*;

use crate::MetricError;
use crate::pixel::{check_pair, pixel_count};

/// The mean CIEDE2000 difference over the pixels of the mask, between colours clipped to 0..1 and seen under D65.
///
/// Lower is better: 0 for equal pictures, about 1 for a difference that an observer just notices, 100 between black and
/// white. `None` where no pixel counts. Fails if sizes differ or a value inside the mask is not finite.
///
/// ```
/// use mateval_image::{LinearRgb, Picture};
///
/// let black = Picture::filled(2, 1, LinearRgb([0.0; 3]));
/// let white = Picture::filled(2, 1, LinearRgb([1.0; 3]));
/// let difference = mateval_metrics::delta_e(&white, &black, &Picture::filled(2, 1, true))?;
/// assert!(difference.is_some_and(|mean| (mean - 100.0).abs() < 1e-4));
/// # Ok::<(), mateval_metrics::MetricError>(())
/// ```
pub fn delta_e(
    prediction: &Picture<LinearRgb>,
    reference: &Picture<LinearRgb>,
    mask: &Mask,
) -> Result<Option<f64>, MetricError> {
    check_pair(prediction, reference, Some(mask))?;
    let width = mask.width();
    let sum_of_row = |y: usize| -> f64 {
        let row = y * width..(y + 1) * width;
        let pairs = prediction.pixels()[row.clone()].iter().zip(&reference.pixels()[row.clone()]);
        let counted = pairs.zip(&mask.pixels()[row]).filter(|&(_, &counts)| counts);
        counted.map(|((&p, &r), _)| color_difference(p, r)).sum()
    };
    // Threads take whole rows and the rows' sums are added from the top, so the number of threads changes no bit.
    let rows: Vec<f64> = (0..mask.height()).into_par_iter().map(sum_of_row).collect();
    let count = pixel_count(mask);
    Ok((count > 0).then(|| rows.iter().sum::<f64>() / count as f64))
}

/// The CIEDE2000 difference of two colours, clipped to 0..1 and seen under D65.
pub fn color_difference(a: LinearRgb, b: LinearRgb) -> f64 {
    lab(a).difference(lab(b))
}

/// The colour in CIE Lab under D65.
fn lab(LinearRgb(channels): LinearRgb) -> Lab<D65, f64> {
    let [r, g, b] = channels.map(|value| f64::from(value).clamp(0.0, 1.0));
    Lab::from_color_unclamped(LinSrgb::new(r, g, b))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Pairs 1, 7, 10, 11, 15, 17, 25 and 34 of table 1 of Sharma, Wu and Dalal 2005, which gives four decimals. They
    /// cover blue's rotation, colours without hue, both sides of opposite hues, large differences and near blacks.
    #[test]
    fn published_pairs() {
        let pairs = [
            ([50.0, 2.6772, -79.7751], [50.0, 0.0, -82.7485], 2.0425),
            ([50.0, 0.0, 0.0], [50.0, -1.0, 2.0], 2.3669),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.001], 7.1792),
            ([50.0, 2.49, -0.001], [50.0, -2.49, 0.0011], 7.2195),
            ([50.0, -0.001, 2.49], [50.0, 0.0011, -2.49], 4.7461),
            ([50.0, 2.5, 0.0], [73.0, 25.0, -18.0], 27.1492),
            ([60.2574, -34.0099, 36.2677], [60.4626, -34.1751, 39.4387], 1.2644),
            ([2.0776, 0.0795, -1.135], [0.9033, -0.0636, -0.5514], 0.9082),
        ];
        for ([l1, a1, b1], [l2, a2, b2], expected) in pairs {
            let (first, second): (Lab<D65, f64>, Lab<D65, f64>) = (Lab::new(l1, a1, b1), Lab::new(l2, a2, b2));
            assert!((first.difference(second) - expected).abs() < 6e-5, "{first:?} {second:?}");
            assert!((second.difference(first) - expected).abs() < 6e-5, "{second:?} {first:?}");
        }
    }

    /// Sixteenths, which `f32` holds exactly.
    fn made(a: usize, b: usize, c: usize) -> Picture<LinearRgb> {
        let value = |x, y, channel| ((a * x + b * y + c * channel) % 17) as f32 / 16.0;
        Picture::from_fn(7, 5, |x, y| LinearRgb(std::array::from_fn(|channel| value(x, y, channel))))
    }

    fn two_of_three() -> Mask {
        Picture::from_fn(7, 5, |x, y| (x + 2 * y) % 3 != 0)
    }

    /// scikit-image 0.26.0: the same pictures as arrays `p` and `r` of doubles, encoded to sRGB (`e`) for `rgb2lab`, or
    /// multiplied by the 7-digit matrix `M` of brucelindbloom.com, which `palette` has too:
    /// `deltaE_ciede2000(rgb2lab(e(r)), rgb2lab(e(p)))` and
    /// `deltaE_ciede2000(xyz2lab(r @ M.T), xyz2lab(p @ M.T))`, then the mean over all pixels or over `[mask]`.
    #[test]
    fn agrees_with_scikit_image() {
        let (p, r) = (made(3, 7, 5), made(5, 2, 11));
        let whole = delta_e(&p, &r, &Picture::filled(7, 5, true)).unwrap().unwrap();
        let masked = delta_e(&p, &r, &two_of_three()).unwrap().unwrap();
        assert!((whole - 49.333_799_7).abs() < 1e-3 && (masked - 49.481_191_1).abs() < 1e-3);
        assert!((whole - 49.333_983_371_332_1).abs() < 1e-9, "{whole}");
        assert!((masked - 49.481_304_722_153_5).abs() < 1e-9, "{masked}");
    }

    /// Not from an independent source: the bits of this implementation, which the mathematical functions of the
    /// standard library would change on some machines. A dependency that enables `palette`'s feature `std` brings them.
    #[test]
    fn every_machine_computes_the_same_bits() {
        let mean = delta_e(&made(3, 7, 5), &made(5, 2, 11), &two_of_three()).unwrap().unwrap();
        assert_eq!(mean, 49.481_304_722_129_4);
    }

    #[test]
    fn values_are_clipped() {
        let pixel = |value| Picture::filled(1, 1, LinearRgb(value));
        let all = Picture::filled(1, 1, true);
        let clipped = delta_e(&pixel([-0.5, 0.25, 3.0]), &pixel([0.0, 0.25, 1.0]), &all);
        assert_eq!(clipped.unwrap(), Some(0.0));
        // The twin that differs inside 0..1.
        assert!(delta_e(&pixel([0.0, 0.25, 0.9]), &pixel([0.0, 0.25, 1.0]), &all).unwrap().unwrap() > 1.0);
    }

    #[test]
    fn only_values_inside_the_mask_count() {
        let good = Picture::filled(2, 1, LinearRgb([0.5; 3]));
        let mut bad = good.clone();
        bad.set(1, 0, LinearRgb([0.5, f32::NAN, 0.5]));
        let masks = [[true, false], [true, true], [false, false]];
        let [left, whole, none] = masks.map(|counts| Picture::new(2, 1, counts.to_vec()).unwrap());
        assert_eq!(delta_e(&bad, &good, &left).unwrap(), Some(0.0));
        assert_eq!(delta_e(&good, &good, &none).unwrap(), None);
        let error = delta_e(&good, &bad, &whole).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { picture: "reference", x: 1, y: 0, channel: 1, .. }));
        let tall = Picture::filled(1, 2, true);
        assert!(matches!(delta_e(&good, &good, &tall), Err(MetricError::SizesDiffer { what: "mask", .. })));
    }

    #[test]
    fn an_empty_picture_has_no_value() {
        let empty = Picture::filled(0, 0, LinearRgb::default());
        assert_eq!(delta_e(&empty, &empty, &Picture::filled(0, 0, true)).unwrap(), None);
    }

    fn colours() -> impl Strategy<Value = Picture<LinearRgb>> {
        let pixels = prop::collection::vec(prop::array::uniform3(0.0_f32..1.0).prop_map(LinearRgb), 6);
        pixels.prop_map(|pixels| Picture::new(3, 2, pixels).unwrap())
    }

    proptest! {
        #[test]
        fn identity_and_symmetry(p in colours(), r in colours()) {
            let all = Picture::filled(3, 2, true);
            prop_assert_eq!(delta_e(&p, &p, &all).unwrap(), Some(0.0));
            let [there, back] = [(&p, &r), (&r, &p)].map(|(a, b)| delta_e(a, b, &all).unwrap().unwrap());
            prop_assert!((there - back).abs() <= 1e-12 * there);
        }
    }
}
