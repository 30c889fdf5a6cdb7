//! Small graphs, and points, that the tests share.

use mateval_procedural::evaluator::Points;
use mateval_procedural::mtlx::{Limits, read_text};
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
    read_text("test.mtlx", text, &Limits::default())
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
