//! The parameters of one plugin. A reader takes those that it knows by name; the others are reported at the end.

use glam::DMat4;

use super::document::{Element, Ids};
use super::error::ValueError;
use super::{transform, value};
use crate::source_scene::Log;
use mateval_scene::findings::shortened;

/// A plugin's children with references resolved.
pub(super) struct Parameters<'a> {
    /// The place that findings name, as in `bsdf 'Wood'`.
    pub(super) place: String,
    kind: String,
    children: Vec<Child<'a>>,
    /// Names of parameters that are given but cannot be used as they are, so that a default stands in for them.
    replaced: Vec<String>,
}

struct Child<'a> {
    name: &'a str,
    element: &'a Element,
    taken: bool,
}

/// Tags of parameters that hold a value. All other tags are objects.
const VALUES: [&str; 11] =
    ["float", "integer", "boolean", "string", "rgb", "srgb", "spectrum", "vector", "point", "transform", "blackbody"];

/// Tags of colours and textures.
pub(super) const COLORS: [&str; 5] = ["rgb", "srgb", "spectrum", "blackbody", "texture"];

impl<'a> Parameters<'a> {
    /// The children of `element`. An unresolved reference is a finding.
    pub(super) fn new(element: &'a Element, place: String, ids: &Ids<'a>, log: &mut Log) -> Self {
        let (mut children, mut replaced) = (Vec::new(), Vec::new());
        for child in &element.children {
            let target = if child.tag == "ref" { resolve(child, &place, ids, log) } else { Some(child) };
            if target.is_none() {
                replaced.push(child.name().to_owned());
            }
            children.extend(target.map(|target| Child { name: child.name(), element: target, taken: false }));
        }
        Self { place, kind: format!("{} '{}'", element.tag, shortened(element.kind())), children, replaced }
    }

    /// The first child with one of these names that has not been taken yet. A child that is never taken is reported.
    pub(super) fn take(&mut self, names: &[&str]) -> Option<&'a Element> {
        let child = self.children.iter_mut().find(|c| !c.taken && names.contains(&c.name))?;
        child.taken = true;
        Some(child.element)
    }

    /// Whether a child has this name.
    pub(super) fn contains(&self, name: &str) -> bool {
        self.children.iter().any(|child| child.name == name)
    }

    /// Whether a child with one of these tags has not been taken.
    pub(super) fn has_untaken(&self, tags: &[&str]) -> bool {
        self.children.iter().any(|child| !child.taken && tags.contains(&child.element.tag.as_str()))
    }

    /// Records that the parameter `name` is given but cannot be used as it is.
    pub(super) fn mark_replaced(&mut self, name: &str) {
        self.replaced.push(name.to_owned());
    }

    /// Whether one of the parameters of these names is given but cannot be used as it is.
    pub(super) fn is_replaced(&self, names: &[&str]) -> bool {
        self.replaced.iter().any(|name| names.contains(&name.as_str()))
    }

    /// Whether any parameter that has been taken cannot be used as it is.
    pub(super) fn is_any_replaced(&self) -> bool {
        !self.replaced.is_empty()
    }

    /// Takes every object with this tag, in order.
    pub(super) fn objects(&mut self, tag: &str) -> Vec<&'a Element> {
        let found = self.children.iter_mut().filter(|c| !c.taken && c.element.tag == tag);
        found.map(|child| (child.taken = true, child.element).1).collect()
    }

    /// Takes parameters of these names that are known but have no effect here.
    pub(super) fn ignore(&mut self, names: &[&str]) {
        for child in &mut self.children {
            child.taken |= names.contains(&child.name);
        }
    }

    /// Takes all remaining parameters, which then are not reported.
    pub(super) fn take_all(&mut self) {
        self.children.iter_mut().for_each(|child| child.taken = true);
    }

    /// Takes a value that `read` makes of its text. A faulty value is a finding.
    pub(super) fn value<T>(
        &mut self,
        name: &str,
        read: impl Fn(&str) -> Result<T, ValueError>,
        log: &mut Log,
    ) -> Option<T> {
        let element = self.take(&[name])?;
        let value = read(element.attribute("value").unwrap_or(""));
        self.value_or_finding(name, element, value, log)
    }

    fn value_or_finding<T>(
        &mut self,
        name: &str,
        element: &Element,
        value: Result<T, ValueError>,
        log: &mut Log,
    ) -> Option<T> {
        let report = |error| {
            let message = format!("line {}: '{name}': {error}", element.line);
            log.warn("bad_value", &self.place, message, "used the default");
            self.mark_replaced(name);
        };
        value.map_err(report).ok()
    }

    /// Takes a finite number.
    pub(super) fn number(&mut self, name: &str, log: &mut Log) -> Option<f64> {
        self.value(name, value::number, log)
    }

    /// Takes a finite number from `least` to `most`. Any other is a finding.
    pub(super) fn number_within(&mut self, name: &str, least: f64, most: f64, log: &mut Log) -> Option<f64> {
        self.value(name, |text| value::number_within(text, least, most), log)
    }

    /// Takes `true` or `false`.
    pub(super) fn boolean(&mut self, name: &str, default: bool, log: &mut Log) -> bool {
        self.value(name, value::boolean, log).unwrap_or(default)
    }

    /// Takes a text.
    pub(super) fn string(&mut self, name: &str) -> Option<&'a str> {
        self.take(&[name]).and_then(|element| element.attribute("value"))
    }

    /// Takes a vector or point.
    pub(super) fn vector(&mut self, name: &str, log: &mut Log) -> Option<[f64; 3]> {
        let element = self.take(&[name])?;
        self.value_or_finding(name, element, value::vector(element, 0.0), log)
    }

    /// Takes a transform. The default is the identity, also for a faulty one.
    pub(super) fn transform(&mut self, name: &str, log: &mut Log) -> DMat4 {
        self.sound_transform(name, "used the identity", log).unwrap_or_else(|| {
            self.mark_replaced(name);
            DMat4::IDENTITY
        })
    }

    /// Takes a transform. The default is the identity. A faulty one gives none and is a finding with this `action`.
    pub(super) fn sound_transform(&mut self, name: &str, action: &str, log: &mut Log) -> Option<DMat4> {
        match self.take(&[name]) {
            Some(element) => transform::read(element, &self.place, action, log),
            // A reference that leads nowhere has been reported.
            None => (!self.is_replaced(&[name])).then_some(DMat4::IDENTITY),
        }
    }

    /// Reports parameters that were not taken.
    pub(super) fn finish(self, log: &mut Log) {
        for child in self.children.iter().filter(|c| !c.taken) {
            let (line, tag) = (child.element.line, shortened(&child.element.tag));
            let (code, what) = if VALUES.contains(&child.element.tag.as_str()) {
                ("unknown_parameter", format!("'{}'", shortened(child.name)))
            } else {
                ("unknown_element", format!("<{tag} type='{}'>", shortened(child.element.kind())))
            };
            log.warn(code, &self.place, format!("line {line}: {} does not take {what} here", self.kind), "ignored it");
        }
    }
}

fn resolve<'a>(reference: &Element, place: &str, ids: &Ids<'a>, log: &mut Log) -> Option<&'a Element> {
    let id = reference.attribute("id").unwrap_or("");
    let found = ids.get(id).copied();
    if found.is_none() {
        let message = format!("line {}: no element has the id '{}'", reference.line, shortened(id));
        log.warn("unknown_id", place, message, "ignored the reference");
    }
    found
}
