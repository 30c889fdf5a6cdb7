//! The built-in files in MaterialX: valid, translated to OSL, GLSL and MDL, and with the colours of that OSL in Cycles;
//! and the variants of nodes, with the defaults of their inputs, against the definitions of the standard library.
//!
//! Cycles computes in single precision, so that cells may differ at their borders, and fine noise is off by the noise's
//! slope times the rounding of its place.

use std::ffi::OsStr;
use std::path::PathBuf;

use mateval_procedural::evaluator::Points;
use mateval_procedural::graph::FOOTPRINT;
use mateval_procedural::library::LIBRARY;
use mateval_procedural::mtlx::{to_text, to_text_of_all};
use mateval_procedural::node::{Kind, Signature, Unset, signatures};
use mateval_procedural::program::op::LANES;
use mateval_procedural::{Evaluator, Graph, Program, Settings};
use serde_json::{Value, json};

use super::osl::{Input, PLACES, evaluate, with_materialx};

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

fn check(files: &[PathBuf]) -> Vec<Value> {
    let files: Vec<&OsStr> = files.iter().map(|file| file.as_os_str()).collect();
    serde_json::from_slice(&with_materialx("check_files.py", &files)).unwrap()
}

/// Files as they are in the folder, and as this crate writes them.
#[test]
fn all_files_are_valid_and_have_shaders_in_three_languages() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for entry in &LIBRARY {
        for (kind, text) in [("built_in", entry.text.to_owned()), ("written", to_text(&entry.graph().unwrap()))] {
            files.push(folder.path().join(format!("{}_{kind}.mtlx", entry.name)));
            std::fs::write(files.last().unwrap(), text).unwrap();
        }
    }
    let reports = check(&files);
    assert_eq!(reports.len(), 56);
    for report in reports {
        assert_eq!(report["faults"], "", "{report}");
        for language in ["osl", "glsl", "mdl"] {
            // Three outputs and a material.
            let lengths = report["shaders"][language].as_array().unwrap();
            assert!(lengths.len() == 4 && lengths.iter().all(|length| length.as_u64() > Some(300)), "{report}");
        }
    }
}

/// One file that holds graphs of different settings under names of their own.
#[test]
fn a_file_of_all_graphs_is_valid() {
    let folder = tempfile::tempdir().unwrap();
    let named = LIBRARY.iter().enumerate().map(|(at, entry)| {
        let graph = entry.graph().unwrap();
        Settings::defaults(&graph).as_defaults(&graph, &format!("part_{at}"))
    });
    let file = folder.path().join("materials.mtlx");
    std::fs::write(&file, to_text_of_all(&named.collect::<Vec<_>>())).unwrap();
    let reports = check(&[file]);
    assert_eq!(reports[0]["faults"], "", "{reports:?}");
    // Three outputs and a material each.
    assert_eq!(reports[0]["shaders"]["osl"].as_array().unwrap().len(), 4 * LIBRARY.len());
}

/// The twin: a file whose nodes do not fit together.
#[test]
fn a_faulty_file_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("faulty.mtlx");
    let text = LIBRARY[0].text.replacen(r#"type="color3" interfacename"#, r#"type="float" interfacename"#, 1);
    assert_ne!(text, LIBRARY[0].text);
    std::fs::write(&file, text).unwrap();
    assert_ne!(check(&[file])[0]["faults"], "");
}

fn described(kind: Kind, signature: &Signature) -> Value {
    let default = |unset: &Unset| match unset {
        Unset::Value(value) => json!(value.numbers()),
        Unset::Place => json!("place"),
    };
    let inputs = signature.inputs.iter().map(|input| json!([input.name, input.kind.word(), default(&input.unset)]));
    let outputs = signature.outputs.iter().map(|(name, kind)| json!([name, kind.word()]));
    json!({ "node": kind.word(), "inputs": inputs.collect::<Vec<_>>(), "outputs": outputs.collect::<Vec<_>>() })
}

/// The variants that MaterialX does not have.
fn unknown(variants: &[Value]) -> Vec<Value> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("variants.json");
    std::fs::write(&file, json!(variants).to_string()).unwrap();
    serde_json::from_slice(&with_materialx("check_definitions.py", &[file.as_os_str()])).unwrap()
}

#[test]
fn variants_and_defaults_are_those_of_the_standard_library() {
    let of = |&kind: &Kind| signatures(kind).into_iter().map(move |signature| described(kind, &signature));
    let all: Vec<Value> = Kind::ALL.iter().flat_map(of).collect();
    assert_eq!(unknown(&all), [Value::Null; 0]);
    assert!(all.len() > 200, "{}", all.len());
    // The twin: another default.
    let mut changed = all[0].clone();
    changed["inputs"][0][2] = json!([0.5]);
    assert_eq!(unknown(std::slice::from_ref(&changed)), [changed]);
}
