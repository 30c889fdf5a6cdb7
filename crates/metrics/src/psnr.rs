//! The peak signal-to-noise ratio.

use crate::MetricError;

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

#[cfg(test)]
mod tests {
    use super::*;

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
}
