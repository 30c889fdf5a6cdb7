//! The clusters that each draw of the bootstrap holds, from a fixed generator, so that they are the same on every
//! machine.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use mateval_scene::splitmix64;

/// Draws with replacement, each of as many clusters as the results have.
pub(super) struct Draws {
    clusters: usize,
    /// How often each draw holds each cluster, draw by draw.
    counts: Vec<u16>,
}

impl Draws {
    /// The largest supported number of clusters.
    pub(super) const MOST_CLUSTERS: usize = u16::MAX as usize;

    /// `draws` draws of `clusters` clusters, at most [`Draws::MOST_CLUSTERS`]. The k-th number of a draw follows from
    /// the seed, the draw and k alone.
    pub(super) fn new(seed: u64, draws: usize, clusters: usize) -> Self {
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
    pub(super) fn iter(&self) -> impl Iterator<Item = &[u16]> {
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

    /// The draws of `clusters` clusters.
    pub(super) fn of(&self, clusters: usize) -> Arc<Draws> {
        let mut made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        Arc::clone(made.entry(clusters).or_insert_with(|| Arc::new(Draws::new(self.seed, self.draws, clusters))))
    }
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
}
