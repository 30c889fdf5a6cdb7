//! What kinds of numbers there are: which way is better, and how they are shown.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Whether more is better.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Better {
    /// As of errors.
    Lower,
    /// As of likenesses.
    Higher,
}

impl Better {
    /// Of two values times this the greater one is better.
    pub fn sign(self) -> f64 {
        match self {
            Self::Lower => -1.0,
            Self::Higher => 1.0,
        }
    }
}

/// One kind of number.
#[derive(Debug)]
pub struct Metric {
    /// Last word of its key.
    pub key: &'static str,
    /// As a table's head has it.
    pub title: &'static str,
    /// What values are multiplied by to be shown.
    pub scale: f64,
    /// Digits after the point when shown.
    pub digits: usize,
    /// None for what is no score.
    pub better: Option<Better>,
}

/// The paper prints MSE in units of 1e-3.
pub const MSE: Metric = Metric { key: "mse", title: "MSE (1e-3)", scale: 1e3, digits: 3, better: Some(Better::Lower) };
/// In dB.
pub const PSNR: Metric = Metric { key: "psnr", title: "PSNR", scale: 1.0, digits: 2, better: Some(Better::Higher) };
/// Structural similarity.
pub const SSIM: Metric = Metric { key: "ssim", title: "SSIM", scale: 1.0, digits: 4, better: Some(Better::Higher) };
/// LPIPS by AlexNet.
pub const LPIPS: Metric =
    Metric { key: "lpips_alex", title: "LPIPS", scale: 1.0, digits: 4, better: Some(Better::Lower) };
/// A count of pixels, no score.
pub const PIXELS: Metric = Metric { key: "pixels", title: "Pixels", scale: 1.0, digits: 0, better: None };

/// The paper's four columns.
pub const SCORES: &[Metric] = &[MSE, PSNR, SSIM, LPIPS];

/// The score that a key of a result, as in `albedo.novel.psnr`, is of.
pub fn score_of_key(key: &str) -> Option<&'static Metric> {
    let (_, last) = key.rsplit_once('.')?;
    SCORES.iter().find(|metric| metric.key == last)
}
