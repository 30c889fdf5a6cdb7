//! What is known of a release besides its files, and how to cite it.

use std::str::FromStr;

use mateval_scene::dataset::DatasetFile;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Facts that the dataset does not hold.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Publication {
    /// The day of publication.
    pub date: Option<Day>,
    /// Where the dataset is published.
    pub url: Option<String>,
    /// The authors, separated by ` and ` as in BibTeX.
    pub authors: Option<String>,
}

/// A day, as in `2026-11-24`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "String", into = "String")]
pub struct Day(String);

/// A text that is not a day.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{}' is not a day; expected one as in 2026-11-24", mateval_scene::findings::shortened(.0))]
pub struct BadDay(String);

impl FromStr for Day {
    type Err = BadDay;

    fn from_str(text: &str) -> Result<Self, BadDay> {
        let parts: Vec<&str> = text.split('-').collect();
        let is_number = |part: &str, digits: usize| part.len() == digits && part.bytes().all(|b| b.is_ascii_digit());
        let within = |part: &str, most: u32| part.parse::<u32>().is_ok_and(|number| (1..=most).contains(&number));
        match parts[..] {
            [year, month, day]
                if is_number(year, 4)
                    && is_number(month, 2)
                    && is_number(day, 2)
                    && within(month, 12)
                    && within(day, 31) =>
            {
                Ok(Self(text.to_owned()))
            }
            _ => Err(BadDay(text.to_owned())),
        }
    }
}

impl TryFrom<String> for Day {
    type Error = BadDay;

    fn try_from(text: String) -> Result<Self, BadDay> {
        text.parse()
    }
}

impl From<Day> for String {
    fn from(day: Day) -> Self {
        day.0
    }
}

impl Day {
    /// The day as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

/// An entry for BibTeX. It names the manifest, so that the citation fixes every byte of the dataset.
pub fn bibtex(dataset: &DatasetFile, publication: &Publication) -> String {
    let manifest = &dataset.manifest_sha256;
    let date = publication.date.as_ref().map(Day::as_str);
    let title = format!("{}, version {}", escaped(&dataset.name), escaped(&dataset.version));
    let fields = [
        ("author", publication.authors.as_deref().map(escaped)),
        ("title", Some(format!("{{{title}}}"))),
        ("year", date.map(|date| date[..4].to_owned())),
        ("date", date.map(str::to_owned)),
        ("url", publication.url.clone().map(|url| url.replace(['{', '}', '\\'], ""))),
        ("note", Some(format!("Dataset, SHA-256 of its manifest: {manifest}"))),
    ];
    let lines = fields.into_iter().filter_map(|(name, value)| Some(format!("  {name:<6} = {{{}}},\n", value?)));
    format!("@misc{{{},\n{}}}\n", key(dataset), lines.collect::<String>())
}

/// The entry's key: the name and the beginning of the hash.
fn key(dataset: &DatasetFile) -> String {
    let name: String = dataset.name.chars().filter(char::is_ascii_alphanumeric).take(40).collect();
    let hash: String = dataset.manifest_sha256.chars().take(8).collect();
    format!("{}-{hash}", if name.is_empty() { "dataset" } else { &name })
}

/// The text in one line, with the characters escaped that TeX interprets.
fn escaped(text: &str) -> String {
    let one = |c: char| match c {
        '#' | '$' | '%' | '&' | '_' => format!("\\{c}"),
        '{' | '}' => String::new(),
        '\\' => "\\textbackslash ".to_owned(),
        '~' => "\\textasciitilde ".to_owned(),
        '^' => "\\textasciicircum ".to_owned(),
        c if c.is_control() => " ".to_owned(),
        c => c.to_string(),
    };
    text.chars().map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dataset(name: &str) -> DatasetFile {
        let text = serde_json::json!({
            "format": "mateval/3", "name": name, "version": "1.0", "tool": "mateval 0", "scenes": [],
            "photo_renderer": null, "licences": [], "manifest_sha256": "0123456789abcdef",
        });
        serde_json::from_value(text).unwrap()
    }

    #[test]
    fn days() {
        assert_eq!("2026-11-24".parse::<Day>().unwrap().as_str(), "2026-11-24");
        for bad in ["", "2026", "2026-13-01", "2026-1-1", "2026-01-00", "+026-01-01", "2026-01-01-01", "<b>"] {
            assert!(bad.parse::<Day>().is_err(), "{bad}");
        }
    }

    #[test]
    fn the_entry_names_the_manifest_and_stays_one() {
        let publication = Publication {
            date: "2026-11-24".parse().ok(),
            url: Some("https://example.org/a_b".to_owned()),
            authors: Some("A. Author and B. Author".to_owned()),
        };
        let entry = bibtex(&dataset("rooms_1}, author={x"), &publication);
        assert!(entry.starts_with("@misc{rooms1authorx-01234567,\n  author = {A. Author and B. Author},\n"), "{entry}");
        assert!(entry.contains("  title  = {{rooms\\_1, author=x, version 1.0}},\n"), "{entry}");
        assert!(entry.contains("0123456789abcdef") && entry.contains("  year   = {2026},\n"), "{entry}");
        let bare = bibtex(&dataset("♥"), &Publication::default());
        assert!(bare.starts_with("@misc{dataset-01234567,\n  title"), "{bare}");
        assert!(!bare.contains("year"), "{bare}");
    }
}
