//! Standard deviations and correlation of pairs of numbers.

use std::collections::BTreeMap;

/// Sums over pairs of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Pairs {
    count: f64,
    x: f64,
    y: f64,
    xx: f64,
    yy: f64,
    xy: f64,
}

impl Pairs {
    /// Adds one pair.
    pub(super) fn add(&mut self, x: f64, y: f64) {
        self.count += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.yy += y * y;
        self.xy += x * y;
    }

    /// The sums of all pairs after the mean of each pair's group has been subtracted.
    pub(super) fn within<K: Ord>(pairs: impl IntoIterator<Item = (K, f64, f64)>) -> Self {
        let mut groups: BTreeMap<K, Self> = BTreeMap::new();
        pairs.into_iter().for_each(|(group, x, y)| groups.entry(group).or_default().add(x, y));
        groups.values().fold(Self::default(), |sum, group| {
            let [xx, yy, xy] = group.centred();
            Self { count: sum.count + group.count, xx: sum.xx + xx, yy: sum.yy + yy, xy: sum.xy + xy, ..sum }
        })
    }

    /// The number of pairs.
    pub(super) fn count(&self) -> f64 {
        self.count
    }

    /// The standard deviations of x and of y.
    pub(super) fn deviations(&self) -> [f64; 2] {
        let [xx, yy, _] = self.centred();
        [xx, yy].map(|sum| (sum / self.count.max(1.0)).sqrt())
    }

    /// The correlation, -1 to 1; 0 where x or y is constant.
    pub(super) fn correlation(&self) -> f64 {
        let [xx, yy, xy] = self.centred();
        if xx > 0.0 && yy > 0.0 { xy / (xx * yy).sqrt() } else { 0.0 }
    }

    /// Squares and products about the means, summed.
    fn centred(&self) -> [f64; 3] {
        let count = self.count.max(1.0);
        let about = |sum: f64, a: f64, b: f64| sum - a * b / count;
        let [xx, yy] = [about(self.xx, self.x, self.x), about(self.yy, self.y, self.y)].map(|sum| sum.max(0.0));
        [xx, yy, about(self.xy, self.x, self.y)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_and_groups_on_lines() {
        let mut line = Pairs::default();
        (0..5).for_each(|x| line.add(f64::from(x), 3.0 - 2.0 * f64::from(x)));
        assert!((line.correlation() + 1.0).abs() < 1e-12);
        let [x, y] = line.deviations();
        assert!((x - 2.0_f64.sqrt()).abs() < 1e-12 && (y - 2.0 * x).abs() < 1e-12);
        // Two groups, each rising, the later far below: within them it rises, over all it falls.
        let groups = (0..10).map(|k| (k / 5, f64::from(k), f64::from(k % 5) - 100.0 * f64::from(k / 5)));
        let mut all = Pairs::default();
        groups.clone().for_each(|(_, x, y)| all.add(x, y));
        assert!(all.correlation() < -0.5 && (Pairs::within(groups).correlation() - 1.0).abs() < 1e-12);
    }
}
