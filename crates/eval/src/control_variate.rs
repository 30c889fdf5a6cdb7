//! Light of a prediction, corrected by what its paths show of the companions.
//!
//! With P the prediction's picture, F_j the pictures of the companions from the same paths, C_j their converged pictures,
//! and r the ratio of the prediction's base colour to the truth's,
//!
//! ```text
//! corrected = P + r * sum over j of b_j * (C_j - F_j)
//! ```
//!
//! has the expectation of P for any b and r that do not depend on these paths (control variates; Owen, "Monte Carlo theory,
//! methods and examples", section 8.9). The coefficients b of each channel come from a pilot: weighted least squares of the
//! difference of two of its renders on the same difference of the companions.

use mateval_image::{LinearRgb, Picture};

use crate::companions::COMPANIONS;

/// For each companion a coefficient of each channel.
pub(crate) type Coefficients = [[f64; 3]; COMPANIONS];

/// The largest ratio of base colours.
pub const MOST_RATIO: f32 = 8.0;

/// The smallest base colour of the truth that a prediction's is divided by.
pub const LEAST_BASE_COLOR: f32 = 1e-3;

/// Share of the trace of the normal equations that is added to their diagonal.
pub const RIDGE: f64 = 1e-6;

/// The range of exposed values whose slope of the sRGB curve weighs a pixel.
pub const WEIGHED_RANGE: [f64; 2] = [0.003, 1.0];

/// The ratio of base colours as a view shows them, the prediction's clipped to 0..1 as when it is rendered; 1 where the
/// truth's is 0.
pub(crate) fn base_color_ratio(prediction: &Picture<LinearRgb>, truth: &Picture<LinearRgb>) -> Picture<LinearRgb> {
    let ratio =
        |p: f32, t: f32| if t == 0.0 { 1.0 } else { (p.clamp(0.0, 1.0) / t.max(LEAST_BASE_COLOR)).min(MOST_RATIO) };
    Picture::from_fn(truth.width(), truth.height(), |x, y| {
        let (LinearRgb(p), LinearRgb(t)) = (prediction.get(x, y), truth.get(x, y));
        LinearRgb([0, 1, 2].map(|c| ratio(p[c], t[c])))
    })
}

/// The sum over companions, weighted by the coefficients and the ratio, of one pixel.
pub(crate) fn combined(coefficients: &Coefficients, ratio: [f32; 3], companions: [[f64; 3]; COMPANIONS]) -> [f64; 3] {
    [0, 1, 2].map(|c| {
        let sum: f64 = (0..COMPANIONS).map(|j| coefficients[j][c] * companions[j][c]).sum();
        f64::from(ratio[c]) * sum
    })
}

/// The normal equations of the coefficients, for each channel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Regression {
    normal: [[[f64; COMPANIONS]; COMPANIONS]; 3],
    right: [[f64; COMPANIONS]; 3],
}

impl Regression {
    /// Adds a pixel: the difference of two renders of the prediction, that of the companions times the ratio, and the
    /// pixel's exposed value, all by channel.
    pub(crate) fn add(&mut self, prediction: [f64; 3], companions: [[f64; 3]; COMPANIONS], value: [f64; 3]) {
        for c in 0..3 {
            let weight = encoded_slope(value[c]).powi(2);
            for i in 0..COMPANIONS {
                let weighed = weight * companions[i][c];
                self.right[c][i] += weighed * prediction[c];
                for (sum, companion) in self.normal[c][i].iter_mut().zip(&companions) {
                    *sum += weighed * companion[c];
                }
            }
        }
    }

    /// The coefficients; 0 in a channel in which no companion varies.
    pub(crate) fn solve(&self) -> Coefficients {
        let by_channel = [0, 1, 2].map(|c| solve(self.normal[c], self.right[c]));
        std::array::from_fn(|j| [0, 1, 2].map(|c| by_channel[c][j]))
    }
}

/// The slope of the sRGB curve at an exposed value.
fn encoded_slope(value: f64) -> f64 {
    let value = value.clamp(WEIGHED_RANGE[0], WEIGHED_RANGE[1]);
    if value <= 0.0031308 { 12.92 } else { 1.055 / 2.4 * libm::pow(value, 1.0 / 2.4 - 1.0) }
}

fn solve(normal: [[f64; COMPANIONS]; COMPANIONS], right: [f64; COMPANIONS]) -> [f64; COMPANIONS] {
    let trace: f64 = (0..COMPANIONS).map(|i| normal[i][i]).sum();
    if !(trace > 0.0 && trace.is_finite()) {
        return [0.0; COMPANIONS];
    }
    let ridge = glam::DMat3::from_diagonal(glam::DVec3::splat(RIDGE * trace));
    // The matrix is symmetric, so rows are columns.
    let matrix = glam::DMat3::from_cols_array_2d(&normal) + ridge;
    (matrix.inverse() * glam::DVec3::from_array(right)).to_array()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Random differences whose coefficients are known.
    #[test]
    fn known_coefficients_are_found() {
        let known = [[0.7, 0.1, -0.3], [0.2, 1.5, 0.0], [-0.4, 0.0, 1.0]];
        let mut regression = Regression::default();
        let mut state = 1;
        let mut random = || {
            state += 1;
            (mateval_scene::splitmix64::number(7, state) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        for _ in 0..500 {
            let companions: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| random()));
            let prediction = combined(&known, [1.0; 3], companions);
            regression.add(prediction, companions, [0.2, 0.5, 2.0]);
        }
        let found = regression.solve();
        for (found, known) in found.as_flattened().iter().zip(known.as_flattened()) {
            assert!((found - known).abs() < 1e-4, "{found} {known}");
        }
        assert_eq!(Regression::default().solve(), [[0.0; 3]; 3]);
    }

    #[test]
    fn ratios_are_bounded() {
        let picture = |rgb| Picture::filled(1, 1, LinearRgb(rgb));
        let ratio = base_color_ratio(&picture([0.5, 0.9, 0.3]), &picture([0.25, 1e-4, 0.0])).get(0, 0);
        assert_eq!(ratio.0, [2.0, 8.0, 1.0]);
        let outside = base_color_ratio(&picture([16.0, -1.0, 0.5]), &picture([0.5; 3])).get(0, 0);
        assert_eq!(outside.0, [2.0, 0.0, 1.0]);
    }
}
