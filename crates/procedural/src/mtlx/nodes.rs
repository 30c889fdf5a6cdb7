//! What a `<nodegraph>` holds: its inputs as parameters, with `uimin` and `uimax` as their range; its nodes and
//! outputs, with their types and connections, in an order in which each node follows those that it depends on.

use std::collections::{BTreeMap, BTreeSet};

use super::document::{Element, MOST_NODES, MOST_OCTAVES, MOST_PARAMETERS};
use crate::error::{Code, Findings};
use crate::graph::{FOOTPRINT, Node, Output, Parameter, Source};
use crate::node::{Kind, Signature, is_ignored_input, signatures};
use crate::value::{Type, Value, shortened};

const KNOWN: [&str; 13] = [
    "name",
    "type",
    "value",
    "uimin",
    "uimax",
    "uisoftmin",
    "uisoftmax",
    "uistep",
    "uiname",
    "uifolder",
    "uiadvanced",
    "uniform",
    "doc",
];

/// Reads the `<input>` children. One that cannot be read is reported and replaced by a zero, so that those that use it
/// are still checked.
pub(super) fn read_parameters(interface: &Element, findings: &mut Findings) -> Vec<Parameter> {
    let inputs: Vec<&Element> = interface.children.iter().filter(|child| child.tag == "input").collect();
    if inputs.len() > MOST_PARAMETERS {
        let message = format!("expected at most {MOST_PARAMETERS} inputs, found {}", inputs.len());
        interface.report(findings, Code::TooMany, message);
    }
    inputs.into_iter().take(MOST_PARAMETERS).map(|input| parameter(input, findings)).collect()
}

fn parameter(input: &Element, findings: &mut Findings) -> Parameter {
    input.check_attributes(&KNOWN, findings);
    input.check_no_children(findings);
    let kind = kind_of(input, findings).unwrap_or(Type::Float);
    if input.name() == FOOTPRINT && kind != Type::Float {
        input.report(findings, Code::Type, format!("expected the type float, found {}", kind.word()));
    }
    let value = value_of(input, "value", kind, findings);
    if value.is_none() && input.attribute("value").is_none() {
        input.report(findings, Code::Attribute, "expected a default in the attribute 'value'".to_owned());
    }
    let parameter = Parameter {
        name: input.name().to_owned(),
        value: value.unwrap_or(Value::filled(kind, 0.0)),
        least: value_of(input, "uimin", kind, findings),
        most: value_of(input, "uimax", kind, findings),
        doc: input.attribute("doc").map(str::to_owned),
    };
    check_range(input, &parameter, findings);
    parameter
}

/// The type of an element; reports one that is missing or not supported.
fn kind_of(element: &Element, findings: &mut Findings) -> Option<Type> {
    let word = element.attribute("type").unwrap_or("");
    let kind = Type::from_word(word);
    if kind.is_none() {
        let known: Vec<&str> = Type::ALL.iter().map(|kind| kind.word()).collect();
        let message = format!("expected a type of {}, found '{}'", known.join(", "), shortened(word));
        element.report(findings, Code::Type, message);
    }
    kind
}

/// The value of an attribute; reports one that is not of the type.
fn value_of(element: &Element, key: &str, kind: Type, findings: &mut Findings) -> Option<Value> {
    match Value::parse(kind, element.attribute(key)?) {
        Ok(value) => Some(value),
        Err(reason) => {
            element.report(findings, Code::Value, format!("{key}: {reason}"));
            None
        }
    }
}

fn check_range(input: &Element, parameter: &Parameter, findings: &mut Findings) {
    let exceeds = |a: &Value, b: &Value| a.numbers().iter().zip(b.numbers()).any(|(a, b)| a > b);
    let too_small = parameter.least.as_ref().is_some_and(|least| exceeds(least, &parameter.value));
    let too_great = parameter.most.as_ref().is_some_and(|most| exceeds(&parameter.value, most));
    if too_small || too_great {
        let print = |value: &Option<Value>| value.map_or("none".to_owned(), |value| value.to_string());
        let (least, most) = (print(&parameter.least), print(&parameter.most));
        let message = format!("expected uimin <= value <= uimax, found {least}, {}, {most}", parameter.value);
        input.report(findings, Code::Value, message);
    }
}

/// Reads the nodes in the order of the file, and the outputs. A node that cannot be read is reported and left out;
/// connections to it are not reported again. The places of nodes in sources are those of the returned list.
pub(super) fn read_nodes(
    graph: &Element,
    parameters: &[Parameter],
    findings: &mut Findings,
) -> (Vec<Node>, [Source; 3]) {
    let elements: Vec<&Element> = graph.children.iter().filter(|c| c.tag != "input" && c.tag != "output").collect();
    if elements.len() > MOST_NODES {
        let message = format!("expected at most {MOST_NODES} nodes, found {}", elements.len());
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
        if let Some(message) = integer_fault(kind, &signature, def.name, source, names.parameters) {
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
    [Output::BaseColor, Output::Roughness, Output::Metallic].map(|output| {
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

/// Why an integer input is not usable. Octaves and styles may be parameters whose range fits; what selects a component
/// must be a constant.
fn integer_fault(
    kind: Kind,
    signature: &Signature,
    input: &str,
    source: &Source,
    parameters: &[Parameter],
) -> Option<String> {
    let (most, may_vary) = match kind {
        Kind::Fractal2d => (f64::from(MOST_OCTAVES), true),
        Kind::WorleyNoise2d => (1.0, true),
        Kind::Extract => (signature.inputs[0].kind.width() as f64 - 1.0, false),
        // Only the first set of texture coordinates is evaluated.
        Kind::Texcoord => (0.0, false),
        _ => return None,
    };
    let (least_found, most_found) = match source {
        Source::Unset => return None,
        Source::Value(value) => (value.numbers()[0], value.numbers()[0]),
        Source::Parameter(at) if may_vary => range(&parameters[*at]),
        Source::Parameter(_) | Source::Node { .. } => return Some(format!("{input}: expected a constant")),
    };
    let fits = least_found >= 0.0 && most_found <= most;
    (!fits).then(|| format!("{input}: expected {}, found {}", span(0.0, most), span(least_found, most_found)))
}

/// A range in words; one number where the ends are the same.
fn span(least: f64, most: f64) -> String {
    if least == most { least.to_string() } else { format!("{least} to {most}") }
}

/// The range of a parameter; without end where none is given.
fn range(parameter: &Parameter) -> (f64, f64) {
    let number = |value: Option<Value>, otherwise| value.map_or(otherwise, |value| value.numbers()[0]);
    (number(parameter.least, f64::NEG_INFINITY), number(parameter.most, f64::INFINITY))
}

/// Sorts the nodes; among those that may come next, the first of the file does. `None`, with findings, where nodes
/// depend on themselves.
pub(super) fn sorted(
    nodes: Vec<Node>,
    outputs: [Source; 3],
    graph: &Element,
    findings: &mut Findings,
) -> Option<(Vec<Node>, [Source; 3])> {
    let needs: Vec<BTreeSet<usize>> = nodes.iter().map(needs).collect();
    let order = peel(&needs);
    if order.len() < nodes.len() {
        report_cycles(&nodes, &needs, &order, graph, findings);
        return None;
    }
    let mut place_of = vec![0; nodes.len()];
    for (place, &node) in order.iter().enumerate() {
        place_of[node] = place;
    }
    let moved = |source: Source| match source {
        Source::Node { node, output } => Source::Node { node: place_of[node], output },
        other => other,
    };
    let mut slots: Vec<Option<Node>> = nodes.into_iter().map(Some).collect();
    let in_order = order.iter().filter_map(|&at| slots[at].take());
    let in_order = in_order.map(|node| Node { inputs: node.inputs.into_iter().map(moved).collect(), ..node }).collect();
    Some((in_order, outputs.map(moved)))
}

fn needs(node: &Node) -> BTreeSet<usize> {
    let of = |source: &Source| match source {
        Source::Node { node, .. } => Some(*node),
        _ => None,
    };
    node.inputs.iter().filter_map(of).collect()
}

/// Nodes whose needs come before them, in order; without those that depend on a cycle.
fn peel(needs: &[BTreeSet<usize>]) -> Vec<usize> {
    let mut users: Vec<Vec<usize>> = vec![Vec::new(); needs.len()];
    for (user, needed) in needs.iter().enumerate() {
        needed.iter().for_each(|&node| users[node].push(user));
    }
    let mut missing: Vec<usize> = needs.iter().map(BTreeSet::len).collect();
    let mut ready: BTreeSet<usize> = (0..needs.len()).filter(|&node| missing[node] == 0).collect();
    let mut order = Vec::with_capacity(needs.len());
    while let Some(node) = ready.pop_first() {
        order.push(node);
        for &user in &users[node] {
            missing[user] -= 1;
            if missing[user] == 0 {
                ready.insert(user);
            }
        }
    }
    order
}

/// Reports the nodes of cycles: what remains after those before and those after all cycles are taken away.
fn report_cycles(
    nodes: &[Node],
    needs: &[BTreeSet<usize>],
    before: &[usize],
    graph: &Element,
    findings: &mut Findings,
) {
    let mut reversed = vec![BTreeSet::new(); nodes.len()];
    for (user, needed) in needs.iter().enumerate() {
        for &node in needed {
            reversed[node].insert(user);
        }
    }
    let outside: BTreeSet<usize> = before.iter().copied().chain(peel(&reversed)).collect();
    // The first element of each name.
    let named: BTreeMap<&str, &Element> = graph.children.iter().rev().map(|child| (child.name(), child)).collect();
    for (_, node) in nodes.iter().enumerate().filter(|(at, _)| !outside.contains(at)) {
        let element = named.get(node.name.as_str()).copied().unwrap_or(graph);
        element.report(findings, Code::Cycle, "this node depends on itself".to_owned());
    }
}
