//! The types that the supported nodes pass on, and constants of these types.

/// An enum whose variants have words in files and reports.
macro_rules! words {
    ($(#[$attribute:meta])* pub enum $name:ident { $($(#[$of_variant:meta])* $variant:ident = $word:literal,)* }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum $name { $($(#[$of_variant])* $variant),* }

        impl $name {
            pub const ALL: &[Self] = &[$(Self::$variant),*];

            pub fn word(self) -> &'static str {
                match self { $(Self::$variant => $word),* }
            }

            pub fn from_word(word: &str) -> Option<Self> {
                Self::ALL.iter().copied().find(|one| one.word() == word)
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.serialize_str(self.word())
            }
        }
    };
}
pub(crate) use words;

words! {
    /// The type of a value. `boolean`, `vector4`, `color4` and matrices are not supported.
    pub enum Type {
        Float = "float",
        /// A whole number, always a constant or a parameter.
        Integer = "integer",
        Vector2 = "vector2",
        Vector3 = "vector3",
        /// A linear colour.
        Color3 = "color3",
    }
}

impl Type {
    pub fn width(self) -> usize {
        match self {
            Self::Float | Self::Integer => 1,
            Self::Vector2 => 2,
            Self::Vector3 | Self::Color3 => 3,
        }
    }
}

/// Why a text is not a value of a type.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ValueError {
    #[error("expected {expected} numbers separated by commas, found {found}")]
    Count { expected: usize, found: usize },
    #[error("expected a finite number, found '{0}'")]
    NotANumber(String),
    #[error("expected a whole number, found '{0}'")]
    NotWhole(String),
}

/// A constant. All its numbers are finite, and those of an integer are whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Value {
    kind: Type,
    numbers: [f64; 3],
}

impl Value {
    /// A float; `None` where it is not finite.
    pub fn float(number: f64) -> Option<Self> {
        number.is_finite().then_some(Self { kind: Type::Float, numbers: [number, 0.0, 0.0] })
    }

    /// A value all of whose components are `number`, which must be finite.
    pub(crate) fn filled(kind: Type, number: f64) -> Self {
        debug_assert!(number.is_finite());
        Self { kind, numbers: [number; 3] }
    }

    /// A value of this type and these numbers, of which there are as many as the type is wide; `None` where one is not
    /// finite, or not whole in an integer.
    pub(crate) fn of_numbers(kind: Type, found: &[f64]) -> Option<Self> {
        let mut numbers = [0.0; 3];
        numbers[..kind.width()].copy_from_slice(found);
        let is_sound = |x: &f64| x.is_finite() && (kind != Type::Integer || x.fract() == 0.0);
        found.iter().all(is_sound).then_some(Self { kind, numbers })
    }

    /// Reads numbers separated by commas, as in `.mtlx` files.
    pub fn parse(kind: Type, text: &str) -> Result<Self, ValueError> {
        let found = text.split(',').count();
        if found != kind.width() {
            return Err(ValueError::Count { expected: kind.width(), found });
        }
        let mut numbers = [0.0; 3];
        for (number, part) in numbers.iter_mut().zip(text.split(',')) {
            *number = parse_number(kind, part.trim())?;
        }
        Ok(Self { kind, numbers })
    }

    pub fn kind(&self) -> Type {
        self.kind
    }

    pub fn numbers(&self) -> &[f64] {
        &self.numbers[..self.kind.width()]
    }
}

fn parse_number(kind: Type, text: &str) -> Result<f64, ValueError> {
    if kind == Type::Integer {
        return text.parse::<i32>().map(f64::from).map_err(|_| ValueError::NotWhole(shortened(text)));
    }
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(ValueError::NotANumber(shortened(text))),
    }
}

/// Prints as `.mtlx` files do; the text parses to the same value.
impl std::fmt::Display for Value {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (at, number) in self.numbers().iter().enumerate() {
            let comma = if at > 0 { ", " } else { "" };
            write!(f, "{comma}{number}")?;
        }
        Ok(())
    }
}

/// The first 60 characters of untrusted text, for messages on one line.
pub(crate) fn shortened(text: &str) -> String {
    const MOST: usize = 60;
    let plain = |c: char| if c.is_control() { ' ' } else { c };
    let mut out: String = text.chars().take(MOST).map(plain).collect();
    if text.chars().nth(MOST).is_some() {
        out.push_str("...");
    }
    out
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn only_finite_numbers_of_the_right_count_are_values() {
        assert_eq!(Value::parse(Type::Color3, "0.25, .5,1").unwrap().numbers(), [0.25, 0.5, 1.0]);
        for (kind, text) in [
            (Type::Float, "nan"),
            (Type::Float, "1e999"),
            (Type::Float, ""),
            (Type::Float, "1, 2"),
            (Type::Vector2, "1"),
            (Type::Integer, "2.5"),
            (Type::Integer, "99999999999"),
            (Type::Color3, "1, 2, inf"),
        ] {
            assert!(Value::parse(kind, text).is_err(), "{text}");
        }
    }

    #[test]
    fn untrusted_text_is_cut_and_stays_on_one_line() {
        assert_eq!(shortened("a\nb"), "a b");
        assert_eq!(shortened(&"x".repeat(1000)).len(), 63);
    }

    proptest! {
        #[test]
        fn printing_keeps_every_bit(numbers in prop::array::uniform3(-1e12..1e12_f64)) {
            let value = Value { kind: Type::Vector3, numbers };
            prop_assert_eq!(Value::parse(Type::Vector3, &value.to_string()).unwrap(), value);
        }
    }
}
