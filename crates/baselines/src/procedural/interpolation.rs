//! How well held-out points are predicted by those around them, without any pattern.
//!
//! Light and colour that is left in an estimate changes slowly, so that a pattern of few wide stripes predicts it well,
//! and so do its neighbours. Only what they do not predict speaks for a pattern.

use mateval_procedural::fit::points::{Point, split};
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// The number of neighbours whose mean is the prediction.
const NEIGHBOURS: usize = 16;

/// The most held-out points that are predicted.
const MOST_POINTS: usize = 1024;

/// The mean square of the differences between held-out points and the mean of the points nearest to them that are not
/// held out; none where there are none of either.
pub(super) fn interpolation_error(points: &[Point]) -> Option<f64> {
    let (seen, held_out) = split(points);
    if seen.is_empty() || held_out.is_empty() {
        return None;
    }
    let tree = RTree::bulk_load(seen.iter().map(|point| GeomWithData::new([point.u, point.v], point.albedo)).collect());
    let judged = &held_out[..held_out.len().min(MOST_POINTS)];
    let square = |point: &Point| {
        let nearest = tree.nearest_neighbor_iter(&[point.u, point.v]).take(NEIGHBOURS);
        let (sum, count) = nearest.fold(([0.0; 3], 0.0), |(sum, count), near| {
            (std::array::from_fn(|channel| sum[channel] + near.data[channel]), count + 1.0)
        });
        let of_channel = |channel: usize| (sum[channel] / count - point.albedo[channel]).powi(2);
        (0..3).map(of_channel).sum::<f64>() / 3.0
    };
    Some(judged.iter().map(square).sum::<f64>() / judged.len() as f64)
}

#[cfg(test)]
mod tests {
    use mateval_procedural::noise::cell;

    use super::*;

    fn error(color: impl Fn(f64, f64) -> f64) -> f64 {
        let point = |at: u32| {
            let [u, v] = [0.5, 1.5].map(|row| 2.0 * cell(f64::from(at) + 0.5, row));
            Point { u, v, footprint: 0.01, albedo: [color(u, v); 3], weight: 1.0 }
        };
        interpolation_error(&(0..4096).map(point).collect::<Vec<_>>()).unwrap()
    }

    /// Slow changes are predicted, and fine stripes are not.
    #[test]
    fn neighbours_predict_what_changes_slowly() {
        let slow = error(|u, _| 0.5 + 0.2 * (1.5 * u).sin());
        let stripes = error(|u, _| if (u / 0.1).fract() < 0.5 { 0.7 } else { 0.3 });
        assert!(slow < 1e-3 && stripes > 0.02, "{slow} {stripes}");
        assert_eq!(interpolation_error(&[]), None);
    }
}
