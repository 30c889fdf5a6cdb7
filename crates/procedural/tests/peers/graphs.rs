//! The built-in graphs against the OSL of MaterialX in Cycles.
//!
//! Cycles computes in single precision, so that cells may differ at their borders, and fine noise is off by the noise's
//! slope times the rounding of its place.

use mateval_procedural::evaluator::Points;
use mateval_procedural::graph::FOOTPRINT;
use mateval_procedural::library::LIBRARY;
use mateval_procedural::program::op::LANES;
use mateval_procedural::{Evaluator, Graph, Program, Settings};

use super::osl::{Input, PLACES, evaluate};

const TOLERANCE: f64 = 2e-3;

/// Scattered places on a square of two metres, with footprints below 4 mm.
fn inputs() -> Vec<Input> {
    let input =
        |name: &str, step, scale| Input { name: name.to_owned(), step, start: 5, modulus: PLACES, scale, offset: 0.0 };
    vec![
        input("place_u", 1103, 1.0 / 2048.0),
        input("place_v", 2741, 1.0 / 2048.0),
        input(FOOTPRINT, 677, 1.0 / f64::from(1 << 20)),
    ]
}

fn ours(graph: &Graph, inputs: &[Input]) -> Vec<[f64; 3]> {
    let program = Program::new(graph);
    let mut evaluator = Evaluator::new(&program, &Settings::defaults(graph), &[]);
    let mut colors = Vec::new();
    for first in (0..PLACES).step_by(LANES) {
        let [u, v, footprint] = [0, 1, 2].map(|at| std::array::from_fn(|lane| inputs[at].at(first + lane)));
        evaluator.run(&Points { u, v, footprint });
        colors.extend((0..LANES).map(|lane| evaluator.outputs(lane)).map(|[red, green, blue, ..]| [red, green, blue]));
    }
    colors
}

#[test]
fn graphs_are_those_of_osl() {
    let graphs: Vec<Graph> = LIBRARY.iter().map(|entry| entry.graph().unwrap()).collect();
    let cases: Vec<_> = graphs.iter().map(|graph| (graph.clone(), inputs())).collect();
    let osl = evaluate(&cases);
    let mut textured = 0;
    for (graph, osl) in graphs.iter().zip(&osl) {
        let ours = ours(graph, &inputs());
        let far = |shift: usize| {
            let pairs = ours.iter().skip(shift).zip(osl);
            // NaN is far from everything.
            let is_close = |(a, b): (&f64, &f32)| (a - f64::from(*b)).abs() <= TOLERANCE;
            pairs.filter(|(a, b)| !a.iter().zip(*b).all(is_close)).count()
        };
        eprintln!("{}: {} of {PLACES} places beyond {TOLERANCE}", graph.name, far(0));
        assert!(far(0) < PLACES / 200, "{}", graph.name);
        // The twin: colours of the next place.
        textured += usize::from(far(1) > PLACES / 4);
    }
    assert_eq!(textured, 27, "all but paint");
}
