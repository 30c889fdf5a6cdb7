//! The metrics, one row each, and the kinds of pictures that they compare.
//!
//! A row states everything about its metric: results, tables, boards and section 3 of `dataset_spec/PROTOCOL.md` follow
//! from it. Squared errors alone are computed elsewhere: of maps by [`crate::materials::score`], of light by
//! [`crate::light::mse`]. A new metric is a file of the crate `metrics`, a row here, and that section again, which a
//! test of [`crate::protocol`] writes.

use mateval_dataset::submission::Map;
use mateval_dataset::word_enum;
use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::mask_rule::{MaskRule, ReferenceFeatures};
use mateval_metrics::measured::{RegionColors, maw_chromaticity, maw_intensity, region_delta_e};
use mateval_metrics::{Lpips, MetricError, Net, delta_e, flip, mae};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NumberStyle {
    /// Title of a table's column, with the unit.
    pub title: &'static str,
    /// The factor by which values are multiplied for display.
    pub scale: f64,
    pub digits: usize,
}

impl NumberStyle {
    pub fn text(&self, value: f64) -> String {
        format!("{:.*}", self.digits, value * self.scale)
    }
}

/// A value; absent where no pixel or window counts.
type Measured = Result<Option<f64>, MetricError>;

/// A picture of colours as metrics see it.
pub struct ColorPicture {
    pub linear: Picture<LinearRgb>,
    /// Clipped to 0..1 and encoded, for windows and networks.
    pub encoded: Picture<SrgbRgb>,
    /// What LPIPS compares of a reference, which many predictions share.
    features: ReferenceFeatures,
}

impl ColorPicture {
    pub fn new(linear: Picture<LinearRgb>) -> Self {
        Self { encoded: linear.to_srgb(), linear, features: ReferenceFeatures::default() }
    }
}

/// An encoded prediction and its reference, with what windows and networks need besides.
pub struct EncodedPair<'a> {
    pub prediction: &'a Picture<SrgbRgb>,
    pub reference: &'a ColorPicture,
    pub mask: &'a Mask,
    pub mask_rule: MaskRule,
    /// Without its weights LPIPS has no value.
    pub lpips: Option<&'a Lpips>,
}

/// How a metric is computed. All but errors compare whole views, since windows and networks look across a mask's edge.
pub enum Measure {
    /// From the mean squared error of each region, which light estimates without render noise.
    SquaredError,
    /// Of each region of a map, whose values are not colours.
    Scalars(fn(&Picture<f32>, &Picture<f32>, Option<&Mask>) -> Measured),
    /// Of linear colours, not clipped. Renders have none without noise.
    Linear(fn(&Picture<LinearRgb>, &Picture<LinearRgb>, &Mask) -> Measured),
    Encoded(fn(&EncodedPair<'_>) -> Measured),
    /// Of the means over regions whose colour was measured.
    Regions(fn(&[RegionColors]) -> Option<f64>),
    /// The same of the picture that MAW compares.
    MawRegions(fn(&[RegionColors]) -> Option<f64>),
}

pub enum Stated {
    /// Every processor computes the same bits.
    Exactly,
    /// With the protocol's decimals. `tolerance` is the largest difference between two processors.
    Rounded { tolerance: f64 },
}

pub struct MetricRow {
    pub style: NumberStyle,
    pub better: Better,
    pub of: &'static [&'static [PictureKind]],
    pub measure: Measure,
    pub stated: Stated,
    /// For `PROTOCOL.md`: source, and the rules that the source leaves open.
    pub definition: &'static str,
}

const ALBEDOS: &[PictureKind] = &[PictureKind::Albedo, PictureKind::AlbedoAligned];
const SCALARS: &[PictureKind] = &[PictureKind::Roughness, PictureKind::Metallic];
const COLOURS: &[PictureKind] = &[
    PictureKind::Albedo,
    PictureKind::AlbedoAligned,
    PictureKind::RgbTrue,
    PictureKind::RgbRelit,
    PictureKind::RgbFitted,
];
const TEXELS: &[PictureKind] = &[PictureKind::TextureBaseColor];
const MEASURED: &[PictureKind] = &[PictureKind::Measured];

const fn style(title: &'static str, scale: f64, digits: usize) -> NumberStyle {
    NumberStyle { title, scale, digits }
}

macro_rules! metrics {
    ($($variant:ident = $word:literal => $row:expr;)+) => {
        word_enum! {
            /// A kind of score: the last word of a result's key.
            Metric, a "metric":
            $($variant = $word,)+
        }

        impl Metric {
            pub const fn row(self) -> &'static MetricRow {
                match self {
                    $(Self::$variant => {
                        const ROW: MetricRow = $row;
                        &ROW
                    })+
                }
            }
        }
    };
}

// In the order of display.
metrics! {
    // The paper prints it in units of 1e-3.
    Mse = "mse" => MetricRow {
        style: style("MSE (1e-3)", 1e3, 3),
        better: Better::Lower,
        of: &[COLOURS, SCALARS, TEXELS],
        measure: Measure::SquaredError,
        stated: Stated::Exactly,
        definition: "mean squared error over the region's pixels and channels. Albedo: linear, not clipped. Roughness \
            and metallic: as for `mae`, and not of specular regions. Light: sections 7 and 8",
    };
    Mae = "mae" => MetricRow {
        style: style("MAE", 1.0, 4),
        better: Better::Lower,
        of: &[SCALARS],
        measure: Measure::Scalars(mae),
        stated: Stated::Exactly,
        definition: "mean absolute error over the region's pixels, of the values as they are; a pixel's difference of \
            at most 0.505/255 (half a byte and rounding, `scalar_tolerance`) counts as 0",
    };
    Psnr = "psnr" => MetricRow {
        style: style("PSNR", 1.0, 2),
        better: Better::Higher,
        of: &[COLOURS, TEXELS],
        measure: Measure::SquaredError,
        stated: Stated::Exactly,
        definition: "10 log10(1 / MSE) in dB, at most 100; of light section 8 bounds the MSE. `exact` marks an MSE of 0 without noise; it counts as \
            100 dB in means",
    };
    Ssim = "ssim" => MetricRow {
        style: style("SSIM", 1.0, 4),
        better: Better::Higher,
        of: &[COLOURS],
        measure: Measure::Encoded(|pair| Ok(pair.mask_rule.ssim(pair.prediction, &pair.reference.encoded, pair.mask)?.0)),
        stated: Stated::Exactly,
        definition: "Wang et al. 2004, of clipped, sRGB-encoded colours: 11x11 Gaussian window, sigma 1.5, K1 = 0.01, \
            K2 = 0.03, population covariance, mean over channels and over the windows that lie wholly inside the mask",
    };
    LpipsAlex = "lpips_alex" => MetricRow {
        style: style("LPIPS", 1.0, 4),
        better: Better::Lower,
        of: &[COLOURS],
        measure: Measure::Encoded(|EncodedPair { prediction, reference, mask, mask_rule, lpips }| match lpips {
            Some(lpips) => mask_rule.lpips(lpips, prediction, &reference.encoded, &reference.features, mask),
            None => Ok(None),
        }),
        // The last bits depend on the processor.
        stated: Stated::Rounded { tolerance: 1e-5 },
        definition: "Zhang et al. 2018, version 0.1, AlexNet, of clipped, sRGB-encoded colours: outside the mask the \
            prediction has the truth's pixels; the map of each stage is enlarged bilinearly to the picture's size; \
            the sum of the maps is averaged over the mask",
    };
    Flip = "flip" => MetricRow {
        style: style("FLIP", 1.0, 4),
        better: Better::Lower,
        of: &[&[PictureKind::RgbTrue]],
        measure: Measure::Encoded(|pair| flip(pair.prediction, &pair.reference.encoded, pair.mask)),
        stated: Stated::Rounded { tolerance: 0.0 },
        definition: "Andersson et al. 2020, LDR, of clipped, sRGB-encoded colours: 67.0206 pixels per degree, separable \
            filters as in `flip-evaluator`, edge pixels repeated beyond the border; outside the mask the prediction \
            has the truth's pixels; mean over the mask",
    };
    DeltaE = "delta_e" => MetricRow {
        style: style("CIEDE2000", 1.0, 3),
        better: Better::Lower,
        of: &[ALBEDOS],
        measure: Measure::Linear(delta_e),
        stated: Stated::Exactly,
        definition: "CIEDE2000 (Sharma et al. 2005): linear colours clipped to 0..1, CIE Lab under D65; mean over the \
            mask",
    };
    RegionDeltaE = "region_delta_e" => MetricRow {
        style: style("CIEDE2000", 1.0, 3),
        better: Better::Lower,
        of: &[MEASURED],
        measure: Measure::Regions(region_delta_e),
        stated: Stated::Exactly,
        definition: "CIEDE2000 between the mean predicted base colour of a region, linear, and its measured colour, \
            without any scale; Lab as colour-science has it by default; mean over regions, which count alike",
    };
    MawIntensity = "maw_intensity" => MetricRow {
        style: style("MAW intensity (1e-3)", 1e3, 3),
        better: Better::Lower,
        of: &[MEASURED],
        measure: Measure::MawRegions(maw_intensity),
        stated: Stated::Exactly,
        definition: "MAW's `si`, `mean`: squared difference of the means over channels after the one factor that fits \
            all regions of the picture; of MAW's 8-bit picture of 320x240; regions count by their pixels",
    };
    MawChromaticity = "maw_chromaticity" => MetricRow {
        style: style("MAW chromaticity", 1.0, 3),
        better: Better::Lower,
        of: &[MEASURED],
        measure: Measure::MawRegions(maw_chromaticity),
        stated: Stated::Exactly,
        definition: "MAW's `per_si`, `deltae`: CIEDE2000 after a factor for each region that makes its mean over \
            channels the measured one; of the same picture; regions count by their pixels",
    };
}

pub const LPIPS_NET: Net = Net::Alex;

/// A difference of roughness or metallic of at most this counts as none: half a byte's step, which no file of bytes can
/// avoid (0.5 is stored as 128 of 255), and a hundredth of that for rounding.
pub const HALF_A_BYTE: f32 = 0.505 / 255.0;

impl Metric {
    /// The metrics of a kind of picture.
    pub(crate) fn of(kind: PictureKind) -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied().filter(move |metric| metric.row().of.iter().any(|kinds| kinds.contains(&kind)))
    }

    /// The largest difference of a value between two processors.
    pub(crate) const fn tolerance(self) -> f64 {
        match self.row().stated {
            Stated::Exactly => 0.0,
            Stated::Rounded { tolerance } => tolerance,
        }
    }

    pub const fn better(self) -> Better {
        self.row().better
    }

    pub const fn style(self) -> NumberStyle {
        self.row().style
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
    /// The mean base colour of regions whose colour was measured.
    Measured = "measured",
}

impl PictureKind {
    /// What tables, boards and pages call it.
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
            Self::Measured => "Measured colours",
        }
    }

    /// The map that it shows; none for light, which comes from all of them.
    pub const fn map(self) -> Option<Map> {
        match self {
            Self::Albedo | Self::AlbedoAligned | Self::TextureBaseColor | Self::Measured => Some(Map::BaseColor),
            Self::Roughness => Some(Map::Roughness),
            Self::Metallic => Some(Map::Metallic),
            Self::RgbTrue | Self::RgbFitted | Self::RgbRelit => None,
        }
    }

    /// Whether it is rendered light, whose errors are estimated without render noise.
    pub const fn is_light(self) -> bool {
        self.map().is_none()
    }
}

/// The rows as a table of Markdown.
#[cfg(test)]
pub(crate) fn markdown() -> String {
    let row = |metric: &Metric| {
        let MetricRow { better, of, measure, definition, .. } = metric.row();
        let better = if *better == Better::Lower { "lower" } else { "higher" };
        let where_ = match measure {
            Measure::Linear(_) | Measure::Encoded(_) => "`input`, `novel`, `wide`",
            Measure::Regions(_) | Measure::MawRegions(_) => "`input`",
            Measure::SquaredError | Measure::Scalars(_) => "all",
        };
        let of: Vec<String> = of.iter().copied().flatten().map(|kind| format!("`{kind}`")).collect();
        format!("| `{metric}` | {better} | {} | {where_} | {definition} |\n", of.join(" "))
    };
    let rows: String = Metric::ALL.iter().map(row).collect();
    format!("| Metric | Better | Pictures | Views | Definition |\n|---|---|---|---|---|\n{rows}")
}
