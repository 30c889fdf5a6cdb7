//! The inputs of a graph as parameters, with `uimin` and `uimax` as their range.

use super::document::Element;
use crate::finding::{Code, Findings};
use crate::graph::{FOOTPRINT, Parameter};
use crate::limits::Limits;
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
pub(super) fn read(interface: &Element, limits: &Limits, findings: &mut Findings) -> Vec<Parameter> {
    let inputs: Vec<&Element> = interface.children.iter().filter(|child| child.tag == "input").collect();
    if inputs.len() > limits.parameters {
        let message = format!("expected at most {} inputs, found {}", limits.parameters, inputs.len());
        interface.report(findings, Code::TooMany, message);
    }
    inputs.into_iter().take(limits.parameters).map(|input| parameter(input, findings)).collect()
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
pub(super) fn kind_of(element: &Element, findings: &mut Findings) -> Option<Type> {
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
pub(super) fn value_of(element: &Element, key: &str, kind: Type, findings: &mut Findings) -> Option<Value> {
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
