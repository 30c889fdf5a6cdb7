//! Graphs as `.mtlx` files: one graph, and the material that it feeds. The reader reports everything that it finds;
//! what the writer writes reads back as the same graph.

mod document;
mod nodes;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use crate::error::{Code, Finding, Findings, ProceduralError};
use crate::graph::{Graph, Node, Output, Parameter, Source};
use crate::value::{Type, Value, shortened};
use document::{Element, MOST_BYTES, parse};
use nodes::{read_nodes, read_parameters, sorted};

pub fn read_file(path: &Path) -> Result<Graph, ProceduralError> {
    use std::io::Read as _;
    let io = |source| ProceduralError::Io { path: path.to_owned(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(MOST_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(io)?;
    let name = path.display().to_string();
    if bytes.len() > MOST_BYTES {
        return Err(refused(name, format!("expected at most {MOST_BYTES} bytes, found more")));
    }
    match String::from_utf8(bytes) {
        Ok(text) => read_text(&name, &text),
        Err(_) => Err(refused(name, "expected UTF-8 text".to_owned())),
    }
}

/// The error about a file that is refused as a whole.
fn refused(name: String, message: String) -> ProceduralError {
    let finding = Finding { line: None, element: None, code: Code::Xml, message };
    ProceduralError::Invalid { name, findings: vec![finding] }
}

/// Reads the text of a file called `name`. Fails with everything that is wrong with it.
pub fn read_text(name: &str, text: &str) -> Result<Graph, ProceduralError> {
    let mut findings = Findings::default();
    match read(text, &mut findings) {
        Some(graph) if findings.is_empty() => Ok(graph),
        _ => Err(ProceduralError::Invalid { name: name.to_owned(), findings: findings.into_sorted() }),
    }
}

/// The graph, or what could be read of it where there are findings.
fn read(text: &str, findings: &mut Findings) -> Option<Graph> {
    if text.len() > MOST_BYTES {
        let message = format!("expected at most {MOST_BYTES} bytes, found {}", text.len());
        findings.add(Code::Xml, None, None, message);
        return None;
    }
    let root = parse(text, findings)?;
    check_root(&root, findings)?;
    let element = the_graph(&root, findings)?;
    check_names(&root, findings);
    check_names(element, findings);
    let interface = interface_of(&root, element, findings);
    if !std::ptr::eq(interface, element) {
        check_names(interface, findings);
        check_nodedef(interface, element, findings);
    }

    let parameters = read_parameters(interface, findings);
    let (nodes, outputs) = read_nodes(element, &parameters, findings);
    check_shaders(&root, element.name(), findings);
    let (nodes, outputs) = sorted(nodes, outputs, element, findings)?;
    let name = element.name();
    let name = name.strip_prefix("NG_").filter(|rest| !rest.is_empty()).unwrap_or(name).to_owned();
    Some(Graph { name, doc: element.attribute("doc").map(str::to_owned), parameters, nodes, outputs })
}

fn check_root(root: &Element, findings: &mut Findings) -> Option<()> {
    if root.tag != "materialx" {
        root.report(findings, Code::UnknownElement, "expected the root element <materialx>".to_owned());
        return None;
    }
    root.check_attributes(&["version", "colorspace", "doc"], findings);
    let version = root.attribute("version").unwrap_or("");
    if version != "1.39" {
        let message = format!("expected version 1.39 of MaterialX, found '{}'", shortened(version));
        root.report(findings, Code::Attribute, message);
    }
    let space = root.attribute("colorspace").unwrap_or("lin_rec709");
    if space != "lin_rec709" {
        let message = format!("expected the colour space lin_rec709, found '{}'", shortened(space));
        root.report(findings, Code::Attribute, message);
    }
    Some(())
}

/// The one node graph. Reports elements that are not supported beside it.
fn the_graph<'a>(root: &'a Element, findings: &mut Findings) -> Option<&'a Element> {
    const KNOWN: [&str; 4] = ["nodegraph", "nodedef", "standard_surface", "surfacematerial"];
    for child in root.children.iter().filter(|child| !KNOWN.contains(&child.tag.as_str())) {
        child.report(findings, Code::UnknownElement, format!("expected one of {}", KNOWN.join(", ")));
    }
    let mut graphs = root.children.iter().filter(|child| child.tag == "nodegraph");
    let Some(first) = graphs.next() else {
        root.report(findings, Code::UnknownElement, "expected a <nodegraph>, found none".to_owned());
        return None;
    };
    for other in graphs {
        other.report(findings, Code::UnknownElement, "expected one <nodegraph>, found another".to_owned());
    }
    first.check_attributes(&["name", "nodedef", "doc", "xpos", "ypos"], findings);
    Some(first)
}

/// The element whose inputs are the parameters: the graph itself, or the nodedef that it implements.
fn interface_of<'a>(root: &'a Element, graph: &'a Element, findings: &mut Findings) -> &'a Element {
    let wanted = graph.attribute("nodedef");
    let mut found = graph;
    for nodedef in root.children.iter().filter(|child| child.tag == "nodedef") {
        nodedef.check_attributes(&["name", "node", "nodegroup", "doc"], findings);
        if wanted == Some(nodedef.name()) {
            found = nodedef;
        } else {
            let message = format!("expected the <nodedef> that {} names", graph.place());
            nodedef.report(findings, Code::UnknownElement, message);
        }
    }
    if let (Some(wanted), true) = (wanted, std::ptr::eq(found, graph)) {
        let message = format!("there is no <nodedef> '{}'", shortened(wanted));
        graph.report(findings, Code::Connection, message);
    }
    found
}

/// The writer puts the inputs of a nodedef beside the nodes and outputs of its graph, so that their names must differ.
/// Also reports inputs of the graph itself, and children of the nodedef that are neither inputs nor outputs.
fn check_nodedef(nodedef: &Element, graph: &Element, findings: &mut Findings) {
    let mut used = BTreeSet::new();
    for child in &graph.children {
        if child.tag == "input" {
            let message = format!("expected the inputs within {}", nodedef.place());
            child.report(findings, Code::UnknownElement, message);
        } else {
            used.insert(child.name());
        }
    }
    for child in &nodedef.children {
        if child.tag != "input" && child.tag != "output" {
            child.report(findings, Code::UnknownElement, "expected <input> or <output>".to_owned());
        } else if child.tag == "input" && used.contains(child.name()) {
            let message = format!("another element within {} has this name", graph.place());
            child.report(findings, Code::DuplicateName, message);
        }
    }
}

/// Names are made of letters, digits and underscores, and those of one parent differ.
fn check_names(parent: &Element, findings: &mut Findings) {
    let mut seen = BTreeSet::new();
    for child in &parent.children {
        let name = child.name();
        let fits = !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
        if !fits {
            let message = "expected a name made of letters, digits and underscores".to_owned();
            child.report(findings, Code::Attribute, message);
        } else if !seen.insert(name) {
            let message = format!("another element within {} has this name", parent.place());
            child.report(findings, Code::DuplicateName, message);
        }
    }
}

/// The input of `standard_surface` that an output feeds.
fn surface_input(output: Output) -> &'static str {
    match output {
        Output::BaseColor => "base_color",
        Output::Roughness => "specular_roughness",
        Output::Metallic => "metalness",
    }
}

/// Reports shaders and materials that show anything but the graph's outputs. The material that a graph feeds in
/// programs that read `.mtlx` is checked, since other inputs would change the look without changing what is evaluated
/// here.
fn check_shaders(root: &Element, graph: &str, findings: &mut Findings) {
    let surfaces = root.children.iter().filter(|child| child.tag == "standard_surface");
    let surfaces: BTreeSet<&str> = surfaces.map(Element::name).collect();
    for element in &root.children {
        match element.tag.as_str() {
            "standard_surface" => check_surface(element, graph, findings),
            "surfacematerial" => check_material(element, &surfaces, findings),
            _ => {}
        }
    }
}

fn check_surface(surface: &Element, graph: &str, findings: &mut Findings) {
    surface.check_attributes(&["name", "type", "doc", "xpos", "ypos"], findings);
    for input in &surface.children {
        input.check_no_children(findings);
        let fed = Output::ALL.iter().any(|&output| {
            let expected = [
                ("name", surface_input(output)),
                ("type", output.kind().word()),
                ("nodegraph", graph),
                ("output", output.word()),
            ];
            input.tag == "input" && expected.iter().all(|(key, value)| input.attribute(key) == Some(value))
        });
        if !fed {
            let message = "expected base_color, specular_roughness and metalness, connected to the graph's outputs";
            input.report(findings, Code::Connection, message.to_owned());
        }
        input.check_attributes(&["name", "type", "nodegraph", "output"], findings);
    }
}

fn check_material(material: &Element, surfaces: &BTreeSet<&str>, findings: &mut Findings) {
    material.check_attributes(&["name", "type", "doc", "xpos", "ypos"], findings);
    for input in &material.children {
        input.check_no_children(findings);
        input.check_attributes(&["name", "type", "nodename"], findings);
        let surface = input.attribute("nodename").unwrap_or("");
        if input.tag != "input" || input.name() != "surfaceshader" || !surfaces.contains(surface) {
            let message = "expected the input surfaceshader, connected to a standard_surface".to_owned();
            input.report(findings, Code::Connection, message);
        }
    }
}

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
    for (output, source) in Output::ALL.iter().zip(&graph.outputs) {
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
    for &output in Output::ALL {
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
