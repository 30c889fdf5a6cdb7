//! What a camera sees of a planted pattern: at an angle, with light that is left, and noise.

use mateval_procedural::evaluator::Points;
use mateval_procedural::fit::points::Point;
use mateval_procedural::noise::cell;
use mateval_procedural::program::op::LANES;
use mateval_procedural::{Evaluator, Graph, Program, Settings};

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
