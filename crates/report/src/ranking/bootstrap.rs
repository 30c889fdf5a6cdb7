//! Intervals of methods and comparisons of pairs, from the same draws of houses for all of them.

use super::clusters::{Clusters, Mean};
use super::draws::Draws;
use super::file::{Interval, IntervalKind};

/// The share of draws outside an interval on each side: 95 % lie inside.
const TAIL: f64 = 0.025;

/// The comparison of one method with another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Duel {
    /// The share of draws in which the first has the higher mean; equal means count half.
    pub(super) first_higher: f64,
    /// p-value: the probability of a difference this large, in either direction, between equal methods.
    pub(super) p: f64,
}

/// Means of all columns and their intervals.
pub(super) fn intervals(clusters: &Clusters, draws: &Draws, kind: IntervalKind) -> Vec<(f64, Option<Interval>)> {
    let means = clusters.means();
    let mut columns: Vec<Vec<f64>> = means.iter().map(|_| Vec::with_capacity(draws.len())).collect();
    let keep = |row: &[f64]| columns.iter_mut().zip(row).for_each(|(column, value)| column.push(*value));
    match kind {
        IntervalKind::Percentile => clusters.each_draw(draws, keep),
        IntervalKind::Student => clusters.each_studentised_draw(draws, keep),
    }
    let interval = |(mean, column): (&Mean, Vec<f64>)| {
        let [low, high] = tails(column);
        let [low, high] = match kind {
            IntervalKind::Percentile => [low, high],
            _ if mean.standard_error == 0.0 => [mean.value; 2],
            // Efron & Tibshirani 1993, chapter 12: the upper quantile of the draws gives the lower end.
            IntervalKind::Student => [high, low].map(|off| mean.value - off * mean.standard_error),
        };
        (mean.value, (low.is_finite() && high.is_finite()).then_some(Interval { low, high, kind }))
    };
    means.iter().zip(columns).map(interval).collect()
}

/// The values below and above which [`TAIL`] of the draws lie.
fn tails(mut values: Vec<f64>) -> [f64; 2] {
    // The k-th of n draws is the quantile k / (n + 1).
    let below = ((values.len() + 1) as f64 * TAIL) as usize;
    let low = below.saturating_sub(1);
    let high = values.len() - 1 - low;
    [low, high].map(|at| *values.select_nth_unstable_by(at, f64::total_cmp).1)
}

/// Compares pairs of columns.
pub(super) fn duels(clusters: &Clusters, pairs: &[(usize, usize)], draws: &Draws, kind: IntervalKind) -> Vec<Duel> {
    let mut tallies = vec![Tally::default(); pairs.len()];
    clusters.each_draw(draws, |row| {
        for (tally, (a, b)) in tallies.iter_mut().zip(pairs) {
            tally.count(row[*a], row[*b]);
        }
    });
    let p_values: Vec<f64> = match kind {
        IntervalKind::Percentile => tallies.iter().map(|tally| tally.p_value(draws.len())).collect(),
        IntervalKind::Student => studentised_p_values(&clusters.differences(pairs), draws),
    };
    let first_higher = |tally: &Tally| 0.5 + 0.5 * (tally.above as f64 - tally.below as f64) / draws.len() as f64;
    tallies.iter().zip(p_values).map(|(tally, p)| Duel { first_higher: first_higher(tally), p }).collect()
}

/// The numbers of draws above and below a bound; the rest equal it.
#[derive(Clone, Copy, Default)]
struct Tally {
    above: usize,
    below: usize,
}

impl Tally {
    fn count(&mut self, value: f64, bound: f64) {
        self.above += usize::from(value > bound);
        self.below += usize::from(value < bound);
    }

    /// The p-value: twice the share of draws on the rarer side, draws at the bound included (Davison & Hinkley 1997,
    /// equation 4.11).
    fn p_value(&self, draws: usize) -> f64 {
        let rarer = draws - self.above.max(self.below);
        (2.0 * (rarer + 1) as f64 / (draws + 1) as f64).min(1.0)
    }
}

/// p-values of studentised differences: how often the draws have a difference over its standard error as large as the
/// one found.
fn studentised_p_values(differences: &Clusters, draws: &Draws) -> Vec<f64> {
    let means = differences.means();
    let found: Vec<f64> = means.iter().map(studentised).collect();
    let mut tallies = vec![Tally::default(); means.len()];
    differences.each_studentised_draw(draws, |row| {
        for ((tally, off), found) in tallies.iter_mut().zip(row).zip(&found) {
            tally.count(*off, *found);
        }
    });
    tallies.iter().map(|tally| tally.p_value(draws.len())).collect()
}

/// A mean over its standard error; 0 for a mean of 0, and infinite for a difference that is the same in every house.
fn studentised(mean: &Mean) -> f64 {
    if mean.value == 0.0 { 0.0 } else { mean.value / mean.standard_error }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOTH: [IntervalKind; 2] = [IntervalKind::Percentile, IntervalKind::Student];

    /// Ten houses of one scene: a ramp, a copy of it, and one that is 0.5 higher everywhere.
    fn three() -> Clusters {
        let ramp: Vec<f64> = (0..10).map(f64::from).collect();
        let higher = ramp.iter().map(|value| value + 0.5).collect();
        Clusters::gather(&[ramp.clone(), ramp, higher], &(0..10).collect::<Vec<_>>())
    }

    #[test]
    fn equal_methods_do_not_differ_and_constant_differences_are_significant() {
        let draws = Draws::new(1, 999, 10);
        for kind in BOTH {
            let duels = duels(&three(), &[(0, 1), (2, 0), (0, 2)], &draws, kind);
            assert_eq!(duels[0], Duel { first_higher: 0.5, p: 1.0 });
            assert_eq!(duels[1], Duel { first_higher: 1.0, p: 0.002 });
            assert_eq!(duels[2], Duel { first_higher: 0.0, p: 0.002 });
        }
    }

    /// The standard error of 0 to 9 is 0.957; the normal's interval is 4.5 +- 1.96 * 0.957 * sqrt(0.9), Student's of 9
    /// degrees of freedom 4.5 +- 2.262 * 0.957.
    #[test]
    fn intervals_of_a_ramp() {
        let draws = Draws::new(1, 9_999, 10);
        for (kind, half, slack) in [(IntervalKind::Percentile, 1.78, 0.1), (IntervalKind::Student, 2.166, 0.25)] {
            let (mean, interval) = intervals(&three(), &draws, kind)[0];
            let interval = interval.unwrap();
            assert_eq!(mean, 4.5);
            assert!(
                (interval.high - 4.5 - half).abs() < slack && (4.5 - interval.low - half).abs() < slack,
                "{interval:?}"
            );
        }
    }

    #[test]
    fn intervals_of_constants_have_no_width() {
        let clusters = Clusters::gather(&[vec![2.0; 6]], &[0, 1, 2, 3, 4, 5]);
        for kind in BOTH {
            let (_, interval) = intervals(&clusters, &Draws::new(1, 99, 6), kind)[0];
            assert_eq!(interval, Some(Interval { low: 2.0, high: 2.0, kind }));
        }
    }
}
