//! Intervals of methods and comparisons of pairs, from the same draws of houses for all of them. Scenes of one house
//! are alike, so that scores are summed by house and whole houses are drawn.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use mateval_dataset::splitmix64;

use super::file::{Interval, IntervalKind};

/// The share of draws outside an interval on each side: 95 % lie inside.
pub(super) const TAIL: f64 = 0.025;
/// Differences of means within this relative bound are rounding errors.
const ROUNDING: f64 = 1e-12;

/// Draws with replacement, each of as many clusters as the results have, from a fixed generator: they are the same on
/// every machine.
pub(crate) struct Draws {
    clusters: usize,
    /// How often each draw holds each cluster, draw by draw.
    counts: Vec<u16>,
}

impl Draws {
    /// The largest supported number of clusters.
    pub(crate) const MOST_CLUSTERS: usize = u16::MAX as usize;

    /// `draws` draws of `clusters` clusters, at most [`Draws::MOST_CLUSTERS`]. The k-th number of a draw follows from
    /// the seed, the draw and k alone.
    pub(crate) fn new(seed: u64, draws: usize, clusters: usize) -> Self {
        let mut counts = vec![0; draws * clusters];
        for (draw, counts) in counts.chunks_exact_mut(clusters.max(1)).enumerate() {
            for k in 0..clusters {
                let index = (draw * clusters + k) as u64;
                // The upper bits of the product are uniform up to one part in 2^32.
                let drawn = ((splitmix64::number(seed, index) >> 32) * clusters as u64) >> 32;
                counts[drawn as usize] += 1;
            }
        }
        Self { clusters, counts }
    }

    /// Draw by draw, how often it holds each cluster.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &[u16]> {
        self.counts.chunks_exact(self.clusters.max(1))
    }

    pub(super) fn len(&self) -> usize {
        self.counts.len() / self.clusters.max(1)
    }
}

/// Draws by the number of clusters, made on first use.
pub(super) struct DrawTable {
    seed: u64,
    draws: usize,
    made: Mutex<BTreeMap<usize, Arc<Draws>>>,
}

impl DrawTable {
    /// A table of draws with one seed and one number of draws.
    pub(super) fn new(seed: u64, draws: usize) -> Self {
        Self { seed, draws, made: Mutex::default() }
    }

    pub(super) fn of(&self, clusters: usize) -> Arc<Draws> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(made.entry(clusters).or_insert_with(|| Arc::new(Draws::new(self.seed, self.draws, clusters))))
    }
}

/// What the bootstrap needs of some columns of scores: for each cluster, its number of scenes and the sum of each
/// column over them.
#[derive(Debug)]
pub(super) struct Clusters {
    columns: usize,
    scenes: Vec<f64>,
    /// Cluster by cluster, one sum for each column.
    sums: Vec<f64>,
}

/// A column's mean, and its standard error, which allows for clusters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mean {
    pub(super) value: f64,
    pub(super) standard_error: f64,
}

impl Clusters {
    /// `values` holds a column's value of each scene, `house` the number of each scene's house. Clusters are in the
    /// order in which their houses appear.
    pub(super) fn gather(values: &[Vec<f64>], house: &[usize]) -> Self {
        let mut places: BTreeMap<usize, usize> = BTreeMap::new();
        let mut clusters = Self { columns: values.len(), scenes: Vec::new(), sums: Vec::new() };
        for (scene, house) in house.iter().enumerate() {
            let at = *places.entry(*house).or_insert_with(|| {
                clusters.scenes.push(0.0);
                clusters.sums.resize(clusters.sums.len() + values.len(), 0.0);
                clusters.scenes.len() - 1
            });
            clusters.scenes[at] += 1.0;
            for (sum, column) in clusters.sums[at * values.len()..].iter_mut().zip(values) {
                *sum += column[scene];
            }
        }
        clusters
    }

    pub(super) fn len(&self) -> usize {
        self.scenes.len()
    }

    /// The differences of pairs of columns, as new columns.
    pub(super) fn differences(&self, pairs: &[(usize, usize)]) -> Self {
        let rows = self.sums.chunks_exact(self.columns.max(1));
        let sums = rows.flat_map(|row| pairs.iter().map(|&(a, b)| row[a] - row[b])).collect();
        Self { columns: pairs.len(), scenes: self.scenes.clone(), sums }
    }

    /// Means over all scenes. The variance is that of a ratio of sums over clusters (Cochran 1977, section 6.3).
    pub(super) fn means(&self) -> Vec<Mean> {
        let all: f64 = self.scenes.iter().sum();
        let clusters = self.len() as f64;
        let mean = |column: usize| {
            let sums = || self.sums.iter().skip(column).step_by(self.columns);
            let value = sums().sum::<f64>() / all;
            let squares: f64 = sums().zip(&self.scenes).map(|(sum, scenes)| (sum - value * scenes).powi(2)).sum();
            let size: f64 = sums().map(|sum| sum * sum).sum();
            let squares = if squares <= ROUNDING * ROUNDING * size { 0.0 } else { squares };
            Mean { value, standard_error: (clusters / (clusters - 1.0) * squares).sqrt() / all }
        };
        (0..self.columns).map(mean).collect()
    }

    /// Calls `see` for each draw with the means of all columns.
    pub(super) fn each_draw(&self, draws: &Draws, mut see: impl FnMut(&[f64])) {
        let mut means = vec![0.0; self.columns];
        for counts in draws.iter() {
            means.fill(0.0);
            let mut scenes = 0.0;
            for ((count, row), size) in counts.iter().zip(self.sums.chunks_exact(self.columns)).zip(&self.scenes) {
                if *count > 0 {
                    let count = f64::from(*count);
                    scenes += count * size;
                    means.iter_mut().zip(row).for_each(|(mean, sum)| *mean += count * sum);
                }
            }
            means.iter_mut().for_each(|mean| *mean /= scenes);
            see(&means);
        }
    }

    /// Calls `see` for each draw with each column's mean minus its mean over all clusters, in the draw's own standard
    /// errors. Infinite if the draw holds a single cluster with another mean.
    pub(super) fn each_studentised_draw(&self, draws: &Draws, mut see: impl FnMut(&[f64])) {
        let residuals = self.residuals();
        let clusters = self.len() as f64;
        let mut sums = vec![Sums::default(); self.columns];
        let mut off = vec![0.0; self.columns];
        for counts in draws.iter() {
            sums.fill(Sums::default());
            let (mut scenes, mut squared_scenes) = (0.0, 0.0);
            for ((count, row), size) in counts.iter().zip(residuals.chunks_exact(self.columns)).zip(&self.scenes) {
                if *count > 0 {
                    let count = f64::from(*count);
                    scenes += count * size;
                    squared_scenes += count * size * size;
                    sums.iter_mut().zip(row).for_each(|(sums, residual)| sums.add(count, *residual, *size));
                }
            }
            for (off, sums) in off.iter_mut().zip(&sums) {
                *off = sums.studentised(scenes, squared_scenes, clusters);
            }
            see(&off);
        }
    }

    /// Each cluster's sums minus those that its scenes would have at the columns' means.
    fn residuals(&self) -> Vec<f64> {
        let means = self.means();
        let rows = self.sums.chunks_exact(self.columns.max(1)).zip(&self.scenes);
        rows.flat_map(|(row, scenes)| row.iter().zip(&means).map(move |(sum, mean)| sum - mean.value * scenes))
            .collect()
    }
}

/// Sums over the clusters of a draw.
#[derive(Clone, Copy, Default)]
struct Sums {
    residuals: f64,
    squares: f64,
    by_size: f64,
}

impl Sums {
    fn add(&mut self, count: f64, residual: f64, size: f64) {
        let counted = count * residual;
        self.residuals += counted;
        self.squares += counted * residual;
        self.by_size += counted * size;
    }

    /// The draw's mean minus the mean over all clusters, over the draw's standard error.
    fn studentised(&self, scenes: f64, squared_scenes: f64, clusters: f64) -> f64 {
        let off = self.residuals / scenes;
        // Squares about the draw's own mean.
        let squares = self.squares - 2.0 * off * self.by_size + off * off * squared_scenes;
        if squares > ROUNDING * self.squares {
            return off * scenes / (clusters / (clusters - 1.0) * squares).sqrt();
        }
        if self.squares == 0.0 { 0.0 } else { off.signum() * f64::INFINITY }
    }
}

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
pub(crate) fn tails(mut values: Vec<f64>) -> [f64; 2] {
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

    /// Every draw holds 20 clusters. Over all draws, the count of each cluster has the mean 1 and the variance of a
    /// binomial distribution, 1 - 1/n.
    #[test]
    fn draws_are_uniform() {
        let draws = Draws::new(1, 10_000, 20);
        assert_eq!(draws.len(), 10_000);
        assert!(draws.iter().all(|counts| counts.iter().map(|&c| usize::from(c)).sum::<usize>() == 20));
        for cluster in 0..20 {
            let counts = || draws.iter().map(|counts| f64::from(counts[cluster]));
            let mean = counts().sum::<f64>() / 1e4;
            let variance = counts().map(|c| (c - 1.0).powi(2)).sum::<f64>() / 1e4;
            // Five standard errors: 0.01 of the mean, 0.018 of the variance.
            assert!((mean - 1.0).abs() < 0.05 && (variance - 0.95).abs() < 0.09, "{mean} {variance}");
        }
        // The twin: another seed gives other draws.
        assert!(draws.counts != Draws::new(2, 10_000, 20).counts);
    }

    /// Scenes of houses 7, 7, 3: sums 3 and 5; mean 8/3; residuals 3 - 16/3 and 5 - 8/3, both 7/3 off.
    #[test]
    fn by_hand() {
        let clusters = Clusters::gather(&[vec![1.0, 2.0, 5.0]], &[7, 7, 3]);
        assert_eq!((clusters.scenes.as_slice(), clusters.sums.as_slice()), (&[2.0, 1.0][..], &[3.0, 5.0][..]));
        let mean = clusters.means()[0];
        let squares: f64 = 2.0 * 7.0 * 7.0 / 9.0;
        assert!((mean.value - 8.0 / 3.0).abs() < 1e-15);
        assert!((mean.standard_error - (2.0 * squares).sqrt() / 3.0).abs() < 1e-15, "{mean:?}");
    }

    /// With one scene in each house it is the textbook's standard error of a mean.
    #[test]
    fn single_scenes_have_the_textbooks_standard_error() {
        let clusters = Clusters::gather(&[vec![2.0, 4.0, 4.0, 6.0]], &[0, 1, 2, 3]);
        assert!((clusters.means()[0].standard_error - (8.0_f64 / 3.0 / 4.0).sqrt()).abs() < 1e-15);
    }

    /// A draw has the mean and the standard error of its clusters as a sample of their own.
    #[test]
    fn a_draw_is_a_sample_of_its_own() {
        let (sizes, sums) = ([1.0, 2.0, 3.0, 1.0, 2.0], [2.0, 3.0, 9.0, 0.5, 1.0]);
        let clusters = Clusters { columns: 1, scenes: sizes.into(), sums: sums.into() };
        let whole = clusters.means()[0].value;
        let draws = Draws::new(5, 50, 5);
        let expected = draws.iter().map(|counts| {
            let again = |of: [f64; 5]| (0..5).flat_map(|k| vec![of[k]; usize::from(counts[k])]).collect::<Vec<f64>>();
            let mean = Clusters { columns: 1, scenes: again(sizes), sums: again(sums) }.means()[0];
            (mean.value, (mean.value - whole) / mean.standard_error)
        });
        let expected: Vec<(f64, f64)> = expected.collect();
        let (mut means, mut offs) = (Vec::new(), Vec::new());
        clusters.each_draw(&draws, |row| means.push(row[0]));
        clusters.each_studentised_draw(&draws, |row| offs.push(row[0]));
        let mut seen = 0;
        for ((mean, off), (expected_mean, expected_off)) in means.iter().zip(&offs).zip(&expected) {
            assert!((mean - expected_mean).abs() < 1e-12);
            // A draw of a single house has no standard error, and its difference is infinite.
            let is_same = off == expected_off || (off - expected_off).abs() < 1e-9 * off.abs().max(1.0);
            assert!(is_same, "{off} {expected_off}");
            seen += 1;
        }
        assert_eq!(seen, 50);
    }

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
