//! Scores of scenes summed by house: scenes of one house are alike, so that the bootstrap draws whole houses.

use std::collections::BTreeMap;

use super::draws::Draws;

/// Differences of means within this relative bound are rounding errors.
const ROUNDING: f64 = 1e-12;

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

    /// The number of clusters.
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
