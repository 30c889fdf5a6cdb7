//! The writer of `.mtlx` files. What it writes reads back as the same graph.

use std::fmt::Write as _;

use super::material::surface_input;
use crate::graph::{Graph, Node, Output, Parameter, Source};
use crate::value::{Type, Value};

/// The graph as the text of a `.mtlx` file, with a `standard_surface` and a material that show it.
pub fn to_text(graph: &Graph) -> String {
    to_text_of_all(std::slice::from_ref(graph))
}

/// Several graphs, whose names differ, as the text of one `.mtlx` file, with a `standard_surface` and a material for
/// each. The reader accepts files of one graph alone.
pub fn to_text_of_all(graphs: &[Graph]) -> String {
    let mut out = String::from("<?xml version=\"1.0\"?>\n<materialx version=\"1.39\" colorspace=\"lin_rec709\">\n");
    graphs.iter().for_each(|graph| write_graph(&mut out, graph));
    out.push_str("</materialx>\n");
    out
}

fn write_graph(out: &mut String, graph: &Graph) {
    let doc = attribute("doc", graph.doc.as_deref());
    let _ = writeln!(out, "  <nodegraph name=\"NG_{}\"{doc}>", graph.name);
    graph.parameters.iter().for_each(|parameter| write_parameter(out, parameter));
    graph.nodes.iter().for_each(|node| write_node(out, graph, node));
    for (output, source) in Output::ALL.into_iter().zip(&graph.outputs) {
        let connection = connection(graph, source);
        let _ = writeln!(out, "    <output {} {connection} />", named(output.word(), output.kind()));
    }
    out.push_str("  </nodegraph>\n");
    write_material(out, &graph.name);
}

fn write_parameter(out: &mut String, parameter: &Parameter) {
    let number = |key, value: &Option<Value>| attribute(key, value.map(|value| value.to_string()).as_deref());
    let _ = writeln!(
        out,
        "    <input {} value=\"{}\"{}{}{} />",
        named(&parameter.name, parameter.value.kind()),
        parameter.value,
        number("uimin", &parameter.least),
        number("uimax", &parameter.most),
        attribute("doc", parameter.doc.as_deref()),
    );
}

fn write_node(out: &mut String, graph: &Graph, node: &Node) {
    let word = node.kind.word();
    let _ = write!(out, "    <{word} name=\"{}\" type=\"{}\"", node.name, node.signature.type_word());
    let set: Vec<_> = node.signature.inputs.iter().zip(&node.inputs).filter(|(_, s)| **s != Source::Unset).collect();
    if set.is_empty() {
        out.push_str(" />\n");
        return;
    }
    out.push_str(">\n");
    for (def, source) in set {
        let _ = writeln!(out, "      <input {} {} />", named(def.name, def.kind), connection(graph, source));
    }
    let _ = writeln!(out, "    </{word}>");
}

fn named(name: &str, kind: Type) -> String {
    format!("name=\"{name}\" type=\"{}\"", kind.word())
}

fn connection(graph: &Graph, source: &Source) -> String {
    match source {
        Source::Unset => String::new(),
        Source::Value(value) => format!("value=\"{value}\""),
        Source::Parameter(at) => format!("interfacename=\"{}\"", graph.parameters[*at].name),
        Source::Node { node, output } => {
            let node = &graph.nodes[*node];
            let (output, _) = node.signature.outputs[*output];
            let output = if node.signature.outputs.len() > 1 { format!(" output=\"{output}\"") } else { String::new() };
            format!("nodename=\"{}\"{output}", node.name)
        }
    }
}

fn write_material(out: &mut String, name: &str) {
    let _ = writeln!(out, "  <standard_surface name=\"SR_{name}\" type=\"surfaceshader\">");
    for output in Output::ALL {
        let input = named(surface_input(output), output.kind());
        let _ = writeln!(out, "    <input {input} nodegraph=\"NG_{name}\" output=\"{}\" />", output.word());
    }
    let _ = writeln!(out, "  </standard_surface>\n  <surfacematerial name=\"{name}\" type=\"material\">");
    let _ = writeln!(out, "    <input name=\"surfaceshader\" type=\"surfaceshader\" nodename=\"SR_{name}\" />");
    out.push_str("  </surfacematerial>\n");
}

/// ` key="value"`, escaped; empty where there is no value.
fn attribute(key: &str, value: Option<&str>) -> String {
    value.map_or(String::new(), |value| format!(" {key}=\"{}\"", value.chars().map(escaped).collect::<String>()))
}

/// A character of an attribute. Spaces other than ` ` would be read as ` `.
fn escaped(character: char) -> String {
    match character {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '"' => "&quot;".to_owned(),
        '\n' | '\r' | '\t' => format!("&#{};", u32::from(character)),
        other => other.to_string(),
    }
}
