//! A graph with the settings that a fit gave it: what a fit returns and what textures are made of. Beside it, what is
//! known before anything is seen: how usual the sizes of a graph are (in metres, a plank and a strip of parquet differ,
//! and so do leather and roughcast), and which graphs are likely on which things: weak odds, so that what is seen
//! decides.

use std::sync::Arc;

use super::Point;
use super::least_squares::mean_square;
use super::model::{Model, Role, is_length, role};
use crate::evaluator::evaluate;
use crate::graph::{Graph, Settings, slots};
use crate::library::Class;
use crate::noise::cell;
use crate::program::{OUTPUTS, Program};

/// The number of places at which the mean colour of a pattern is measured.
const MEAN_PLACES: u32 = 4096;

/// The side of the square over which they are scattered, in metres.
const MEAN_SIDE: f64 = 8.0;

/// A graph with its settings.
#[derive(Clone, Debug)]
pub struct Candidate {
    pub graph: Arc<Graph>,
    /// The kind of pattern of a built-in graph; `None` for a user's.
    pub class: Option<Class>,
    /// The settings, what is random included.
    pub settings: Settings,
    /// The weighted mean square of the difference of colours at the points that were held out, for the predictable part
    /// of the pattern ([`Candidate::with_detail`] of 0).
    pub error: f64,
    /// The logarithm of how much less the points of a cell differ than those of the same cells elsewhere; 0 where the
    /// graph has no cells.
    pub cells: f64,
    /// How far the statistics of the pattern are from those of the points; 0 for the same.
    pub distance: f64,
}

impl Candidate {
    /// The candidate of these settings, judged by these points; its statistics are not compared.
    pub(super) fn judged(model: &Model, settings: Settings, judged: &[Point]) -> Self {
        let error = mean_square(model, &settings, judged);
        Self { graph: Arc::clone(&model.graph), class: model.class, settings, error, cells: 0.0, distance: 0.0 }
    }

    /// The candidate with its randomness scaled: 1 keeps it, 0 removes it. Amplitudes of what is random shrink to their
    /// least values and colours that are scattered at random to their mean. The mean colour of the pattern stays, and
    /// so do the fibres of `carpet`, a tenth of its brightness, which have no parameter.
    pub fn with_detail(&self, detail: f64) -> Self {
        let detail = detail.clamp(0.0, 1.0);
        let mut scaled = self.clone();
        let mean = self.mean();
        let slots = slots(&self.graph);
        for (at, slot) in slots.iter().enumerate() {
            let anchor = match role(&self.graph, slot.parameter) {
                Role::Amplitude => slot.least.unwrap_or(0.0),
                Role::RandomColor => mean[slot.component],
                _ => continue,
            };
            let number = scaled.settings.number_mut(at);
            *number = anchor + detail * (*number - anchor);
        }
        let after = scaled.mean();
        for (at, slot) in slots.iter().enumerate() {
            if matches!(role(&self.graph, slot.parameter), Role::Color | Role::RandomColor)
                && after[slot.component] > 0.0
            {
                let number = scaled.settings.number_mut(at);
                *number = slot.clamped(*number * mean[slot.component] / after[slot.component]);
            }
        }
        scaled
    }

    /// Base colour (linear red, green, blue), roughness and metallic at places `[u, v, footprint]`, all in metres.
    pub fn evaluate(&self, places: &[[f64; 3]]) -> Vec<[f64; OUTPUTS]> {
        evaluate(&Program::new(&self.graph), &self.settings, places)
    }

    /// The mean colour over a large square.
    fn mean(&self) -> [f64; 3] {
        let random = |i: u32, axis: f64| MEAN_SIDE * cell(f64::from(i) + 0.5, axis);
        let places: Vec<[f64; 3]> = (0..MEAN_PLACES).map(|i| [random(i, 20.5), random(i, 21.5), 0.0]).collect();
        let shown = self.evaluate(&places);
        std::array::from_fn(|channel| shown.iter().map(|out| out[channel]).sum::<f64>() / f64::from(MEAN_PLACES))
    }
}

/// The factor of a usual size that counts as one standard deviation.
const FACTOR: f64 = 2.0;

/// The greatest square that counts: what is seen decides on unusual sizes too.
const MOST: f64 = 6.0;

/// The mean square of the logarithms of a graph's sizes over those of its defaults, in standard deviations; 0 for
/// graphs without sizes. Gaps and shifts do not count.
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

/// How much a graph is preferred for a category, in log-odds from -1 to 1; 0 for categories that are not in the table.
pub(super) fn log_odds(category: Option<&str>, graph: &str) -> f64 {
    let Some(category) = category else { return 0.0 };
    let category = category.to_lowercase();
    let row = TABLE.iter().find(|row| row.words.iter().any(|word| category.contains(word)));
    row.map_or(0.0, |row| match graph {
        _ if row.likely.contains(&graph) => 1.0,
        _ if row.unlikely.contains(&graph) => -1.0,
        _ => 0.0,
    })
}

/// Things of one kind.
struct Row {
    /// Words of which a category has one.
    words: &'static [&'static str],
    likely: &'static [&'static str],
    unlikely: &'static [&'static str],
}

const FABRICS: &[&str] = &["stripes", "plaid", "houndstooth", "weave", "corduroy", "leather"];
const STONES: &[&str] = &["roughcast", "concrete", "terrazzo", "granite", "travertine", "brick"];

/// The first row that has a word of the category counts.
const TABLE: [Row; 7] = [
    Row {
        words: &["table", "desk", "cabinet", "shelf", "wardrobe", "drawer", "door", "stool"],
        likely: &["paint", "veneer", "marble"],
        unlikely: &["brick", "roughcast", "carpet", "concrete"],
    },
    Row {
        words: &["rug", "carpet"],
        likely: &["carpet", "stripes", "trellis", "checks", "weave"],
        unlikely: &["brick", "metal", "plank", "granite", "concrete"],
    },
    Row {
        words: &["floor"],
        likely: &["plank", "strip_parquet", "herringbone", "basket_parquet", "tile", "carpet"],
        unlikely: &["houndstooth", "corduroy", "plaid", "leather", "metal", "roughcast"],
    },
    Row {
        words: &["ceiling"],
        likely: &["paint", "plaster"],
        unlikely: &["carpet", "leather", "houndstooth", "corduroy", "granite"],
    },
    Row {
        words: &["wall"],
        likely: &["paint", "plaster", "brick", "roughcast", "tile"],
        unlikely: &["carpet", "leather", "houndstooth", "corduroy", "metal"],
    },
    Row {
        words: &["sofa", "couch", "chair", "bed", "pillow", "cushion", "curtain"],
        likely: FABRICS,
        unlikely: STONES,
    },
    Row {
        words: &["lamp", "sink", "faucet", "refrigerator"],
        likely: &["paint", "metal"],
        unlikely: &["carpet", "brick"],
    },
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library::entry;

    fn candidate(name: &str) -> Candidate {
        let entry = entry(name).unwrap();
        let graph = Arc::new(entry.graph().unwrap());
        let settings = Settings::defaults(&graph);
        Candidate { graph, class: Some(entry.class), settings, error: 0.0, cells: 0.0, distance: 0.0 }
    }

    fn spread(candidate: &Candidate) -> f64 {
        let places: Vec<[f64; 3]> = (0..1000).map(|i| [0.0137 * f64::from(i), 0.0071 * f64::from(i), 0.0]).collect();
        let grey: Vec<f64> = candidate.evaluate(&places).iter().map(|out| out[..3].iter().sum::<f64>() / 3.0).collect();
        let mean = grey.iter().sum::<f64>() / 1000.0;
        (grey.iter().map(|grey| (grey - mean).powi(2)).sum::<f64>() / 1000.0).sqrt() / mean
    }

    #[test]
    fn detail_scales_randomness_and_keeps_the_mean() {
        for name in ["plaster", "granite", "carpet", "veneer", "leather", "roughcast", "marble", "terrazzo", "metal"] {
            let full = candidate(name);
            let [half, none] = [0.5, 0.0].map(|detail| full.with_detail(detail));
            let [a, b, c] = [&full, &half, &none].map(spread);
            assert!(a > 0.02 && b < a && b > 0.2 * a, "{name}: {a} {b}");
            let most = if name == "carpet" { 0.12 } else { 0.02 };
            assert!(c < most && c < 0.4 * a, "{name}: {a} {c}");
            for (before, after) in full.mean().iter().zip(none.mean()) {
                assert!((before / after - 1.0).abs() < 0.02, "{name}");
            }
        }
        // The twin: a periodic pattern is not random.
        let checks = candidate("checks");
        assert_eq!(spread(&checks), spread(&checks.with_detail(0.0)));
    }

    #[test]
    fn places_are_evaluated_one_by_one_or_together() {
        let plank = candidate("plank");
        let places: Vec<[f64; 3]> = (0..150).map(|i| [0.01 * f64::from(i), 0.3, 0.002]).collect();
        let together = plank.evaluate(&places);
        assert_eq!(together.len(), 150);
        assert_eq!(together[140], plank.evaluate(&places[140..141])[0]);
        assert_ne!(together[140], together[10]);
        assert!(plank.evaluate(&[]).is_empty());
    }

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

    #[test]
    fn known_words_prefer_graphs_and_unknown_ones_do_not() {
        assert_eq!(log_odds(Some("Floor"), "plank"), 1.0);
        assert_eq!(log_odds(Some("Corner Sofa"), "granite"), -1.0);
        assert_eq!(log_odds(Some("Bedside Table"), "veneer"), 1.0);
        assert_eq!(log_odds(Some("gizmo"), "plank"), 0.0);
        assert_eq!(log_odds(None, "plank"), 0.0);
    }

    #[test]
    fn every_graph_of_the_table_exists() {
        for name in TABLE.iter().flat_map(|row| row.likely.iter().chain(row.unlikely)) {
            assert!(entry(name).is_some(), "{name}");
        }
    }
}
