//! The choice of a graph: the twelve periodic graphs that `periods` lists are fitted, and the best one counts if it
//! predicts held-out points better than a single colour does.
//!
//! Held-out points take no part in the fit of a graph. They do take part in that of the cubic polynomial whose shading
//! is taken away before: it is fitted to all points, so that both groups are divided by the same light.

use super::candidate::Candidate;
use super::category::log_odds;
use super::colors::{mean_square, project};
use super::hypotheses::starts;
use super::lm::polish;
use super::model::Model;
use super::pattern::Pattern;
use super::periods::layout;
use super::points::{Point, split, thinned};
use super::smooth::flattened;
use super::waves::{Wave, waves};
use crate::error::ProceduralError;
use crate::graph::Graph;
use crate::library::{Class, LIBRARY, entry};

/// The graph of one colour.
const PAINT: &str = "paint";

/// Fewer points than this are one colour.
pub const LEAST_POINTS: usize = 400;

/// The error of a graph must be below this share of a single colour's.
pub const MOST_ERROR: f64 = 0.98;

/// By how much a graph's error must be lower for each number that it has more than another.
const PRICE: f64 = 0.002;

/// By how much a graph's error may be higher for each unit of log-odds in its favour.
const PRIOR: f64 = 0.02;

/// The fit of a part.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The graph that was chosen; `paint` where none is better than a colour.
    pub chosen: Candidate,
    /// The other graphs, best first.
    pub others: Vec<Candidate>,
}

/// The graphs that are fitted.
pub struct Fitter {
    paint: Model,
    patterns: Vec<Pattern>,
    textures: Vec<Model>,
}

impl Fitter {
    /// Prepares the twelve periodic graphs and `paint`.
    pub fn new() -> Result<Self, ProceduralError> {
        let mut patterns = Vec::new();
        for entry in &LIBRARY {
            if let Some(layout) = layout(entry.name) {
                patterns.push(Pattern::new(Model::new(entry.graph()?, Some(entry.class)), layout));
            }
        }
        let paint = entry(PAINT).expect("paint is a built-in graph").graph()?;
        Ok(Self { paint: Model::new(paint, Some(Class::Flat)), patterns, textures: Vec::new() })
    }

    /// Adds a user's graphs, which are fitted by the names of their parameters.
    pub fn with_graphs(mut self, graphs: Vec<Graph>) -> Self {
        self.textures.extend(graphs.into_iter().map(|graph| Model::new(graph, None)));
        self
    }

    /// Fits the graphs to points, of which unsound ones are left out. The category, such as `floor` or `sofa`, makes
    /// some graphs more likely; unknown ones change nothing. Fails where no point is sound.
    pub fn fit(&self, points: &[Point], category: Option<&str>) -> Result<Fit, ProceduralError> {
        let sound: Vec<Point> = points.iter().filter(|point| point.is_sound()).copied().collect();
        if sound.is_empty() {
            return Err(ProceduralError::NoPoints);
        }
        let sound = flattened(&sound);
        let (seen, held_out) = split(&sound);
        // Too few points to hold some out: only the single colour is fitted, to all of them.
        let is_enough = seen.len() >= LEAST_POINTS && held_out.len() >= LEAST_POINTS / 8;
        let judged = if is_enough { held_out } else { sound.clone() };
        let paint = self.painted(if is_enough { &seen } else { &sound }, &judged);
        let mut others = if is_enough { self.fitted(&seen, &judged) } else { Vec::new() };
        others.sort_by(|a, b| rank(a, category).total_cmp(&rank(b, category)));
        let is_better = others.first().is_some_and(|best| best.error < MOST_ERROR * paint.error);
        let chosen = if is_better { std::mem::replace(&mut others[0], paint) } else { paint };
        others.sort_by(|a, b| rank(a, category).total_cmp(&rank(b, category)));
        Ok(Fit { chosen, others })
    }

    /// One colour.
    fn painted(&self, seen: &[Point], judged: &[Point]) -> Candidate {
        let mut settings = self.paint.start();
        project(&self.paint, &mut settings, seen);
        self.paint.candidate(settings, judged)
    }

    /// The best fit of each pattern that has the waves of the points.
    fn fitted(&self, seen: &[Point], judged: &[Point]) -> Vec<Candidate> {
        let found = waves(&thinned(seen, 4096), 8);
        self.patterns.iter().filter_map(|pattern| candidate(pattern, seen, judged, &found)).collect()
    }
}

/// What graphs are ordered by: of two that are as good, the one with fewer parameters or of the likelier kind is first.
fn rank(candidate: &Candidate, category: Option<&str>) -> f64 {
    let odds = log_odds(category, &candidate.graph.name);
    candidate.error * (1.0 + PRICE * candidate.settings.numbers().len() as f64 - PRIOR * odds)
}

/// The best of a few starts, polished.
fn candidate(pattern: &Pattern, seen: &[Point], judged: &[Point], found: &[Wave]) -> Option<Candidate> {
    let model = &pattern.model;
    let (few, many) = (thinned(seen, 800), thinned(seen, 2048));
    let polished = starts(pattern, seen, found, 5).into_iter().map(|mut start| {
        polish(model, &mut start.settings, &few, 10);
        (mean_square(model, &start.settings, &few), start.settings)
    });
    let (_, mut settings) = polished.min_by(|a, b| a.0.total_cmp(&b.0))?;
    polish(model, &mut settings, &many, 25);
    Some(model.candidate(settings, judged))
}
