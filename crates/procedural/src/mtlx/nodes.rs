//! The nodes and outputs of a graph: their types, inputs and connections.

use std::collections::{BTreeMap, BTreeSet};

use super::document::Element;
use super::integers;
use super::parameters::{kind_of, value_of};
use crate::finding::{Code, Findings};
use crate::graph::{Node, Output, Parameter, Source};
use crate::limits::Limits;
use crate::node::catalog::{is_ignored_input, signatures};
use crate::node::kind::Kind;
use crate::node::signature::Signature;
use crate::value::{Type, shortened};

/// Reads the nodes in the order of the file, and the outputs. A node that cannot be read is reported and left out;
/// connections to it are not reported again. The places of nodes in sources are those of the returned list.
pub(super) fn read(
    graph: &Element,
    parameters: &[Parameter],
    limits: &Limits,
    findings: &mut Findings,
) -> (Vec<Node>, [Source; 3]) {
    let elements: Vec<&Element> = graph.children.iter().filter(|c| c.tag != "input" && c.tag != "output").collect();
    if elements.len() > limits.nodes {
        let message = format!("expected at most {} nodes, found {}", limits.nodes, elements.len());
        graph.report(findings, Code::TooMany, message);
        return (Vec::new(), [Source::Unset, Source::Unset, Source::Unset]);
    }
    let named = elements.iter().map(|element| (*element, variant(element, findings)));
    let mut names = Names { parameters, nodes: BTreeMap::new() };
    let mut read = Vec::new();
    for (element, variant) in named {
        let place = variant.as_ref().map(|_| read.len());
        let signature = variant.as_ref().map(|(_, signature)| signature.clone());
        names.nodes.entry(element.name()).or_insert((place, signature));
        read.extend(variant.map(|(kind, signature)| (element, kind, signature)));
    }
    let nodes = read.into_iter().map(|(element, kind, signature)| node(element, kind, signature, &names, findings));
    let nodes = nodes.collect();
    (nodes, outputs(graph, &names, findings))
}

/// What connections may lead to.
struct Names<'a> {
    parameters: &'a [Parameter],
    /// The place and signature of each node; `None` for one that could not be read.
    nodes: BTreeMap<&'a str, (Option<usize>, Option<Signature>)>,
}

/// The node of the standard library and its variant that fits the types of the element and its inputs.
fn variant(element: &Element, findings: &mut Findings) -> Option<(Kind, Signature)> {
    element.check_attributes(&["name", "type", "doc", "xpos", "ypos"], findings);
    let Some(kind) = Kind::from_word(&element.tag) else {
        element.report(findings, Code::UnknownNode, "this node is not supported".to_owned());
        return None;
    };
    let word = element.attribute("type").unwrap_or("");
    let mut typed = signatures(kind);
    typed.retain(|signature| signature.type_word() == word);
    if typed.is_empty() {
        let mut known: Vec<&str> = signatures(kind).iter().map(Signature::type_word).collect();
        known.dedup();
        let message = format!("expected the type {}, found '{}'", known.join(" or "), shortened(word));
        element.report(findings, Code::Type, message);
        return None;
    }
    let inputs: Vec<(&Element, &str)> = wanted_inputs(element, kind, findings);
    let names = typed.iter().flat_map(|signature| &signature.inputs).map(|input| input.name);
    let names: Vec<&str> = names.collect();
    for (input, name) in inputs.iter().filter(|(_, name)| !names.contains(name)) {
        let message = format!("a {word} {} has no input '{}'", kind.word(), shortened(name));
        input.report(findings, Code::UnknownInput, message);
    }
    let known: Vec<(&Element, &str)> = inputs.into_iter().filter(|(_, name)| names.contains(name)).collect();
    let found = typed.into_iter().find(|signature| known.iter().all(|(input, name)| fits(signature, input, name)));
    if found.is_none() {
        let types: Vec<String> = known.iter().map(|(input, name)| typed_name(input, name)).collect();
        let message = format!("no {word} {} has inputs of these types: {}", kind.word(), types.join(", "));
        element.report(findings, Code::Type, message);
    }
    found.map(|signature| (kind, signature))
}

fn fits(signature: &Signature, input: &Element, name: &str) -> bool {
    let kind = input.attribute("type").and_then(Type::from_word);
    signature.inputs.iter().any(|def| def.name == name && Some(def.kind) == kind)
}

fn typed_name(input: &Element, name: &str) -> String {
    format!("{} {}", shortened(input.attribute("type").unwrap_or("none")), shortened(name))
}

/// The inputs that matter. Reports other child elements, and inputs of one name.
fn wanted_inputs<'a>(element: &'a Element, kind: Kind, findings: &mut Findings) -> Vec<(&'a Element, &'a str)> {
    let mut inputs: Vec<(&Element, &str)> = Vec::new();
    let mut seen = BTreeSet::new();
    for child in &element.children {
        let name = child.name();
        if child.tag != "input" {
            child.report(findings, Code::UnknownElement, "expected <input>".to_owned());
        } else if is_ignored_input(kind, name) {
            continue;
        } else if !seen.insert(name) {
            child.report(findings, Code::DuplicateName, format!("{} has this input twice", element.place()));
        } else {
            inputs.push((child, name));
        }
    }
    inputs
}

fn node(element: &Element, kind: Kind, signature: Signature, names: &Names, findings: &mut Findings) -> Node {
    let mut inputs = vec![Source::Unset; signature.inputs.len()];
    for child in element.children.iter().filter(|child| child.tag == "input") {
        let Some(at) = signature.inputs.iter().position(|def| def.name == child.name()) else { continue };
        inputs[at] = source(child, signature.inputs[at].kind, names, findings);
        child.check_no_children(findings);
    }
    for (def, source) in signature.inputs.iter().zip(&inputs).filter(|(def, _)| def.kind == Type::Integer) {
        if let Some(message) = integers::fault(kind, &signature, def.name, source, names.parameters) {
            element.report(findings, Code::Value, message);
        }
    }
    Node { name: element.name().to_owned(), kind, signature, inputs }
}

/// What an input or output is connected to; [`Source::Unset`], with a finding, where the connection is faulty.
fn source(element: &Element, kind: Type, names: &Names, findings: &mut Findings) -> Source {
    element.check_attributes(&["name", "type", "value", "nodename", "output", "interfacename", "doc"], findings);
    let attributes = ["value", "nodename", "interfacename"].map(|key| element.attribute(key));
    let found = match attributes {
        [Some(_), None, None] => value_of(element, "value", kind, findings).map(Source::Value),
        [None, Some(name), None] => to_node(element, name, kind, names, findings),
        [None, None, Some(name)] => to_parameter(element, name, kind, names, findings),
        _ => {
            let message = "expected one of the attributes 'value', 'nodename' and 'interfacename'".to_owned();
            element.report(findings, Code::Connection, message);
            None
        }
    };
    if element.attribute("output").is_some() && element.attribute("nodename").is_none() {
        element.report(findings, Code::Connection, "the attribute 'output' needs 'nodename'".to_owned());
    }
    found.unwrap_or(Source::Unset)
}

fn to_node(element: &Element, name: &str, kind: Type, names: &Names, findings: &mut Findings) -> Option<Source> {
    let Some((place, signature)) = names.nodes.get(name) else {
        element.report(findings, Code::Connection, format!("there is no node '{}'", shortened(name)));
        return None;
    };
    // A node that could not be read has been reported.
    let (node, signature) = (place.as_ref()?, signature.as_ref()?);
    let wanted = element.attribute("output");
    let output = match (wanted, signature.outputs.len()) {
        (None, 1) => Some(0),
        (None, _) => None,
        (Some(wanted), _) => signature.outputs.iter().position(|(name, _)| *name == wanted),
    };
    let Some(output) = output else {
        let known: Vec<&str> = signature.outputs.iter().map(|(name, _)| *name).collect();
        let message = format!("expected the attribute 'output' to be one of {}", known.join(", "));
        element.report(findings, Code::Connection, message);
        return None;
    };
    check_kind(element, kind, signature.outputs[output].1, findings)?;
    Some(Source::Node { node: *node, output })
}

fn to_parameter(element: &Element, name: &str, kind: Type, names: &Names, findings: &mut Findings) -> Option<Source> {
    let Some(place) = names.parameters.iter().position(|parameter| parameter.name == name) else {
        element.report(findings, Code::Connection, format!("the graph has no input '{}'", shortened(name)));
        return None;
    };
    check_kind(element, kind, names.parameters[place].value.kind(), findings)?;
    Some(Source::Parameter(place))
}

fn check_kind(element: &Element, expected: Type, found: Type, findings: &mut Findings) -> Option<()> {
    if expected != found {
        let message = format!("expected a connection of type {}, found {}", expected.word(), found.word());
        element.report(findings, Code::Type, message);
        return None;
    }
    Some(())
}

/// The sources of the three outputs.
fn outputs(graph: &Element, names: &Names, findings: &mut Findings) -> [Source; 3] {
    let elements: Vec<&Element> = graph.children.iter().filter(|child| child.tag == "output").collect();
    for element in &elements {
        element.check_no_children(findings);
        if !Output::ALL.iter().any(|output| output.word() == element.name()) {
            let message = "expected the outputs base_color, roughness and metallic".to_owned();
            element.report(findings, Code::Output, message);
        }
    }
    Output::ALL.map(|output| {
        let Some(element) = elements.iter().find(|element| element.name() == output.word()) else {
            graph.report(findings, Code::Output, format!("expected an output '{}', found none", output.word()));
            return Source::Unset;
        };
        if let Some(kind) = kind_of(element, findings) {
            check_kind(element, output.kind(), kind, findings);
        }
        source(element, output.kind(), names, findings)
    })
}
