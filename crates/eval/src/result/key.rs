//! The keys of a result, as in `rgb_true_specular.novel.psnr`: the one place that prints and parses them.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use mateval_dataset::word_enum::UnknownWord;
use mateval_dataset::{ViewId, by_text, word_enum};
use mateval_files::untrusted::quoted;
use serde::{Deserialize, Serialize};

use crate::metric::{Metric, PictureKind};

word_enum! {
    Surfaces, a "kind of surfaces":
    All = "all",
    /// Those that are metal or smooth in truth.
    Specular = "specular",
}

word_enum! {
    /// Which views a number is a mean over, and which of their pixels count; or which texels.
    Views, a "kind of views":
    /// The valid pixels of the input view.
    Input = "input",
    /// The valid pixels of the other views from its place, or of a captured scene's other photos.
    Novel = "novel",
    /// Texels that the input view sees.
    Observed = "observed",
    /// Pixels of those other views, or texels, that the input view does not see.
    Unobserved = "unobserved",
    /// The valid pixels of views from other places.
    Wide = "wide",
    /// Those of them that the input view does not see.
    WideUnobserved = "wide_unobserved",
}

word_enum! {
    /// Which pixels of a picture count.
    Region, a "region":
    /// All that `valid.png` holds.
    Valid = "valid",
    /// Those of them that the input view does not see.
    Unobserved = "unobserved",
}

impl Surfaces {
    pub const fn title(self) -> &'static str {
        match self {
            Self::All => "All surfaces",
            Self::Specular => "Specular regions",
        }
    }

    const fn suffix(self) -> &'static str {
        match self {
            Self::All => "",
            Self::Specular => "_specular",
        }
    }
}

impl Views {
    pub const fn title(self) -> &'static str {
        match self {
            Self::Input => "Input view",
            Self::Novel => "Novel views",
            Self::Observed => "Observed",
            Self::Unobserved => "Unobserved",
            Self::Wide => "Wide views",
            Self::WideUnobserved => "Unobserved in wide views",
        }
    }

    /// The views that a region of one view counts for.
    pub fn of(view: &ViewId, region: Region) -> Self {
        match region {
            Region::Valid if view.is_wide() => Self::Wide,
            Region::Unobserved if view.is_wide() => Self::WideUnobserved,
            Region::Unobserved => Self::Unobserved,
            Region::Valid if view.as_str() == mateval_dataset::layout::INPUT => Self::Input,
            Region::Valid => Self::Novel,
        }
    }
}

/// What is compared and on which surfaces, as in `albedo` or `rgb_true_specular`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct PictureName {
    pub kind: PictureKind,
    pub surfaces: Surfaces,
}

/// Which mean of a result a number is: `<picture>.<views>.<metric>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ResultKey {
    pub picture: PictureName,
    pub views: Views,
    pub metric: Metric,
}

const fn psnr(kind: PictureKind, views: Views) -> ResultKey {
    ResultKey::whole(kind, views, Metric::Psnr)
}

pub const HEADLINE: [ResultKey; 8] = [
    psnr(PictureKind::Albedo, Views::Novel),
    psnr(PictureKind::RgbTrue, Views::Novel),
    psnr(PictureKind::Albedo, Views::Input),
    psnr(PictureKind::Albedo, Views::Unobserved),
    psnr(PictureKind::AlbedoAligned, Views::Novel),
    psnr(PictureKind::RgbTrue, Views::Input),
    psnr(PictureKind::RgbRelit, Views::Novel),
    ResultKey::whole(PictureKind::Albedo, Views::Novel, Metric::LpipsAlex),
];

pub const PAPER_HEADLINE: [ResultKey; 4] = [
    psnr(PictureKind::RgbFitted, Views::Input),
    psnr(PictureKind::RgbFitted, Views::Novel),
    psnr(PictureKind::Albedo, Views::Input),
    psnr(PictureKind::Albedo, Views::Novel),
];

pub const CAPTURE_HEADLINE: [ResultKey; 5] = [
    ResultKey::whole(PictureKind::Measured, Views::Input, Metric::RegionDeltaE),
    ResultKey::whole(PictureKind::Measured, Views::Input, Metric::MawIntensity),
    ResultKey::whole(PictureKind::Measured, Views::Input, Metric::MawChromaticity),
    psnr(PictureKind::RgbFitted, Views::Input),
    psnr(PictureKind::RgbFitted, Views::Novel),
];

/// A text that is not a key of a result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum BadResultKey {
    /// It has fewer or more than three words.
    #[error("{} is not a key of a result; expected <picture>.<views>.<metric>", quoted(.0))]
    Shape(String),
    /// One of its words is unknown.
    #[error("{} is not a key of a result: {source}", quoted(key))]
    Word { key: String, source: UnknownWord },
}

impl PictureName {
    /// That kind of picture, on all surfaces.
    pub const fn whole(kind: PictureKind) -> Self {
        Self { kind, surfaces: Surfaces::All }
    }
}

impl ResultKey {
    /// Of a picture on all surfaces.
    pub const fn whole(kind: PictureKind, views: Views, metric: Metric) -> Self {
        Self { picture: PictureName::whole(kind), views, metric }
    }

    /// The same mean by another metric.
    pub const fn with(self, metric: Metric) -> Self {
        Self { metric, ..self }
    }
}

impl FromStr for PictureName {
    type Err = UnknownWord;

    fn from_str(text: &str) -> Result<Self, UnknownWord> {
        let specular = Surfaces::Specular;
        let (kind, surfaces) =
            text.strip_suffix(specular.suffix()).map_or((text, Surfaces::All), |kind| (kind, specular));
        Ok(Self { kind: kind.parse()?, surfaces })
    }
}

impl FromStr for ResultKey {
    type Err = BadResultKey;

    fn from_str(text: &str) -> Result<Self, BadResultKey> {
        let words: Vec<&str> = text.split('.').collect();
        let [picture, views, metric] = words.as_slice() else { return Err(BadResultKey::Shape(text.to_owned())) };
        let bad = |source| BadResultKey::Word { key: text.to_owned(), source };
        Ok(Self {
            picture: picture.parse().map_err(bad)?,
            views: views.parse().map_err(bad)?,
            metric: metric.parse().map_err(bad)?,
        })
    }
}

impl fmt::Display for PictureName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}", self.kind, self.surfaces.suffix())
    }
}

impl fmt::Display for ResultKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}.{}", self.picture, self.views, self.metric)
    }
}

by_text!(PictureName, UnknownWord, "^[a-z_]+$");
by_text!(ResultKey, BadResultKey, "^[a-z_]+\\.[a-z_]+\\.[a-z0-9_]+$");

/// The headline numbers first, all others in the order of their texts: the order of a result's keys.
impl Ord for ResultKey {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |key: &Self| HEADLINE.iter().position(|headline| headline == key).unwrap_or(HEADLINE.len());
        place(self).cmp(&place(other)).then_with(|| self.to_string().cmp(&other.to_string()))
    }
}

impl PartialOrd for ResultKey {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> Vec<ResultKey> {
        let mut keys = Vec::new();
        for &kind in PictureKind::ALL {
            for &surfaces in Surfaces::ALL {
                for &views in Views::ALL {
                    let picture = PictureName { kind, surfaces };
                    keys.extend(Metric::ALL.iter().map(|&metric| ResultKey { picture, views, metric }));
                }
            }
        }
        keys
    }

    #[test]
    fn keys_are_parsed_from_what_they_print() {
        let keys = all();
        assert_eq!(keys.iter().map(ResultKey::to_string).collect::<std::collections::BTreeSet<_>>().len(), keys.len());
        for key in &keys {
            assert_eq!(key.to_string().parse(), Ok(*key));
            let json = serde_json::to_string(key).unwrap();
            assert_eq!((json.as_str(), serde_json::from_str(&json).unwrap()), (format!("\"{key}\"").as_str(), *key));
        }
        let key = ResultKey {
            picture: PictureName { kind: PictureKind::RgbTrue, surfaces: Surfaces::Specular },
            views: Views::Novel,
            metric: Metric::Psnr,
        };
        assert_eq!(key.to_string(), "rgb_true_specular.novel.psnr");
    }

    #[test]
    fn headlines_come_first_and_then_the_order_of_texts() {
        let mut keys = all();
        keys.sort();
        let (first, rest) = keys.split_at(HEADLINE.len());
        assert_eq!(first, HEADLINE);
        let texts: Vec<String> = rest.iter().map(ResultKey::to_string).collect();
        let mut sorted = texts.clone();
        sorted.sort();
        sorted.dedup();
        assert_eq!(texts, sorted);
    }

    #[test]
    fn unknown_words_are_named() {
        for (text, unknown) in [
            ("albedo.novel.rmse", "'rmse' is not a metric; expected one of: mse, mae, psnr, "),
            ("albedo.behind.psnr", "'behind' is not a kind of views"),
            ("shading.novel.psnr", "'shading' is not a kind of picture"),
            ("albedo_specular_specular.novel.psnr", "'albedo_specular' is not a kind of picture"),
            ("albedo.novel", "expected <picture>.<views>.<metric>"),
            ("albedo.input./../../evil.psnr", "expected <picture>.<views>.<metric>"),
            ("a\nb.novel.psnr", "'a\\nb' is not a kind of picture"),
            ("", "expected <picture>.<views>.<metric>"),
        ] {
            let error = text.parse::<ResultKey>().unwrap_err().to_string();
            assert!(error.contains(unknown), "{error}");
        }
    }
}
