//! Categories and materials of furniture from 3D-FUTURE's `model_info.json`, and guesses for models that it does not
//! list.

use std::collections::BTreeMap;

use mateval_scene::Severity;
use serde_json::Value;

use super::document::{kind, parse_any, text};
use super::house::FurnitureRecord;
use super::limits::Limits;
use crate::source_scene::Log;
use mateval_scene::super_categories::SUPER_CATEGORIES;

/// Words in categories and titles, and the super-categories that they imply. The first match counts.
const WORDS: [(&str, &str); 22] = [
    ("lamp", "Lighting"),
    ("light", "Lighting"),
    ("chandelier", "Lighting"),
    ("footstool", "Pier/Stool"),
    ("stool", "Pier/Stool"),
    ("pier", "Pier/Stool"),
    ("bench", "Pier/Stool"),
    ("sofa", "Sofa"),
    ("couch", "Sofa"),
    ("nightstand", "Cabinet/Shelf/Desk"),
    ("side table", "Cabinet/Shelf/Desk"),
    ("coffee table", "Table"),
    ("cabinet", "Cabinet/Shelf/Desk"),
    ("shelf", "Cabinet/Shelf/Desk"),
    ("desk", "Cabinet/Shelf/Desk"),
    ("wardrobe", "Cabinet/Shelf/Desk"),
    ("bookcase", "Cabinet/Shelf/Desk"),
    ("stand", "Cabinet/Shelf/Desk"),
    ("chair", "Chair"),
    ("table", "Table"),
    ("bed", "Bed"),
    ("mattress", "Bed"),
];

/// Rows of `model_info.json` by model id.
#[derive(Clone, Debug, Default)]
pub(super) struct ModelInfo {
    rows: BTreeMap<String, Row>,
}

#[derive(Clone, Debug)]
struct Row {
    super_category: String,
    category: Option<String>,
    material: Option<String>,
}

/// The categories and the material of a piece of furniture.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Kind {
    pub(super) super_category: String,
    pub(super) category: Option<String>,
    /// Its main material, as in `Solid Wood`.
    pub(super) material: Option<String>,
    /// Whether `model_info.json` lists the model.
    pub(super) known: bool,
}

impl ModelInfo {
    /// Parses the file's text. Rows without a known super-category are skipped; a file that is not a list is a finding.
    pub(super) fn parse(bytes: &[u8], file: &str, limits: &Limits, log: &mut Log) -> Self {
        let mut warn = |message: String| {
            let action = "guessed categories from names";
            log.push(Severity::Warning, "bad_model_info", file, "", message, action);
        };
        let tree = match parse_any(bytes, limits) {
            Ok(tree) => tree,
            Err(error) => {
                warn(error.to_string());
                return Self::default();
            }
        };
        let Some(all) = tree.as_array() else {
            warn(format!("expected a list of rows with model_id and super-category, found {}", kind(&tree)));
            return Self::default();
        };
        let row = |row: &Value| {
            let known = text(row, "super-category")?;
            let super_category = SUPER_CATEGORIES.iter().find(|one| one.eq_ignore_ascii_case(known))?;
            let category = text(row, "category").map(tidy);
            let material = text(row, "material").map(str::to_owned);
            let super_category = (*super_category).to_owned();
            Some((text(row, "model_id")?.to_owned(), Row { super_category, category, material }))
        };
        // Rows are collected in reverse, so that the first of two rows for one model counts.
        let rows = all.iter().rev().filter_map(row).collect();
        Self { rows }
    }

    /// The categories of the piece that `record` describes.
    pub(super) fn kind(&self, record: &FurnitureRecord) -> Kind {
        let named = record.category.as_deref().map(tidy).or_else(|| {
            let title = record.title.as_deref()?;
            Some(tidy(title.rsplit('/').next().unwrap_or(title)))
        });
        if let Some(row) = self.rows.get(&record.jid) {
            let category = row.category.clone().or(named);
            let material = row.material.clone();
            return Kind { super_category: row.super_category.clone(), category, material, known: true };
        }
        let words = [record.category.as_deref(), record.title.as_deref()];
        let words = words.into_iter().flatten().collect::<Vec<_>>().join(" ").to_lowercase();
        let guess = WORDS.iter().find(|(word, _)| words.contains(word)).map_or("Others", |(_, kind)| kind);
        Kind { super_category: guess.to_owned(), category: named, material: None, known: false }
    }
}

/// The name without blanks around its slashes, in which the data's spellings differ.
fn tidy(name: &str) -> String {
    name.split('/').map(str::trim).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn record(jid: &str, category: Option<&str>, title: Option<&str>) -> FurnitureRecord {
        FurnitureRecord {
            uid: "u".into(),
            jid: jid.into(),
            valid: true,
            category: category.map(str::to_owned),
            title: title.map(str::to_owned),
            place: String::new(),
        }
    }

    #[test]
    fn the_list_takes_precedence_over_words() {
        let text = br#"[{"model_id": "a", "super-category": "Sofa", "category": "Three-Seat / Multi-seat Sofa", "material": "Suede"},
            {"model_id": "a", "super-category": "Bed"}, {"model_id": "b", "super-category": "chair", "category": null}, 7]"#;
        let mut log = Log::new("h".into(), 10);
        let info = ModelInfo::parse(text, "model_info.json", &Limits::default(), &mut log);
        assert!(log.into_findings().is_empty());
        let kind = |jid, category, title| {
            let kind = info.kind(&record(jid, category, title));
            (kind.super_category, kind.category.unwrap_or_default(), kind.known)
        };
        assert_eq!(kind("a", None, None), ("Sofa".into(), "Three-Seat/Multi-seat Sofa".into(), true));
        assert_eq!(kind("b", Some("Dining Chair"), None), ("Chair".into(), "Dining Chair".into(), true));
        assert_eq!(kind("c", Some("Floor Lamp"), None), ("Lighting".into(), "Floor Lamp".into(), false));
        assert_eq!(kind("c", None, Some("lighting/pendant")), ("Lighting".into(), "pendant".into(), false));
        assert_eq!(kind("c", Some("植物"), None), ("Others".into(), "植物".into(), false));
        assert_eq!(kind("c", None, None), ("Others".into(), String::new(), false));
        let materials = ["a", "b", "c"].map(|jid| info.kind(&record(jid, None, None)).material);
        assert_eq!(materials, [Some("Suede".to_owned()), None, None]);
    }

    #[test]
    fn a_file_that_is_not_a_list_is_reported() {
        let small = Limits { json_containers: 3, ..Limits::default() };
        for bad in [&b"{"[..], b"{}", b"7", b"[[],[],[]]"] {
            let mut log = Log::new("h".into(), 10);
            ModelInfo::parse(bad, "model_info.json", &small, &mut log);
            assert_eq!(log.into_findings()[0].code, "bad_model_info");
        }
    }
}
