#![no_main]
//! Reads a graph, writes it and reads it again, and evaluates it with a derivative in its first parameter.

use libfuzzer_sys::fuzz_target;
use mateval_procedural::program::op::LANES;
use mateval_procedural::evaluator::Points;
use mateval_procedural::mtlx::{read_text, to_text};
use mateval_procedural::{Evaluator, Program, Settings};

fuzz_target!(|text: &str| {
    let Ok(graph) = read_text("fuzzed", text) else { return };
    let again = read_text("written", &to_text(&graph)).expect("what is written can be read");
    assert!(again == graph, "what is written is the same graph");
    let program = Program::new(&graph);
    let mut evaluator = Evaluator::new(&program, &Settings::defaults(&graph), &[0]);
    evaluator.run(&Points { u: [0.3; LANES], v: [-1e9; LANES], footprint: [0.001; LANES] });
});
