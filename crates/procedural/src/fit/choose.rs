//! The choice of a graph: all graphs are fitted, and the best one counts if it is better than a single colour.
//!
//! Three things decide. Pixels: how much better than a single colour the predictable part of a graph, such as joints
//! and stripes, shows points that were held out. Cells: how much more alike the points of a tile or a board are than
//! those of the same cells elsewhere. Statistics: how likely those of what is seen are among those of the graph, its
//! randomness included. Graphs without a period predict no pixels, so only their statistics speak for them. Numbers,
//! unusual sizes and unlikely categories have a small price.
//!
//! Held-out points take no part in the fit of what is periodic. They do take part in statistics, which are fitted by
//! few numbers, and in the cubic polynomial whose shading is taken away before: it is fitted to all points, so that
//! both groups are divided by the same light.

use std::sync::Arc;

use super::candidate::{Candidate, log_odds, unusual};
use super::cells::{better, cell_error, excess, settled, without_tones};
use super::least_squares::{flattened, mean_square, polish, project};
use super::model::{Model, Role, layout};
use super::starts::{Pattern, Start, starts};
use super::texture::{Colors, Sight, Texture};
use super::waves::{Order, Wave, waves};
use super::{Point, sound, split, thinned};
use crate::error::ProceduralError;
use crate::graph::{Graph, Settings};
use crate::library::{Class, LIBRARY, entry};

/// The graph of one colour.
const PAINT: &str = "paint";

/// Fewer points than this are one colour.
pub const LEAST_POINTS: usize = 400;

/// By how much the score of a graph must be below that of a single colour.
const LEAST_GAIN: f64 = 0.05;

/// Points whose mean square difference from one colour is below this are one colour: storing colours as bytes changes
/// as much.
const LEAST_VARIANCE: f64 = 2e-6;

/// The most error of what is predictable in a graph, in those of a single colour.
const MOST_ERROR: f64 = 1.01;

/// The weight of the logarithm of the error and of how much alike the points of a cell are.
const PIXELS: f64 = 2.0;

/// The greatest sum of both, negated and weighted, that searches over many places find in noise; it does not count.
const BY_CHANCE: f64 = 0.15;

/// The weight of the distance of statistics.
const STATISTICS: f64 = 0.25;

/// The distance of statistics from which on more of it hardly counts.
const FAR: f64 = 2.0;

/// The distance of a single colour's statistics below which nothing but noise is left to explain.
const OF_NOISE: f64 = -0.55;

/// The score below which no texture's can be: its statistics are hardly ever closer than -0.8.
const PREDICTED: f64 = -0.4;

/// The price of each number that a graph has.
const PRICE: f64 = 0.01;

/// The worth of each unit of log-odds in a graph's favour.
const PRIOR: f64 = 0.05;

/// The price of sizes that are a standard deviation from the usual ones. Nothing is known of those of a user's graph.
const SIZES: f64 = 0.04;

/// By how much a start has to be better than a single colour, or its cells than the same ones elsewhere.
const LEAST_PROMISE: f64 = 0.025;

/// How often tones are taken away and sizes are reconsidered.
const ROUNDS: usize = 4;

/// How many starts of a pattern are polished.
const STARTS: usize = 4;

/// For how many of them the place of cells is searched.
const SETTLED: usize = 2;

/// How many patterns are polished.
const POLISHED: usize = 7;

/// How many periodic graphs are compared in their statistics.
const PERIODIC: usize = 5;

/// How many graphs without a period are refined.
const RANDOM: usize = 5;

/// How many of those are refined from two starts.
const TWICE: usize = 2;

/// How many waves of each order are sought in the points, from which all patterns start.
const WAVES: usize = 8;

/// Points in which waves are sought, once a part.
const WAVE_POINTS: usize = 4096;

/// Points to which a candidate is fitted last, and by which its cells are judged.
const FINAL_POINTS: usize = 2048;

/// Points by which starts are judged and to which they are polished: every pattern has several, which are fitted to
/// few points each to save time.
const START_POINTS: usize = 700;

/// Points by which the place and the size of cells are searched, which evaluates the most settings.
const CELL_POINTS: usize = 500;

/// The most steps of a start's fit, which only orders the starts.
const START_STEPS: usize = 8;

/// The most steps of a candidate's fit.
const FINAL_STEPS: usize = 20;

/// Fewer held-out points than this cannot judge a fit, so that only the single colour is fitted.
const LEAST_HELD_OUT: usize = LEAST_POINTS / 8;

/// Smaller mean squares count as this one, so that logarithms and ratios are finite.
const LEAST_SQUARE: f64 = 1e-12;

/// Added to the ratio of a graph's error to that of a single colour, so that an exact fit is not infinitely better than a good one.
const EXACT: f64 = 1e-3;

/// Rows that are shifted by less than this share of a brick count as not shifted.
const LEAST_SHIFT: f64 = 0.03;

/// The fit of a part. A graph matches what is random only statistically, so a texture of variance s^2 adds s^2 to the
/// mean squared difference; [`Candidate::with_detail`] removes as much as is wanted.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The graph that was chosen; `paint` where none is better than a colour.
    pub chosen: Candidate,
    /// The other graphs, best first. Textures are left out where a periodic graph is surely better.
    pub others: Vec<Candidate>,
}

/// The graphs that are fitted.
pub struct Fitter {
    paint: Model,
    patterns: Vec<Pattern>,
    textures: Vec<Model>,
}

impl Fitter {
    /// Prepares the built-in graphs.
    pub fn new() -> Result<Self, ProceduralError> {
        let (mut patterns, mut textures) = (Vec::new(), Vec::new());
        for entry in LIBRARY.iter().filter(|entry| entry.name != PAINT) {
            let model = || Ok::<_, ProceduralError>(Model::new(entry.graph()?, Some(entry.class)));
            let layout = layout(entry.name);
            // Concrete is in panels, or without joints.
            if entry.class == Class::Isotropic || layout.is_none() {
                textures.push(model()?);
            }
            if let Some(layout) = layout {
                patterns.push(Pattern::new(model()?, layout));
            }
        }
        let paint = entry(PAINT).expect("paint is a built-in graph").graph()?;
        Ok(Self { paint: Model::new(paint, Some(Class::Flat)), patterns, textures })
    }

    /// Adds a user's graphs, which are fitted by the names of their parameters ([`super::model::Role`]) and by
    /// statistics only: nothing is known of their periods.
    pub fn with_graphs(mut self, graphs: Vec<Graph>) -> Self {
        self.textures.extend(graphs.into_iter().map(|graph| Model::new(graph, None)));
        self
    }

    /// All graphs, each once.
    pub(super) fn models(&self) -> impl Iterator<Item = &Model> {
        let periodic = self.patterns.iter().map(|pattern| &pattern.model);
        let is_new = |model: &&Model| self.patterns.iter().all(|pattern| pattern.model.graph.name != model.graph.name);
        std::iter::once(&self.paint).chain(periodic).chain(self.textures.iter().filter(is_new))
    }

    /// Fits the graphs to points, of which unsound ones are left out. The category, such as `floor` or `sofa`, makes
    /// some graphs more likely; unknown ones change nothing. Fails where no point is sound.
    pub fn fit(&self, points: &[Point], category: Option<&str>) -> Result<Fit, ProceduralError> {
        let sound = sound(points)?;
        let sound = flattened(&sound);
        let (seen, held_out) = split(&sound);
        // Where too few points are held out, the single colour is fitted to all of them.
        let is_enough = seen.len() >= LEAST_POINTS && held_out.len() >= LEAST_HELD_OUT;
        let judged = if is_enough { held_out } else { sound.clone() };
        let mut paint = self.painted(if is_enough { &seen } else { &sound }, &judged);
        if !is_enough || paint.error < LEAST_VARIANCE {
            return Ok(Fit { chosen: paint, others: Vec::new() });
        }
        let sight = Sight::new(&sound);
        paint.distance = sight.judged(&self.paint, &paint.settings);
        // A user's graph may have values that are not numbers, which are no less than anything.
        let is_usable = |other: &Candidate| other.error <= MOST_ERROR * paint.error && other.distance.is_finite();
        let mut others = self.fitted(&seen, &judged, &sight);
        others.retain(is_usable);
        let least = others.iter().map(|other| score(other, paint.error, category)).fold(f64::INFINITY, f64::min);
        // A texture has only its statistics, which cannot make up for what is predicted well.
        if paint.distance > OF_NOISE && least > PREDICTED {
            others.extend(self.textured(&sight, paint.error).into_iter().filter(is_usable));
        }
        let score = |candidate: &Candidate| score(candidate, paint.error, category);
        others.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let is_better = others.first().is_some_and(|best| score(best) < score(&paint) - LEAST_GAIN);
        let chosen = if is_better { others.remove(0) } else { paint.clone() };
        if is_better {
            let place = others.partition_point(|other| score(other) <= score(&paint));
            others.insert(place, paint.clone());
        }
        Ok(Fit { chosen, others })
    }

    /// One colour.
    fn painted(&self, seen: &[Point], judged: &[Point]) -> Candidate {
        let mut settings = self.paint.start();
        project(&self.paint, &mut settings, seen);
        Candidate::judged(&self.paint, settings, judged)
    }

    /// The best fit of each promising pattern; the best ones also with what is random in them.
    fn fitted(&self, seen: &[Point], judged: &[Point], sight: &Sight) -> Vec<Candidate> {
        let mut all: Vec<(&Model, Candidate)> = Vec::new();
        for (pattern, starts) in self.promising_patterns(seen) {
            all.extend(candidate(pattern, seen, judged, starts).map(|candidate| (&pattern.model, candidate)));
        }
        let promise = |candidate: &Candidate| libm::log(candidate.error.max(LEAST_SQUARE)) + candidate.cells;
        all.sort_by(|a, b| promise(&a.1).total_cmp(&promise(&b.1)));
        all.truncate(PERIODIC);
        all.into_iter().map(|(model, candidate)| with_random(sight, model, candidate)).collect()
    }

    /// The patterns whose best start is most promising, with their starts.
    fn promising_patterns(&self, seen: &[Point]) -> Vec<(&Pattern, Vec<Start>)> {
        let few = thinned(seen, WAVE_POINTS);
        let strong = waves(&few, WAVES, Order::Power);
        // The joints of cells stand out against waves of similar period, not by their power.
        let sharp = waves(&few, WAVES, Order::Contrast);
        let both = [strong.as_slice(), &sharp];
        let of = |pattern: &Pattern| if pattern.model.tone.is_some() { &both } else { &both[..1] };
        let fewer = thinned(seen, START_POINTS);
        let with_starts =
            |pattern| promising_starts(pattern, seen, &fewer, of(pattern)).map(|(best, all)| (best, pattern, all));
        let mut all: Vec<(f64, &Pattern, Vec<Start>)> = self.patterns.iter().filter_map(with_starts).collect();
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        all.truncate(POLISHED);
        all.into_iter().map(|(_, pattern, starts)| (pattern, starts)).collect()
    }

    /// The fits of the graphs without a period that come closest in their statistics. As their phase is random, no more
    /// than their mean colour can be predicted.
    fn textured(&self, sight: &Sight, error: f64) -> Vec<Candidate> {
        let mut starts: Vec<(&Model, Vec<Texture>)> =
            self.textures.iter().map(|model| (model, sight.starts(model))).filter(|(_, all)| !all.is_empty()).collect();
        starts.sort_by(|a, b| a.1[0].distance.total_cmp(&b.1[0].distance));
        starts.truncate(RANDOM);
        let fitted = starts.into_iter().enumerate().map(|(place, (model, starts))| {
            // Nothing is known of the layout of a user's graph.
            let roles = [Role::RandomSize, Role::Amplitude, Role::Turn, Role::Shape];
            let roles = match model.class {
                Some(Class::Isotropic) => &roles[..2],
                Some(_) => &roles[..3],
                None => &roles,
            };
            // The most promising ones are searched from two places.
            let tried = starts.into_iter().take(if place < TWICE { 2 } else { 1 });
            let searched = tried.map(|start| sight.searched(model, start, roles, Colors::Ranked));
            let best = searched.min_by(|a, b| a.distance.total_cmp(&b.distance));
            let settings = best.expect("graphs without a start were left out").settings;
            let distance = sight.judged(model, &settings);
            Candidate { graph: Arc::clone(&model.graph), class: model.class, settings, error, cells: 0.0, distance }
        });
        fitted.collect()
    }
}

/// What graphs are ordered by, the least first: by how much what can be predicted reduces the error of a single colour,
/// how far statistics are, how many numbers a graph has, how unusual its sizes are, and whether things of the category
/// are often made of it.
fn score(candidate: &Candidate, of_paint: f64, category: Option<&str>) -> f64 {
    let pixels = PIXELS * (libm::log(candidate.error / of_paint.max(LEAST_SQUARE) + EXACT) + candidate.cells);
    let pixels = if pixels > 0.0 { pixels } else { (pixels + BY_CHANCE).min(0.0) };
    let sizes = candidate.class.map_or(0.0, |_| unusual(&candidate.graph, &candidate.settings));
    let price = PRICE * candidate.settings.numbers().len() as f64 + SIZES * sizes;
    let prior = PRIOR * log_odds(category, &candidate.graph.name);
    pixels + STATISTICS * compressed(candidate.distance) + price - prior
}

/// The distance of statistics, which grows like its logarithm from [`FAR`] on: pixels that agree count for more than
/// how far off a few statistics are.
fn compressed(distance: f64) -> f64 {
    if distance > FAR { FAR * (1.0 + libm::log(distance / FAR)) } else { distance }
}

/// The candidate with what is random in its graph, and its statistics.
fn with_random(sight: &Sight, model: &Model, mut candidate: Candidate) -> Candidate {
    let is_scattered = !model.of_role(Role::RandomColor).is_empty();
    let colors = if is_scattered { Colors::Ranked } else { Colors::Kept };
    let mut settings = candidate.settings.clone();
    if is_scattered {
        model.reset(&mut settings, Role::RandomColor);
    }
    let start = sight.with_amplitudes(model, settings, colors);
    candidate.settings = sight.searched(model, start, &[Role::Amplitude, Role::RandomSize], colors).settings;
    candidate.distance = sight.judged(model, &candidate.settings);
    candidate
}

/// The starts of a pattern, the best first, after the logarithm of the best one's error in that of a single colour.
/// `None` where none is promising.
fn promising_starts(pattern: &Pattern, seen: &[Point], few: &[Point], found: &[&[Wave]]) -> Option<(f64, Vec<Start>)> {
    let model = &pattern.model;
    let most = STARTS / found.len();
    let mut all: Vec<Start> = found.iter().flat_map(|waves| starts(pattern, seen, waves, most)).collect();
    all.sort_by(|a, b| a.error.total_cmp(&b.error));
    let best = all.first()?;
    let promise = if model.tone.is_some() { excess(model, &best.settings, few) } else { gain(model, best, few) };
    (promise < -LEAST_PROMISE).then_some((promise, all))
}

/// The best of a few starts, polished. The tones of cells are taken away first, and again from where that leads.
fn candidate(pattern: &Pattern, seen: &[Point], judged: &[Point], starts: Vec<Start>) -> Option<Candidate> {
    let model = &pattern.model;
    let (few, many, fewer) = (thinned(seen, START_POINTS), thinned(seen, FINAL_POINTS), thinned(seen, CELL_POINTS));
    // The place of cells is searched, and what that leads to is polished.
    let polished = starts.into_iter().enumerate().map(|(place, mut start)| {
        if place < SETTLED {
            start.settings = settled(model, pattern.layout, start.settings, &fewer);
        }
        let toneless = without_tones(model, &start.settings, &few);
        polish(model, &mut start.settings, &toneless, START_STEPS);
        let error = mean_square(model, &start.settings, &without_tones(model, &start.settings, &few));
        (cell_error(model, &start.settings, &many).unwrap_or(error), start.settings)
    });
    let (_, mut settings) = polished.min_by(|a, b| a.0.total_cmp(&b.0))?;
    for round in 0..if model.tone.is_some() { ROUNDS } else { 1 } {
        let toneless = without_tones(model, &settings, &many);
        polish(model, &mut settings, &toneless, FINAL_STEPS);
        let resized = if round + 1 < ROUNDS { better(model, pattern.layout, &settings, &fewer) } else { None };
        match resized {
            Some(resized) => settings = resized,
            None if round > 0 => break,
            None => {}
        }
    }
    if is_a_tile(model, &settings) {
        return None;
    }
    let mut candidate = Candidate::judged(model, settings, judged);
    candidate.cells = excess(model, &candidate.settings, &many);
    Some(candidate)
}

/// The logarithm of a start's error in that of a single colour.
fn gain(model: &Model, start: &Start, few: &[Point]) -> f64 {
    let count = few.len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|c| few.iter().map(|point| point.albedo[c]).sum::<f64>() / count);
    let square = |point: &Point| (0..3).map(|c| (point.albedo[c] - mean[c]).powi(2)).sum::<f64>() / 3.0;
    let of_one = few.iter().map(square).sum::<f64>() / count;
    libm::log(mean_square(model, &start.settings, few).max(LEAST_SQUARE) / of_one.max(LEAST_SQUARE))
}

/// Bricks that are not shifted from row to row are tiles.
fn is_a_tile(model: &Model, settings: &Settings) -> bool {
    let shift = model.slot("row_shift").filter(|_| model.slot("edge_wear").is_some()).map(|at| settings.numbers()[at]);
    shift.is_some_and(|shift| (shift - shift.round()).abs() < LEAST_SHIFT)
}
