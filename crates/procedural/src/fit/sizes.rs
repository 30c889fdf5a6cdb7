//! How usual the sizes of a fitted graph are: in metres, a plank and a strip of parquet differ, and so do leather
//! and roughcast.

use super::roles::{Role, is_length, role};
use crate::graph::Graph;
use crate::settings::{Settings, slots};

/// The factor of a usual size that counts as one standard deviation.
const FACTOR: f64 = 2.0;

/// The greatest square that counts: what is seen decides on unusual sizes too.
const MOST: f64 = 6.0;

/// The mean square of the logarithms of a graph's sizes over those of its defaults, in standard deviations; 0 for graphs
/// without sizes. Gaps and shifts do not count.
pub(super) fn unusual(graph: &Graph, settings: &Settings) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for (at, slot) in slots(graph).iter().enumerate() {
        let is_size = matches!(role(graph, slot.parameter), Role::Shape | Role::RandomSize)
            && is_length(graph, slot.parameter)
            && !["joint", "gap"].contains(&graph.parameters[slot.parameter].name.as_str());
        if is_size && slot.value > 0.0 {
            let apart = libm::log(settings.numbers()[at].max(1e-9) / slot.value) / libm::log(FACTOR);
            sum += (apart * apart).min(MOST);
            count += 1.0;
        }
    }
    sum / f64::max(count, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::entry;

    #[test]
    fn twice_and_half_of_a_usual_size_are_as_unusual() {
        let graph = entry("stripes").unwrap().graph().unwrap();
        let of = |factor: f64| {
            let mut settings = Settings::defaults(&graph);
            let at = slots(&graph).iter().position(|slot| graph.parameters[slot.parameter].name == "period").unwrap();
            *settings.number_mut(at) *= factor;
            unusual(&graph, &settings)
        };
        assert_eq!(of(1.0), 0.0);
        assert!((of(2.0) - 1.0).abs() < 1e-9 && (of(0.5) - 1.0).abs() < 1e-9);
        // The twin: one colour has no size.
        let paint = entry("paint").unwrap().graph().unwrap();
        assert_eq!(unusual(&paint, &Settings::defaults(&paint)), 0.0);
    }
}
