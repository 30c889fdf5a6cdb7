//! The XML as a tree of plain elements, and the limits on this untrusted input, which are checked before memory is
//! taken. A file that exceeds one is refused.

use crate::error::{Code, Findings};
use crate::value::shortened;

/// The most bytes of a file.
pub(super) const MOST_BYTES: usize = 4 << 20;
/// The most elements, texts and comments of the XML.
const MOST_XML_NODES: u32 = 1 << 16;
/// The most attributes of an element. Each is compared with all earlier ones of its element.
const MOST_ATTRIBUTES: usize = 64;
/// The most namespaces of the XML. An element that declares one copies all those of its parent.
const MOST_NAMESPACES: usize = 16;
/// The greatest depth of nested elements. The elements that are supported nest four deep.
const MOST_DEPTH: usize = 8;
pub(super) const MOST_NODES: usize = 2048;
pub(super) const MOST_PARAMETERS: usize = 256;
/// The greatest number of octaves of a fractal, since each costs as much as a noise.
pub(super) const MOST_OCTAVES: i32 = 16;

#[derive(Debug)]
pub(super) struct Element {
    pub(super) tag: String,
    /// The line, from 1.
    pub(super) line: usize,
    /// The attributes, in the order of the file.
    attributes: Vec<(String, String)>,
    pub(super) children: Vec<Element>,
}

impl Element {
    /// The value of an attribute.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The attribute `name`; empty where it is absent.
    pub(super) fn name(&self) -> &str {
        self.attribute("name").unwrap_or("")
    }

    /// The tag and the name, as findings print them.
    pub(super) fn place(&self) -> String {
        match self.name() {
            "" => format!("<{}>", shortened(&self.tag)),
            name => format!("{} '{}'", shortened(&self.tag), shortened(name)),
        }
    }

    /// Adds a finding about this element.
    pub(super) fn report(&self, findings: &mut Findings, code: Code, message: String) {
        findings.add(code, Some(self.line), Some(self.place()), message);
    }

    /// Reports every attribute that is not in `known`, since it might change what the element means.
    pub(super) fn check_attributes(&self, known: &[&str], findings: &mut Findings) {
        for (key, _) in self.attributes.iter().filter(|(key, _)| !known.contains(&key.as_str())) {
            let message = format!("the attribute '{}' is not supported", shortened(key));
            self.report(findings, Code::Attribute, message);
        }
    }

    pub(super) fn check_no_children(&self, findings: &mut Findings) {
        for child in &self.children {
            child.report(
                findings,
                Code::UnknownElement,
                format!("expected no elements within <{}>", shortened(&self.tag)),
            );
        }
    }
}

/// The root element; `None`, with findings, where the text is not XML or exceeds a limit.
pub(super) fn parse(text: &str, findings: &mut Findings) -> Option<Element> {
    check_crowding(text, findings)?;
    let options = roxmltree::ParsingOptions { nodes_limit: MOST_XML_NODES, ..Default::default() };
    let document = match roxmltree::Document::parse_with_options(text, options) {
        Ok(document) => document,
        Err(reason) => {
            let line = line_of(&reason);
            findings.add(Code::Xml, line, None, format!("expected XML without a DTD: {}", explained(&reason)));
            return None;
        }
    };
    let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
    let lines: Vec<usize> = std::iter::once(0).chain(ends).collect();
    match element(&lines, document.root_element(), 1) {
        Ok(root) => Some(root),
        Err(line) => {
            let message = format!("expected elements nested at most {MOST_DEPTH} deep, found deeper ones");
            findings.add(Code::Xml, Some(line), None, message);
            None
        }
    }
}

/// Refuses text on which the parser would take time that grows with the square of its length.
fn check_crowding(text: &str, findings: &mut Findings) -> Option<()> {
    if text.matches("xmlns").count() > MOST_NAMESPACES {
        let message = format!("expected at most {MOST_NAMESPACES} namespaces, found more");
        findings.add(Code::Xml, None, None, message);
        return None;
    }
    let mut line = 1;
    // Values of attributes hold no `<`, so that a piece holds all attributes of an element.
    for piece in text.split('<') {
        if most_attributes(piece) > MOST_ATTRIBUTES {
            let message = format!("expected at most {MOST_ATTRIBUTES} attributes of an element, found more");
            findings.add(Code::Xml, Some(line), None, message);
            return None;
        }
        line += piece.matches('\n').count();
    }
    Some(())
}

/// An upper bound of the attributes in a piece of XML: equals signs before quotes.
fn most_attributes(piece: &str) -> usize {
    piece.split('=').skip(1).filter(|value| value.trim_start().starts_with(['"', '\''])).count()
}

/// The line of an error; none for a limit.
fn line_of(reason: &roxmltree::Error) -> Option<usize> {
    match reason {
        roxmltree::Error::NodesLimitReached | roxmltree::Error::AttributesLimitReached => None,
        other => usize::try_from(other.pos().row).ok(),
    }
}

fn explained(reason: &roxmltree::Error) -> String {
    match reason {
        roxmltree::Error::NodesLimitReached => "it has too many elements".to_owned(),
        other => shortened(&other.to_string()),
    }
}

/// The element as a tree, or the line at which it is too deep. The recursion ends at the limit. `lines` are the places
/// where lines begin.
fn element(lines: &[usize], node: roxmltree::Node, depth: usize) -> Result<Element, usize> {
    let line = lines.partition_point(|&start| start <= node.range().start);
    if depth > MOST_DEPTH {
        return Err(line);
    }
    let attributes = node.attributes().map(|a| (qualified(a.namespace(), a.name()), a.value().to_owned())).collect();
    let children = node.children().filter(roxmltree::Node::is_element);
    let children = children.map(|child| element(lines, child, depth + 1)).collect::<Result<_, _>>()?;
    let tag = qualified(node.tag_name().namespace(), node.tag_name().name());
    Ok(Element { tag, line, attributes, children })
}

/// A name with its namespace before it, so that `xi:include` is no `include`.
fn qualified(namespace: Option<&str>, name: &str) -> String {
    match namespace {
        Some(namespace) => format!("{namespace}:{name}"),
        None => name.to_owned(),
    }
}
