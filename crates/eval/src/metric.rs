//! The metrics of results: their names, which direction is better, and how they are displayed.

use mateval_metrics::Net;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::word_enum::word_enum;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lpips_has_its_networks_word() {
        assert_eq!(Metric::LpipsAlex.word(), LPIPS_NET.key());
    }
}
