//! The state that all parts of the reader share, and the parameters of one plugin: numbers, vectors and transforms. A
//! plugin takes the parameters that it knows by name; the others are reported at the end.

use std::collections::BTreeMap;

use glam::{DMat3, DMat4, DVec3};
use mateval_dataset::Severity;
use mateval_dataset::material::{StatedParameters, TextureIndex};
use mateval_dataset::reference::{LightGroup, MaterialIndex, ReferenceScene};
use mateval_files::source_folder::{FileFault, SourceFolder};
use mateval_files::untrusted::shortened;

use super::document::{Element, Ids, Limits};
use crate::log::{Log, UniqueNames};
use crate::open::Invalid;

/// A scene under construction.
pub(super) struct Reader<'a> {
    pub(super) ids: Ids<'a>,
    /// 0 for Mitsuba 0.5 and 0.6.
    pub(super) major_version: u32,
    pub(super) limits: Limits,
    pub(super) log: Log,
    pub(super) source: SourceFolder,
    /// Folders in which files are looked for besides the scene's own, from `<path>`.
    pub(super) search: Vec<String>,
    /// Shapes that could not be read at all.
    pub(super) left_out: Vec<String>,
    /// What is subtracted from all positions.
    pub(super) shift_m: DVec3,
    pub(super) scene: ReferenceScene,
    /// Every texture looked up so far. None stands for a file that could not be used, which has been reported.
    pub(super) textures: BTreeMap<TextureKey, Option<TextureIndex>>,
    pub(super) texels: usize,
    /// By file: whether it has an alpha channel that is not 1 everywhere.
    pub(super) alphas: BTreeMap<String, bool>,
    /// For each material of the scene, which of its parameters are stated.
    pub(super) stated: Vec<StatedParameters>,
    /// By the serial number of the BSDF's element.
    pub(super) materials: BTreeMap<usize, MaterialIndex>,
    pub(super) totals: Totals,
    pub(super) has_environment: bool,
    pub(super) light_names: UniqueNames,
}

/// Totals over the shapes read so far.
#[derive(Debug, Default)]
pub(super) struct Totals {
    pub(super) triangles: usize,
    pub(super) vertices: usize,
    pub(super) mesh_bytes: u64,
}

impl<'a> Reader<'a> {
    /// The parameters of `element`; their findings are reported at `place`.
    pub(super) fn parameters(&mut self, element: &'a Element, place: String) -> Parameters<'a> {
        Parameters::new(element, place, &self.ids, &mut self.log)
    }

    /// The file `name` relative to the scene's folder. As in Mitsuba, the last `<path>` that has it counts, and the
    /// scene's own folder comes after all of them.
    pub(super) fn file(&self, name: &str) -> Result<String, FileFault> {
        let own = SourceFolder::relative(name)?;
        let below = |folder: &String| SourceFolder::relative(&format!("{folder}/{own}")).ok();
        let mut found = self.search.iter().rev().filter_map(below);
        Ok(found.find(|file| self.source.contains(file)).unwrap_or(own))
    }

    /// Reports that the file `name` could not be used. The finding names that file where the name is valid, else the
    /// XML.
    pub(super) fn report_file(&mut self, name: &str, place: &str, line: usize, fault: &FileFault, action: &str) {
        let about = SourceFolder::relative(name).unwrap_or_else(|_| self.log.file().to_owned());
        let message = format!("{} (named in '{}' line {line})", fault.message, self.log.file());
        self.log.push(Severity::Warning, fault.code, &about, place, message, action);
    }

    /// Adds a light. A number makes its name unique.
    pub(super) fn add_light(&mut self, light: LightGroup) {
        let name = self.light_names.unique(light.name);
        self.scene.lights.push(LightGroup { name, ..light });
    }
}

/// The aspect of a picture that a texture holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Aspect {
    Color,
    Luminance,
    Alpha,
}

/// The file, whether it is decoded as linear, a number for each wrap mode, and the aspect. Textures with equal keys are
/// equal.
pub(super) type TextureKey = (String, bool, u8, Aspect);

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
    fn new(element: &'a Element, place: String, ids: &Ids<'a>, log: &mut Log) -> Self {
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
        read: impl Fn(&str) -> Result<T, Invalid>,
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
        value: Result<T, Invalid>,
        log: &mut Log,
    ) -> Option<T> {
        let report = |error| {
            let message = format!("line {}: '{name}': {error}", element.line);
            log.warn("bad_value", &self.place, message, "used the default");
            self.mark_replaced(name);
        };
        value.map_err(report).ok()
    }

    pub(super) fn number(&mut self, name: &str, log: &mut Log) -> Option<f64> {
        self.value(name, number, log)
    }

    /// Takes a finite number from `least` to `most`. Any other is a finding.
    pub(super) fn number_within(&mut self, name: &str, least: f64, most: f64, log: &mut Log) -> Option<f64> {
        self.value(name, |text| number_within(text, least, most), log)
    }

    pub(super) fn boolean(&mut self, name: &str, default: bool, log: &mut Log) -> bool {
        self.value(name, boolean, log).unwrap_or(default)
    }

    pub(super) fn string(&mut self, name: &str) -> Option<&'a str> {
        self.take(&[name]).and_then(|element| element.attribute("value"))
    }

    pub(super) fn vector(&mut self, name: &str, log: &mut Log) -> Option<[f64; 3]> {
        let element = self.take(&[name])?;
        self.value_or_finding(name, element, vector(element, 0.0), log)
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
            Some(element) => read_transform(element, &self.place, action, log),
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

/// The longest list of numbers that any value has, with room to spare.
const MOST_NUMBERS: usize = 64;

pub(super) fn number(text: &str) -> Result<f64, Invalid> {
    let trimmed = text.trim();
    let refused = || {
        let is_comma = trimmed.replacen(',', ".", 1).parse::<f64>().is_ok();
        let hint = if is_comma { "; write a point in place of the comma" } else { "" };
        Invalid(format!("expected a finite number, found '{}'{hint}", shortened(trimmed)))
    };
    trimmed.parse::<f64>().ok().filter(|n| n.is_finite()).ok_or_else(refused)
}

/// One number from `least` to `most`.
pub(super) fn number_within(text: &str, least: f64, most: f64) -> Result<f64, Invalid> {
    let found = number(text)?;
    if (least..=most).contains(&found) { Ok(found) } else { Err(out_of_range(least, most, found)) }
}

pub(super) fn out_of_range(least: f64, most: f64, found: f64) -> Invalid {
    Invalid(format!("expected {least} to {most}, found {found}"))
}

/// `expected` lists the lengths allowed, as in `1 or 3`.
pub(super) fn wrong_count(expected: &str, found: usize) -> Invalid {
    Invalid(format!("expected {expected} numbers, found {found}"))
}

/// The words between commas or white space.
pub(super) fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty())
}

/// What `read` makes of each word, of which there may be `most`.
pub(super) fn at_most<'t, T>(
    most: usize,
    words: impl Iterator<Item = &'t str>,
    read: impl Fn(&str) -> Result<T, Invalid>,
) -> Result<Vec<T>, Invalid> {
    let list = words.take(most + 1).map(read).collect::<Result<Vec<_>, _>>()?;
    if list.len() > most { Err(Invalid(format!("expected at most {most} numbers, found more"))) } else { Ok(list) }
}

/// Finite numbers between commas or white space, at most [`MOST_NUMBERS`].
pub(super) fn numbers(text: &str) -> Result<Vec<f64>, Invalid> {
    at_most(MOST_NUMBERS, words(text), number)
}

/// Three numbers, or one that stands for all three.
pub(super) fn triple(text: &str) -> Result<[f64; 3], Invalid> {
    match numbers(text)?[..] {
        [one] => Ok([one; 3]),
        [a, b, c] => Ok([a, b, c]),
        ref other => {
            let Invalid(message) = wrong_count("1 or 3", other.len());
            // `0,5 0,2 0,1` is six numbers: a comma stands inside each number.
            let are_commas = 2 * text.split_whitespace().count() == other.len() && text.contains(',');
            let hint = if are_commas { "; write points in place of decimal commas" } else { "" };
            Err(Invalid(format!("{message}{hint}")))
        }
    }
}

/// The triple in the attribute `value` of an element, or in `x`, `y` and `z`, where an absent one counts as `missing`.
pub(super) fn vector(element: &Element, missing: f64) -> Result<[f64; 3], Invalid> {
    if let Some(text) = element.attribute("value") {
        return triple(text);
    }
    let axis = |key| element.attribute(key).map_or(Ok(missing), number);
    Ok([axis("x")?, axis("y")?, axis("z")?])
}

pub(super) fn boolean(text: &str) -> Result<bool, Invalid> {
    match text.trim().to_ascii_lowercase().as_str() {
        "true" => Ok(true),
        "false" => Ok(false),
        other => Err(Invalid(format!("expected true or false, found '{}'", shortened(other)))),
    }
}

/// The last row of a matrix that is no projection.
const AFFINE: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// The largest deviation from [`AFFINE`] that counts as noise.
const AFFINE_TOLERANCE: f64 = 1e-6;

/// The product of a transform's steps, each applied after those before it. A transform with a faulty step gives none
/// and is a finding with this `action`: without that step, it would put its object elsewhere.
pub(super) fn read_transform(transform: &Element, place: &str, action: &str, log: &mut Log) -> Option<DMat4> {
    if transform.tag != "transform" {
        let tag = shortened(&transform.tag);
        let message = format!("line {}: expected a <transform>, found <{tag}>", transform.line);
        log.warn("bad_transform", place, message, action);
        return None;
    }
    let mut is_sound = true;
    let mut product = DMat4::IDENTITY;
    for element in &transform.children {
        match step(element) {
            Ok(matrix) => product = matrix * product,
            Err(error) => {
                let tag = shortened(&element.tag);
                let message = format!("line {}: <{tag}>: {error}", element.line);
                log.warn("bad_transform", place, message, action);
                is_sound = false;
            }
        }
    }
    if product.to_cols_array().iter().all(|v| v.is_finite()) {
        return is_sound.then_some(product);
    }
    log.warn("bad_transform", place, "the product of the transform's steps overflows", action);
    None
}

fn step(element: &Element) -> Result<DMat4, Invalid> {
    let vector = |missing| vector(element, missing).map(DVec3::from_array);
    match element.tag.as_str() {
        "matrix" => matrix(element.attribute("value").unwrap_or("")),
        "translate" => Ok(DMat4::from_translation(vector(0.0)?)),
        "scale" => Ok(DMat4::from_scale(vector(1.0)?)),
        "rotate" => {
            let angle = number(element.attribute("angle").unwrap_or(""))?;
            let axis = vector(0.0)?
                .try_normalize()
                .ok_or_else(|| Invalid::new("expected an axis, found a vector of length 0"))?;
            Ok(DMat4::from_mat3(rotation(axis, angle.to_radians())))
        }
        "lookat" => look_at(element),
        _ => Err(Invalid::new("expected matrix, translate, rotate, scale or lookat")),
    }
}

/// A row-major matrix of 16 numbers, or of 9 without translation.
fn matrix(text: &str) -> Result<DMat4, Invalid> {
    let list = numbers(text)?;
    if let Ok(rows) = <[f64; 16]>::try_from(list.as_slice()) {
        // A matrix that was inverted elsewhere has noise in its last row.
        let miss = rows[12..].iter().zip(AFFINE).map(|(found, expected)| (found - expected).abs());
        if miss.fold(0.0, f64::max) > AFFINE_TOLERANCE {
            return Err(Invalid::new("expected a last row of 0 0 0 1, found a projection"));
        }
        let mut rows = rows;
        rows[12..].copy_from_slice(&AFFINE);
        return Ok(DMat4::from_cols_array(&rows).transpose());
    }
    match <[f64; 9]>::try_from(list.as_slice()) {
        Ok(rows) => Ok(DMat4::from_mat3(DMat3::from_cols_array(&rows).transpose())),
        Err(_) => Err(wrong_count("16 or 9", list.len())),
    }
}

/// Rotation by `angle` radians about the unit vector `axis`, by Rodrigues' formula.
pub(super) fn rotation(axis: DVec3, angle: f64) -> DMat3 {
    let (sin, cos) = libm::sincos(angle);
    let turned = |v: DVec3| v * cos + axis.cross(v) * sin + axis * axis.dot(v) * (1.0 - cos);
    DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z))
}

/// The transform from Mitsuba's camera space: +z towards the target, +y up, +x left.
fn look_at(element: &Element) -> Result<DMat4, Invalid> {
    let given = |key| -> Result<Option<DVec3>, Invalid> {
        let Some(text) = element.attribute(key) else { return Ok(None) };
        let point =
            numbers(text).and_then(|list| <[f64; 3]>::try_from(list).map_err(|list| wrong_count("3", list.len())));
        let point = point.map_err(|reason| Invalid(format!("{key}: {reason}")))?;
        Ok(Some(DVec3::from_array(point)))
    };
    let needed = |key| given(key)?.ok_or_else(|| Invalid(format!("expected {key}, found none")));
    let (origin, target) = (needed("origin")?, needed("target")?);
    let forward =
        (target - origin).try_normalize().ok_or_else(|| Invalid::new("expected origin and target to differ"))?;
    let up = match given("up")? {
        Some(up) => up,
        None if forward.y.abs() < 0.999 => DVec3::Y,
        None => DVec3::Z,
    };
    let parallel = || Invalid::new("expected an up vector that is not parallel to the direction of view");
    let left = up.cross(forward).try_normalize().ok_or_else(parallel)?;
    let rotation = DMat3::from_cols(left, forward.cross(left), forward);
    Ok(DMat4::from_translation(origin) * DMat4::from_mat3(rotation))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bitterli::document::Document;

    #[test]
    fn numbers_in_all_notations() {
        assert_eq!(number("-2.81996e-008").unwrap(), -2.81996e-8);
        assert_eq!(numbers("1, 2,3\n 4\t+5").unwrap(), [1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(triple("0.5").unwrap(), [0.5; 3]);
        assert_eq!(triple("0.1 0.2 0.3").unwrap(), triple("0.1, 0.2, 0.3").unwrap());
    }

    #[test]
    fn other_texts_are_refused() {
        for bad in ["", "nan", "inf", "1e999", "0x1", "1.0f", "one"] {
            assert!(number(bad).is_err(), "{bad}");
        }
        assert!(triple("1 2").is_err() && triple("1 2 nan").is_err() && boolean("yes").is_err());
        assert!(numbers(&"1 ".repeat(1_000_000)).is_err());
        assert!(number("0,3").unwrap_err().0.contains("write a point"));
        assert!(triple("0,5 0,2 0,1").unwrap_err().0.contains("write points") && triple("0,5").is_err());
        assert!(!triple("1, 2").unwrap_err().0.contains("write points"));
    }

    fn read_text(steps: &str) -> (DMat4, usize) {
        let (matrix, findings) = read_faulty(steps);
        (matrix.unwrap(), findings)
    }

    fn read_faulty(steps: &str) -> (Option<DMat4>, usize) {
        let mut log = Log::new("scene.xml".into(), 100);
        let text = format!("<scene version='3.0.0'><transform>{steps}</transform></scene>");
        let document = Document::parse_text(&text, &mut log).unwrap();
        let matrix = read_transform(&document.root.children[0], "shape", "left it out", &mut log);
        (matrix, log.into_findings().len())
    }

    /// In Mitsuba 3.9.1 a rectangle under this transform has the bounding box (0, -2, -4) to (0, 2, 0).
    #[test]
    fn each_step_is_applied_after_those_before() {
        let (matrix, _) = read_text("<translate x='1'/><scale value='2'/><rotate y='1' angle='90'/>");
        let corner = |x, y| matrix.transform_point3(DVec3::new(x, y, 0.0));
        assert!((corner(1.0, 1.0) - DVec3::new(0.0, 2.0, -4.0)).length() < 1e-12);
        assert!((corner(-1.0, -1.0) - DVec3::new(0.0, -2.0, 0.0)).length() < 1e-12);
        // Twin: the other order is another transform.
        let (other, _) = read_text("<rotate y='1' angle='90'/><scale value='2'/><translate x='1'/>");
        assert!((other.transform_point3(DVec3::X) - matrix.transform_point3(DVec3::X)).length() > 0.5);
    }

    /// Mitsuba 3.9.1's matrix for the same lookat.
    #[test]
    fn look_at_as_mitsuba() {
        let expected = read_text("<matrix value='0 0 1 1 0 1 0 2 -1 0 0 3 0 0 0 1'/>").0;
        for tag in ["lookat", "look_at", "lookAt"] {
            let (matrix, findings) = read_text(&format!("<{tag} origin='1,2,3' target='4 2 3' up='0, 1, 0'/>"));
            assert_eq!((matrix, findings), (expected, 0));
        }
    }

    #[test]
    fn noise_in_the_last_row_is_dropped() {
        let noisy = read_text("<matrix value='2 0 0 1 0 2 0 2 0 0 2 3 0 -1e-9 5.9e-08 0.9999999'/>");
        assert_eq!(noisy, read_text("<matrix value='2 0 0 1 0 2 0 2 0 0 2 3 0 0 0 1'/>"));
        assert_eq!(noisy.1, 0);
    }

    #[test]
    fn faulty_steps_are_findings_and_give_no_transform() {
        for bad in [
            "<matrix value='1 2 3'/>",
            "<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1'/>",
            "<matrix value='1 0 0 0 0 1 0 0 0 0 1 0 0 0 2e-6 1'/>",
            "<matrix value='2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 2'/>",
            "<translate x='nan'/>",
            "<rotate angle='3'/>",
            "<rotate x='1' angle='nan'/>",
            "<skew/>",
            "<lookat origin='0 0 0' target='0 0 0'/>",
            "<scale value='1e308'/><scale value='1e308'/>",
        ] {
            assert_eq!(read_faulty(bad), (None, 1), "{bad}");
        }
    }
}
