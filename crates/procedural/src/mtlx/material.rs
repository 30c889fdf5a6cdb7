//! The material that a graph feeds in programs that read `.mtlx`: a `standard_surface` whose inputs are the graph's
//! outputs. It is checked, since other inputs would change the look without changing what is evaluated here.

use std::collections::BTreeSet;

use super::document::Element;
use crate::finding::{Code, Findings};
use crate::graph::Output;

/// The input of `standard_surface` that an output feeds.
pub(super) fn surface_input(output: Output) -> &'static str {
    match output {
        Output::BaseColor => "base_color",
        Output::Roughness => "specular_roughness",
        Output::Metallic => "metalness",
    }
}

/// Reports shaders and materials that show anything but the graph's outputs.
pub(super) fn check(root: &Element, graph: &str, findings: &mut Findings) {
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
        let fed = Output::ALL.into_iter().any(|output| {
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
