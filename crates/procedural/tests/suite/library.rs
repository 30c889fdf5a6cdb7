//! The built-in graphs: what their files hold, derivatives in every parameter against central differences, edges and
//! lines that are as blurred as a pixel needs, and pictures.

use std::collections::BTreeSet;

use mateval_procedural::evaluator::{Pixel, Square, render};
use mateval_procedural::graph::{FOOTPRINT, Slot, slots};
use mateval_procedural::library::{LIBRARY, entry};
use mateval_procedural::program::OUTPUTS;
use mateval_procedural::program::op::{LANES, Lanes};
use mateval_procedural::{Evaluator, Graph, Program, Settings};

use super::graphs::{read, scattered, text};

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

fn mean(pixels: &[Pixel]) -> [f64; 3] {
    std::array::from_fn(|c| pixels.iter().map(|pixel| pixel.base_color[c]).sum::<f64>() / pixels.len() as f64)
}

fn variance(pixels: &[Pixel]) -> f64 {
    let [.., mean] = mean(pixels);
    pixels.iter().map(|pixel| (pixel.base_color[2] - mean).powi(2)).sum::<f64>() / pixels.len() as f64
}

/// Coarse pixels show the mean of fine ones: their mean colour is the same, though lines are thinner than a pixel.
#[test]
fn coarse_pixels_keep_the_mean_colour() {
    let mut seen = 0;
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        let program = Program::new(&graph);
        let settings = Settings::defaults(&graph);
        // Large enough that the mean over random cells is one.
        let [fine, coarse] = [1200, 300].map(|resolution| Square::new(3.0, resolution).unwrap());
        let [fine, coarse] = [fine, coarse].map(|square| render(&program, &settings, square).unwrap());
        for (fine, coarse) in mean(&fine).into_iter().zip(mean(&coarse)) {
            assert!((fine - coarse).abs() < 0.05 * fine + 0.002, "{}: {fine} {coarse}", entry.name);
        }
        assert!(variance(&coarse) <= variance(&fine) * 1.05 + 1e-6, "{}", entry.name);
        seen += 1;
    }
    assert_eq!(seen, 28);
}

/// The twin: without its footprint a coarse picture of thin lines has another mean at some phase.
#[test]
fn the_footprint_is_what_keeps_it() {
    let graph = mateval_procedural::library::entry("stripes").unwrap().graph().unwrap();
    let program = Program::new(&graph);
    let mut settings = Settings::defaults(&graph);
    settings.set(&graph, "period", "0.0401").unwrap();
    settings.set(&graph, "fine", "0").unwrap();
    let square = Square::new(3.0, 75).unwrap();
    let with = variance(&render(&program, &settings, square).unwrap());
    let sharp = mateval_procedural::mtlx::to_text(&graph).replace("interfacename=\"footprint\"", "value=\"0\"");
    let sharp = read(&sharp).unwrap();
    let without = variance(&render(&Program::new(&sharp), &settings, square).unwrap());
    assert!(with < 0.5 * without, "{with} {without}");
}

#[test]
fn pixels_are_the_same_on_any_number_of_threads() {
    let graph = entry("brick").unwrap().graph().unwrap();
    let program = Program::new(&graph);
    let settings = Settings::defaults(&graph);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| render(&program, &settings, Square::new(0.5, 100).unwrap()).unwrap())
    };
    let one = on(1);
    assert_eq!(one.len(), 100 * 100);
    assert_eq!(one, on(3));
    // The twin: another seed of the pattern, a shift, changes pixels.
    let mut shifted = settings.clone();
    shifted.set(&graph, "t_u", "0.5").unwrap();
    assert_ne!(one, render(&program, &shifted, Square::new(0.5, 100).unwrap()).unwrap());
}

/// The first row is at the top, where v is greatest.
#[test]
fn pixels_are_centres_of_a_square_above_and_right_of_the_origin() {
    let place = r#"<texcoord name="uv" type="vector2" />
        <convert name="c" type="color3"><input name="in" type="vector2" nodename="uv" /></convert>"#;
    let graph = read(&text("", place, "c")).unwrap();
    let pixels = render(&Program::new(&graph), &Settings::defaults(&graph), Square::new(2.0, 4).unwrap()).unwrap();
    assert_eq!(pixels[0].base_color, [0.25, 1.75, 0.0]);
    assert_eq!(pixels[15].base_color, [1.75, 0.25, 0.0]);
    assert_eq!(pixels[15].roughness, 0.5);
}

#[test]
fn values_that_are_not_finite_are_errors() {
    let great = r#"<constant name="g" type="float"><input name="value" type="float" value="1000" /></constant>
        <exp name="e" type="float"><input name="in" type="float" nodename="g" /></exp>
        <convert name="c" type="color3"><input name="in" type="float" nodename="e" /></convert>"#;
    let square = Square::new(1.0, 2).unwrap();
    let render = |nodes: &str| {
        let graph = read(&text("", nodes, "c")).unwrap();
        render(&Program::new(&graph), &Settings::defaults(&graph), square)
    };
    let error = render(great).unwrap_err();
    assert!(error.to_string().contains("its red is"), "{error}");
    assert!(render(&great.replace("1000", "1")).is_ok());
}

#[test]
fn sizes_are_checked() {
    for (size, resolution) in [(0.0, 4), (-1.0, 4), (f64::NAN, 4), (f64::INFINITY, 4), (1.0, 0), (1.0, 4097)] {
        assert!(
            Square::new(size, resolution).unwrap_err().to_string().contains("1 to 4096 pixels a side"),
            "{size} {resolution}"
        );
    }
    assert!(Square::new(0.01, 1).is_ok() && Square::new(0.01, 4096).is_ok());
}
