//! Light samples divided among light groups as a caller asks.

use glam::Vec3;
use mateval_image::LUMINANCE;

use crate::LightMix;
use crate::emitter::Emitters;

/// The smallest share of a group, so that lamps that light little of a view are sampled too.
pub const LEAST_SHARE: f64 = 0.02;
/// Steps of the iteration that finds the factors on solid angles. Shares that no factors can meet are approached as far
/// as [`LEAST_FACTOR`] allows.
const STEPS: usize = 24;
/// The smallest factor; the largest is 1.
const LEAST_FACTOR: f64 = 1e-3;

/// How much each light group matters to the noise of pictures under `mixes`, for
/// [`World::with_group_shares`](crate::World::with_group_shares): the root of the sum over pictures of its squared
/// share of their luminance. With light samples divided in these proportions, the sum of the pictures' variances is
/// least if the variance of a group's light follows the square of the light (Cochran, "Sampling techniques", section
/// 5.5).
pub fn shares_for(mixes: &[LightMix], group_light: &[[f64; 3]]) -> Vec<f64> {
    let mut squares = vec![0.0; group_light.len()];
    for mix in mixes {
        let of_groups: Vec<f64> =
            group_light.iter().zip(mix).map(|(light, weight)| luminance_of(light, weight)).collect();
        let total: f64 = of_groups.iter().sum();
        if total > 0.0 {
            squares.iter_mut().zip(of_groups).for_each(|(square, light)| *square += (light / total).powi(2));
        }
    }
    squares.into_iter().map(f64::sqrt).collect()
}

/// The luminance of a group's light under its weights.
fn luminance_of(light: &[f64; 3], weight: &[f64; 3]) -> f64 {
    (0..3).map(|c| LUMINANCE[c] * light[c] * weight[c]).sum()
}

impl Emitters {
    /// The same emitters. A sample that goes to an area emitter goes to one of light group g with a probability that
    /// is, on average over `points`, proportional to `shares[g]` (at least [`LEAST_SHARE`] of all), apart from the
    /// share that is spread evenly. The solid angles of a group's emitters are all multiplied by one factor.
    pub(crate) fn with_group_shares(&self, points: &[Vec3], shares: &[f64]) -> Self {
        let groups = self.solid_angles_of_groups(points);
        let factors = factors(&groups, shares);
        let of_area: Vec<f32> = self.areas.iter().map(|area| factors[area.light.0] as f32).collect();
        Self { outlines: self.outlines.scaled(&of_area), ..self.clone() }
    }

    /// For each point that sees an emitter, the solid angle of each group's area emitters.
    fn solid_angles_of_groups(&self, points: &[Vec3]) -> Vec<Vec<f64>> {
        let of_point = |&point: &Vec3| {
            let mut groups = vec![0.0; self.groups()];
            for (area, solid_angle) in self.areas.iter().zip(self.outlines.solid_angles(point).flatten()) {
                groups[area.light.0] += f64::from(solid_angle);
            }
            groups
        };
        points.iter().map(of_point).filter(|groups| groups.iter().sum::<f64>() > 0.0).collect()
    }
}

/// The factor of each group; the largest is 1. Groups that no point sees keep the factor 1, and their shares do not
/// count.
fn factors(points: &[Vec<f64>], shares: &[f64]) -> Vec<f64> {
    let mut factors = vec![1.0; shares.len()];
    let seen: Vec<bool> = mean_probabilities(points, &factors).into_iter().map(|found| found > 0.0).collect();
    let of_seen = |values: &[f64]| -> Vec<f64> {
        values.iter().zip(&seen).filter(|(_, seen)| **seen).map(|(value, _)| *value).collect()
    };
    let total: f64 = of_seen(shares).iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return factors;
    }
    for _ in 0..STEPS {
        let found = mean_probabilities(points, &factors);
        for (at, factor) in factors.iter_mut().enumerate().filter(|(at, _)| seen[*at]) {
            *factor *= (shares[at] / total).max(LEAST_SHARE) / found[at];
        }
        let most = of_seen(&factors).into_iter().fold(f64::MIN_POSITIVE, f64::max);
        for (factor, _) in factors.iter_mut().zip(&seen).filter(|(_, seen)| **seen) {
            *factor = (*factor / most).max(LEAST_FACTOR);
        }
    }
    factors
}

/// The mean over points of the probability of each group, if solid angles are multiplied by `factors`.
fn mean_probabilities(points: &[Vec<f64>], factors: &[f64]) -> Vec<f64> {
    let mut mean = vec![0.0; factors.len()];
    for groups in points {
        let weights: Vec<f64> = groups.iter().zip(factors).map(|(angle, factor)| angle * factor).collect();
        let total: f64 = weights.iter().sum();
        mean.iter_mut().zip(weights).for_each(|(mean, weight)| *mean += weight / total / points.len() as f64);
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A faint group that is once alone is sampled more often than its light in the other pictures would deserve.
    #[test]
    fn shares_follow_the_pictures() {
        let group_light = [[9.0; 3], [1.0; 3]];
        let own = vec![[1.0; 3]; 2];
        let shares = |mixes: &[LightMix]| {
            let shares = shares_for(mixes, &group_light);
            shares[1] / shares[0]
        };
        assert!((shares(std::slice::from_ref(&own)) - 1.0 / 9.0).abs() < 1e-12);
        let alone = vec![[0.0; 3], [10.0; 3]];
        assert!((shares(&[own, alone]) - (1.01_f64.sqrt() / 0.9)).abs() < 1e-12);
        assert_eq!(shares_for(&[vec![[0.0; 3]; 2]], &group_light), [0.0; 2]);
    }

    /// Two groups, of which each is near to some of the points.
    fn points() -> Vec<Vec<f64>> {
        (0..50).map(|k| vec![1.0 / f64::from(1 + k), 0.0, 0.01 * f64::from(1 + k)]).collect()
    }

    #[test]
    fn mean_probabilities_meet_the_shares() {
        for shares in [[0.5, 0.0, 0.5], [0.9, 0.0, 0.1], [0.1, 0.0, 0.9], [30.0, 0.0, 10.0]] {
            let factors = factors(&points(), &shares);
            let found = mean_probabilities(&points(), &factors);
            let total: f64 = shares.iter().sum();
            assert!((found[0] - shares[0] / total).abs() < 1e-3, "{shares:?}: {found:?}");
            assert_eq!((factors[1], factors.iter().copied().fold(0.0, f64::max)), (1.0, 1.0));
        }
    }

    #[test]
    fn faint_groups_keep_a_share() {
        let found = mean_probabilities(&points(), &factors(&points(), &[1.0, 0.0, 0.0]));
        assert!((found[2] - LEAST_SHARE / (1.0 + LEAST_SHARE)).abs() < 1e-3, "{found:?}");
    }

    /// Nine of ten points see the first group alone, which can then not have a tenth of the samples.
    #[test]
    fn shares_out_of_reach_leave_factors_bounded() {
        let points: Vec<Vec<f64>> = (0..10).map(|k| vec![1.0, f64::from(u8::from(k == 0))]).collect();
        let factors = factors(&points, &[0.1, 0.9]);
        assert!(factors.iter().all(|factor| (LEAST_FACTOR..=1.0).contains(factor)), "{factors:?}");
    }

    /// The light of a group that no point sees, as that of a sky, does not change how the others share.
    #[test]
    fn unseen_groups_take_nothing_from_the_others() {
        let [alone, beside] = [[0.3, 0.0, 0.1], [0.3, 100.0, 0.1]].map(|shares| factors(&points(), &shares));
        assert_eq!(alone, beside);
    }

    #[test]
    fn without_light_or_points_nothing_changes() {
        assert_eq!(factors(&points(), &[0.0; 3]), [1.0; 3]);
        assert_eq!(factors(&[], &[0.3, 0.7]), [1.0; 2]);
    }
}
