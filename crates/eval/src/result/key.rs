//! The keys of a result, as in `rgb_true_specular.novel.psnr`: the one place that prints and parses them, with the
//! metrics, which direction of them is better, and how they are displayed.

use std::cmp::Ordering;
use std::fmt;
use std::str::FromStr;

use mateval_dataset::ViewId;
use mateval_dataset::submission::Map;
use mateval_metrics::Net;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use mateval_dataset::word_enum::UnknownWord;
use mateval_dataset::{by_text, word_enum};
use mateval_files::untrusted::quoted;

/// The better direction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Better {
    /// Lower is better, as with errors.
    Lower,
    /// Higher is better, as with similarities.
    Higher,
}

impl Better {
    /// The factor after which the greater of two values is the better one.
    pub fn sign(self) -> f64 {
        match self {
            Self::Lower => -1.0,
            Self::Higher => 1.0,
        }
    }
}

word_enum! {
    /// A kind of score: the last word of a result's key.
    Metric, a "metric":
    Mse = "mse",
    Mae = "mae",
    /// Peak signal-to-noise ratio, in dB.
    Psnr = "psnr",
    Ssim = "ssim",
    LpipsAlex = "lpips_alex",
    /// NVIDIA's LDR-FLIP, at 67 pixels a degree.
    Flip = "flip",
    /// CIEDE2000, the mean over pixels.
    DeltaE = "delta_e",
}

/// The network of [`Metric::LpipsAlex`].
pub const LPIPS_NET: Net = Net::Alex;

/// A difference of roughness or metallic of at most this counts as none: half a byte's step, which no file of bytes can
/// avoid (0.5 is stored as 128 of 255), and a hundredth of that for rounding.
pub const HALF_A_BYTE: f32 = 0.505 / 255.0;

/// How a number is displayed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NumberStyle {
    /// Title of a table's column, with the unit.
    pub title: &'static str,
    /// The factor by which values are multiplied for display.
    pub scale: f64,
    /// Digits after the point.
    pub digits: usize,
}

impl NumberStyle {
    /// The value as text.
    pub fn text(&self, value: f64) -> String {
        format!("{:.*}", self.digits, value * self.scale)
    }
}

impl Metric {
    pub const fn better(self) -> Better {
        match self {
            Self::Mse | Self::Mae | Self::LpipsAlex | Self::Flip | Self::DeltaE => Better::Lower,
            Self::Psnr | Self::Ssim => Better::Higher,
        }
    }

    /// Title, scale and digits. The paper prints MSE in units of 1e-3.
    pub const fn style(self) -> NumberStyle {
        match self {
            Self::Mse => NumberStyle { title: "MSE (1e-3)", scale: 1e3, digits: 3 },
            Self::Mae => NumberStyle { title: "MAE", scale: 1.0, digits: 4 },
            Self::Psnr => NumberStyle { title: "PSNR", scale: 1.0, digits: 2 },
            Self::Ssim => NumberStyle { title: "SSIM", scale: 1.0, digits: 4 },
            Self::LpipsAlex => NumberStyle { title: "LPIPS", scale: 1.0, digits: 4 },
            Self::Flip => NumberStyle { title: "FLIP", scale: 1.0, digits: 4 },
            Self::DeltaE => NumberStyle { title: "CIEDE2000", scale: 1.0, digits: 3 },
        }
    }

    /// The largest difference of a value between two processors: the last digits of LPIPS depend on them.
    pub const fn tolerance(self) -> f64 {
        match self {
            Self::LpipsAlex => 1e-5,
            _ => 0.0,
        }
    }
}

word_enum! {
    /// What is compared with the truth.
    PictureKind, a "kind of picture":
    /// Pictures of the base colour.
    Albedo = "albedo",
    /// Pictures of the base colour, each channel multiplied by the scale that fits the truth best.
    AlbedoAligned = "albedo_aligned",
    /// Renders under the scene's own lights.
    RgbTrue = "rgb_true",
    /// Renders under lights that are fitted to the input view.
    RgbFitted = "rgb_fitted",
    /// Renders under the scene's own lights with other weights.
    RgbRelit = "rgb_relit",
    Roughness = "roughness",
    Metallic = "metallic",
    /// The texels of base colour.
    TextureBaseColor = "texture_base_color",
}

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
    /// The valid pixels of the other views from its place.
    Novel = "novel",
    /// Texels that the input view sees.
    Observed = "observed",
    /// Pixels of the other views from its place, or texels, that the input view does not see.
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

impl PictureKind {
    /// The title for display.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Albedo => "Albedo",
            Self::AlbedoAligned => "Aligned albedo",
            Self::RgbTrue => "RGB, true light",
            Self::RgbFitted => "RGB, fitted light",
            Self::RgbRelit => "RGB, relit",
            Self::Roughness => "Roughness",
            Self::Metallic => "Metallic",
            Self::TextureBaseColor => "Base colour texels",
        }
    }

    /// The map that it shows; none for light, which comes from all of them.
    pub const fn map(self) -> Option<Map> {
        match self {
            Self::Albedo | Self::AlbedoAligned | Self::TextureBaseColor => Some(Map::BaseColor),
            Self::Roughness => Some(Map::Roughness),
            Self::Metallic => Some(Map::Metallic),
            Self::RgbTrue | Self::RgbFitted | Self::RgbRelit => None,
        }
    }

    /// Whether it is rendered light, whose errors are estimated without render noise.
    pub const fn is_light(self) -> bool {
        matches!(self, Self::RgbTrue | Self::RgbFitted | Self::RgbRelit)
    }
}

impl Surfaces {
    /// The title for display.
    pub const fn title(self) -> &'static str {
        match self {
            Self::All => "All surfaces",
            Self::Specular => "Specular regions",
        }
    }

    /// The end of a picture's name.
    const fn suffix(self) -> &'static str {
        match self {
            Self::All => "",
            Self::Specular => "_specular",
        }
    }
}

impl Views {
    /// The title for display.
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct PictureName {
    pub kind: PictureKind,
    pub surfaces: Surfaces,
}

/// Which mean of a result a number is: `<picture>.<views>.<metric>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct ResultKey {
    /// What is compared and on which surfaces.
    pub picture: PictureName,
    pub views: Views,
    pub metric: Metric,
}

const fn psnr(kind: PictureKind, views: Views) -> ResultKey {
    ResultKey::whole(kind, views, Metric::Psnr)
}

/// The headline numbers of `mateval-3`.
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

/// The headline numbers of `paper`.
pub const PAPER_HEADLINE: [ResultKey; 4] = [
    psnr(PictureKind::RgbFitted, Views::Input),
    psnr(PictureKind::RgbFitted, Views::Novel),
    psnr(PictureKind::Albedo, Views::Input),
    psnr(PictureKind::Albedo, Views::Novel),
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

    /// The two words whose concatenation is the printed name.
    const fn parts(self) -> [&'static str; 2] {
        [self.kind.word(), self.surfaces.suffix()]
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

    fn parts(self) -> [&'static str; 6] {
        let [kind, suffix] = self.picture.parts();
        [kind, suffix, ".", self.views.word(), ".", self.metric.word()]
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
        self.parts().iter().try_for_each(|part| f.write_str(part))
    }
}

impl fmt::Display for ResultKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.parts().iter().try_for_each(|part| f.write_str(part))
    }
}

by_text!(PictureName, UnknownWord, "^[a-z_]+$");
by_text!(ResultKey, BadResultKey, "^[a-z_]+\\.[a-z_]+\\.[a-z0-9_]+$");

fn by_letters(a: &[&'static str], b: &[&'static str]) -> Ordering {
    let letters = |parts: &[&'static str]| parts.iter().flat_map(|part| part.bytes()).collect::<Vec<_>>();
    letters(a).cmp(&letters(b))
}

impl Ord for PictureName {
    fn cmp(&self, other: &Self) -> Ordering {
        by_letters(&self.parts(), &other.parts())
    }
}

impl PartialOrd for PictureName {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// The headline numbers first, all others in the order of their texts: the order of a result's keys.
impl Ord for ResultKey {
    fn cmp(&self, other: &Self) -> Ordering {
        let place = |key: &Self| HEADLINE.iter().position(|headline| headline == key).unwrap_or(HEADLINE.len());
        place(self).cmp(&place(other)).then_with(|| by_letters(&self.parts(), &other.parts()))
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

    #[test]
    fn lpips_has_its_networks_word() {
        assert_eq!(Metric::LpipsAlex.word(), LPIPS_NET.key());
    }

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
        assert_eq!(keys.len(), 8 * 2 * 6 * Metric::ALL.len());
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

    /// The published example of a result holds only known keys; its twins with an unknown word are refused.
    #[test]
    fn the_published_example_holds_known_keys_alone() {
        let text = include_str!("../../../../dataset_spec/examples/result.json");
        let read = |text: &str| serde_json::from_str::<crate::result::ResultFile>(text).map_err(|e| e.to_string());
        assert!(read(text).unwrap().protocols["mateval-3"].summary.len() >= 4);
        for twin in ["albedo.input.mze", "albido.input.mse", "albedo.inputs.mse"] {
            let error = read(&text.replace("albedo.input.mse", twin)).unwrap_err();
            assert!(error.contains(&format!("'{twin}' is not a key of a result")), "{error}");
        }
    }
}
