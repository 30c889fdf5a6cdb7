//! Small graphs: values of nodes from the definitions and from an independent source, files that are read and written,
//! and parameters that are set from text.

use mateval_procedural::evaluator::Points;
use mateval_procedural::graph::slots;
use mateval_procedural::library::{LIBRARY, entry};
use mateval_procedural::mtlx::{read_text, to_text};
use mateval_procedural::program::op::LANES;
use mateval_procedural::{Evaluator, Graph, ProceduralError, Program, Settings};

/// The text of a file whose graph has these inputs and nodes; `color` names the node that is the base colour.
pub fn text(inputs: &str, nodes: &str, color: &str) -> String {
    format!(
        r#"<?xml version="1.0"?>
<materialx version="1.39" colorspace="lin_rec709">
  <nodegraph name="NG_test">
{inputs}
{nodes}
    <constant name="half" type="float"><input name="value" type="float" value="0.5" /></constant>
    <output name="base_color" type="color3" nodename="{color}" />
    <output name="roughness" type="float" nodename="half" />
    <output name="metallic" type="float" nodename="half" />
  </nodegraph>
</materialx>
"#
    )
}

/// Reads a file.
pub fn read(text: &str) -> Result<Graph, ProceduralError> {
    read_text("test.mtlx", text)
}

/// The findings of a file, each on one line; none where it is accepted.
pub fn findings(text: &str) -> Vec<String> {
    match read(text) {
        Ok(_) => Vec::new(),
        Err(ProceduralError::Invalid { findings, .. }) => findings.iter().map(ToString::to_string).collect(),
        Err(other) => panic!("{other}"),
    }
}

/// The base colour of a graph with these nodes at a place; `color` names the node.
pub fn color_at(nodes: &str, color: &str, u: f64, v: f64) -> [f64; 3] {
    let graph = read(&text("", nodes, color)).unwrap();
    let program = Program::new(&graph);
    let mut evaluator = Evaluator::new(&program, &Settings::defaults(&graph), &[]);
    evaluator.run(&Points { u: [u; LANES], v: [v; LANES], footprint: [0.0; LANES] });
    let [red, green, blue, ..] = evaluator.outputs(0);
    [red, green, blue]
}

/// Places scattered over a square of this side, the same at every run.
pub fn scattered(side: f64, footprint: f64) -> Points {
    // The additive recurrence of the plastic number (Roberts 2018).
    let at = |step: f64| std::array::from_fn(|lane| side * (0.5 + step * (lane as f64 + 1.0)).fract());
    Points { u: at(0.754_877_666_246_692_8), v: at(0.569_840_290_998_053_3), footprint: [footprint; LANES] }
}

/// The value of one node without connections.
fn bare(word: &str, kind: &str) -> [f64; 3] {
    let nodes = format!(
        r#"<{word} name="n" type="{kind}" />
        <convert name="c" type="color3"><input name="in" type="{kind}" nodename="n" /></convert>"#
    );
    let (nodes, color) = if kind == "color3" { (nodes.lines().next().unwrap().to_owned(), "n") } else { (nodes, "c") };
    color_at(&nodes, color, 1.25, -0.5)
}

/// What is not set is the default of the node's definition (`stdlib_defs.mtlx` of MaterialX 1.39).
#[test]
fn inputs_that_are_not_set_have_the_defaults_of_the_definition() {
    assert_eq!(bare("multiply", "color3"), [0.0; 3]);
    assert_eq!(bare("ln", "float"), [0.0; 3]);
    // 1 > 0, so the first input.
    assert_eq!(bare("ifgreater", "color3"), [0.0; 3]);
    assert_eq!(bare("invert", "vector3"), [1.0; 3]);
    assert_eq!(bare("contrast", "float"), [0.0; 3]);
    assert_eq!(bare("exp", "vector3"), [1.0; 3]);
    // The place.
    assert_eq!(bare("texcoord", "vector2"), [1.25, -0.5, 0.0]);
    assert_eq!(bare("position", "vector3"), [1.25, -0.5, 0.0]);
    let noise = |texcoord: &str| {
        let nodes = format!(r#"<noise2d name="n" type="color3">{texcoord}</noise2d>"#);
        color_at(&nodes, "n", 1.25, -0.5)
    };
    assert_eq!(noise(""), noise(r#"<input name="texcoord" type="vector2" value="1.25, -0.5" />"#));
    assert_ne!(noise(""), noise(r#"<input name="texcoord" type="vector2" value="1.25, 0.5" />"#));
}

/// Open Shading Language as of Blender 4.5, in single precision: `noise("snoise", x, y)` and `cellnoise(x, y)`.
#[test]
fn noises_are_those_of_open_shading_language() {
    let osl = [
        ((-7.382_812_5, 6.015_625), -0.135_572_84, 0.187_664_06),
        ((-13.531_25, 6.257_812_5), -0.683_802_6, 0.860_763_73),
    ];
    for ((u, v), snoise, cellnoise) in osl {
        for (word, expected) in [("noise2d", snoise), ("cellnoise2d", cellnoise)] {
            let nodes = format!(
                r#"<{word} name="n" type="float" />
                <convert name="c" type="color3"><input name="in" type="float" nodename="n" /></convert>"#
            );
            let [found, ..] = color_at(&nodes, "c", u, v);
            assert!((found - expected).abs() < 1e-6, "{word}: {found} {expected}");
            // The twin: in the next cell.
            let [elsewhere, ..] = color_at(&nodes, "c", u + 1.5, v + 0.5);
            assert!((elsewhere - expected).abs() > 1e-3, "{word}: {elsewhere}");
        }
    }
}

/// A positive angle turns the place clockwise (MaterialX' definition), by degrees.
#[test]
fn rotation_is_in_degrees() {
    let nodes = r#"
        <texcoord name="uv" type="vector2" />
        <rotate2d name="r" type="vector2">
          <input name="in" type="vector2" nodename="uv" /><input name="amount" type="float" value="90" />
        </rotate2d>
        <convert name="c" type="color3"><input name="in" type="vector2" nodename="r" /></convert>"#;
    let [x, y, _] = color_at(nodes, "c", 1.0, 0.0);
    assert!(x.abs() < 1e-15 && (y + 1.0).abs() < 1e-15, "{x} {y}");
}

/// `switch` takes the first input whose number is above `which`, and zero from 10 on.
#[test]
fn switch_selects() {
    let selected = |which: f64| {
        let nodes = format!(
            r#"<switch name="s" type="float"><input name="in1" type="float" value="0.1" />
              <input name="in3" type="float" value="0.3" /><input name="in10" type="float" value="1" />
              <input name="which" type="float" value="{which}" /></switch>
            <convert name="c" type="color3"><input name="in" type="float" nodename="s" /></convert>"#
        );
        color_at(&nodes, "c", 0.0, 0.0)[0]
    };
    assert_eq!([-3.0, 0.0, 0.9, 1.0, 2.5, 9.5, 10.0].map(selected), [0.1, 0.1, 0.1, 0.0, 0.3, 1.0, 0.0]);
}

const GREY: &str = r#"    <constant name="grey" type="color3" />"#;

#[test]
fn what_is_written_reads_back_as_the_same_graph() {
    for entry in &LIBRARY {
        let graph = entry.graph().unwrap();
        let written = to_text(&graph);
        let again = read(&written).unwrap();
        assert_eq!(again, graph, "{}", entry.name);
        assert_eq!(to_text(&again), written);
        // The twin: another value is another graph.
        let changed = written.replacen("value=\"0", "value=\"0.001", 1);
        assert_ne!(read(&changed).ok(), Some(graph), "{}", entry.name);
    }
}

#[test]
fn text_in_attributes_is_escaped() {
    let mut graph = read(&text("", GREY, "grey")).unwrap();
    graph.doc = Some("a < b & \"c\"\n\t".to_owned());
    assert_eq!(read(&to_text(&graph)).unwrap(), graph);
}

/// A graph that implements a nodedef has the nodedef's inputs as parameters.
#[test]
fn parameters_may_stand_in_a_nodedef() {
    let plain = text(
        r#"<input name="tint" type="color3" value="0.1, 0.2, 0.3" uimin="0, 0, 0" uimax="1, 1, 1" />"#,
        r#"<dot name="tinted" type="color3"><input name="in" type="color3" interfacename="tint" /></dot>"#,
        "tinted",
    );
    let input = plain.lines().find(|line| line.contains("<input name=\"tint\"")).unwrap();
    let nodedef = format!(r#"<nodedef name="ND_test" node="test">{input}</nodedef><nodegraph nodedef="ND_test""#);
    let moved = plain.replace(input, "").replace("<nodegraph", &nodedef);
    assert_eq!(read(&moved).unwrap(), read(&plain).unwrap());
    let unknown = moved.replace(r#"nodedef="ND_test""#, r#"nodedef="ND_other""#);
    assert!(findings(&unknown).iter().any(|found| found.contains("there is no <nodedef> 'ND_other'")));
}

/// Order does not matter, as in MaterialX.
#[test]
fn nodes_may_stand_before_those_that_they_need() {
    let late = r#"
        <multiply name="twice" type="color3">
          <input name="in1" type="color3" nodename="once" /><input name="in2" type="float" value="2" />
        </multiply>
        <constant name="once" type="color3"><input name="value" type="color3" value="0.1, 0.2, 0.3" /></constant>"#;
    let graph = read(&text("", late, "twice")).unwrap();
    let names: Vec<&str> = graph.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["once", "twice", "half"]);
}

#[test]
fn a_file_that_does_not_exist_is_an_io_error() {
    let error = mateval_procedural::mtlx::read_file("no/such.mtlx".as_ref()).unwrap_err();
    assert!(matches!(error, ProceduralError::Io { .. }), "{error}");
}

#[test]
fn parameters_are_set_by_name() {
    let graph = entry("brick").unwrap().graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    settings.set(&graph, "joint_color", "0.1, 0.2,0.3").unwrap();
    settings.set(&graph, "row_shift", "0.25").unwrap();
    let set = slots(&graph).into_iter().zip(settings.numbers()).filter(|(slot, number)| slot.value != **number);
    let set: Vec<_> = set.map(|(slot, number)| (graph.parameters[slot.parameter].name.clone(), *number)).collect();
    let expected = [("row_shift", 0.25), ("joint_color", 0.1), ("joint_color", 0.2), ("joint_color", 0.3)];
    assert_eq!(set, expected.map(|(name, number)| (name.to_owned(), number)));
}

#[test]
fn wrong_names_and_values_are_refused() {
    let graph = entry("herringbone").unwrap().graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    let before = settings.clone();
    let mut refusal = |name: &str, text: &str| settings.set(&graph, name, text).unwrap_err().to_string();
    assert!(refusal("widht", "1").contains("has no parameter 'widht'; expected one of: theta, t_u, t_v, width"));
    assert_eq!(refusal("width", "9"), "parameter 'width' of 'herringbone': expected 0.02 to 0.3, found 9");
    assert_eq!(refusal("ratio", "4.5"), "parameter 'ratio' of 'herringbone': expected a whole number, found '4.5'");
    assert!(refusal("color", "0.5").contains("expected 3 numbers separated by commas, found 1"));
    assert!(refusal("width", "nan").contains("expected a finite number"));
    assert!(refusal("footprint", "0.1").contains("it is the extent of a pixel at every point"));
    assert_eq!(settings, before);
}

/// A range may have one end only.
#[test]
fn ranges_are_named_by_the_ends_that_they_have() {
    let grey = r#"<constant name="grey" type="color3" />"#;
    let refusal = |range: &str, value: &str| {
        let graph =
            read(&text(&format!(r#"<input name="a" type="float" value="0.5" {range} />"#), grey, "grey")).unwrap();
        Settings::defaults(&graph).set(&graph, "a", value).err().map(|error| error.to_string())
    };
    for (range, value, expected) in [
        (r#"uimin="0""#, "-1", "at least 0"),
        (r#"uimax="1""#, "2", "at most 1"),
        (r#"uimin="0" uimax="1""#, "2", "0 to 1"),
    ] {
        let message = format!("parameter 'a' of 'test': expected {expected}, found {value}");
        assert_eq!(refusal(range, value), Some(message));
        assert_eq!(refusal("", value), None);
    }
}

/// A graph that carries its settings reads back with them; what no parameter can have leaves the default.
#[test]
fn settings_become_defaults() {
    let graph = entry("herringbone").unwrap().graph().unwrap();
    let mut settings = Settings::defaults(&graph);
    for (name, text) in [("width", "0.123"), ("ratio", "5"), ("color", "0.1, 0.2, 0.3")] {
        settings.set(&graph, name, text).unwrap();
    }
    let own = settings.as_defaults(&graph, "floor");
    assert_eq!((own.name.as_str(), Settings::defaults(&own)), ("floor", settings.clone()));
    assert_eq!(read(&to_text(&own)).unwrap(), own);
    assert_ne!(Settings::defaults(&graph), settings);
    let place = slots(&graph).iter().position(|slot| slot.parameter == graph.parameter("width").unwrap()).unwrap();
    *settings.number_mut(place) = f64::NAN;
    let kept = Settings::defaults(&settings.as_defaults(&graph, "floor"));
    assert_eq!(kept.numbers()[place], Settings::defaults(&graph).numbers()[place]);
}
