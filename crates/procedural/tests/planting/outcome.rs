//! How well a fit recovers a planted pattern.

use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::fit::choose::{Fit, Fitter};
use mateval_procedural::fit::paper::fit_as_paper;

use super::draw::{Draw, category};
use super::lattice::lattice_errors;
use super::view::{PIXELS, random, seen};

/// What the fit of a planted pattern gave.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The graph that was chosen.
    pub chosen: String,
    /// Whether its class is the planted one.
    pub is_right_class: bool,
    /// Whether it is the planted graph.
    pub is_right_graph: bool,
    /// Whether the planted graph has periods.
    pub is_periodic: bool,
    /// The greatest relative error of the lattice's lengths in the planted graph's own fit; infinite where it has none.
    pub period_error: f64,
    /// The greatest error of the lattice's directions in degrees; infinite where it has none.
    pub turn_error: f64,
    /// The peak signal-to-noise ratio of the chosen colours without what is random, in decibels.
    pub psnr: f64,
    /// The same with what is random.
    pub psnr_with_detail: f64,
    /// The difference of the chosen mean colour from the planted one (root mean square), after one gain.
    pub color_error: f64,
}

impl Outcome {
    /// Whether there are periods, and the lattice's lengths are within 1 % and its directions within 1 degree.
    pub fn is_in_place(&self) -> bool {
        self.is_periodic && self.period_error < 0.01 && self.turn_error < 1.0
    }
}

/// Fits a planted pattern as PSDR-Room does.
pub fn outcome_as_paper(fitter: &Fitter, draw: &Draw) -> Outcome {
    judged(&fit_as_paper(fitter, &seen(&draw.graph, &draw.settings, draw.side, 4096)).unwrap(), draw)
}

/// Fits a planted pattern of which nothing else is known.
pub fn outcome(fitter: &Fitter, draw: &Draw) -> Outcome {
    judged(&fitter.fit(&seen(&draw.graph, &draw.settings, draw.side, 4096), None).unwrap(), draw)
}

/// Fits a planted pattern on a thing of a category that is often made of it.
pub fn outcome_of_category(fitter: &Fitter, draw: &Draw) -> Outcome {
    let points = seen(&draw.graph, &draw.settings, draw.side, 4096);
    judged(&fitter.fit(&points, category(draw.entry.name)).unwrap(), draw)
}

/// Compares a fit with what was planted.
pub fn judged(fit: &Fit, draw: &Draw) -> Outcome {
    let own = find(fit, draw.entry.name);
    let periods = draw.lengths.periods;
    let errors = |own: &Candidate| lattice_errors(&draw.graph, periods, &own.settings, &draw.settings);
    let [period_error, turn_error] = own.filter(|_| !periods.is_empty()).map_or([f64::INFINITY; 2], errors);
    Outcome {
        chosen: fit.chosen.graph.name.clone(),
        is_right_class: fit.chosen.class == Some(draw.entry.class),
        is_right_graph: fit.chosen.graph.name == draw.entry.name,
        is_periodic: !periods.is_empty(),
        period_error,
        turn_error,
        psnr: psnr(draw, &fit.chosen.with_detail(0.0)),
        psnr_with_detail: psnr(draw, &fit.chosen),
        color_error: color_error(draw, &fit.chosen),
    }
}

/// The fit of a graph, if there is one.
pub fn find<'a>(fit: &'a Fit, graph: &str) -> Option<&'a Candidate> {
    std::iter::once(&fit.chosen).chain(&fit.others).find(|candidate| candidate.graph.name == graph)
}

/// Colours at the same places of two candidates.
fn colors(draw: &Draw, fitted: &Candidate) -> [Vec<[f64; 5]>; 2] {
    let at = |i: usize, number: u32| draw.side * (0.1 + 0.8 * random(i, number));
    let places: Vec<[f64; 3]> = (0..2048).map(|i| [at(i, 7), at(i, 8), draw.side / PIXELS]).collect();
    [fitted.evaluate(&places), planted(draw).evaluate(&places)]
}

/// The planted pattern as a candidate.
fn planted(draw: &Draw) -> Candidate {
    let (graph, settings) = (draw.graph.clone().into(), draw.settings.clone());
    Candidate { graph, class: Some(draw.entry.class), settings, error: 0.0, cells: 0.0, distance: 0.0 }
}

/// The gain of what is fitted that comes closest to what was planted: the light that is left has an unknown mean.
fn gain(found: &[[f64; 5]], planted: &[[f64; 5]]) -> f64 {
    let dot = |a: &[[f64; 5]], b: &[[f64; 5]]| -> f64 {
        a.iter().zip(b).map(|(a, b)| a[0] * b[0] + a[1] * b[1] + a[2] * b[2]).sum()
    };
    dot(found, planted) / dot(found, found)
}

/// The peak signal-to-noise ratio against the planted colours without light and noise, in decibels.
pub fn psnr(draw: &Draw, fitted: &Candidate) -> f64 {
    let [found, planted] = colors(draw, fitted);
    let gain = gain(&found, &planted);
    let square = |(a, b): (&[f64; 5], &[f64; 5])| (0..3).map(|c| (gain * a[c] - b[c]).powi(2)).sum::<f64>() / 3.0;
    -10.0 * (found.iter().zip(&planted).map(square).sum::<f64>() / found.len() as f64).log10()
}

fn color_error(draw: &Draw, fitted: &Candidate) -> f64 {
    let [found, planted] = colors(draw, fitted);
    let gain = gain(&found, &planted);
    let mean = |all: &[[f64; 5]], c: usize| all.iter().map(|out| out[c]).sum::<f64>() / all.len() as f64;
    ((0..3).map(|c| (gain * mean(&found, c) - mean(&planted, c)).powi(2)).sum::<f64>() / 3.0).sqrt()
}
