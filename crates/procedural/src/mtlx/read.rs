//! The reader of `.mtlx` files: one graph, and the material that it feeds.

use std::collections::BTreeSet;
use std::path::Path;

use super::document::{self, Element};
use super::{material, nodes, order, parameters};
use crate::error::ProceduralError;
use crate::finding::{Code, Finding, Findings};
use crate::graph::Graph;
use crate::limits::Limits;
use crate::value::shortened;

/// Reads a file.
pub fn read_file(path: &Path, limits: &Limits) -> Result<Graph, ProceduralError> {
    use std::io::Read as _;
    let io = |source| ProceduralError::Io { path: path.to_owned(), source };
    let file = std::fs::File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.take(limits.bytes as u64 + 1).read_to_end(&mut bytes).map_err(io)?;
    let name = path.display().to_string();
    if bytes.len() > limits.bytes {
        return Err(refused(name, format!("expected at most {} bytes, found more", limits.bytes)));
    }
    match String::from_utf8(bytes) {
        Ok(text) => read_text(&name, &text, limits),
        Err(_) => Err(refused(name, "expected UTF-8 text".to_owned())),
    }
}

/// The error about a file that is refused as a whole.
fn refused(name: String, message: String) -> ProceduralError {
    let finding = Finding { line: None, element: None, code: Code::Xml, message };
    ProceduralError::Invalid { name, findings: vec![finding] }
}

/// Reads the text of a file called `name`. Fails with everything that is wrong with it.
pub fn read_text(name: &str, text: &str, limits: &Limits) -> Result<Graph, ProceduralError> {
    let mut findings = Findings::new(limits.findings);
    let graph = read(text, limits, &mut findings);
    match graph {
        Some(graph) if findings.is_empty() => Ok(graph),
        _ => Err(ProceduralError::Invalid { name: name.to_owned(), findings: findings.into_sorted() }),
    }
}

/// The graph, or what could be read of it where there are findings.
fn read(text: &str, limits: &Limits, findings: &mut Findings) -> Option<Graph> {
    if text.len() > limits.bytes {
        let message = format!("expected at most {} bytes, found {}", limits.bytes, text.len());
        findings.add(Code::Xml, None, None, message);
        return None;
    }
    let root = document::parse(text, limits, findings)?;
    check_root(&root, findings)?;
    let element = the_graph(&root, findings)?;
    check_names(&root, findings);
    check_names(element, findings);
    let interface = interface_of(&root, element, findings);
    if !std::ptr::eq(interface, element) {
        check_names(interface, findings);
        check_nodedef(interface, element, findings);
    }

    let parameters = parameters::read(interface, limits, findings);
    let (nodes, outputs) = nodes::read(element, &parameters, limits, findings);
    material::check(&root, element.name(), findings);
    let (nodes, outputs) = order::sorted(nodes, outputs, element, findings)?;
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
