//! Derivatives in every parameter of every built-in graph against central differences.

use mateval_procedural::graph::{FOOTPRINT, Slot, slots};
use mateval_procedural::library::LIBRARY;
use mateval_procedural::program::OUTPUTS;
use mateval_procedural::program::op::{LANES, Lanes};
use mateval_procedural::{Evaluator, Graph, Program, Settings};

use super::graphs::scattered;

/// How much a derivative may differ from the difference quotient, relative to it.
const TOLERANCE: f64 = 1e-3;

/// Settings a little off the defaults, so that nothing sits on a special value such as an angle of 0.
fn generic(graph: &Graph) -> Settings {
    let mut settings = Settings::defaults(graph);
    for (at, slot) in slots(graph).iter().enumerate().filter(|(_, slot)| slot.is_real) {
        let share = 0.03 + 0.02 * (at as f64 * 0.618).fract();
        let range = slot.most.unwrap() - slot.least.unwrap();
        let up = slot.value + share * range;
        *settings.number_mut(at) = if up < slot.most.unwrap() { up } else { slot.value - share * range };
    }
    // Shifts range over metres; a shift of millimetres is generic enough.
    for name in ["t_u", "t_v"] {
        settings.set(graph, name, "0.0137").unwrap();
    }
    settings
}

/// All outputs at all places.
fn outputs(evaluator: &mut Evaluator, settings: &Settings, side: f64) -> [Lanes; OUTPUTS] {
    evaluator.set(settings);
    evaluator.run(&scattered(side, 0.002));
    std::array::from_fn(|output| *evaluator.value(output))
}

/// The difference quotients of a slot with a step of `h`.
fn quotients(evaluator: &mut Evaluator, settings: &Settings, at: usize, h: f64, side: f64) -> [Lanes; OUTPUTS] {
    let mut moved = |by: f64| {
        let mut changed = settings.clone();
        *changed.number_mut(at) += by;
        outputs(evaluator, &changed, side)
    };
    let (above, below) = (moved(h), moved(-h));
    std::array::from_fn(|output| std::array::from_fn(|lane| (above[output][lane] - below[output][lane]) / (2.0 * h)))
}

/// What comparing a slot at all places gave.
#[derive(Debug, Default)]
struct Comparison {
    compared: usize,
    /// Outputs that have an edge between the places of the quotient, where no quotient is a derivative.
    beside_edges: usize,
    wrong: usize,
}

/// Compares where two steps give the same quotient: elsewhere an edge lies between the places of the quotient.
fn compare(program: &Program, settings: &Settings, at: usize, slot: &Slot, factor: f64) -> Comparison {
    let side = 0.7;
    let mut with = Evaluator::new(program, settings, &[at]);
    with.run(&scattered(side, 0.002));
    let mut plain = Evaluator::new(program, settings, &[]);
    let h = 2e-7 * (slot.most.unwrap() - slot.least.unwrap());
    let [coarse, fine] = [h, h / 2.0].map(|h| quotients(&mut plain, settings, at, h, side));
    let mut found = Comparison::default();
    for output in 0..OUTPUTS {
        let derivative = with.derivative(output, 0).copied().unwrap_or([0.0; LANES]);
        for lane in 0..LANES {
            let (coarse, fine) = (coarse[output][lane], fine[output][lane]);
            // The rounding of the quotient.
            let floor = 1e-14 / h;
            if (coarse - fine).abs() > 2e-4 * fine.abs() + floor {
                found.beside_edges += 1;
                continue;
            }
            found.compared += 1;
            let error = (factor * derivative[lane] - fine).abs();
            found.wrong += usize::from(error > TOLERANCE * fine.abs() + 4.0 * floor);
        }
    }
    found
}

#[test]
fn derivatives_are_those_of_central_differences() {
    let (mut seen, mut caught) = (0, 0);
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        let program = Program::new(&graph);
        let settings = generic(&graph);
        for (at, slot) in slots(&graph).iter().enumerate().filter(|(_, slot)| slot.is_real) {
            let name = &graph.parameters[slot.parameter].name;
            if name == FOOTPRINT {
                continue;
            }
            let found = compare(&program, &settings, at, slot, 1.0);
            assert_eq!(found.wrong, 0, "{} {name}: {found:?}", entry.name);
            assert!(found.compared > 8 * found.beside_edges, "{} {name}: {found:?}", entry.name);
            // The twin: derivatives that are wrong by 1 %.
            caught += usize::from(compare(&program, &settings, at, slot, 1.01).wrong > 0);
            seen += 1;
        }
    }
    assert!(seen > 250, "{seen}");
    // Derivatives that are zero everywhere cannot be wrong by 1 %.
    assert!(caught * 10 > seen * 8, "{caught} of {seen}");
}

/// Derivatives in several parameters at once are those in each alone.
#[test]
fn the_choice_of_parameters_does_not_change_derivatives() {
    let graph = mateval_procedural::library::entry("herringbone").unwrap().graph().unwrap();
    let program = Program::new(&graph);
    let settings = generic(&graph);
    let chosen: Vec<usize> = (0..slots(&graph).len()).rev().collect();
    let mut all = Evaluator::new(&program, &settings, &chosen);
    all.run(&scattered(0.7, 0.002));
    for (place, &at) in chosen.iter().enumerate() {
        let mut one = Evaluator::new(&program, &settings, &[at]);
        one.run(&scattered(0.7, 0.002));
        for output in 0..OUTPUTS {
            assert_eq!(one.derivative(output, 0), all.derivative(output, place), "slot {at}, output {output}");
        }
    }
}
