//! The SSIM that a noisy render would have without noise, from its two halves.
//!
//! Noise lowers SSIM, since its variance counts as the prediction's. So the prediction's moments within a window are
//! taken from two independent halves. Its mean is the mean of both halves' means, its squared mean is their product,
//! its variance is the covariance of the halves (at least 0), and its covariance with the reference is the mean of both
//! halves' covariances. The reference is one picture without noise. Window, constants and mask rules are those of
//! [`mod@crate::ssim`].
//!
//! Each moment is free of bias, except the variance where it is held at 0. Their ratio keeps a bias of second order,
//! and a single window may exceed 1. With equal halves the result is plain SSIM. The bias of encoding the halves remains
//! unless they are a [`crate::NoisyRender`]'s. On synthetic renders of 64 samples, 0.003 remained of an error of 0.025
//! where a pixel of the mean is off by 6 % of its value, and 0.02 of 0.08 where it is off by 12 %.

use mateval_image::{Mask, Picture};

use crate::Halves;
use crate::MetricError;
use crate::mask::{black_filled, pixel_count};
use crate::pixel::{Pixel, check_finite, check_size, size_of};
use crate::ssim::{C1, C2, MaskedSsim, SIGMA, check_window_fits, gaussian, mean, mean_of_valid, windows_map};

/// Estimates [`ssim`](crate::ssim()) of the noise-free picture that both halves are renders of, over all windows.
///
/// Meant for sRGB-encoded pictures in 0..1, all of one size. Fails if sizes differ, a side is below 11 pixels or a
/// value is not finite.
pub fn ssim_halves<P: Pixel>(prediction: Halves<P>, reference: &Picture<P>) -> Result<f64, MetricError> {
    check(prediction, reference, None)?;
    Ok(mean(&map(prediction, reference)))
}

/// [`ssim_halves`] with black outside the mask, averaged over the whole picture, as
/// [`ssim_black_fill`](crate::ssim_black_fill) does. `None` where no pixel counts. Fails as [`ssim_halves`] does.
pub fn ssim_halves_black_fill<P: Pixel>(
    prediction: Halves<P>,
    reference: &Picture<P>,
    mask: &Mask,
) -> Result<Option<f64>, MetricError> {
    let map = filled_map(prediction, reference, mask)?;
    Ok((pixel_count(mask) > 0).then(|| mean(&map)))
}

/// [`ssim_halves`] over the windows that lie wholly inside the mask, as
/// [`ssim_valid_windows`](crate::ssim_valid_windows) does; `None` without such a window. Fails as [`ssim_halves`] does.
pub fn ssim_halves_valid_windows<P: Pixel>(
    prediction: Halves<P>,
    reference: &Picture<P>,
    mask: &Mask,
) -> Result<Option<MaskedSsim>, MetricError> {
    Ok(mean_of_valid(&filled_map(prediction, reference, mask)?, mask))
}

fn check<P: Pixel>(prediction: Halves<P>, reference: &Picture<P>, mask: Option<&Mask>) -> Result<(), MetricError> {
    let size = size_of(prediction.a);
    check_size(size, "prediction's second half", size_of(prediction.b))?;
    check_size(size, "reference", size_of(reference))?;
    mask.map_or(Ok(()), |mask| check_size(size, "mask", size_of(mask)))?;
    check_window_fits(size)?;
    check_finite("prediction's first half", prediction.a, mask)?;
    check_finite("prediction's second half", prediction.b, mask)?;
    check_finite("reference", reference, mask)
}

/// The map of both halves and the reference with black outside the mask.
fn filled_map<P: Pixel>(
    prediction: Halves<P>,
    reference: &Picture<P>,
    mask: &Mask,
) -> Result<Picture<f64>, MetricError> {
    check(prediction, reference, Some(mask))?;
    let (a, b) = (black_filled(prediction.a, mask)?, black_filled(prediction.b, mask)?);
    Ok(map(Halves { a: &a, b: &b }, &black_filled(reference, mask)?))
}

fn map<P: Pixel>(prediction: Halves<P>, reference: &Picture<P>) -> Picture<f64> {
    let terms = |pixel: usize, channel: usize| {
        let [a, b, r] = [prediction.a, prediction.b, reference]
            .map(|picture| f64::from(picture.pixels()[pixel].channels()[channel]));
        [a, b, r, a * b, r * r, 0.5 * (a + b) * r]
    };
    windows_map(size_of(reference), P::default().channels().len(), &gaussian(SIGMA), terms, index)
}

/// The index of one window from its means of a, b, r, ab, r² and pr, where p = (a + b) / 2 (Wang et al. 2004, equation
/// 13).
fn index(&[a, b, r, ab, rr, pr]: &[f64; 6]) -> f64 {
    let (p, p_squared) = (0.5 * (a + b), a * b);
    let (variance_p, variance_r, covariance) = ((ab - a * b).max(0.0), rr - r * r, pr - p * r);
    let numerator = (2.0 * p * r + C1) * (2.0 * covariance + C2);
    numerator / ((p_squared + r * r + C1) * (variance_p + variance_r + C2))
}

#[cfg(test)]
mod tests {
    use mateval_image::{LinearRgb, SrgbRgb};

    use super::*;
    use crate::{ssim, ssim_black_fill, ssim_valid_windows};
    use mateval_testkit::synthetic_noise::{Render, SCATTERS, Scatter, mean_of, waves};

    const SIDE: usize = 48;

    /// The prediction without noise: darker, and with fine stripes.
    fn truth() -> Picture<LinearRgb> {
        let mut picture = waves(SIDE);
        for (index, pixel) in picture.pixels_mut().iter_mut().enumerate() {
            let factor = if (index % SIDE).is_multiple_of(3) { 0.6 } else { 0.85 };
            pixel.0 = pixel.0.map(|value| value * factor);
        }
        picture
    }

    /// A half of `samples / 2` samples, linear. The standard deviation of one sample is half its value.
    fn half(scatter: Scatter, samples: u32, seed: u64) -> Picture<LinearRgb> {
        let strength = match scatter {
            Scatter::GaussianLike => 0.5,
            Scatter::HeavyTailed => 0.5 / 3.0,
        };
        Render { scatter, strength, samples: samples / 2, blocks: None, view: 0 }.picture(&truth(), seed)
    }

    fn some_mask() -> Mask {
        Picture::from_fn(SIDE, SIDE, |x, y| x + y > 20 && y < 40)
    }

    #[test]
    fn equal_halves_are_plain_ssim() {
        let (p, r, mask) = (half(Scatter::HeavyTailed, 16, 1).to_srgb(), waves(SIDE).to_srgb(), some_mask());
        let halves = Halves { a: &p, b: &p };
        assert!((ssim_halves(halves, &r).unwrap() - ssim(&p, &r).unwrap()).abs() < 1e-12);
        let found = ssim_halves_black_fill(halves, &r, &mask).unwrap().unwrap();
        assert!((found - ssim_black_fill(&p, &r, &mask).unwrap().unwrap()).abs() < 1e-12);
        let found = ssim_halves_valid_windows(halves, &r, &mask).unwrap().unwrap();
        let plain = ssim_valid_windows(&p, &r, &mask).unwrap().unwrap();
        assert!(found.windows == plain.windows && (found.ssim - plain.ssim).abs() < 1e-12);
        // The twin: another half changes the value.
        let other = half(Scatter::HeavyTailed, 16, 2).to_srgb();
        assert!((ssim_halves(Halves { a: &p, b: &other }, &r).unwrap() - ssim(&p, &r).unwrap()).abs() > 1e-3);
    }

    /// Two halves of 32 samples agree with 4096 samples; the noisy mean of the same 64 does not.
    #[test]
    fn sixty_four_samples_are_as_good_as_4096() {
        let (r, mask) = (waves(SIDE).to_srgb(), some_mask());
        for scatter in SCATTERS {
            let [a, b, fine_a, fine_b] =
                [(64, 1), (64, 2), (4096, 3), (4096, 4)].map(|(n, seed)| half(scatter, n, seed));
            let (noisy, fine) = (mean_of(&a, &b).to_srgb(), mean_of(&fine_a, &fine_b).to_srgb());
            let (a, b) = (a.to_srgb(), b.to_srgb());
            let halves = Halves { a: &a, b: &b };
            let whole = [ssim_halves(halves, &r).unwrap(), ssim(&noisy, &r).unwrap(), ssim(&fine, &r).unwrap()];
            let plain = |p| ssim_black_fill(p, &r, &mask).unwrap().unwrap();
            let black = [ssim_halves_black_fill(halves, &r, &mask).unwrap().unwrap(), plain(&noisy), plain(&fine)];
            let plain = |p| ssim_valid_windows(p, &r, &mask).unwrap().unwrap().ssim;
            let valid =
                [ssim_halves_valid_windows(halves, &r, &mask).unwrap().unwrap().ssim, plain(&noisy), plain(&fine)];
            for [found, noisy, fine] in [whole, black, valid] {
                assert!((found - fine).abs() < 0.005, "{scatter:?}: {found} for {fine}");
                assert!((noisy - fine).abs() > 0.015, "{scatter:?}: {noisy} for {fine}");
            }
        }
    }

    #[test]
    fn values_outside_the_mask_are_not_read() {
        let (r, mask) = (waves(SIDE).to_srgb(), some_mask());
        let [a, b] = [1, 2].map(|seed| half(Scatter::GaussianLike, 8, seed).to_srgb());
        let mut spoilt = b.clone();
        spoilt.set(0, 0, SrgbRgb([f32::NAN; 3]));
        let (good, bad) = (Halves { a: &a, b: &b }, Halves { a: &a, b: &spoilt });
        assert_eq!(
            ssim_halves_valid_windows(bad, &r, &mask).unwrap(),
            ssim_halves_valid_windows(good, &r, &mask).unwrap()
        );
        assert_eq!(ssim_halves_black_fill(bad, &r, &mask).unwrap(), ssim_halves_black_fill(good, &r, &mask).unwrap());
        let error = ssim_halves(bad, &r).unwrap_err();
        assert!(matches!(error, MetricError::NotFinite { picture: "prediction's second half", x: 0, y: 0, .. }));
        let none = Picture::filled(SIDE, SIDE, false);
        assert_eq!(ssim_halves_black_fill(good, &r, &none).unwrap(), None);
        assert_eq!(ssim_halves_valid_windows(good, &r, &none).unwrap(), None);
        let small = Picture::filled(11, 10, 0.5_f32);
        assert!(matches!(ssim_halves(Halves { a: &small, b: &small }, &small), Err(MetricError::TooSmall { .. })));
        assert!(matches!(
            ssim_halves(good, &Picture::filled(12, 12, SrgbRgb([0.5; 3]))),
            Err(MetricError::SizesDiffer { .. })
        ));
    }

    #[test]
    fn the_thread_count_changes_no_bit() {
        let [a, b] = [1, 2].map(|seed| half(Scatter::HeavyTailed, 8, seed).to_srgb());
        let r = waves(SIDE).to_srgb();
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| ssim_halves(Halves { a: &a, b: &b }, &r).unwrap().to_bits())
        };
        assert_eq!(with(1), with(2));
        assert_ne!(with(1), ssim_halves(Halves { a: &a, b: &a }, &r).unwrap().to_bits());
    }
}
