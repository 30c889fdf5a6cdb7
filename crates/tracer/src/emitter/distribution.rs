//! A discrete distribution, sampled by its cumulative weights.

/// Cumulative weights, scaled to end at 1.
#[derive(Clone, Debug)]
pub(crate) struct Distribution {
    /// `cumulative[k]` is the probability of all choices before k; there is one more entry than choices.
    cumulative: Vec<f32>,
    total: f64,
}

impl Distribution {
    /// Builds the distribution from finite weights of at least 0. If all are zero, all choices are equally likely.
    pub(crate) fn new(weights: impl Iterator<Item = f64>) -> Self {
        let mut sums = vec![0.0_f64];
        let mut total = 0.0;
        for weight in weights {
            total += weight;
            sums.push(total);
        }
        let count = (sums.len() - 1) as f64;
        let scaled = |(k, sum): (usize, f64)| if total > 0.0 { sum / total } else { k as f64 / count };
        Self { cumulative: sums.into_iter().enumerate().map(|entry| scaled(entry) as f32).collect(), total }
    }

    /// The sum of the weights.
    pub(crate) fn total(&self) -> f64 {
        self.total
    }

    /// The choice for `u` in [0, 1), and the position of u within that choice, rescaled to [0, 1). A choice of weight
    /// zero is never made.
    pub(crate) fn sample(&self, u: f32) -> (usize, f32) {
        let choice = self.cumulative.partition_point(|&before| before <= u) - 1;
        let choice = choice.min(self.cumulative.len() - 2);
        let rest = (u - self.cumulative[choice]) / self.probability(choice);
        (choice, rest.clamp(0.0, 1.0 - f32::EPSILON))
    }

    /// The probability of `choice`.
    pub(crate) fn probability(&self, choice: usize) -> f32 {
        self.cumulative[choice + 1] - self.cumulative[choice]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choices_follow_their_weights() {
        let distribution = Distribution::new([1.0, 0.0, 3.0].into_iter());
        let mut counts = [0; 3];
        for k in 0..1000 {
            counts[distribution.sample((k as f32 + 0.5) / 1000.0).0] += 1;
        }
        assert_eq!(counts, [250, 0, 750]);
        assert_eq!(distribution.sample(0.625), (2, 0.5));
        assert_eq!(distribution.probability(2), 0.75);
    }

    #[test]
    fn weights_of_zero_alone_are_all_alike() {
        let distribution = Distribution::new([0.0, 0.0].into_iter());
        assert_eq!((distribution.sample(0.75).0, distribution.probability(0)), (1, 0.5));
    }
}
