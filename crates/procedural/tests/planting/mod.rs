//! Patterns with known graphs and settings, as a camera would see them, and how well a fit recovers them.
//!
//! Draws are random settings of the built-in graphs, within what is usual and visible. Amplitudes are a quarter to all of
//! their defaults. Plaster has nothing but its grain, of which the points show four or five per grain: with the noise of
//! [`seen`], a contrast below the default is one colour to any observer, so it is drawn from one to two defaults. Ribs of
//! corduroy wander by a tenth of their distance; enough of them are shown for their mean distance to be known to 1 %.
//!
//! Fits are compared by the lattice of a pattern: the translations that leave it the same. The same dots are described by
//! many settings: rows may be taken along any of the lattice's vectors, and shifts from row to row count up to a whole
//! one. So two fits are compared by their lattices, of which each has to hold the vectors of the other, and not by the
//! values of parameters. A pattern of one length scales and turns a square, or of hexagons a triangular, lattice with it;
//! rows and stripes repeat along one vector only.

#![allow(dead_code, reason = "tests and the bench use different parts")]

use mateval_procedural::evaluator::Points;
use mateval_procedural::fit::Point;
use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::fit::choose::{Fit, Fitter};
use mateval_procedural::fit::model::{Role, role};
use mateval_procedural::fit::paper::fit_as_paper;
use mateval_procedural::graph::{Slot, slots};
use mateval_procedural::library::{Entry, entry};
use mateval_procedural::noise::cell;
use mateval_procedural::program::op::LANES;
use mateval_procedural::{Evaluator, Graph, Program, Settings};

/// What is known of a graph's lengths.
pub struct Lengths {
    /// The graph.
    pub graph: &'static str,
    /// Its periods; none where it is random.
    pub periods: &'static [&'static str],
    /// The length that the size of the patch follows.
    pub main: &'static str,
    /// The side of the patch in main lengths.
    pub across: f64,
    /// The range of its whole number.
    pub whole: Option<(&'static str, u32, u32)>,
}

const fn lengths(graph: &'static str, periods: &'static [&'static str], main: &'static str, across: f64) -> Lengths {
    Lengths { graph, periods, main, across, whole: None }
}

const fn with_whole(lengths: Lengths, name: &'static str, least: u32, most: u32) -> Lengths {
    Lengths { whole: Some((name, least, most)), ..lengths }
}

/// All built-in graphs.
pub const LENGTHS: [Lengths; 28] = [
    lengths("paint", &[], "", 2.0),
    with_whole(lengths("plaster", &[], "grain_size", 30.0), "octaves", 2, 4),
    lengths("roughcast", &[], "stone_size", 30.0),
    lengths("concrete", &[], "panel_u", 2.5),
    lengths("terrazzo", &[], "chip_size", 25.0),
    lengths("granite", &[], "large_size", 30.0),
    lengths("marble", &[], "vein_scale", 5.0),
    lengths("travertine", &[], "band_period", 14.0),
    lengths("veneer", &[], "ring_period", 25.0),
    lengths("plank", &["width"], "width", 14.0),
    with_whole(lengths("strip_parquet", &["width"], "width", 20.0), "strips", 2, 4),
    with_whole(lengths("herringbone", &["width"], "width", 30.0), "ratio", 3, 7),
    with_whole(lengths("basket_parquet", &["square"], "square", 6.0), "strips", 3, 6),
    lengths("tile", &["size_u", "size_v"], "size_u", 11.0),
    lengths("brick", &["size_u", "size_v"], "size_u", 7.0),
    lengths("hexagon", &["side"], "side", 17.0),
    lengths("mosaic", &["size"], "size", 22.0),
    lengths("checks", &["size_u", "size_v"], "size_u", 20.0),
    lengths("stripes", &["period"], "period", 12.0),
    lengths("plaid", &["period_u", "period_v"], "period_u", 11.0),
    lengths("houndstooth", &["size"], "size", 18.0),
    lengths("dots", &["pitch_u", "pitch_v"], "pitch_u", 11.0),
    lengths("trellis", &["pitch_u", "pitch_v"], "pitch_u", 11.0),
    with_whole(lengths("weave", &["pitch"], "pitch", 15.0), "twill", 1, 3),
    lengths("corduroy", &["rib_period"], "rib_period", 24.0),
    lengths("carpet", &[], "pile_size", 30.0),
    lengths("leather", &[], "cell_size", 30.0),
    lengths("metal", &[], "streak_width", 100.0),
];

/// A category of things that are often made of a graph; none where no category is.
pub fn category(graph: &str) -> Option<&'static str> {
    match graph {
        "paint" | "plaster" | "roughcast" | "brick" | "mosaic" => Some("wall"),
        "plank" | "strip_parquet" | "herringbone" | "basket_parquet" | "tile" | "hexagon" | "terrazzo" => Some("floor"),
        "concrete" => Some("floor"),
        "veneer" | "marble" | "travertine" | "granite" => Some("table"),
        "carpet" | "trellis" | "checks" => Some("rug"),
        "weave" | "corduroy" | "leather" | "houndstooth" => Some("sofa"),
        "plaid" | "stripes" | "dots" => Some("curtain"),
        "metal" => Some("lamp"),
        _ => None,
    }
}

/// A pattern.
pub struct Draw {
    /// What is known of its lengths.
    pub lengths: &'static Lengths,
    /// The built-in graph.
    pub entry: &'static Entry,
    /// The graph.
    pub graph: Graph,
    /// The settings.
    pub settings: Settings,
    /// The side of the patch in metres.
    pub side: f64,
}

/// A random pattern of a graph; the same for the same number.
pub fn draw(lengths: &'static Lengths, number: usize) -> Draw {
    let entry = entry(lengths.graph).unwrap();
    let graph = entry.graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    let slots = slots(&graph);
    // One number scales all lengths: half to twice the defaults.
    let scale = 4.0_f64.powf(uniform(number, 0) - 0.5);
    let bright = 0.75 + 0.5 * uniform(number, 1);
    for (at, slot) in slots.iter().enumerate() {
        let found = drawn(&graph, slot, uniform(number, 10 + at as u32), scale, bright);
        *settings.number_mut(at) = found.max(slot.least.unwrap_or(found)).min(slot.most.unwrap_or(found));
    }
    if let Some((name, least, most)) = lengths.whole {
        let whole = least + (uniform(number, 2) * f64::from(most - least + 1)) as u32;
        settings.set(&graph, name, &whole.to_string()).unwrap();
    }
    let main = graph.parameter(lengths.main).map_or(1.0, |_| value(&graph, &settings, lengths.main));
    Draw { lengths, entry, graph, settings, side: lengths.across * main }
}

/// The value of a slot out of a random number of its own.
fn drawn(graph: &Graph, slot: &Slot, own: f64, scale: f64, bright: f64) -> f64 {
    let parameter = &graph.parameters[slot.parameter];
    let is_length = parameter.doc.as_ref().is_some_and(|doc| doc.contains("in metres"));
    // A fifth up or down.
    let jitter = 1.44_f64.powf(own - 0.5);
    match role(graph, slot.parameter) {
        Role::Turn => 180.0 * (own - 0.5),
        Role::Shift => own,
        Role::Color | Role::RandomColor => (slot.value * bright * jitter).min(0.9),
        Role::Amplitude if graph.name == "plaster" => slot.value * (1.0 + own),
        Role::Amplitude => slot.value * (0.25 + 0.75 * own),
        Role::Shape | Role::RandomSize if is_length => slot.value * scale * jitter,
        Role::Shape | Role::RandomSize => slot.value * jitter,
        Role::Kept => slot.value,
    }
}

fn uniform(number: usize, of: u32) -> f64 {
    random(1000 + number, 1000 + of)
}

/// The first slot of a parameter.
pub fn slot(graph: &Graph, name: &str) -> usize {
    let parameter = graph.parameter(name).unwrap();
    slots(graph).iter().position(|slot| slot.parameter == parameter).unwrap()
}

/// The number of a parameter.
pub fn value(graph: &Graph, settings: &Settings, name: &str) -> f64 {
    settings.numbers()[slot(graph, name)]
}

/// Noise of each colour, relative to it (standard deviation).
const NOISE: f64 = 0.06;

/// The number of footprints along the side of a patch.
pub const PIXELS: f64 = 300.0;

/// A random number from 0 to 1 of a point.
pub fn random(point: usize, number: u32) -> f64 {
    cell(point as f64 + 0.5, f64::from(number) + 0.5)
}

/// Colours of a patch that recedes: its far end is narrower in the picture, so it has fewer points, of greater
/// footprint. Light falls by a quarter to either side.
pub fn seen(graph: &Graph, settings: &Settings, side: f64, count: usize) -> Vec<Point> {
    let program = Program::new(graph);
    let mut evaluator = Evaluator::new(&program, settings, &[]);
    let mut points = Vec::new();
    for first in (0..count).step_by(LANES) {
        let depth = |lane: usize| random(first + lane, 1).powi(2);
        let u = std::array::from_fn(|lane| side * (0.5 + (random(first + lane, 0) - 0.5) * (0.7 + 0.3 * depth(lane))));
        let v = std::array::from_fn(|lane| side * depth(lane));
        let footprint = std::array::from_fn(|lane| side / PIXELS * (0.6 + depth(lane)));
        let places = Points { u, v, footprint };
        evaluator.run(&places);
        points.extend((0..LANES).map(|lane| point(&evaluator, &places, lane, first + lane, side)));
    }
    points
}

fn point(evaluator: &Evaluator, places: &Points, lane: usize, number: usize, side: f64) -> Point {
    let (u, v) = (places.u[lane], places.v[lane]);
    let light = 1.0 + 0.25 * (u + v - side) / side;
    // The sum of three uniform numbers has a standard deviation of a half.
    let noise = 1.0 + 2.0 * NOISE * (random(number, 2) + random(number, 3) + random(number, 4) - 1.5);
    let [red, green, blue, ..] = evaluator.outputs(lane);
    let albedo = [red, green, blue].map(|channel| channel * light * noise);
    Point { u, v, footprint: places.footprint[lane], albedo, weight: 1.0 }
}

/// The vectors of a lattice in metres, of the least lengths.
struct Lattice {
    vectors: Vec<[f64; 2]>,
}

impl Lattice {
    fn of(graph: &Graph, periods: &[&str], settings: &Settings) -> Self {
        let number = |name: &str| value(graph, settings, name);
        let first = number(periods[0]);
        let second = periods.get(1).map(|name| number(name));
        let vectors = match graph.name.as_str() {
            "stripes" | "corduroy" => vec![[first, 0.0]],
            "plank" | "strip_parquet" => vec![[0.0, first]],
            "hexagon" => vec![[first, 0.0], [0.5 * first, 0.75_f64.sqrt() * first]],
            "brick" => vec![[first, 0.0], [-number("row_shift") * first, second.unwrap()]],
            "dots" => vec![[first, 0.0], [-number("stagger") * first, second.unwrap()]],
            _ => vec![[first, 0.0], [0.0, second.unwrap_or(first)]],
        };
        let (sin, cos) = number("theta").to_radians().sin_cos();
        let turned = |[u, v]: [f64; 2]| [u * cos - v * sin, u * sin + v * cos];
        Self { vectors: reduced(vectors.into_iter().map(turned).collect()) }
    }

    /// The area of a cell in square metres, or the period along the one vector in metres.
    fn size(&self) -> f64 {
        match self.vectors.as_slice() {
            [a, b] => (a[0] * b[1] - a[1] * b[0]).abs(),
            all => length(all[0]),
        }
    }

    /// The vector of the lattice that is nearest to this one or its opposite, turned to its side.
    fn nearest(&self, to: [f64; 2]) -> [f64; 2] {
        let (a, b) = (self.vectors[0], self.vectors.get(1).copied().unwrap_or_default());
        let combined = |i: i32, j: i32| [0, 1].map(|axis| f64::from(i) * a[axis] + f64::from(j) * b[axis]);
        let all = (-3..=3).flat_map(|i| (-3..=3).map(move |j| combined(i, j)));
        let apart = |from: &[f64; 2]| length([from[0] - to[0], from[1] - to[1]]);
        all.min_by(|p, q| apart(p).total_cmp(&apart(q))).unwrap()
    }
}

/// Two vectors of the same lattice, of the least lengths (Lagrange and Gauss).
fn reduced(mut vectors: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    if let [a, b] = vectors.as_mut_slice() {
        for _ in 0..64 {
            if length(*a) > length(*b) {
                std::mem::swap(a, b);
            }
            let times = ((a[0] * b[0] + a[1] * b[1]) / (a[0] * a[0] + a[1] * a[1])).round();
            if times == 0.0 {
                break;
            }
            *b = [b[0] - times * a[0], b[1] - times * a[1]];
        }
    }
    vectors
}

fn length([u, v]: [f64; 2]) -> f64 {
    u.hypot(v)
}

/// How far two lattices of a graph are apart: the greatest relative error of a length, and the greatest angle in
/// degrees. Multiples of the planted lengths count as the errors that they are.
pub fn lattice_errors(graph: &Graph, periods: &[&str], found: &Settings, planted: &Settings) -> [f64; 2] {
    let [found, planted] = [found, planted].map(|settings| Lattice::of(graph, periods, settings));
    let mut errors = [(found.size() / planted.size()).ln().abs() / planted.vectors.len() as f64, 0.0];
    for vector in &planted.vectors {
        let nearest = found.nearest(*vector);
        let cross = vector[0] * nearest[1] - vector[1] * nearest[0];
        let dot = vector[0] * nearest[0] + vector[1] * nearest[1];
        errors[0] = errors[0].max((length(nearest) / length(*vector) - 1.0).abs());
        errors[1] = errors[1].max(cross.atan2(dot).to_degrees().abs());
    }
    errors
}

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
