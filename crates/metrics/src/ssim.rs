//! The structural similarity index.
//!
//! Wang, Bovik, Sheikh, Simoncelli: "Image quality assessment: from error visibility to structural similarity", 2004,
//! with their constants: an 11x11 Gaussian window of sigma 1.5, K1 = 0.01, K2 = 0.03, dynamic range 1. Variances are
//! population variances; the index of a colour picture is the mean over its channels. scikit-image computes the same
//! with `gaussian_weights`, `sigma=1.5`, `use_sample_covariance=False`, `data_range=1`.
//!
//! Higher is better: 1 for equal pictures, at least -1. Meant for sRGB-encoded pictures in 0..1.

use mateval_image::{Mask, Picture};
use rayon::prelude::*;

use crate::MetricError;
use crate::pixel::{Pixel, black_filled, check_pair, pixel_count, size_of};

/// Pixels from a window's centre to its edge.
const RADIUS: usize = 5;
/// Width and height of the window; pictures must be at least as large.
pub const WINDOW: usize = 2 * RADIUS + 1;
/// Standard deviation of the Gaussian window, in pixels.
pub const SIGMA: f64 = 1.5;
/// The constant that stabilises the comparison of means.
pub const K1: f64 = 0.01;
/// The constant that stabilises the comparison of variances.
pub const K2: f64 = 0.03;
const C1: f64 = K1 * K1;
const C2: f64 = K2 * K2;

/// SSIM over the windows that lie wholly inside a mask.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaskedSsim {
    /// Their mean index.
    pub ssim: f64,
    /// Their number, at least 1.
    pub windows: usize,
}

/// The mean over all windows inside the picture. No window is centred on the border of 5 pixels.
///
/// Fails if sizes differ, a side is below 11 pixels or a value is not finite.
pub fn ssim<P: Pixel>(prediction: &Picture<P>, reference: &Picture<P>) -> Result<f64, MetricError> {
    let map = ssim_map(prediction, reference)?;
    Ok(map.pixels().iter().sum::<f64>() / map.pixels().len() as f64)
}

/// [`ssim`] of both pictures with black outside the mask, averaged over the whole picture (protocol `paper`). The
/// larger the black part, the nearer the result is to 1. `None` where no pixel counts. Values outside the mask are not
/// read. Fails as [`ssim`] does.
pub fn ssim_black_fill<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: &Mask,
) -> Result<Option<f64>, MetricError> {
    check_pair(prediction, reference, Some(mask))?;
    let value = ssim(&black_filled(prediction, mask)?, &black_filled(reference, mask)?)?;
    Ok((pixel_count(mask) > 0).then_some(value))
}

/// The mean over the windows that lie wholly inside picture and mask (protocol `mateval-3`), `None` without such a
/// window. Values outside the mask are not read. Fails as [`ssim`] does.
pub fn ssim_valid_windows<P: Pixel>(
    prediction: &Picture<P>,
    reference: &Picture<P>,
    mask: &Mask,
) -> Result<Option<MaskedSsim>, MetricError> {
    check_pair(prediction, reference, Some(mask))?;
    // No valid window reaches the filling; it replaces values that may be NaN.
    let map = ssim_map(&black_filled(prediction, mask)?, &black_filled(reference, mask)?)?;
    let (mut sum, mut windows) = (0.0, 0);
    for (value, _) in map.pixels().iter().zip(valid_windows(mask)).filter(|&(_, valid)| valid) {
        sum += value;
        windows += 1;
    }
    Ok((windows > 0).then(|| MaskedSsim { ssim: sum / windows as f64, windows }))
}

/// The index of every window, averaged over channels. The map is 10 pixels narrower and lower than the pictures; its
/// pixel (x, y) is the index of the window around (x + 5, y + 5). Fails as [`ssim`] does.
fn ssim_map<P: Pixel>(prediction: &Picture<P>, reference: &Picture<P>) -> Result<Picture<f64>, MetricError> {
    check_pair(prediction, reference, None)?;
    let found = size_of(prediction);
    if found.0.min(found.1) < WINDOW {
        return Err(MetricError::TooSmall { metric: "ssim", least: WINDOW, found });
    }
    Ok(map_with(prediction, reference, &gaussian(SIGMA)))
}

/// The window's weights along one axis; their sum is 1.
fn gaussian(sigma: f64) -> [f64; WINDOW] {
    let weights: [f64; WINDOW] = std::array::from_fn(|i| {
        let distance = i as f64 - RADIUS as f64;
        libm::exp(-0.5 * distance * distance / (sigma * sigma))
    });
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// The weighted means of p, r, p², r² and pr over a window or a part of it.
type Moments = [f64; 5];

/// The map of two pictures under the given window.
fn map_with<P: Pixel>(prediction: &Picture<P>, reference: &Picture<P>, window: &[f64; WINDOW]) -> Picture<f64> {
    let (width, height) = size_of(prediction);
    let channels = P::default().channels().len();
    let row = |y: usize| {
        let mut row = vec![0.0; width - 2 * RADIUS];
        for channel in 0..channels {
            // The moments of each column of 11 pixels that starts at this row.
            let mut columns = vec![Moments::default(); width];
            for (dy, weight) in window.iter().enumerate() {
                for (x, sums) in columns.iter_mut().enumerate() {
                    let pixel = (y + dy) * width + x;
                    let value = |picture: &Picture<P>| f64::from(picture.pixels()[pixel].channels()[channel]);
                    let [p, r] = [value(prediction), value(reference)];
                    add_weighted(sums, *weight, &[p, r, p * p, r * r, p * r]);
                }
            }
            for (x, value) in row.iter_mut().enumerate() {
                let mut sums = Moments::default();
                columns[x..].iter().zip(window).for_each(|(column, weight)| add_weighted(&mut sums, *weight, column));
                *value += index(&sums);
            }
        }
        row.iter_mut().for_each(|value| *value /= channels as f64);
        row
    };
    let rows: Vec<Vec<f64>> = (0..height - 2 * RADIUS).into_par_iter().map(row).collect();
    let map = Picture::new(width - 2 * RADIUS, height - 2 * RADIUS, rows.concat());
    map.expect("one row of the map for each row of windows")
}

fn add_weighted(sums: &mut Moments, weight: f64, terms: &Moments) {
    (0..terms.len()).for_each(|i| sums[i] += weight * terms[i]);
}

/// The index of one window from its means of p, r, p², r² and pr (Wang et al. 2004, equation 13).
fn index(&[p, r, pp, rr, pr]: &Moments) -> f64 {
    let (variance_p, variance_r, covariance) = (pp - p * p, rr - r * r, pr - p * r);
    let numerator = (2.0 * p * r + C1) * (2.0 * covariance + C2);
    numerator / ((p * p + r * r + C1) * (variance_p + variance_r + C2))
}

/// For each window inside the picture, row by row, whether all its pixels are in the mask.
fn valid_windows(mask: &Mask) -> Vec<bool> {
    let (width, height) = size_of(mask);
    let counts: Vec<usize> = (0..height).flat_map(|y| runs(&mask.pixels()[y * width..(y + 1) * width])).collect();
    let row = width - 2 * RADIUS;
    let full = |start: usize| (0..WINDOW).all(|dy| counts[start + dy * row] >= WINDOW);
    (0..(height - 2 * RADIUS) * row).map(full).collect()
}

/// For each run of 11 neighbouring pixels of a row, how many of them count.
fn runs(row: &[bool]) -> impl Iterator<Item = usize> {
    row.windows(WINDOW).map(|stretch| stretch.iter().filter(|&&counts| counts).count())
}

#[cfg(test)]
mod tests {
    use mateval_image::SrgbRgb;
    use proptest::prelude::*;

    use super::*;

    /// A picture of hashed values in 0..1.
    fn noise(width: usize, height: usize, seed: u32) -> Picture<SrgbRgb> {
        Picture::from_fn(width, height, |x, y| {
            SrgbRgb(std::array::from_fn(|c| {
                let mut h = seed ^ (x as u32).wrapping_mul(0x9E37_79B1) ^ (y as u32).wrapping_mul(0x85EB_CA6B);
                h = (h ^ (h >> 15) ^ c as u32).wrapping_mul(0x2C1B_3C6D);
                h = (h ^ (h >> 12)).wrapping_mul(0x297A_2D39);
                (h >> 8) as f32 / (1 << 24) as f32
            }))
        })
    }

    /// Flat pictures have no variance, so the index is (2ab + C1) / (a² + b² + C1).
    #[test]
    fn flat_pictures_in_closed_form() {
        let (a, b) = (0.25_f64, 0.5_f64);
        let found = ssim(&Picture::filled(12, 11, a as f32), &Picture::filled(12, 11, b as f32)).unwrap();
        assert!((found - (2.0 * a * b + 1e-4) / (a * a + b * b + 1e-4)).abs() < 1e-12);
    }

    /// The window of scipy's `gaussian_filter` (sigma 1.5, truncate 3.5), which scikit-image uses: its centre is
    /// 0.26601172, its end 0.00102838.
    #[test]
    fn the_window_is_scipys() {
        let window = gaussian(SIGMA);
        assert!((window[RADIUS] - 0.266_011_72).abs() < 1e-8);
        assert!((window[0] - 0.001_028_38).abs() < 1e-8);
        assert_eq!(window[0], window[WINDOW - 1]);
    }

    /// Two passes along the axes equal one sum over 121 pixels; with another sigma they do not.
    #[test]
    fn a_window_summed_directly() {
        let (p, r) = (noise(13, 12, 1), noise(13, 12, 2));
        let direct = |x0: usize, y0: usize| {
            let window = gaussian(SIGMA);
            let mut sum = 0.0;
            for c in 0..3 {
                let mut moments = [0.0; 5];
                for (dy, dx) in (0..WINDOW).flat_map(|dy| (0..WINDOW).map(move |dx| (dy, dx))) {
                    let (a, b) = (f64::from(p.get(x0 + dx, y0 + dy).0[c]), f64::from(r.get(x0 + dx, y0 + dy).0[c]));
                    let terms = [a, b, a * a, b * b, a * b];
                    (0..5).for_each(|i| moments[i] += window[dy] * window[dx] * terms[i]);
                }
                sum += index(&moments);
            }
            sum / 3.0
        };
        let (map, other) = (ssim_map(&p, &r).unwrap(), map_with(&p, &r, &gaussian(1.4)));
        assert_eq!((map.width(), map.height()), (3, 2));
        for (x, y) in (0..2).flat_map(|y| (0..3).map(move |x| (x, y))) {
            assert!((map.get(x, y) - direct(x, y)).abs() < 1e-12);
            assert!((other.get(x, y) - direct(x, y)).abs() > 1e-6);
        }
    }

    #[test]
    fn pictures_below_the_window_are_refused() {
        let small = Picture::filled(11, 10, 0.5_f32);
        assert!(matches!(ssim(&small, &small), Err(MetricError::TooSmall { least: 11, found: (11, 10), .. })));
        let least = Picture::filled(11, 11, 0.5_f32);
        assert_eq!(ssim(&least, &least).unwrap(), 1.0);
    }

    #[test]
    fn windows_are_valid_where_all_of_the_mask_is() {
        let mut mask = Picture::filled(14, 12, true);
        mask.set(1, 0, false);
        // Rows of four windows; the missing pixel lies in the first two of the first row.
        assert_eq!(valid_windows(&mask), [false, false, true, true, true, true, true, true]);
        let (p, r) = (noise(14, 12, 3), noise(14, 12, 4));
        assert_eq!(ssim_valid_windows(&p, &r, &mask).unwrap().unwrap().windows, 6);
        mask.set(7, 6, false);
        assert_eq!(ssim_valid_windows(&p, &r, &mask).unwrap(), None);
        assert!(ssim_black_fill(&p, &r, &mask).unwrap().is_some());
        assert_eq!(ssim_black_fill(&p, &r, &Picture::filled(14, 12, false)).unwrap(), None);
    }

    #[test]
    fn values_outside_the_mask_are_not_read() {
        let mask = Picture::from_fn(24, 16, |x, _| x < 14);
        let (p, r) = (noise(24, 16, 5), noise(24, 16, 6));
        let mut spoilt = p.clone();
        spoilt.set(20, 8, SrgbRgb([f32::NAN; 3]));
        spoilt.set(14, 8, SrgbRgb([1e30; 3]));
        let valid = ssim_valid_windows(&p, &r, &mask).unwrap();
        assert_eq!(ssim_valid_windows(&spoilt, &r, &mask).unwrap(), valid);
        assert_eq!(ssim_black_fill(&spoilt, &r, &mask).unwrap(), ssim_black_fill(&p, &r, &mask).unwrap());
        assert!(matches!(ssim(&spoilt, &r), Err(MetricError::NotFinite { .. })));
        spoilt.set(2, 3, SrgbRgb([f32::NAN; 3]));
        let error = ssim_valid_windows(&spoilt, &r, &mask).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { picture: "prediction", x: 2, y: 3, .. }));
    }

    #[test]
    fn the_thread_count_changes_no_bit() {
        let (p, r) = (noise(40, 33, 7), noise(40, 33, 8));
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ssim(&p, &r).unwrap().to_bits())
        };
        assert_eq!(with(1), with(2));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn identity_symmetry_and_full_mask(width in 11_usize..20, height in 11_usize..20, seed: u32) {
            let (p, r) = (noise(width, height, seed), noise(width, height, !seed));
            let whole = ssim(&p, &r).unwrap();
            let full = Picture::filled(width, height, true);
            prop_assert!((ssim(&p, &p).unwrap() - 1.0).abs() < 1e-12);
            prop_assert!((-1.0..1.0).contains(&whole));
            prop_assert!((ssim(&r, &p).unwrap() - whole).abs() < 1e-14);
            prop_assert_eq!(ssim_black_fill(&p, &r, &full).unwrap(), Some(whole));
            let windows = (width - 10) * (height - 10);
            prop_assert_eq!(ssim_valid_windows(&p, &r, &full).unwrap(), Some(MaskedSsim { ssim: whole, windows }));
        }
    }
}
