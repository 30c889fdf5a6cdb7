//! Ids of scenes, instances, parts, views and renderers, and the indices of instances and parts in pictures.

use std::borrow::Cow;
use std::collections::BTreeSet;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use mateval_files::untrusted::shortened;

/// The pattern of every id, which is safe as the name of a folder on every system.
const ID_PATTERN: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";

/// A text that is not an id.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{}' is not an id: expected 1 to 64 lower-case letters (a-z), digits, '-' and '_', beginning with a letter or \
     a digit",
    shortened(.0)
)]
pub struct BadId(pub String);

fn is_id(text: &str) -> bool {
    let bytes = text.as_bytes();
    let word = |b: &u8| b.is_ascii_lowercase() || b.is_ascii_digit();
    (1..=64).contains(&bytes.len()) && word(&bytes[0]) && bytes.iter().all(|b| word(b) || matches!(b, b'_' | b'-'))
}

/// Turns any text into an id: in lower case, with `-` for everything but letters, digits, `_` and `-`, and cut to 48
/// characters so that a number can be appended. `fallback` where nothing remains.
pub fn id_text_from(name: &str, fallback: &str) -> String {
    let mapped: String = name
        .chars()
        .map(|c| c.to_ascii_lowercase())
        .map(|c| if c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' { c } else { '-' })
        .collect();
    let trimmed: String = mapped.trim_matches(|c| c == '-' || c == '_').chars().take(48).collect();
    if trimmed.is_empty() { fallback.to_owned() } else { trimmed }
}

/// `name`, or the first of `name-2`, `name-3`, ... (with `separator`) that is not in `taken`, to which it is added.
pub fn unused_name(name: &str, separator: char, taken: &mut BTreeSet<String>) -> String {
    let numbered = (2..).map(|number| format!("{name}{separator}{number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    names.find(|name| taken.insert(name.clone())).expect("taken names are finitely many")
}

/// A count with its noun: `1 scene`, `2 scenes`.
pub fn counted(count: usize, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// Ids as sentences list them: `'a', 'b'`.
pub fn quoted<I: std::fmt::Display>(ids: &[I]) -> String {
    ids.iter().map(|id| format!("'{id}'")).collect::<Vec<_>>().join(", ")
}

macro_rules! id_type {
    ($(#[$doc:meta])* $name:ident) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(try_from = "String", into = "String")]
        pub struct $name(String);

        impl $name {
            /// Checks the text against the pattern of ids.
            pub fn new(text: impl Into<String>) -> Result<Self, BadId> {
                let text = text.into();
                if is_id(&text) { Ok(Self(text)) } else { Err(BadId(text)) }
            }

            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl TryFrom<String> for $name {
            type Error = BadId;
            fn try_from(text: String) -> Result<Self, BadId> {
                Self::new(text)
            }
        }

        impl std::str::FromStr for $name {
            type Err = BadId;
            fn from_str(text: &str) -> Result<Self, BadId> {
                Self::new(text)
            }
        }

        impl From<$name> for String {
            fn from(id: $name) -> String {
                id.0
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(&self.0)
            }
        }

        impl JsonSchema for $name {
            fn schema_name() -> Cow<'static, str> {
                stringify!($name).into()
            }
            fn json_schema(_: &mut SchemaGenerator) -> Schema {
                json_schema!({ "type": "string", "pattern": ID_PATTERN })
            }
        }
    };
}

id_type!(
    /// A scene's id: its folder in the dataset and in a submission.
    SceneId
);
id_type!(
    /// An instance's id: its folder in a submission and its glTF node name.
    InstanceId
);
id_type!(
    /// A part's id, unique in its set: its glTF node name.
    PartId
);
id_type!(
    /// The id of a set of parts that was made elsewhere, as in `partfield`.
    PartSetId
);
id_type!(
    /// A view's id, as in `input`, `up_left` or `wide_1`.
    ViewId
);

impl ViewId {
    /// The input view's id.
    pub const INPUT: &str = "input";

    /// How the ids of views from other places than the input view's begin, and those of no other view. A result names
    /// views by id alone; the prefix decides which means a view enters.
    pub const WIDE: &str = "wide_";

    pub fn input() -> Self {
        Self(Self::INPUT.to_owned())
    }

    /// Whether it is the id of a view from another place than the input view's.
    pub fn is_wide(&self) -> bool {
        self.as_str().starts_with(Self::WIDE)
    }
}

id_type!(
    /// A renderer's id: a folder in `ground_truth/renders/`.
    RendererId
);

/// An instance's value in `instance.png`: 1 to 65535, where 0 stands for no instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct InstanceIndex(pub std::num::NonZeroU16);

/// A part's value in `part.png`: 1 to 65535, where 0 stands for no part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct PartIndex(pub std::num::NonZeroU16);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepts_ids_and_refuses_paths() {
        for good in ["a", "0", "wall-1", "sofa_2", &"x".repeat(64)] {
            assert!(InstanceId::new(good).is_ok(), "{good}");
        }
        for bad in ["", "-a", "_a", "A", "a/b", "..", "a.b", "ä", &"x".repeat(65), "a\n"] {
            assert!(InstanceId::new(bad).is_err(), "{bad}");
        }
        assert_eq!(ViewId::new(ViewId::INPUT), Ok(ViewId::input()));
    }

    #[test]
    fn any_name_becomes_an_id() {
        for (name, id) in [("Mesh 206", "mesh-206"), ("植物", "thing"), ("../x", "x"), ("-", "thing")] {
            let text = id_text_from(name, "thing");
            assert_eq!(text, id);
            assert!(InstanceId::new(text).is_ok());
        }
    }

    #[test]
    fn unused_names_are_unique() {
        let mut taken = BTreeSet::new();
        let ids = ["a", "a", "b", "a", "a-2"].map(|id| unused_name(id, '-', &mut taken));
        assert_eq!(ids, ["a", "a-2", "b", "a-3", "a-2-2"]);
    }
}
