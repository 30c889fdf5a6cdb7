//! The built-in graphs.

use std::collections::BTreeSet;

use mateval_procedural::graph::{FOOTPRINT, slots};
use mateval_procedural::library::{LIBRARY, entry};
use mateval_procedural::program::op::LANES;
use mateval_procedural::{Evaluator, Program, Settings};

use super::graphs::scattered;

#[test]
fn every_file_of_the_folder_is_a_graph_of_the_library() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/library");
    let files = std::fs::read_dir(folder).unwrap().map(|file| file.unwrap().file_name().into_string().unwrap());
    let files: BTreeSet<String> = files.collect();
    let expected: BTreeSet<String> = LIBRARY.iter().map(|entry| format!("{}.mtlx", entry.name)).collect();
    assert_eq!(files, expected);
    assert_eq!(files.len(), 28);
    for entry in &LIBRARY {
        assert_eq!(entry.graph().unwrap().name, entry.name);
        assert!(entry.text.contains("SPDX-License-Identifier: CC0-1.0"), "{}", entry.name);
    }
    assert!(entry("herringbone").is_some() && entry("hering").is_none());
}

#[test]
fn every_graph_has_the_common_parameters_with_a_range_and_a_description() {
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        for name in ["theta", "t_u", "t_v", "surface_roughness", FOOTPRINT] {
            assert!(graph.parameter(name).is_some(), "{} {name}", entry.name);
        }
        for parameter in &graph.parameters {
            let described = parameter.least.is_some() && parameter.most.is_some() && parameter.doc.is_some();
            assert!(described, "{} {}", entry.name, parameter.name);
        }
    }
}

/// At defaults and at both ends of every parameter's range the material is one.
#[test]
fn values_are_those_of_a_material() {
    let mut settings_seen = 0;
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        let program = Program::new(&graph);
        let defaults = Settings::defaults(&graph);
        let mut all = vec![defaults.clone()];
        for (at, slot) in slots(&graph).iter().enumerate() {
            for end in [slot.least, slot.most] {
                let mut changed = defaults.clone();
                *changed.number_mut(at) = end.unwrap();
                all.push(changed);
            }
        }
        let mut evaluator = Evaluator::new(&program, &defaults, &[]);
        for settings in &all {
            evaluator.set(settings);
            evaluator.run(&scattered(3.0, 0.002));
            for lane in 0..LANES {
                let outputs = evaluator.outputs(lane);
                assert!(outputs.iter().all(|value| (0.0..=1.0).contains(value)), "{} {outputs:?}", entry.name);
            }
        }
        settings_seen += all.len();
    }
    assert!(settings_seen > 500, "{settings_seen}");
}

/// Every parameter changes the material somewhere, else it would not be one.
#[test]
fn every_parameter_matters() {
    for entry in LIBRARY.iter().filter(|entry| entry.name != "paint") {
        let graph = entry.graph().unwrap();
        let program = Program::new(&graph);
        let mut defaults = Settings::defaults(&graph);
        // Stripes do not change along themselves.
        defaults.set(&graph, "theta", "10").unwrap();
        for (at, slot) in slots(&graph).iter().enumerate() {
            let name = &graph.parameters[slot.parameter].name;
            if name == FOOTPRINT {
                continue;
            }
            let changes = |end: Option<f64>| {
                let mut changed = defaults.clone();
                *changed.number_mut(at) = end.unwrap();
                let [mut a, mut b] = [&defaults, &changed].map(|settings| Evaluator::new(&program, settings, &[]));
                [0.05, 0.5, 3.0].into_iter().any(|side| {
                    a.run(&scattered(side, 0.001));
                    b.run(&scattered(side, 0.001));
                    (0..LANES).any(|lane| a.outputs(lane) != b.outputs(lane))
                })
            };
            assert!(changes(slot.least) || changes(slot.most), "{} {name}", entry.name);
        }
    }
}
