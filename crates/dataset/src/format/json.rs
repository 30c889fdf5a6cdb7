//! Reads and writes JSON files, with the same bytes on every machine and with path, line and column of every fault.

use std::io::{self, Write};
use std::path::Path;

use mateval_files::FileError;
use mateval_files::untrusted::{hint, in_words, read_at_most, shortened, without_mark};
use mateval_files::whole::write_whole;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::ser::{Formatter, PrettyFormatter};
use serde_path_to_error::Segment;

use crate::DatasetError;

/// Largest JSON file that is read, in bytes.
const MAX_JSON_BYTES: u64 = 256 << 20;

/// Pretty JSON with a closing newline.
pub fn to_text<T: Serialize>(value: &T) -> String {
    // It fails for maps whose keys are not strings, which our types do not hold.
    let mut text = serde_json::to_string_pretty(value).expect("our types can be written as JSON");
    text.push('\n');
    text
}

/// Writes the file whole.
pub fn write<T: Serialize>(path: &Path, value: &T) -> Result<(), DatasetError> {
    Ok(write_whole(path, to_text(value).as_bytes())?)
}

/// JSON in which each element of a list has one line, with a closing newline: for files of long lists.
pub fn to_lines<T: Serialize>(value: &T) -> String {
    let mut text = Vec::new();
    let mut writer = serde_json::Serializer::with_formatter(&mut text, InLines::default());
    value.serialize(&mut writer).expect("our types can be written as JSON");
    text.push(b'\n');
    String::from_utf8(text).expect("JSON is UTF-8")
}

/// Writes the file whole, as [`to_lines`].
pub fn write_lines<T: Serialize>(path: &Path, value: &T) -> Result<(), DatasetError> {
    Ok(write_whole(path, to_lines(value).as_bytes())?)
}

/// Pretty outside of lists, and compact inside of their elements.
#[derive(Default)]
struct InLines {
    pretty: PrettyFormatter<'static>,
    /// Lists around the place that is written.
    lists: usize,
}

impl Formatter for InLines {
    fn begin_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.lists += 1;
        if self.lists > 1 { writer.write_all(b"[") } else { self.pretty.begin_array(writer) }
    }

    fn end_array<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.lists -= 1;
        if self.lists > 0 { writer.write_all(b"]") } else { self.pretty.end_array(writer) }
    }

    fn begin_array_value<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if self.lists > 1 { separate(writer, first) } else { self.pretty.begin_array_value(writer, first) }
    }

    fn end_array_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.lists > 1 { Ok(()) } else { self.pretty.end_array_value(writer) }
    }

    fn begin_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.lists > 0 { writer.write_all(b"{") } else { self.pretty.begin_object(writer) }
    }

    fn end_object<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.lists > 0 { writer.write_all(b"}") } else { self.pretty.end_object(writer) }
    }

    fn begin_object_key<W: ?Sized + Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        if self.lists > 0 { separate(writer, first) } else { self.pretty.begin_object_key(writer, first) }
    }

    fn begin_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.pretty.begin_object_value(writer)
    }

    fn end_object_value<W: ?Sized + Write>(&mut self, writer: &mut W) -> io::Result<()> {
        if self.lists > 0 { Ok(()) } else { self.pretty.end_object_value(writer) }
    }
}

fn separate<W: ?Sized + Write>(writer: &mut W, first: bool) -> io::Result<()> {
    if first { Ok(()) } else { writer.write_all(b", ") }
}

/// Reads a file; what does not fit is an error with its JSON pointer, line and column.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T, DatasetError> {
    parse(path, &read_at_most(path, MAX_JSON_BYTES).map_err(FileError::io("read", path))?)
}

/// Reads a file of the format `expected`. Another format is [`DatasetError::Format`], whatever else differs from what
/// this version reads.
pub fn read_format<T: DeserializeOwned>(path: &Path, expected: &'static str) -> Result<T, DatasetError> {
    let text = read_at_most(path, MAX_JSON_BYTES).map_err(FileError::io("read", path))?;
    parse_format(path, &text, expected)
}

/// Parses the bytes of a file of the format `expected`; `path` is for the error alone.
pub fn parse_format<T: DeserializeOwned>(path: &Path, text: &[u8], expected: &'static str) -> Result<T, DatasetError> {
    // A text without a format, or without JSON, fails below.
    match serde_json::from_slice::<Head>(without_mark(text)) {
        Ok(head) if head.format != expected => {
            Err(DatasetError::Format { path: path.to_owned(), found: shortened(&head.format), expected })
        }
        _ => parse(path, text),
    }
}

#[derive(Deserialize)]
struct Head {
    format: String,
}

/// Parses the bytes of a file; `path` is for the error alone.
pub fn parse<T: DeserializeOwned>(path: &Path, text: &[u8]) -> Result<T, DatasetError> {
    let text = without_mark(text);
    let mut reader = serde_json::Deserializer::from_slice(text);
    // Every type is compiled for this one deserializer: a second one, without paths, would be a quarter of the build.
    let parsed = serde_path_to_error::deserialize::<_, T>(&mut reader)
        .map_err(|fault| (pointer(fault.path()), fault.into_inner()));
    let parsed = parsed.and_then(|value| reader.end().map(|()| value).map_err(|error| (String::new(), error)));
    parsed.map_err(|(place, error)| invalid(path, place, format!("{}{}", in_words(&error.to_string()), hint(text))))
}

/// The JSON pointer of a fault; empty where the text is no JSON at all, or the fault is in the whole of it.
fn pointer(place: &serde_path_to_error::Path) -> String {
    let step = |segment: &Segment| match segment {
        Segment::Map { key } => Some(key.replace('~', "~0").replace('/', "~1")),
        Segment::Seq { index } => Some(index.to_string()),
        // Which variant of an enum was chosen is no place of a file.
        Segment::Enum { .. } | Segment::Unknown => None,
    };
    place.iter().filter_map(step).map(|step| format!("/{step}")).collect()
}

fn invalid(path: &Path, place: String, message: String) -> DatasetError {
    DatasetError::invalid(
        path,
        "bad_json",
        place,
        message,
        "fix the file; `mateval prep verify` lists every fault of a dataset",
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_carry_path_and_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("targets.json");
        std::fs::write(&path, "{\n \"format\": 3}").unwrap();
        let text = read::<crate::dataset::TargetsFile>(&path).unwrap_err().to_string();
        assert!(text.contains("targets.json") && text.contains("line 2"), "{text}");
    }

    #[test]
    fn elements_of_lists_have_a_line_each() {
        let value =
            serde_json::json!({"a": {"b": 1}, "empty": [], "list": [{"c": [1, 2], "d": {"e": null}}, {"c": []}]});
        let expected = concat!(
            "{\n  \"a\": {\n    \"b\": 1\n  },\n  \"empty\": [],\n  \"list\": [\n",
            "    {\"c\": [1, 2], \"d\": {\"e\": null}},\n    {\"c\": []}\n  ]\n}\n"
        );
        assert_eq!(to_lines(&value), expected);
        assert_eq!(serde_json::from_str::<serde_json::Value>(expected).unwrap(), value);
    }

    #[test]
    fn faults_carry_their_json_pointer() {
        type Nested = std::collections::BTreeMap<String, Vec<std::collections::BTreeMap<String, u8>>>;
        for (text, expected) in
            [(r#"{"a/b": [{}, {"c": 1, "d": "x"}]}"#, "/a~1b/1/d"), (r#"{"a": 3}"#, "/a"), ("[]", ""), ("{", "")]
        {
            let error = parse::<Nested>(Path::new("a.json"), text.as_bytes()).unwrap_err();
            let DatasetError::Invalid { findings, .. } = error else { panic!("{text}: {error}") };
            assert_eq!(findings[0].place, expected, "{text}");
        }
    }

    #[test]
    fn marks_are_skipped_and_other_files_named() {
        let parsed = |bytes: &[u8]| parse::<Vec<u8>>(Path::new("a.json"), bytes).map_err(|error| error.to_string());
        assert_eq!(parsed(b"\xef\xbb\xbf[1]").unwrap(), [1]);
        let pointer = b"version https://git-lfs.github.com/spec/v1\n";
        assert!(parsed(pointer).unwrap_err().contains("Git LFS pointer"));
        assert!(parsed(b"\xff\xfe[\x001\0]\0").unwrap_err().contains("UTF-16"));
    }

    #[test]
    fn another_format_is_named_before_any_other_fault() {
        let parsed = |text: &str| {
            let result = parse_format::<crate::dataset::TargetsFile>(Path::new("t"), text.as_bytes(), "mateval/3");
            result.map(|_| ()).map_err(|error| error.to_string())
        };
        let other = parsed(r#"{"an_unknown_key": 3, "format": "other/2"}"#).unwrap_err();
        assert!(other.contains("'other/2'") && other.contains("'mateval/3'"), "{other}");
        for text in ["[]", "{", "{}", r#"{"format": 3}"#, r#"{"format": "mateval/3", "an_unknown_key": 3}"#] {
            let error = parsed(text).unwrap_err();
            assert!(error.contains("bad_json"), "{text}: {error}");
        }
    }

    #[test]
    fn nesting_is_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep.json");
        std::fs::write(&path, "[".repeat(100_000)).unwrap();
        assert!(read::<serde_json::Value>(&path).is_err());
    }
}
