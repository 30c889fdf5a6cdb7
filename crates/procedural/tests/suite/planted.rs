//! Fits of graphs to points that graphs have made: at an angle, with light that is left, and noise.

use mateval_procedural::fit::candidate::Candidate;
use mateval_procedural::fit::choose::{Fit, Fitter};
use mateval_procedural::fit::points::Point;
use mateval_procedural::lanes::{LANES, Points};
use mateval_procedural::library::{Class, entry};
use mateval_procedural::noise::cell::cell;
use rayon::prelude::*;

use mateval_procedural::{Evaluator, Graph, ProceduralError, Program, Settings};

/// Noise of each colour, relative to it (standard deviation).
const NOISE: f64 = 0.06;

/// A planted pattern: the graph, the parameters that are its periods, what is set, and the side of the patch in metres.
type Planted = (&'static str, &'static [&'static str], &'static [(&'static str, &'static str)], f64);

/// One pattern of each graph that is fitted, whose sizes are not the defaults.
const PLANTED: [Planted; 12] = [
    ("stripes", &["period"], &[("period", "0.137"), ("theta", "23"), ("duty", "0.4")], 1.6),
    ("checks", &["size_u", "size_v"], &[("size_u", "0.083"), ("size_v", "0.11"), ("theta", "-31")], 1.8),
    ("plaid", &["period_u", "period_v"], &[("period_u", "0.15"), ("period_v", "0.11"), ("theta", "12")], 1.5),
    ("houndstooth", &["size"], &[("size", "0.026"), ("theta", "-17")], 0.5),
    ("dots", &["pitch_u", "pitch_v"], &[("pitch_u", "0.071"), ("pitch_v", "0.049"), ("theta", "8")], 0.7),
    ("trellis", &["pitch_u", "pitch_v"], &[("pitch_u", "0.14"), ("pitch_v", "0.21"), ("theta", "-9")], 1.6),
    ("weave", &["pitch"], &[("pitch", "0.0052"), ("theta", "34")], 0.08),
    (
        "tile",
        &["size_u", "size_v"],
        &[("size_u", "0.24"), ("size_v", "0.17"), ("joint", "0.008"), ("theta", "28")],
        2.4,
    ),
    ("brick", &["size_u", "size_v"], &[("size_u", "0.25"), ("row_shift", "0.33"), ("theta", "4")], 1.7),
    ("hexagon", &["side"], &[("side", "0.087"), ("joint", "0.008"), ("theta", "19")], 1.5),
    ("corduroy", &["rib_period"], &[("rib_period", "0.0061"), ("theta", "-40")], 0.06),
    ("herringbone", &["width"], &[("width", "0.08"), ("ratio", "4"), ("gap", "0.009"), ("theta", "38")], 2.6),
];

/// A quarter of the default spread of cells and contrast of grain: more hides lines of a few per cent.
fn settings_of(graph: &Graph, set: &[(&str, &str)]) -> Settings {
    let mut settings = Settings::defaults(graph);
    for name in ["tone", "grain", "pile", "clouds"] {
        if let Some(at) = graph.parameter(name) {
            let quarter = 0.25 * graph.parameters[at].value.numbers()[0];
            settings.set(graph, name, &quarter.to_string()).unwrap();
        }
    }
    set.iter().for_each(|(name, text)| settings.set(graph, name, text).unwrap());
    settings
}

/// A random number of a point.
fn random(point: usize, number: u32) -> f64 {
    cell(point as f64 + 0.5, f64::from(number) + 0.5)
}

/// Colours of a patch that recedes: its far end is narrower in the picture, so it has fewer points, of greater
/// footprint. Light falls by a quarter to either side.
fn seen(graph: &Graph, settings: &Settings, side: f64, count: usize) -> Vec<Point> {
    let program = Program::new(graph);
    let mut evaluator = Evaluator::new(&program, settings, &[]);
    let mut points = Vec::new();
    for first in (0..count).step_by(LANES) {
        let depth = |lane: usize| random(first + lane, 1).powi(2);
        let u = std::array::from_fn(|lane| side * (0.5 + (random(first + lane, 0) - 0.5) * (0.7 + 0.3 * depth(lane))));
        let v = std::array::from_fn(|lane| side * depth(lane));
        let footprint = std::array::from_fn(|lane| side / 300.0 * (0.6 + depth(lane)));
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

/// The first slot of a parameter.
fn slot(graph: &Graph, name: &str) -> usize {
    let parameter = graph.parameter(name).unwrap();
    graph.parameters[..parameter].iter().map(|p| p.value.numbers().len()).sum()
}

fn number(graph: &Graph, settings: &Settings, name: &str) -> f64 {
    settings.numbers()[slot(graph, name)]
}

/// The greatest relative error of the periods. A pattern that is turned by a quarter has them in the other order.
fn period_error(graph: &Graph, periods: &[&str], found: &Settings, planted: &Settings) -> f64 {
    let sorted = |settings: &Settings| {
        let mut all: Vec<f64> = periods.iter().map(|name| number(graph, settings, name)).collect();
        all.sort_by(f64::total_cmp);
        all
    };
    let errors = sorted(found).into_iter().zip(sorted(planted)).map(|(found, planted)| (found / planted - 1.0).abs());
    errors.fold(0.0, f64::max)
}

/// The error of the turn in degrees, up to the turns by which patterns repeat, which are multiples of 30 degrees.
fn turn_error(graph: &Graph, found: &Settings, planted: &Settings) -> f64 {
    let apart = number(graph, found, "theta") - number(graph, planted, "theta");
    (apart - 30.0 * (apart / 30.0).round()).abs()
}

fn find<'a>(fit: &'a Fit, graph: &str) -> Option<&'a Candidate> {
    std::iter::once(&fit.chosen).chain(&fit.others).find(|candidate| candidate.graph.name == graph)
}

/// What a fit of a planted pattern gave.
struct Outcome {
    is_right_class: bool,
    is_right_graph: bool,
    is_in_place: bool,
    psnr: f64,
}

/// The peak signal-to-noise ratio of the fitted colours against the planted ones, without light and noise, in decibels.
/// The light that is left has an unknown mean, so one gain for all points is taken out.
fn psnr(planted: &Graph, settings: &Settings, chosen: &Candidate, side: f64) -> f64 {
    let colors = |graph: &Graph, settings: &Settings| -> Vec<f64> {
        let program = Program::new(graph);
        let mut evaluator = Evaluator::new(&program, settings, &[]);
        let mut all = Vec::new();
        for first in (0..2048).step_by(LANES) {
            let at = |number: u32| std::array::from_fn(|lane| side * (0.1 + 0.8 * random(first + lane, number)));
            evaluator.run(&Points { u: at(7), v: at(8), footprint: [side / 300.0; LANES] });
            all.extend((0..LANES).flat_map(|lane| evaluator.outputs(lane)[..3].to_vec()));
        }
        all
    };
    let (found, planted) = (colors(&chosen.graph, &chosen.settings), colors(planted, settings));
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let gain = dot(&found, &planted) / dot(&found, &found);
    let mean_square = found.iter().zip(&planted).map(|(a, b)| (gain * a - b).powi(2)).sum::<f64>() / found.len() as f64;
    -10.0 * mean_square.log10()
}

fn outcome(fitter: &Fitter, (name, periods, set, side): Planted) -> Outcome {
    let planted = entry(name).unwrap();
    let graph = planted.graph().unwrap();
    let settings = settings_of(&graph, set);
    let fit = fitter.fit(&seen(&graph, &settings, side, 4096), None).unwrap();
    let own = find(&fit, name).unwrap();
    let period = period_error(&graph, periods, &own.settings, &settings);
    let turn = turn_error(&graph, &own.settings, &settings);
    let found = psnr(&graph, &settings, &fit.chosen, side);
    // The twin: the same fit, shifted by a third of the shortest period.
    let mut shifted = fit.chosen.clone();
    let shortest = periods.iter().map(|name| number(&graph, &settings, name)).fold(f64::MAX, f64::min);
    let chosen = &fit.chosen.graph;
    *shifted.settings.number_mut(slot(chosen, "t_u")) += shortest / 3.0;
    assert!(psnr(&graph, &settings, &shifted, side) < found - 6.0, "{name}");
    let (psnr, graph) = (found, fit.chosen.graph.name.as_str());
    eprintln!("{name}: {graph}, {psnr:.1} dB, period off by {:.2} %, turn by {turn:.2} degrees", 100.0 * period);
    Outcome {
        is_right_class: fit.chosen.class == Some(planted.class),
        is_right_graph: graph == name,
        is_in_place: period < 0.01 && turn < 1.0,
        psnr,
    }
}

#[test]
fn planted_patterns_are_found() {
    let fitter = Fitter::new().unwrap();
    let all: Vec<Outcome> = PLANTED.par_iter().map(|planted| outcome(&fitter, *planted)).collect();
    let count = |holds: fn(&Outcome) -> bool| all.iter().filter(|outcome| holds(outcome)).count();
    assert_eq!(count(|outcome| outcome.is_right_class), 12);
    assert_eq!(count(|outcome| outcome.is_right_graph), 12);
    assert_eq!(count(|outcome| outcome.psnr > 30.0), 12);
    // Rows of dots may be described in more than one way.
    assert!(count(|outcome| outcome.is_in_place) >= 11);
}

/// The twin: what has no period is one colour, however noisy.
#[test]
fn noise_is_paint() {
    let fitter = Fitter::new().unwrap();
    let graph = entry("paint").unwrap().graph().unwrap();
    let settings = settings_of(&graph, &[("color", "0.3, 0.4, 0.2")]);
    let points = seen(&graph, &settings, 2.0, 4096);
    let fit = fitter.fit(&points, None).unwrap();
    assert_eq!((fit.chosen.graph.name.as_str(), fit.chosen.class), ("paint", Some(Class::Flat)));
    let color = &fit.chosen.settings.numbers()[graph.parameters.iter().position(|p| p.name == "color").unwrap()..][..3];
    for (found, planted) in color.iter().zip([0.3, 0.4, 0.2]) {
        assert!((found / planted - 1.0).abs() < 0.1, "{color:?}");
    }
}

#[test]
fn few_points_are_paint_and_none_are_an_error() {
    let fitter = Fitter::new().unwrap();
    let graph = entry("stripes").unwrap().graph().unwrap();
    let settings = settings_of(&graph, &[]);
    let points = seen(&graph, &settings, 1.0, 320);
    assert_eq!(fitter.fit(&points, None).unwrap().chosen.graph.name, "paint");
    let unsound: Vec<Point> = points.iter().map(|point| Point { weight: f64::NAN, ..*point }).collect();
    assert!(matches!(fitter.fit(&unsound, None), Err(ProceduralError::NoPoints)));
}

/// The same points give the same bits; unsound ones among them change nothing.
#[test]
fn fits_are_repeatable() {
    let fitter = Fitter::new().unwrap();
    let graph = entry("checks").unwrap().graph().unwrap();
    let settings = settings_of(&graph, &[("theta", "15")]);
    let mut points = seen(&graph, &settings, 1.5, 1024);
    let first = fitter.fit(&points, None).unwrap();
    points.insert(100, Point { u: f64::INFINITY, ..points[0] });
    let second = Fitter::new().unwrap().fit(&points, None).unwrap();
    assert_eq!((&first.chosen.graph, &first.chosen.settings), (&second.chosen.graph, &second.chosen.settings));
    assert_eq!(first.chosen.error.to_bits(), second.chosen.error.to_bits());
    assert!(first.others.windows(2).all(|pair| pair[0].error <= 1.05 * pair[1].error), "others are sorted");
    // The twin: a point more is another fit.
    points.push(Point { albedo: [0.9; 3], ..points[0] });
    assert_ne!(fitter.fit(&points, None).unwrap().chosen.error, first.chosen.error);
}
