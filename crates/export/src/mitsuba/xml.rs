//! The scene file as Mitsuba 3 reads it: XML with elements for plugins and their parameters; and the findings about
//! what it cannot express.

use std::fmt::Write as _;

use mateval_dataset::{Finding, Severity};

#[derive(Clone, Debug, PartialEq)]
pub(super) struct Element {
    tag: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Element>,
    /// Written before the element as a comment.
    remark: Option<String>,
}

impl Element {
    pub(super) fn new(tag: &'static str) -> Self {
        Self { tag, attributes: Vec::new(), children: Vec::new(), remark: None }
    }

    /// A plugin of the kind `tag` (`bsdf`, `shape`, ...) and the type `name`.
    pub(super) fn plugin(tag: &'static str, name: &'static str) -> Self {
        Self::new(tag).attribute("type", name)
    }

    pub(super) fn attribute(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.attributes.push((name, value.into()));
        self
    }

    /// Sets the name under which the element is a parameter of its parent.
    pub(super) fn named(self, name: &'static str) -> Self {
        self.attribute("name", name)
    }

    pub(super) fn child(mut self, child: Element) -> Self {
        self.children.push(child);
        self
    }

    pub(super) fn float(self, name: &'static str, value: impl Into<f64>) -> Self {
        self.child(value_element("float", name, number(value.into())))
    }

    pub(super) fn integer(self, name: &'static str, value: impl Into<u64>) -> Self {
        let value: u64 = value.into();
        self.child(value_element("integer", name, value.to_string()))
    }

    pub(super) fn boolean(self, name: &'static str, value: bool) -> Self {
        self.child(value_element("boolean", name, value.to_string()))
    }

    pub(super) fn string(self, name: &'static str, value: impl Into<String>) -> Self {
        self.child(value_element("string", name, value.into()))
    }

    pub(super) fn rgb(self, name: &'static str, value: [f32; 3]) -> Self {
        self.child(value_element("rgb", name, value.map(|v| number(v.into())).join(" ")))
    }

    /// A transform, row-major.
    pub(super) fn matrix(self, name: &'static str, rows: [[f64; 4]; 4]) -> Self {
        let value = rows.as_flattened().iter().map(|&v| number(v)).collect::<Vec<_>>().join(" ");
        self.child(Self::new("transform").named(name).child(Self::new("matrix").attribute("value", value)))
    }

    /// Sets a comment before the element that names what it was made from. Characters that could end the comment or
    /// control a terminal are replaced.
    pub(super) fn remark(mut self, name: &str) -> Self {
        let plain = |c: char| if c.is_alphanumeric() || " ._/()".contains(c) { c } else { '_' };
        self.remark = Some(name.chars().take(100).map(plain).collect());
        self
    }

    /// The text of the document whose root is this element.
    pub(super) fn document(&self) -> String {
        let mut text = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n".to_owned();
        self.write(&mut text, 0);
        text
    }

    fn write(&self, text: &mut String, depth: usize) {
        let indent = "    ".repeat(depth);
        if let Some(remark) = &self.remark {
            // Writing to a String cannot fail, neither here nor below.
            let _ = writeln!(text, "{indent}<!-- {remark} -->");
        }
        let _ = write!(text, "{indent}<{}", self.tag);
        for (name, value) in &self.attributes {
            let _ = write!(text, " {name}=\"{}\"", escaped(value));
        }
        if self.children.is_empty() {
            text.push_str("/>\n");
            return;
        }
        text.push_str(">\n");
        self.children.iter().for_each(|child| child.write(text, depth + 1));
        let _ = writeln!(text, "{indent}</{}>", self.tag);
    }
}

fn value_element(tag: &'static str, name: &'static str, value: String) -> Element {
    Element::new(tag).named(name).attribute("value", value)
}

/// The shortest decimal that reads back as the same number; the shorter one where single precision suffices.
fn number(value: f64) -> String {
    // Turns -0 into 0.
    let value = value + 0.0;
    let single = value as f32;
    if f64::from(single) == value { format!("{single}") } else { format!("{value}") }
}

fn escaped(value: &str) -> String {
    value.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// The name of the exported scene's file, which all findings refer to.
pub(super) const SCENE_FILE: &str = "scene.xml";

#[derive(Default)]
pub(super) struct Remarks(Vec<Finding>);

impl Remarks {
    /// Adds a warning: this part of the exported scene means something else in Mitsuba.
    pub(super) fn warn(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Warning, code, place, message, action);
    }

    /// Adds a note: this part means the same in Mitsuba, or differs so little that only a very long render would show
    /// it.
    pub(super) fn note(&mut self, code: &str, place: &str, message: &str, action: &str) {
        self.add(Severity::Note, code, place, message, action);
    }

    /// All findings, sorted and without duplicates.
    pub(super) fn sorted(mut self) -> Vec<Finding> {
        self.0.sort();
        self.0.dedup();
        self.0
    }

    fn add(&mut self, severity: Severity, code: &str, place: &str, message: &str, action: &str) {
        self.0.push(Finding::new(severity, code, SCENE_FILE, place, message, action));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_document_reads_back() {
        let inner = Element::plugin("bsdf", "diffuse").float("a", 0.1_f32).rgb("b", [-0.0, 0.25, 1e-9]);
        let text =
            Element::new("scene").attribute("version", "3.0.0").child(inner.remark("x --> <y&\u{1b}z--")).document();
        let read = roxmltree::Document::parse(&text).unwrap();
        let values: Vec<_> = read.descendants().filter_map(|node| node.attribute("value")).collect();
        assert_eq!(values, ["0.1", "0 0.25 0.000000001"]);
        let comment = read.descendants().find(|node| node.is_comment()).unwrap();
        assert_eq!(comment.text(), Some(" x ___ _y__z__ "));
    }

    #[test]
    fn values_cannot_break_the_markup() {
        let value = "\"/><&evil;";
        let text = Element::new("scene").string("filename", value).document();
        let read = roxmltree::Document::parse(&text).unwrap();
        assert_eq!(read.descendants().find_map(|node| node.attribute("value")), Some(value));
    }
}
