//! `submission.json`: every fault with its JSON pointer. And the rule for a method's name, which it states, and which
//! tables and boards show.

use std::path::Path;

use mateval_dataset::submission::{MAX_SUBMISSION_BYTES, SUBMISSION, SUBMISSION_FORMAT, SubmissionFile};
use mateval_dataset::{DatasetError, Finding, Severity, json};
use mateval_files::untrusted::{hint, nearest, shortened, without_mark};
use serde_json::{Map, Value};

use crate::error::{FileFault, error, finding, warning};
use crate::files::{SubmittedFile, exists};

/// Its keys, the kinds of value that each may have, and whether it must be given. They are those of [`SubmissionFile`].
const KEYS: [(&str, &[&str], bool); 11] = [
    ("format", &["a string"], true),
    ("method", &["a string"], true),
    ("description", &["a string"], false),
    ("url", &["a string", "null"], false),
    ("licence", &["a string", "null"], false),
    ("cost", &["an object", "null"], false),
    ("trained_on", &["an array"], false),
    ("oracle", &["a boolean"], false),
    ("assumed_encodings", &["an object"], false),
    ("geometry", &["an object", "null"], false),
    ("dataset_manifest_sha256", &["a string"], true),
];

/// Longest name of a method, in characters.
const LONGEST_METHOD_NAME: usize = 100;

/// The method's name, if it has one, and every fault. `manifest_sha256` is that of the dataset to compare with.
pub fn check(submission: &Path, manifest_sha256: &str) -> (Option<String>, Vec<Finding>) {
    match read(submission) {
        Ok((object, mut findings)) => {
            let method = object.get("method").and_then(Value::as_str).map(str::to_owned);
            findings.extend(check_object(object, manifest_sha256));
            (method, findings)
        }
        Err(finding) => (None, vec![*finding]),
    }
}

type Object = Map<String, Value>;

/// The object, and a finding for each of its numbers that is out of range.
fn read(submission: &Path) -> Result<(Object, Vec<Finding>), Box<Finding>> {
    let path = submission.join(SUBMISSION);
    let fault = |code: &str, message: String, action: &str| Box::new(error(code, SUBMISSION, message, action));
    if !exists(&path) {
        return Err(match elsewhere(submission) {
            Some(place) => {
                let message = format!("the file is missing here; '{place}' holds it");
                fault("no_submission_file", message, "hand in that, without the folders or the archive around it")
            }
            None => {
                let action = "write it beside scenes/; dataset_spec/format/submission.md describes it";
                fault("no_submission_file", "the file is missing".to_owned(), action)
            }
        });
    }
    let source = SubmittedFile::read(submission, &path, MAX_SUBMISSION_BYTES).map_err(|found| match found {
        FileFault { code: "file_too_large", message, .. } => {
            fault("json_too_large", message, "shorten the description; results need no more")
        }
        FileFault { code, message, action, .. } => fault(code, message, action),
    })?;
    let bytes = without_mark(&source.bytes);
    let bad = |found: serde_json::Error| {
        let place = format!("line {} column {}", found.line(), found.column());
        Box::new(Finding { place, ..*fault("bad_json", format!("{found}{}", hint(bytes)), "write it as JSON") })
    };
    match serde_json::from_slice(bytes).map_err(bad)? {
        // Parsing the type finds what the object does not show: faults below its keys, and a key that occurs twice.
        Value::Object(object) => match json::parse::<SubmissionFile>(&path, bytes) {
            Err(DatasetError::Invalid { mut findings, .. }) if is_sound(&object) && !findings.is_empty() => {
                Err(Box::new(Finding {
                    action: "write it as dataset_spec/format/submission.md states".to_owned(),
                    ..findings.remove(0)
                }))
            }
            Ok(file) => Ok((object, file.numbers_out_of_range())),
            Err(_) => Ok((object, Vec::new())),
        },
        other => Err(fault("wrong_type", format!("expected an object, found {}", kind(&other)), "write { ... }")),
    }
}

/// The folder below a submission that holds its `submission.json`, or an archive that may; absent if neither exists.
/// The first in the order of names, at most four folders down.
fn elsewhere(submission: &Path) -> Option<String> {
    const MOST: usize = 1000;
    let mut folders = vec![(submission.to_owned(), String::new())];
    let (mut at, mut archive) = (0, None);
    while at < folders.len() && folders.len() < MOST {
        let (folder, name) = folders[at].clone();
        let mut names: Vec<String> = std::fs::read_dir(&folder)
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|entry| entry.file_name().into_string().ok())
            .take(MOST)
            .collect();
        names.sort();
        for entry in names {
            let (path, shown) =
                (folder.join(&entry), if name.is_empty() { entry.clone() } else { format!("{name}/{entry}") });
            let is_archive = [".zip", ".tar.gz", ".tgz"].iter().any(|ending| entry.to_lowercase().ends_with(ending));
            if path.is_dir() && !path.is_symlink() && shown.matches('/').count() < 4 {
                if path.join(SUBMISSION).is_file() {
                    return Some(shown);
                }
                folders.push((path, shown));
            } else if is_archive && archive.is_none() {
                archive = Some(shown);
            }
        }
        at += 1;
    }
    archive
}

fn is_sound(object: &Map<String, Value>) -> bool {
    object.iter().all(|(key, value)| KEYS.iter().any(|(known, kinds, _)| known == key && kinds.contains(&kind(value))))
        && KEYS.iter().all(|(key, _, required)| !required || object.contains_key(*key))
}

fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::String(_) => "a string",
        Value::Array(_) => "an array",
        Value::Object(_) => "an object",
    }
}

fn check_object(object: Map<String, Value>, manifest_sha256: &str) -> Vec<Finding> {
    let mut findings = check_keys(&object);
    for (key, value) in &object {
        let Some(text) = value.as_str() else { continue };
        let found = match key.as_str() {
            "format" => check_format(text),
            "method" => check_method_name(text, Severity::Warning, SUBMISSION),
            "dataset_manifest_sha256" => check_hash(text, manifest_sha256),
            _ => None,
        };
        findings.extend(found.map(|finding| Finding { place: format!("/{key}"), ..finding }));
    }
    findings
}

fn check_keys(object: &Map<String, Value>) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut at = |key: &str, finding: Finding| {
        findings.push(Finding { place: format!("/{}", key.replace('~', "~0").replace('/', "~1")), ..finding });
    };
    let missing = KEYS.iter().filter(|(key, _, required)| *required && !object.contains_key(*key));
    for (key, ..) in missing {
        at(key, error("missing_key", SUBMISSION, format!("the key '{key}' is missing"), "add it"));
    }
    // Untrusted input may have any number of keys.
    for (key, value) in object.iter().take(100) {
        let short = shortened(key);
        let Some(&(_, kinds, _)) = KEYS.iter().find(|(known, ..)| known == key) else {
            let action = nearest(key, KEYS.map(|(key, ..)| key))
                .map_or("leave it out".to_owned(), |near| format!("leave it out, or write '{near}'"));
            at(&short, error("unknown_key", SUBMISSION, format!("the key '{short}' is unknown"), action));
            continue;
        };
        if !kinds.contains(&kind(value)) {
            let message = format!("expected {}, found {}", kinds[0], kind(value));
            at(key, error("wrong_type", SUBMISSION, message, format!("write {}", kinds[0])));
        }
    }
    findings
}

fn check_format(text: &str) -> Option<Finding> {
    let message = || format!("format '{}'; this version reads '{SUBMISSION_FORMAT}'", shortened(text));
    let action = format!("write '{SUBMISSION_FORMAT}'");
    (text != SUBMISSION_FORMAT).then(|| error("wrong_format", SUBMISSION, message(), action))
}

fn check_hash(text: &str, manifest_sha256: &str) -> Option<Finding> {
    let is_hash = text.len() == 64 && text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    let action = "copy manifest_sha256 of the dataset's dataset.json, if it was made for that";
    if !is_hash {
        let message = format!("'{}' is not a SHA-256: expected 64 digits, 0-9 and a-f", shortened(text));
        return Some(warning("bad_hash", SUBMISSION, message, action));
    }
    let message = || format!("made for the dataset {text}, checked against {manifest_sha256}");
    (text != manifest_sha256).then(|| warning("other_dataset", SUBMISSION, message(), action))
}

/// What is wrong with the name of a method, as a finding about `file` without a place; none for a name that tables can
/// show.
pub fn check_method_name(name: &str, severity: Severity, file: &str) -> Option<Finding> {
    let found = |code: &str, message: String, action: String| Some(finding(severity, code, file, message, action));
    if name.chars().all(|c| c.is_whitespace() || is_unprintable(c)) {
        let message = "the method has no name".to_owned();
        return found("no_method_name", message, "write the name that tables should show".to_owned());
    }
    let (length, unprintable) = (name.chars().count(), name.chars().any(is_unprintable));
    if length <= LONGEST_METHOD_NAME && !unprintable {
        return None;
    }
    let unprintable = if unprintable { ", some of them unprintable" } else { "" };
    let message = format!("the method's name has {length} characters{unprintable}");
    found("bad_method_name", message, format!("use at most {LONGEST_METHOD_NAME} printable characters"))
}

/// Whether the character shows nothing by itself: two names that differ only in such characters look the same, and
/// those that set the direction of writing reorder the text around the name.
fn is_unprintable(c: char) -> bool {
    let is_ignorable = matches!(c,
        '\u{ad}' | '\u{34f}' | '\u{61c}' | '\u{115f}' | '\u{1160}' | '\u{17b4}' | '\u{17b5}' | '\u{180b}'..='\u{180f}'
        | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{3164}'
        | '\u{fe00}'..='\u{fe0f}' | '\u{feff}' | '\u{ffa0}' | '\u{fff0}'..='\u{fffb}' | '\u{1d173}'..='\u{1d17a}'
        | '\u{e0000}'..='\u{e0fff}');
    c.is_control() || is_ignorable
}

#[cfg(test)]
mod tests {
    use super::*;
    use mateval_dataset::dataset::{Perturbation, PerturbationKind};
    use mateval_dataset::submission::Cost;
    use mateval_dataset::submission::StoredEncoding;
    use serde_json::json;

    /// The codes and places of what is found in a folder with this `submission.json`.
    fn codes(file: &Value) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(SUBMISSION), file.to_string()).unwrap();
        let (_, findings) = check(folder.path(), &"0".repeat(64));
        findings.into_iter().map(|finding| format!("{} {}", finding.code, finding.place)).collect()
    }

    #[test]
    fn a_submission_that_lies_deeper_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let message = || check(folder.path(), &"0".repeat(64)).1[0].message.clone();
        assert_eq!(message(), "the file is missing");
        std::fs::write(folder.path().join("sub.zip"), "").unwrap();
        assert!(message().contains("'sub.zip' holds it"));
        std::fs::create_dir_all(folder.path().join("home/me/sub")).unwrap();
        std::fs::write(folder.path().join("home/me/sub").join(SUBMISSION), "{}").unwrap();
        assert!(message().contains("'home/me/sub' holds it"));
    }

    #[test]
    fn every_key_that_scoring_reads_is_known() {
        let file = SubmissionFile {
            format: SUBMISSION_FORMAT.to_owned(),
            method: "m".to_owned(),
            description: "d".to_owned(),
            url: Some("https://example.org".to_owned()),
            licence: Some("MIT".to_owned()),
            cost: Some(Cost { seconds_a_scene: 1.5, hardware: "a laptop".to_owned() }),
            trained_on: vec!["3D-FRONT".to_owned()],
            oracle: true,
            assumed_encodings: [(mateval_dataset::submission::Map::Roughness, StoredEncoding::Linear)].into(),
            geometry: Some(Perturbation { kind: PerturbationKind::Pose, level: 1 }),
            dataset_manifest_sha256: "0".repeat(64),
        };
        let whole = serde_json::to_value(&file).unwrap();
        assert_eq!(whole.as_object().unwrap().len(), KEYS.len());
        assert_eq!(codes(&whole), [""; 0]);
        // The twins: another type, and an object that lacks a key.
        for (key, value, expected) in [
            ("url", json!(3), "wrong_type /url"),
            ("cost", json!("cheap"), "wrong_type /cost"),
            ("cost", json!({"hardware": "a laptop"}), "bad_json /cost"),
            ("cost", json!({"seconds_a_scene": -1}), "bad_number /cost/seconds_a_scene"),
            ("cost", json!({"seconds_a_scene": null}), "bad_json /cost/seconds_a_scene"),
            ("geometry", json!({"kind": "scale", "level": 3}), "bad_number /geometry/level"),
            ("geometry", json!({"kind": "pose", "level": 0}), "bad_number /geometry/level"),
            ("geometry", json!({"kind": "posed", "level": 1}), "bad_json /geometry/kind"),
            ("assumed_encodings", json!({"roughness": "sRGB"}), "bad_json /assumed_encodings"),
        ] {
            let mut changed = whole.clone();
            changed[key] = value;
            assert_eq!(codes(&changed), [expected], "{changed}");
        }
    }

    fn code_of_name(name: &str) -> Option<String> {
        check_method_name(name, Severity::Warning, "submission.json").map(|finding| finding.code)
    }

    #[test]
    fn names_that_tables_cannot_show_are_found() {
        for name in ["", " \t", "\u{200b}", "\u{202e}\u{2066}", "\0"] {
            assert_eq!(code_of_name(name).as_deref(), Some("no_method_name"), "{name:?}");
        }
        let long = "x".repeat(LONGEST_METHOD_NAME + 1);
        for name in ["a\nb", "a\0", "safe\u{202e}gpj", "a\u{2067}b", "a\u{200b}b", "a\u{2028}b", &long] {
            assert_eq!(code_of_name(name).as_deref(), Some("bad_method_name"), "{name:?}");
        }
        for name in ["MatEval <b>", "b_2 (ours)", "材料 é", &"x".repeat(LONGEST_METHOD_NAME)] {
            assert_eq!(code_of_name(name), None, "{name:?}");
        }
    }
}
