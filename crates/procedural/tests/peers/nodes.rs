//! Every variant of every node against the OSL of MaterialX in Cycles.

use std::collections::BTreeMap;

use mateval_procedural::{Evaluator, Graph, Program, Settings};

use super::cases;
use super::osl::{Input, PLACES, evaluate};

/// How much a number may differ, relative to it where it is above 1.
const TOLERANCE: f64 = 1e-4;

/// The base colours of a graph by this crate.
fn ours(graph: &Graph, inputs: &[Input]) -> Vec<[f64; 3]> {
    let program = Program::new(graph);
    let mut settings = Settings::defaults(graph);
    let mut evaluator = Evaluator::new(&program, &settings, &[]);
    let mut at = |place: usize| {
        for (slot, input) in inputs.iter().enumerate() {
            *settings.number_mut(slot) = input.at(place);
        }
        // Nothing depends on the point, so setting the parameters evaluates everything.
        evaluator.set(&settings);
        let [red, green, blue, ..] = evaluator.outputs(0);
        [red, green, blue]
    };
    (0..PLACES).map(&mut at).collect()
}

/// The greatest difference, relative where numbers are above 1; infinite where one is not a number.
fn difference(ours: &[f64; 3], osl: &[f32; 3]) -> f64 {
    let of = |(a, b): (&f64, &f32)| (a - f64::from(*b)).abs() / a.abs().max(1.0);
    let differences = ours.iter().zip(osl).map(of);
    // The maximum of two numbers ignores NaN.
    differences.map(|difference| if difference.is_nan() { f64::INFINITY } else { difference }).fold(0.0, f64::max)
}

#[test]
fn nodes_are_those_of_osl() {
    let cases = cases::all();
    let graphs: Vec<(Graph, Vec<Input>)> = cases.iter().map(|(_, g, inputs)| (g.clone(), inputs.clone())).collect();
    let osl = evaluate(&graphs);
    let mut worst: BTreeMap<&str, f64> = BTreeMap::new();
    let mut wrong = Vec::new();
    for ((kind, graph, inputs), osl) in cases.iter().zip(&osl) {
        let ours = ours(graph, inputs);
        let differences: Vec<f64> = ours.iter().zip(osl).map(|(ours, osl)| difference(ours, osl)).collect();
        let greatest = differences.iter().copied().fold(0.0, f64::max);
        let known = worst.entry(kind.word()).or_default();
        *known = known.max(greatest);
        let beyond = differences.iter().filter(|&&difference| difference > TOLERANCE).count();
        if beyond > 0 {
            let first = differences.iter().position(|&d| d > TOLERANCE).unwrap();
            let values: Vec<f64> = inputs.iter().map(|input| input.at(first)).collect();
            wrong.push(format!("{}: {beyond} places, as {values:?}: {:?} {:?}", graph.name, ours[first], osl[first]));
        }
        // The twin: colours of the next place. A converted whole number is the same everywhere.
        let shifted = ours.iter().skip(1).zip(osl).filter(|(ours, osl)| difference(ours, osl) > TOLERANCE).count();
        assert!(shifted > 0 || inputs.is_empty(), "{} does not depend on its inputs", graph.name);
    }
    for (word, difference) in &worst {
        eprintln!("{word}: {difference:.1e}");
    }
    eprintln!("{} variants of {} nodes at {PLACES} places", cases.len(), worst.len());
    assert_eq!(wrong, [""; 0]);
    assert!(cases.len() > 200 && worst.len() > 45);
}
