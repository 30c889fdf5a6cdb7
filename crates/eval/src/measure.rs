//! The metrics of one picture under one protocol.

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{Lpips, MetricError, Psnr, mse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::mask_rule::Counted;
use crate::metric::Metric;
use crate::protocol::{AlbedoSpace, Protocol};
use crate::reference_features::ReferenceFeatures;

/// One metric's value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// The metric.
    pub metric: Metric,
    /// None where nothing counts.
    pub value: Option<f64>,
    /// For PSNR: the MSE was exactly 0.
    pub exact: bool,
    /// The noise, for MSE and PSNR of light.
    pub noise: Option<ValueNoise>,
    /// The number of pixels or windows that it is a mean over.
    pub count: usize,
}

/// The uncertainty of a value due to render noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ValueNoise {
    /// Standard error, in the value's own unit; of a PSNR to first order, and at most the cap.
    pub standard_error: f64,
    /// Of a PSNR: the error may be noise alone; the value is that of 1.645 standard errors of the MSE.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lower_bound: bool,
}

/// An albedo picture, linear and as SSIM and LPIPS see it.
pub struct Albedo {
    /// Linear Rec. 709.
    pub linear: Picture<LinearRgb>,
    /// Clipped to 0..1 and encoded.
    pub encoded: Picture<SrgbRgb>,
}

/// A true albedo picture, with what LPIPS compares of it.
pub struct AlbedoReference {
    /// The picture.
    pub albedo: Albedo,
    features: ReferenceFeatures,
}

impl Albedo {
    /// Encodes a linear picture.
    pub fn new(linear: Picture<LinearRgb>) -> Self {
        Self { encoded: linear.to_srgb(), linear }
    }
}

impl AlbedoReference {
    /// Encodes a linear picture.
    pub fn new(linear: Picture<LinearRgb>) -> Self {
        Self { albedo: Albedo::new(linear), features: ReferenceFeatures::default() }
    }
}

/// MSE, PSNR, SSIM and (where its weights are loaded) LPIPS of an albedo picture over the mask.
pub fn albedo_metrics(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    prediction: &Albedo,
    reference: &AlbedoReference,
    mask: &Mask,
) -> Result<Vec<Measured>, MetricError> {
    let pixels = mateval_metrics::mask::pixel_count(mask);
    let AlbedoReference { albedo: truth, features } = reference;
    let mut measured = error_metrics(albedo_mse(protocol, prediction, truth, mask)?, pixels)?;
    measured.push(ssim_metric(protocol.mask_rule.ssim(&prediction.encoded, &truth.encoded, mask)?));
    if let Some(lpips) = lpips {
        let distance = protocol.mask_rule.lpips(lpips, &prediction.encoded, &truth.encoded, features, mask)?;
        measured.push(rounded_lpips(protocol, distance, pixels));
    }
    Ok(measured)
}

/// MSE of an albedo picture over the mask, in the protocol's space; none where no pixel counts.
pub fn albedo_mse(
    protocol: &Protocol,
    prediction: &Albedo,
    reference: &Albedo,
    mask: &Mask,
) -> Result<Option<f64>, MetricError> {
    match protocol.albedo_space {
        AlbedoSpace::Linear => mse(&prediction.linear, &reference.linear, Some(mask)),
        AlbedoSpace::Srgb => mse(&prediction.encoded, &reference.encoded, Some(mask)),
    }
}

/// MSE, PSNR and SSIM of a picture of roughness or metallic over the mask, of the values as they are: they are not light and
/// have no sRGB encoding. There is no LPIPS: its networks were trained on colour photographs and its weights on people's
/// judgement of those, so its distance between pictures of a parameter has no meaning.
pub fn scalar_metrics(
    protocol: &Protocol,
    prediction: &Picture<f32>,
    reference: &Picture<f32>,
    mask: &Mask,
) -> Result<Vec<Measured>, MetricError> {
    let pixels = mateval_metrics::mask::pixel_count(mask);
    let mut measured = error_metrics(mse(prediction, reference, Some(mask))?, pixels)?;
    measured.push(ssim_metric(protocol.mask_rule.ssim(prediction, reference, mask)?));
    Ok(measured)
}

/// The metrics of [`scalar_metrics`] without values, for scenes whose source does not state the parameter.
pub(crate) fn unstated_scalar_metrics() -> Vec<Measured> {
    [Metric::Mse, Metric::Psnr, Metric::Ssim].map(|metric| Measured::plain(metric, None, 0)).to_vec()
}

/// An MSE, and its PSNR.
fn error_metrics(error: Option<f64>, pixels: usize) -> Result<Vec<Measured>, MetricError> {
    let psnr = error.map(Psnr::from_mse).transpose()?;
    let exact = psnr.is_some_and(|psnr| psnr.exact);
    let psnr = Measured { exact, ..Measured::plain(Metric::Psnr, psnr.map(|psnr| psnr.db), pixels) };
    Ok(vec![Measured::plain(Metric::Mse, error, pixels), psnr])
}

/// An SSIM as a measured value.
pub(crate) fn ssim_metric((value, count): Counted) -> Measured {
    Measured::plain(Metric::Ssim, value, count)
}

/// LPIPS rounded for storage: its last bits depend on the processor.
pub fn rounded_lpips(protocol: &Protocol, distance: Option<f64>, pixels: usize) -> Measured {
    let steps = 10_f64.powi(protocol.lpips_decimals as i32);
    let rounded = distance.map(|distance| (distance * steps).round() / steps);
    Measured::plain(Metric::LpipsAlex, rounded, pixels)
}

impl Measured {
    /// A value without noise.
    pub(crate) fn plain(metric: Metric, value: Option<f64>, count: usize) -> Self {
        Self { metric, value, exact: false, noise: None, count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures() -> (Picture<LinearRgb>, Picture<LinearRgb>, Mask) {
        let reference = Picture::from_fn(40, 30, |x, y| LinearRgb([x as f32 / 40.0, y as f32 / 30.0, 0.3]));
        let prediction = reference.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * 0.9)));
        (prediction, reference, Picture::from_fn(40, 30, |x, _| x >= 20))
    }

    fn value(measured: &[Measured], metric: Metric) -> f64 {
        measured.iter().find(|m| m.metric == metric).and_then(|m| m.value).unwrap()
    }

    #[test]
    fn the_protocols_differ_in_masks_and_encoding() {
        let (prediction, reference, mask) = pictures();
        let (prediction, reference) = (Albedo::new(prediction), AlbedoReference::new(reference));
        let [ours, paper] = ["mateval-2", "paper"]
            .map(|name| albedo_metrics(&Protocol::named(name).unwrap(), None, &prediction, &reference, &mask).unwrap());
        // Half of the frame is black in both pictures: the paper's SSIM is nearer to one.
        assert!(value(&paper, Metric::Ssim) > value(&ours, Metric::Ssim));
        assert!(value(&paper, Metric::Mse) != value(&ours, Metric::Mse));
        assert!(!ours.iter().any(|m| m.metric == Metric::LpipsAlex));
    }

    #[test]
    fn truth_is_exact_and_an_empty_mask_has_no_value() {
        let (_, reference, mask) = pictures();
        let protocol = Protocol::named("mateval-2").unwrap();
        let (same, reference) = (Albedo::new(reference.clone()), AlbedoReference::new(reference));
        let found = albedo_metrics(&protocol, None, &same, &reference, &mask).unwrap();
        assert!(found.iter().any(|m| m.metric == Metric::Psnr && m.exact && m.value == Some(100.0)));
        let nothing = Picture::filled(40, 30, false);
        for measured in albedo_metrics(&protocol, None, &same, &reference, &nothing).unwrap() {
            assert_eq!(measured.value, None, "{}", measured.metric);
        }
    }

    #[test]
    fn scalars_are_compared_as_they_are() {
        let reference = Picture::from_fn(40, 30, |x, y| (x as f32 + y as f32) / 100.0);
        let prediction = reference.map(|v| v + 0.1);
        let mask = Picture::from_fn(40, 30, |x, _| x >= 20);
        let [ours, paper] = ["mateval-2", "paper"].map(|name| {
            let measured = scalar_metrics(&Protocol::named(name).unwrap(), &prediction, &reference, &mask).unwrap();
            let metrics: Vec<Metric> = measured.iter().map(|m| m.metric).collect();
            assert_eq!(metrics, [Metric::Mse, Metric::Psnr, Metric::Ssim]);
            measured
        });
        // 0.1 off everywhere, by hand; no curve lies between, whatever the protocol does to albedo.
        for measured in [&ours, &paper] {
            assert!(
                (value(measured, Metric::Mse) - 0.01).abs() < 1e-8
                    && (value(measured, Metric::Psnr) - 20.0).abs() < 1e-5
            );
        }
        // Twenty columns of thirty; whole windows have their centres 5 pixels inside of that.
        assert_eq!((ours[0].count, ours[2].count, paper[2].count), (600, 10 * 20, 600));
        assert!(value(&paper, Metric::Ssim) != value(&ours, Metric::Ssim));
        let same = scalar_metrics(&Protocol::named("paper").unwrap(), &reference, &reference, &mask).unwrap();
        assert!(same[1].exact && value(&same, Metric::Ssim) == 1.0 && value(&same, Metric::Mse) == 0.0);
    }
}
