//! The ranking by one score, which compares each pair of methods on the scenes that both have. Ranks are ranges:
//! methods whose difference may be chance share ranks.

use mateval_eval::metric::Better;

use super::bootstrap::{Clusters, DrawTable, Duel, duels, intervals};
use super::file::{Interval, IntervalKind, KeyRanking, Pair, RankRange, RankingRules, Standing};

/// Values of one key.
pub(super) struct KeyValues<'a> {
    pub(super) better: Better,
    /// Ids of the methods that have any.
    pub(super) methods: Vec<&'a str>,
    /// For each method, its value for each scene; none if it does not cover the scene or has no such value.
    pub(super) values: Vec<Vec<Option<f64>>>,
}

/// Ranks the methods; `house` holds the number of each scene's house.
pub(super) fn rank_key(key: &KeyValues<'_>, house: &[usize], rules: &RankingRules, draws: &DrawTable) -> KeyRanking {
    let groups = groups_of_equal_cover(&key.values);
    let mut means: Vec<Option<GroupMean>> = vec![None; key.methods.len()];
    let mut met = Vec::new();
    for (at, group) in groups.iter().enumerate() {
        let shared = Shared::of(&key.values, house, group);
        for (method, mean) in group.iter().zip(shared.means(rules, draws)) {
            means[*method] = Some(mean);
        }
        let within = (0..group.len()).flat_map(|a| (a + 1..group.len()).map(move |b| (a, b)));
        met.extend(shared.meetings(&within.collect::<Vec<_>>(), rules, draws));
        for other in &groups[at + 1..] {
            let both = [group.as_slice(), other].concat();
            let shared = Shared::of(&key.values, house, &both);
            let across = (0..group.len()).flat_map(|a| (0..other.len()).map(move |b| (a, group.len() + b)));
            met.extend(shared.meetings(&across.collect::<Vec<_>>(), rules, draws));
        }
    }
    met.sort_by_key(|met| (met.first, met.second));
    let p_values: Vec<f64> = met.iter().map(|met| met.duel.map_or(1.0, |duel| duel.p)).collect();
    let corrected = corrected(&p_values);
    let beaten: Vec<(usize, usize)> =
        met.iter().zip(&corrected).filter(|(_, p)| **p < rules.level).map(|(met, _)| met.winner(key.better)).collect();
    let ranks = rank_ranges(key.methods.len(), &beaten);
    let rows = key.methods.iter().zip(means).zip(ranks);
    let standings = rows.filter_map(|((method, mean), rank)| {
        let GroupMean { value, interval, scenes, houses } = mean?;
        Some(Standing { method: (*method).to_owned(), value, interval, scenes, houses, rank })
    });
    KeyRanking {
        better: key.better,
        standings: standings.collect(),
        pairs: met.iter().zip(corrected).map(|(met, p_holm)| met.pair(key, p_holm)).collect(),
    }
}

/// Groups of methods that have values for exactly the same scenes, and can share their draws.
fn groups_of_equal_cover(values: &[Vec<Option<f64>>]) -> Vec<Vec<usize>> {
    let is_alike = |a: usize, b: usize| values[a].iter().zip(&values[b]).all(|(a, b)| a.is_some() == b.is_some());
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for method in 0..values.len() {
        match groups.iter_mut().find(|group| is_alike(group[0], method)) {
            Some(group) => group.push(method),
            None => groups.push(vec![method]),
        }
    }
    groups
}

/// A method's mean over all scenes that it has.
#[derive(Clone)]
struct GroupMean {
    value: f64,
    interval: Option<Interval>,
    scenes: usize,
    houses: usize,
}

/// Some methods on the scenes that all of them have.
struct Shared<'a> {
    members: &'a [usize],
    scenes: usize,
    clusters: Clusters,
}

impl<'a> Shared<'a> {
    fn of(values: &[Vec<Option<f64>>], house: &[usize], members: &'a [usize]) -> Self {
        let has_all = |scene: &usize| members.iter().all(|&method| values[method][*scene].is_some());
        let scenes: Vec<usize> = (0..house.len()).filter(has_all).collect();
        let column = |method: &usize| scenes.iter().filter_map(|&scene| values[*method][scene]).collect();
        let columns: Vec<Vec<f64>> = members.iter().map(column).collect();
        let houses: Vec<usize> = scenes.iter().map(|&scene| house[scene]).collect();
        Self { members, scenes: scenes.len(), clusters: Clusters::gather(&columns, &houses) }
    }

    /// The kind of intervals; none if there are too few houses to draw from.
    fn kind(&self, rules: &RankingRules) -> Option<IntervalKind> {
        match self.clusters.len() {
            few if few < rules.least_houses => None,
            some if some < rules.student_below => Some(IntervalKind::Student),
            _ => Some(IntervalKind::Percentile),
        }
    }

    fn means(&self, rules: &RankingRules, draws: &DrawTable) -> Vec<GroupMean> {
        let found = match self.kind(rules) {
            Some(kind) => intervals(&self.clusters, &draws.of(self.clusters.len()), kind),
            None => self.clusters.means().iter().map(|mean| (mean.value, None)).collect(),
        };
        let mean = |(value, interval)| GroupMean { value, interval, scenes: self.scenes, houses: self.clusters.len() };
        found.into_iter().map(mean).collect()
    }

    /// Compares pairs of members, which are given by their places.
    fn meetings(&self, pairs: &[(usize, usize)], rules: &RankingRules, draws: &DrawTable) -> Vec<Meeting> {
        if pairs.is_empty() {
            return Vec::new();
        }
        let found: Vec<Option<Duel>> = match self.kind(rules) {
            Some(kind) => {
                duels(&self.clusters, pairs, &draws.of(self.clusters.len()), kind).into_iter().map(Some).collect()
            }
            None => vec![None; pairs.len()],
        };
        let means = self.clusters.means();
        let meeting = |(&(a, b), duel): (&(usize, usize), Option<Duel>)| {
            let difference = (self.scenes > 0).then(|| means[a].value - means[b].value);
            let (first, second) = (self.members[a], self.members[b]);
            Meeting { first, second, scenes: self.scenes, difference, duel }.in_order()
        };
        pairs.iter().zip(found).map(meeting).collect()
    }
}

/// The comparison of two methods, which are given by their places in the key's list.
struct Meeting {
    first: usize,
    second: usize,
    scenes: usize,
    difference: Option<f64>,
    duel: Option<Duel>,
}

impl Meeting {
    /// The same comparison, with the method that is listed first as `first`.
    fn in_order(self) -> Self {
        if self.first < self.second {
            return self;
        }
        Self {
            first: self.second,
            second: self.first,
            scenes: self.scenes,
            difference: self.difference.map(|difference| -difference),
            duel: self.duel.map(|duel| Duel { first_higher: 1.0 - duel.first_higher, ..duel }),
        }
    }

    fn winner(&self, better: Better) -> (usize, usize) {
        let is_higher = self.difference > Some(0.0);
        if is_higher == (better == Better::Higher) { (self.first, self.second) } else { (self.second, self.first) }
    }

    fn pair(&self, key: &KeyValues<'_>, p_holm: f64) -> Pair {
        let win = |duel: Duel| match key.better {
            Better::Higher => duel.first_higher,
            Better::Lower => 1.0 - duel.first_higher,
        };
        Pair {
            first: key.methods[self.first].to_owned(),
            second: key.methods[self.second].to_owned(),
            scenes: self.scenes,
            difference: self.difference,
            win: self.duel.map(win),
            p: self.duel.map(|duel| duel.p),
            p_holm: self.duel.map(|_| p_holm),
        }
    }
}

/// p-values corrected for their number (Holm 1979): below `level` where Holm's procedure rejects equality.
fn corrected(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut corrected = vec![0.0; p_values.len()];
    let mut largest: f64 = 0.0;
    for (done, at) in order.into_iter().enumerate() {
        largest = largest.max(p_values[at] * (p_values.len() - done) as f64);
        corrected[at] = largest.min(1.0);
    }
    corrected
}

/// The range of ranks of each of `methods` methods: a method ranks below all that are significantly better and above
/// all that are significantly worse. `beaten` holds pairs of a winner and a loser, as places in the list of methods.
fn rank_ranges(methods: usize, beaten: &[(usize, usize)]) -> Vec<RankRange> {
    let mut ranks = vec![RankRange { best: 1, worst: methods }; methods];
    for (winner, loser) in beaten {
        ranks[*loser].best += 1;
        ranks[*winner].worst -= 1;
    }
    ranks
}

/// Kendall's tau-b of two lists of values of the same things (Kendall 1945, "The treatment of ties in ranking
/// problems"): 1 if both order them alike, -1 if one is the reverse of the other. None if all values of a list are equal.
pub(crate) fn kendall_tau_b(a: &[f64], b: &[f64]) -> Option<f64> {
    let (mut agreement, mut untied) = (0, [0; 2]);
    for at in 0..a.len().min(b.len()) {
        for before in 0..at {
            let order = |values: &[f64]| values[at].partial_cmp(&values[before]).map_or(0, |order| order as i32);
            let orders = [order(a), order(b)];
            agreement += orders[0] * orders[1];
            untied = [0, 1].map(|list| untied[list] + orders[list].abs());
        }
    }
    // Multiplied before the root, which is then exact for lists without ties.
    let most = (f64::from(untied[0]) * f64::from(untied[1])).sqrt();
    (most > 0.0).then(|| f64::from(agreement) / most)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: of 6 pairs 4 agree and 2 do not; 3 agree, 2 do not, and one list ties one. The third is the example in
    /// the documentation of SciPy's `kendalltau`.
    #[test]
    fn kendall_by_hand_and_as_scipy_does() {
        let tau = |a: &[f64], b: &[f64]| kendall_tau_b(a, b).unwrap();
        assert_eq!(tau(&[1.0, 2.0, 3.0, 4.0], &[1.0, 3.0, 4.0, 2.0]), 1.0 / 3.0);
        assert_eq!(tau(&[1.0, 2.0, 3.0, 4.0], &[1.0, 3.0, 3.0, 2.0]), 1.0 / 30_f64.sqrt());
        let scipy = tau(&[12.0, 2.0, 1.0, 12.0, 2.0], &[1.0, 4.0, 7.0, 1.0, 0.0]);
        assert!((scipy + 0.471_404_520_791_031_7).abs() < 1e-15, "{scipy}");
        assert_eq!(tau(&[1.0, 2.0, 3.0], &[3.0, 2.0, 1.0]), -1.0);
        assert_eq!([kendall_tau_b(&[1.0, 1.0], &[1.0, 2.0]), kendall_tau_b(&[1.0], &[1.0])], [None; 2]);
    }

    /// As R's `p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm")` gives them.
    #[test]
    fn holm_as_r_does() {
        let corrected = corrected(&[0.01, 0.04, 0.03, 0.005]);
        for (found, expected) in corrected.iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((found - expected).abs() < 1e-15, "{corrected:?}");
        }
    }

    #[test]
    fn ranks_by_hand() {
        let range = |best, worst| RankRange { best, worst };
        assert_eq!(rank_ranges(3, &[]), [range(1, 3); 3]);
        assert_eq!(rank_ranges(3, &[(0, 2), (1, 2)]), [range(1, 2), range(1, 2), range(3, 3)]);
    }
}
