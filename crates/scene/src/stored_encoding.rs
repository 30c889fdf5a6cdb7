//! Transfer functions of the numbers that other projects' networks store in pictures.

use mateval_image::transfer::linear_from_srgb;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Transfer function of stored numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StoredEncoding {
    /// Linear.
    Linear,
    /// IEC 61966-2-1.
    Srgb,
    /// A power of 2.2.
    Gamma22,
}

impl StoredEncoding {
    /// All encodings.
    pub const ALL: [Self; 3] = [Self::Linear, Self::Srgb, Self::Gamma22];

    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Srgb => "srgb",
            Self::Gamma22 => "gamma22",
        }
    }

    /// The linear value of a stored number; negative numbers count as 0.
    pub fn decode(self, stored: f32) -> f32 {
        let stored = stored.max(0.0);
        match self {
            Self::Linear => stored,
            Self::Srgb => linear_from_srgb(stored),
            Self::Gamma22 => libm::powf(stored, 2.2),
        }
    }
}

impl std::fmt::Display for StoredEncoding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.word())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 0.5 encoded: 0.5, 0.2140 (IEC 61966-2-1) and 0.5^2.2 = 0.2176.
    #[test]
    fn known_values() {
        let decoded = StoredEncoding::ALL.map(|encoding| encoding.decode(0.5));
        for (found, expected) in decoded.into_iter().zip([0.5, 0.214_041, 0.217_638]) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
        assert_eq!(StoredEncoding::Gamma22.decode(-1.0), 0.0);
        for encoding in StoredEncoding::ALL {
            assert_eq!(serde_json::to_value(encoding).unwrap(), encoding.word());
        }
    }
}
