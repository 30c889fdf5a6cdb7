//! Ranks as ranges: methods whose difference may be chance share ranks.

use super::file::RankRange;

/// The range of ranks of each of `methods` methods: a method ranks below all that are significantly better and above all
/// that are significantly worse. `beaten` holds pairs of a winner and a loser, as places in the list of methods.
pub(super) fn rank_ranges(methods: usize, beaten: &[(usize, usize)]) -> Vec<RankRange> {
    let mut ranks = vec![RankRange { best: 1, worst: methods }; methods];
    for (winner, loser) in beaten {
        ranks[*loser].best += 1;
        ranks[*winner].worst -= 1;
    }
    ranks
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_by_hand() {
        let range = |best, worst| RankRange { best, worst };
        assert_eq!(rank_ranges(3, &[]), [range(1, 3); 3]);
        assert_eq!(rank_ranges(3, &[(0, 2), (1, 2)]), [range(1, 2), range(1, 2), range(3, 3)]);
    }
}
