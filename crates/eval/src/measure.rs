//! The metrics of one picture over one region, under one protocol.

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{Lpips, MetricError, Psnr, delta_e, mse};

use crate::mask_rule::ReferenceFeatures;
use crate::metric::{HALF_A_BYTE, Metric};
use crate::protocol::{AlbedoSpace, Protocol};
use crate::result::PictureValues;

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

/// MSE and PSNR of an albedo picture over the mask. Where the mask holds the `whole` view, also SSIM, CIEDE2000 and (where its
/// weights are loaded) LPIPS.
pub fn measure_albedo(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    prediction: &Albedo,
    reference: &AlbedoReference,
    mask: &Mask,
    whole: bool,
    values: &mut PictureValues,
) -> Result<(), MetricError> {
    let AlbedoReference { albedo: truth, features } = reference;
    let Some(error) = albedo_mse(protocol, prediction, truth, mask)? else { return Ok(()) };
    let Psnr { db, exact } = Psnr::from_mse(error)?;
    values.values.extend([(Metric::Mse, error), (Metric::Psnr, db)]);
    values.exact = exact;
    if whole {
        similarities(protocol, lpips, [&prediction.encoded, &truth.encoded], features, mask, values)?;
        let difference = delta_e(&prediction.linear, &truth.linear, mask)?;
        values.values.extend(difference.map(|value| (Metric::DeltaE, value)));
    }
    Ok(())
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

/// Adds SSIM and (where its weights are loaded) LPIPS of a prediction and a reference, in this order.
pub(crate) fn similarities(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    [prediction, reference]: [&Picture<SrgbRgb>; 2],
    features: &ReferenceFeatures,
    mask: &Mask,
    values: &mut PictureValues,
) -> Result<(), MetricError> {
    let (ssim, _) = protocol.mask_rule.ssim(prediction, reference, mask)?;
    values.values.extend(ssim.map(|ssim| (Metric::Ssim, ssim)));
    if let Some(lpips) = lpips {
        let distance = protocol.mask_rule.lpips(lpips, prediction, reference, features, mask)?;
        // Its last bits depend on the processor.
        values.values.extend(distance.map(|distance| (Metric::LpipsAlex, round_to_steps(protocol, distance))));
    }
    Ok(())
}

/// Mean absolute and mean squared error of a picture of roughness or metallic over the mask, of the values as they are:
/// they are not light and have no peak, so there is no PSNR, nor a similarity of pictures.
pub fn measure_scalar(
    prediction: &Picture<f32>,
    reference: &Picture<f32>,
    mask: &Mask,
    values: &mut PictureValues,
) -> Result<(), MetricError> {
    // What counts as equal is made equal.
    let close = Picture::from_fn(prediction.width(), prediction.height(), |x, y| {
        let (p, t) = (prediction.get(x, y), reference.get(x, y));
        if (p - t).abs() <= HALF_A_BYTE { t } else { p }
    });
    let Some(error) = mse(&close, reference, Some(mask))? else { return Ok(()) };
    let (mut sum, mut count) = (0.0, 0_usize);
    for at in (0..mask.pixels().len()).filter(|&at| mask.pixels()[at]) {
        sum += (f64::from(close.pixels()[at]) - f64::from(reference.pixels()[at])).abs();
        count += 1;
    }
    values.values.extend([(Metric::Mae, sum / count as f64), (Metric::Mse, error)]);
    Ok(())
}

/// A value rounded to the protocol's decimals.
pub(crate) fn round_to_steps(protocol: &Protocol, value: f64) -> f64 {
    let steps = 10_f64.powi(protocol.rounded_decimals as i32);
    (value * steps).round() / steps
}

#[cfg(test)]
mod tests {
    use mateval_scene::{SceneId, ViewId};

    use super::*;
    use crate::result_key::{PictureKind, PictureName, Region};

    fn pictures() -> (Picture<LinearRgb>, Picture<LinearRgb>, Mask) {
        let reference = Picture::from_fn(40, 30, |x, y| LinearRgb([x as f32 / 40.0, y as f32 / 30.0, 0.3]));
        let prediction = reference.map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * 0.9)));
        (prediction, reference, Picture::from_fn(40, 30, |x, _| x >= 20))
    }

    fn blank() -> PictureValues {
        PictureValues {
            scene: SceneId::new("s").unwrap(),
            view: ViewId::new("input").unwrap(),
            picture: PictureName::whole(PictureKind::Albedo),
            lighting: None,
            region: Region::Valid,
            pixels: 600,
            values: Default::default(),
            mse_error: None,
            exact: false,
            lower_bound: false,
        }
    }

    fn albedo(
        protocol: &str,
        prediction: &Picture<LinearRgb>,
        reference: &Picture<LinearRgb>,
        mask: &Mask,
    ) -> PictureValues {
        let (prediction, reference) = (Albedo::new(prediction.clone()), AlbedoReference::new(reference.clone()));
        let mut values = blank();
        measure_albedo(&Protocol::named(protocol).unwrap(), None, &prediction, &reference, mask, true, &mut values)
            .unwrap();
        values
    }

    #[test]
    fn the_protocols_differ_in_masks_and_encoding() {
        let (prediction, reference, mask) = pictures();
        let [ours, paper] = ["mateval-3", "paper"].map(|name| albedo(name, &prediction, &reference, &mask).values);
        // Half of the frame is black in both pictures: the paper's SSIM is nearer to one.
        assert!(paper[&Metric::Ssim] > ours[&Metric::Ssim] && paper[&Metric::Mse] != ours[&Metric::Mse]);
        assert!(!ours.contains_key(&Metric::LpipsAlex) && ours[&Metric::DeltaE] > 0.0);
    }

    #[test]
    fn truth_is_exact_and_an_empty_mask_has_no_value() {
        let (_, reference, mask) = pictures();
        let found = albedo("mateval-3", &reference, &reference, &mask);
        assert!(found.exact && found.values[&Metric::Psnr] == 100.0 && found.values[&Metric::DeltaE] == 0.0);
        assert!(albedo("mateval-3", &reference, &reference, &Picture::filled(40, 30, false)).values.is_empty());
    }

    /// A tenth off everywhere, by hand; and half a byte's step, which is nothing.
    #[test]
    fn scalars_are_compared_as_they_are() {
        let reference = Picture::from_fn(40, 30, |x, y| (x as f32 + y as f32) / 100.0);
        let mask = Picture::from_fn(40, 30, |x, _| x >= 20);
        let measured = |by: f32| {
            let mut values = blank();
            measure_scalar(&reference.map(|v| v + by), &reference, &mask, &mut values).unwrap();
            values.values
        };
        let found = measured(0.1);
        assert!((found[&Metric::Mae] - 0.1).abs() < 1e-6 && (found[&Metric::Mse] - 0.01).abs() < 1e-7);
        assert_eq!(found.len(), 2);
        assert!(measured(128.0 / 255.0 - 0.5).values().all(|error| *error == 0.0));
        assert!(measured(0.51 / 255.0).values().all(|error| *error > 0.0));
    }
}
