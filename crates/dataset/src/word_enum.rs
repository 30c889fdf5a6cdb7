//! Macros for types that are words in files: [`word_enum!`](crate::word_enum!) for enums whose variants are words,
//! [`by_text!`](crate::by_text!) for types that print and parse themselves.

use mateval_files::untrusted::quoted;

/// A word that an enum does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} is not a {what}; expected one of: {expected}", quoted(.word))]
pub struct UnknownWord {
    /// The kind of word that was expected, as in "metric".
    pub what: &'static str,
    pub word: String,
    /// The words that are known, separated by commas.
    pub expected: String,
}

/// Defines an enum with `ALL`, `word`, `Display`, `FromStr`, serde and a schema. Variants compare as their words do, so
/// that maps of them are written in the order of the printed text; `ALL` keeps the order of the definition.
#[macro_export]
macro_rules! word_enum {
    (
        $(#[$meta:meta])*
        $name:ident, a $what:literal:
        $($(#[$variant_meta:meta])* $variant:ident = $word:literal,)+
    ) => {
        $(#[$meta])*
        #[derive(
            Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
        )]
        pub enum $name {
            $($(#[$variant_meta])* #[serde(rename = $word)] $variant,)+
        }

        impl $name {
            /// Every variant, in the order of display.
            pub const ALL: &'static [Self] = &[$(Self::$variant),+];

            /// The word for it in files.
            pub const fn word(self) -> &'static str {
                match self {
                    $(Self::$variant => $word,)+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(self.word())
            }
        }

        impl std::str::FromStr for $name {
            type Err = $crate::word_enum::UnknownWord;

            fn from_str(word: &str) -> Result<Self, Self::Err> {
                Self::ALL.iter().copied().find(|known| known.word() == word).ok_or_else(|| {
                    let expected = [$($word),+].join(", ");
                    $crate::word_enum::UnknownWord { what: $what, word: word.to_owned(), expected }
                })
            }
        }

        impl Ord for $name {
            fn cmp(&self, other: &Self) -> std::cmp::Ordering {
                self.word().cmp(other.word())
            }
        }

        impl PartialOrd for $name {
            fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
                Some(self.cmp(other))
            }
        }
    };
}

/// Serde and a schema by way of `Display` and `FromStr`. The pattern holds the shape alone: `dataset_spec/format`
/// lists the words.
#[macro_export]
macro_rules! by_text {
    ($name:ident, $error:ty, $pattern:literal) => {
        impl TryFrom<String> for $name {
            type Error = $error;

            fn try_from(text: String) -> Result<Self, $error> {
                text.parse()
            }
        }

        impl From<$name> for String {
            fn from(name: $name) -> Self {
                name.to_string()
            }
        }

        impl schemars::JsonSchema for $name {
            fn schema_name() -> std::borrow::Cow<'static, str> {
                stringify!($name).into()
            }

            fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
                schemars::json_schema!({ "type": "string", "pattern": $pattern })
            }
        }
    };
}
