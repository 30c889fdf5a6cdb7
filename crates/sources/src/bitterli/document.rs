//! The XML as a tree of plain elements, with variables substituted and names in snake_case. Size is checked first, and
//! depth while the tree is made: the parser does not recurse.

use std::collections::BTreeMap;

use mateval_files::source_folder::{FileFault, SourceFolder};
use mateval_files::untrusted::{hint, shortened, without_mark};

use crate::log::Log;
use crate::open::Invalid;

/// Limits on an untrusted scene, checked before memory is taken. Exceeding one is an error for the XML itself, and a
/// finding for anything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of the XML, before and after variables are substituted.
    pub xml_bytes: u64,
    pub xml_depth: usize,
    /// Bytes of any other file.
    pub file_bytes: u64,
    /// Bytes of all OBJ files, each counted as often as it is named. Once exceeded, no further file is read.
    pub mesh_bytes: u64,
    pub shapes: usize,
    /// Triangles of all shapes.
    pub triangles: usize,
    /// Vertices of all shapes.
    pub vertices: usize,
    /// Texels of all textures.
    pub texels: usize,
    /// Number of findings. Further ones are only counted.
    pub findings: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            xml_bytes: 64 << 20,
            xml_depth: 64,
            file_bytes: 512 << 20,
            mesh_bytes: 4 << 30,
            shapes: 100_000,
            triangles: 50_000_000,
            vertices: 50_000_000,
            texels: 512 << 20,
            findings: 5_000,
        }
    }
}

#[derive(Debug)]
pub(super) struct Element {
    /// The tag, with `lookAt` and `look_at` written `lookat`.
    pub(super) tag: String,
    /// The line, from 1.
    pub(super) line: usize,
    /// The included file that holds the element; none for the scene's own.
    file: Option<String>,
    /// A number that identifies the element in the document.
    pub(super) serial: usize,
    attributes: Vec<(String, String)>,
    /// Child elements, without `<default>`.
    pub(super) children: Vec<Element>,
}

impl Element {
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str())
    }

    /// The attribute `type`, as in `roughplastic`; empty where it is absent.
    pub(super) fn kind(&self) -> &str {
        self.attribute("type").unwrap_or("")
    }

    /// The attribute `name` in snake_case; empty where it is absent.
    pub(super) fn name(&self) -> &str {
        self.attribute("name").unwrap_or("")
    }

    /// The place of a finding about this element: `bsdf 'Wood'`, or `line 12` where it has no id.
    pub(super) fn place(&self) -> String {
        match self.attribute("id") {
            Some(id) => format!("{} '{}'", self.tag, shortened(id)),
            None => match &self.file {
                Some(file) => format!("'{}' line {}", shortened(file), self.line),
                None => format!("line {}", self.line),
            },
        }
    }
}

#[derive(Debug)]
pub(super) struct Document {
    pub(super) root: Element,
    /// The first number of the scene's version: 0 for Mitsuba 0.5 and 0.6, 3 for Mitsuba 3.
    pub(super) major_version: u32,
}

/// The deepest nesting of included files.
const MOST_INCLUDES: usize = 8;

/// Elements by id and alias.
pub(super) type Ids<'a> = BTreeMap<&'a str, &'a Element>;

impl Document {
    /// Parses XML, with the files that it includes from `folder`. Fails where it is not well-formed, is not a
    /// `<scene>`, or exceeds a limit.
    pub(super) fn parse(
        text: &str,
        limits: &Limits,
        folder: &mut SourceFolder,
        log: &mut Log,
    ) -> Result<Self, Invalid> {
        let xml = roxmltree::Document::parse(text)
            .map_err(|reason| Invalid(format!("expected well-formed XML: {reason}")))?;
        let mut builder = Builder {
            line_starts: line_starts(text),
            variables: BTreeMap::new(),
            budget: limits.xml_bytes,
            depth_limit: limits.xml_depth,
            serial: 0,
            files: Vec::new(),
            search: Vec::new(),
            folder,
            log,
        };
        let root = builder.element(xml.root_element(), 0)?;
        if root.tag != "scene" {
            let found = shortened(&root.tag);
            let what = format!("expected a Mitsuba scene, whose root element is <scene>, found <{found}>");
            return Err(Invalid(what));
        }
        let major_version = major_version(&root, log);
        Ok(Self { root, major_version })
    }

    /// Parses XML that includes no files.
    #[cfg(test)]
    pub(super) fn parse_text(text: &str, log: &mut Log) -> Result<Self, Invalid> {
        let folder = tempfile::tempdir().unwrap();
        Self::parse(text, &Limits::default(), &mut SourceFolder::new(folder.path(), 1 << 20).unwrap(), log)
    }

    /// Every element that has an id. Of several with the same id, the first counts.
    pub(super) fn ids<'a>(&'a self, log: &mut Log) -> Ids<'a> {
        let mut ids = Ids::new();
        let mut aliases = Vec::new();
        collect_ids(&self.root, &mut ids, &mut aliases, log);
        for (id, new, element) in aliases {
            match ids.get(id).copied() {
                Some(target) => drop(ids.entry(new).or_insert(target)),
                None => log.warn("unknown_id", &element.place(), format!("no element '{}'", shortened(id)), "ignored"),
            }
        }
        ids
    }
}

fn collect_ids<'a>(
    element: &'a Element,
    ids: &mut Ids<'a>,
    aliases: &mut Vec<(&'a str, &'a str, &'a Element)>,
    log: &mut Log,
) {
    match (element.tag.as_str(), element.attribute("id"), element.attribute("as")) {
        ("ref", ..) | (_, None, _) => {}
        ("alias", Some(id), new) => aliases.extend(new.map(|new| (id, new, element))),
        (_, Some(id), _) => {
            if ids.contains_key(id) {
                let message = format!("line {}: the id '{}' is already used", element.line, shortened(id));
                log.warn("duplicate_id", &element.place(), message, "resolved references to the first element");
            } else {
                ids.insert(id, element);
            }
        }
    }
    for child in &element.children {
        collect_ids(child, ids, aliases, log);
    }
}

fn major_version(root: &Element, log: &mut Log) -> u32 {
    let text = root.attribute("version").unwrap_or("");
    let major = text.split('.').next().and_then(|first| first.trim().parse().ok());
    match major {
        Some(major @ (0 | 2 | 3)) => major,
        _ => {
            let message = format!("expected a scene version 0.5, 0.6 or 3, found '{}'", shortened(text));
            log.warn("unknown_version", "", message, "read as version 3");
            3
        }
    }
}

fn too_deep(line: usize, most: usize) -> Invalid {
    Invalid(format!("line {line}: expected elements nested at most {most} deep, found deeper ones"))
}

/// Turns the parser's nodes into elements, in document order, so that a `<default>` applies to what follows it.
struct Builder<'l> {
    line_starts: Vec<usize>,
    variables: BTreeMap<String, String>,
    budget: u64,
    depth_limit: usize,
    serial: usize,
    /// The included file that is being read, and its includers; empty in the scene's own.
    files: Vec<String>,
    /// The folders of the `<path>` elements so far.
    search: Vec<String>,
    folder: &'l mut SourceFolder,
    log: &'l mut Log,
}

/// The offsets of the beginnings of lines.
fn line_starts(text: &str) -> Vec<usize> {
    let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(at, _)| at + 1);
    std::iter::once(0).chain(ends).collect()
}

impl Builder<'_> {
    fn element(&mut self, node: roxmltree::Node, depth: usize) -> Result<Element, Invalid> {
        let line = self.line_starts.partition_point(|&start| start <= node.range().start);
        if depth > self.depth_limit {
            return Err(too_deep(line, self.depth_limit));
        }
        self.serial += 1;
        let serial = self.serial;
        let attributes = node.attributes().map(|a| self.attribute(&a, line)).collect::<Result<_, _>>()?;
        let tag = match node.tag_name().name() {
            "lookAt" | "look_at" => "lookat",
            other => other,
        };
        let file = self.files.last().cloned();
        let mut element = Element { tag: tag.to_owned(), line, file, serial, attributes, children: Vec::new() };
        for child in node.children().filter(roxmltree::Node::is_element) {
            let child = self.element(child, depth + 1)?;
            match child.tag.as_str() {
                "default" => self.define(&child),
                "include" => element.children.extend(self.included(&child, depth + 1)?),
                _ => {
                    let folder = child.attribute("value").filter(|_| child.tag == "path");
                    self.search.extend(folder.map(str::to_owned));
                    element.children.push(child);
                }
            }
        }
        Ok(element)
    }

    /// The elements of the file that an `<include>` names. As in Mitsuba, they stand in its place, and variables are
    /// shared.
    fn included(&mut self, include: &Element, depth: usize) -> Result<Vec<Element>, Invalid> {
        let line = include.line;
        let refused = |reason| Invalid(format!("line {line}: <include>: {reason}"));
        let file = self.include_path(include.attribute("filename").unwrap_or(""));
        let file = file.map_err(|fault| refused(fault.message))?;
        if self.files.contains(&file) || self.files.len() >= MOST_INCLUDES {
            return Err(refused(format!("'{}' includes itself, or is included too deeply", shortened(&file))));
        }
        let bytes = self.folder.read(&file).map_err(|fault| refused(fault.message))?;
        self.spend(bytes.len(), line)?;
        let not_text = |_| refused(format!("'{}' is not UTF-8{}", shortened(&file), hint(&bytes)));
        let text = std::str::from_utf8(without_mark(&bytes)).map_err(not_text)?;
        let xml = roxmltree::Document::parse(text)
            .map_err(|reason| refused(format!("'{}': expected well-formed XML: {reason}", shortened(&file))))?;
        // Its own lines, until it ends.
        let outer = std::mem::replace(&mut self.line_starts, line_starts(text));
        self.files.push(file);
        let root = self.element(xml.root_element(), depth);
        self.files.pop();
        self.line_starts = outer;
        let root = root?;
        // A file that holds one object includes that object.
        Ok(if root.tag == "scene" { root.children } else { vec![root] })
    }

    /// The path of an included file: as in Mitsuba beside the including file, else in the scene's own folder, else in
    /// the last `<path>` before it.
    fn include_path(&self, name: &str) -> Result<String, FileFault> {
        let own = SourceFolder::relative(name)?;
        let beside = self.files.last().and_then(|file| file.rsplit_once('/')).map_or("", |(folder, _)| folder);
        let folders = [beside, ""].into_iter().chain(self.search.iter().rev().map(String::as_str));
        let mut found = folders.filter_map(|folder| SourceFolder::relative(&format!("./{folder}/{own}")).ok());
        Ok(found.find(|file| self.folder.contains(file)).unwrap_or(own))
    }

    fn attribute(&mut self, attribute: &roxmltree::Attribute, line: usize) -> Result<(String, String), Invalid> {
        let value = self.with_variables(attribute.value(), line)?;
        let key = attribute.name();
        Ok((key.to_owned(), if key == "name" { snake_case(&value) } else { value }))
    }

    /// Defines a variable. As in Mitsuba, the first definition counts, and names are compared as written.
    fn define(&mut self, default: &Element) {
        match (default.attribute("name"), default.attribute("value")) {
            (Some(name), Some(value)) if !name.is_empty() => {
                self.variables.entry(name.to_owned()).or_insert_with(|| value.to_owned());
            }
            _ => {
                let message = "expected both a name and a value of <default>";
                self.log.warn("bad_default", &default.place(), message, "ignored it");
            }
        }
    }

    /// `text` with every `$` and the longest variable name that follows replaced by the variable's value.
    fn with_variables(&mut self, text: &str, line: usize) -> Result<String, Invalid> {
        let mut out = String::new();
        let mut rest = text;
        while let Some(at) = rest.find('$') {
            out.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            match self.longest_variable(rest) {
                Some((length, value)) => {
                    out.push_str(value);
                    rest = &rest[length..];
                    self.spend(out.len(), line)?;
                }
                None => {
                    let message = format!("'${}' is not defined before it is used", shortened(rest));
                    self.log.warn("unknown_variable", &format!("line {line}"), message, "kept the text unchanged");
                    out.push('$');
                }
            }
        }
        out.push_str(rest);
        Ok(out)
    }

    /// The longest variable whose name `text` begins with: the length of the name in bytes, and its value.
    fn longest_variable(&self, text: &str) -> Option<(usize, &str)> {
        let word = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
        let ends = text[..word].char_indices().map(|(at, c)| at + c.len_utf8()).take(256);
        let longest = ends.filter_map(|end| Some((end, self.variables.get(&snake_case(&text[..end]))?))).last();
        longest.map(|(end, value)| (end, value.as_str()))
    }

    /// Takes `bytes` from the budget of substituted text, since variables within variables can grow exponentially.
    fn spend(&mut self, bytes: usize, line: usize) -> Result<(), Invalid> {
        let too_large = || Invalid(format!("line {line}: the scene with its variables substituted is too large"));
        self.budget = self.budget.checked_sub(bytes as u64).ok_or_else(too_large)?;
        Ok(())
    }
}

/// `diffuseReflectance` as `diffuse_reflectance`. A name in snake_case is returned unchanged.
fn snake_case(name: &str) -> String {
    let mut out = String::with_capacity(name.len() + 4);
    let mut after_small = false;
    for c in name.chars() {
        if c.is_ascii_uppercase() && after_small {
            out.push('_');
        }
        after_small = c.is_ascii_lowercase() || c.is_ascii_digit();
        out.push(c.to_ascii_lowercase());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> (Result<Document, Invalid>, Vec<mateval_dataset::Finding>) {
        let mut log = Log::new("scene.xml".into(), 100);
        let document = Document::parse_text(text, &mut log);
        (document, log.into_findings())
    }

    #[test]
    fn names_become_snake_case() {
        for (name, snake) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("extEta", "ext_eta"),
            ("diffuse_reflectance", "diffuse_reflectance"),
            ("id", "id"),
        ] {
            assert_eq!(snake_case(name), snake);
        }
    }

    #[test]
    fn variables_take_the_longest_name_and_their_first_value() {
        let (document, findings) = parse(
            r#"<scene version="3.0.0"><default name="s" value="1"/><default name="sampleCount" value="9"/>
            <default name="s" value="2"/><integer name="a" value="$sampleCount/$s"/><integer name="b" value="$no"/></scene>"#,
        );
        let root = document.unwrap().root;
        assert_eq!(root.children[0].attribute("value"), Some("9/1"));
        assert_eq!(root.children[1].attribute("value"), Some("$no"));
        assert_eq!(findings.iter().map(|f| f.code.as_str()).collect::<Vec<_>>(), ["unknown_variable"]);
        assert_eq!(findings[0].place, "line 2");
    }

    #[test]
    fn variables_cannot_explode() {
        let mut text = r#"<scene version="3.0.0"><default name="a0" value="xxxxxxxxxxxxxxxx"/>"#.to_owned();
        for step in 1..64 {
            text += &format!(r#"<default name="a{step}" value="$a{p}$a{p}"/>"#, p = step - 1);
        }
        let error = parse(&(text + "</scene>")).0.unwrap_err();
        assert!(error.to_string().contains("line 1: the scene with its variables"), "{error}");
    }

    #[test]
    fn ten_thousand_deep_is_an_error() {
        let deep = format!("{}{}", "<scene>".repeat(10_000), "</scene>".repeat(10_000));
        assert_eq!(parse(&deep).0.unwrap_err(), too_deep(1, 64));
        // Twin: the same number of siblings passes, as do brackets in comments and quotes.
        let wide = format!("<scene version='3.0.0'>{}</scene>", "<a b='>'/><!-- <a><a> -->".repeat(10_000));
        assert_eq!(parse(&wide).0.unwrap().root.children.len(), 10_000);
    }

    #[test]
    fn entities_and_other_roots_are_refused() {
        for text in [
            "<!DOCTYPE s [<!ENTITY a 'aa'>]><scene version='3.0.0'>&a;</scene>",
            "<house/>",
            "",
            "<scene",
            "<scene></house>",
        ] {
            assert!(parse(text).0.is_err(), "{text}");
        }
    }

    #[test]
    fn ids_and_aliases() {
        let (document, _) = parse(
            r#"<scene version="0.6.0"><bsdf id="a" type="x"/><alias id="a" as="b"/><bsdf id="a" type="y"/><ref id="a"/></scene>"#,
        );
        let document = document.unwrap();
        let mut log = Log::new("scene.xml".into(), 100);
        let ids = document.ids(&mut log);
        assert_eq!(ids["a"].kind(), "x");
        assert_eq!(ids["b"].serial, ids["a"].serial);
        assert_eq!(log.into_findings()[0].code, "duplicate_id");
    }
}
