//! The metrics of one picture under one protocol.

use mateval_image::{LinearRgb, Mask, Picture};
use mateval_metrics::{Lpips, MetricError, Psnr, mse, ssim_black_fill, ssim_valid_windows};

use crate::protocol::{AlbedoSpace, MaskRule, Protocol};

/// One metric's value.
#[derive(Clone, Debug, PartialEq)]
pub struct Measured {
    /// Its key.
    pub metric: String,
    /// None where nothing counts.
    pub value: Option<f64>,
    /// For PSNR: there was no error at all.
    pub exact: bool,
    /// Pixels or windows that it is a mean over.
    pub count: usize,
}

/// MSE, PSNR, SSIM and (where its weights are there) LPIPS of an albedo picture over the mask; linear pictures.
pub fn albedo_metrics(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    prediction: &Picture<LinearRgb>,
    reference: &Picture<LinearRgb>,
    mask: &Mask,
) -> Result<Vec<Measured>, MetricError> {
    let pixels = mateval_metrics::mask::pixel_count(mask);
    let (encoded, reference_encoded) = (prediction.to_srgb(), reference.to_srgb());
    let error = match protocol.albedo_space {
        AlbedoSpace::Linear => mse(prediction, reference, Some(mask))?,
        AlbedoSpace::Srgb => mse(&encoded, &reference_encoded, Some(mask))?,
    };
    let psnr = error.map(Psnr::from_mse).transpose()?;
    let mut measured = vec![
        plain("mse", error, pixels),
        Measured { exact: psnr.is_some_and(|psnr| psnr.exact), ..plain("psnr", psnr.map(|psnr| psnr.db), pixels) },
    ];
    measured.push(match protocol.mask_rule {
        MaskRule::BlackFill => plain("ssim", ssim_black_fill(&encoded, &reference_encoded, mask)?, pixels),
        MaskRule::Inside => {
            let inside = ssim_valid_windows(&encoded, &reference_encoded, mask)?;
            plain("ssim", inside.as_ref().map(|s| s.ssim), inside.map_or(0, |s| s.windows))
        }
    });
    if let Some(lpips) = lpips {
        let distance = match protocol.mask_rule {
            MaskRule::BlackFill => lpips.black_fill(&encoded, &reference_encoded, mask),
            MaskRule::Inside => lpips.masked(&encoded, &reference_encoded, mask),
        };
        let distance = match distance {
            // The network has no value for so small a picture: missing, not wrong.
            Err(MetricError::TooSmall { .. }) => None,
            other => other?,
        };
        let steps = 10_f64.powi(protocol.lpips_decimals as i32);
        let rounded = distance.map(|distance| (distance * steps).round() / steps);
        measured.push(plain(&format!("lpips_{}", protocol.lpips_net), rounded, pixels));
    }
    Ok(measured)
}

fn plain(metric: &str, value: Option<f64>, count: usize) -> Measured {
    Measured { metric: metric.to_owned(), value, exact: false, count }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pictures() -> (Picture<LinearRgb>, Picture<LinearRgb>, Mask) {
        let reference = Picture::from_fn(40, 30, |x, y| LinearRgb([x as f32 / 40.0, y as f32 / 30.0, 0.3]));
        let prediction = reference.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * 0.9)));
        (prediction, reference, Picture::from_fn(40, 30, |x, _| x >= 20))
    }

    fn value(measured: &[Measured], metric: &str) -> f64 {
        measured.iter().find(|m| m.metric == metric).and_then(|m| m.value).unwrap()
    }

    #[test]
    fn the_protocols_differ_as_they_say() {
        let (prediction, reference, mask) = pictures();
        let [ours, paper] = ["mateval-1", "paper"]
            .map(|name| albedo_metrics(&Protocol::named(name).unwrap(), None, &prediction, &reference, &mask).unwrap());
        // Half of the frame is black in both pictures: the paper's SSIM is nearer to one.
        assert!(value(&paper, "ssim") > value(&ours, "ssim"));
        assert!(value(&paper, "mse") != value(&ours, "mse"));
        assert!(!ours.iter().any(|m| m.metric.starts_with("lpips")));
    }

    #[test]
    fn truth_is_exact_and_an_empty_mask_has_no_value() {
        let (_, reference, mask) = pictures();
        let protocol = Protocol::named("mateval-1").unwrap();
        let same = albedo_metrics(&protocol, None, &reference, &reference, &mask).unwrap();
        assert!(same.iter().any(|m| m.metric == "psnr" && m.exact && m.value == Some(100.0)));
        let nothing = Picture::filled(40, 30, false);
        for measured in albedo_metrics(&protocol, None, &reference, &reference, &nothing).unwrap() {
            assert_eq!(measured.value, None, "{}", measured.metric);
        }
    }
}
