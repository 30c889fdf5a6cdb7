//! The maps of submissions compared with the truth's in pictures, without light: the metrics of each region, of base
//! colour also with its scale removed.

use mateval_dataset::Report;
use mateval_dataset::dataset::View;
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_metrics::{Lpips, MetricError, Psnr, channel_scales, mse, scaled};
use mateval_submission::prediction::PredictedScene;
use rayon::prelude::*;

use crate::error::EvalError;
use crate::materials::pictures::{MaterialPictures, Places, material_pictures};
use crate::materials::texels::texture_space;
use crate::metric::{ColorPicture, EncodedPair, HALF_A_BYTE, Measure, Metric, PictureKind, Stated};
use crate::protocol::{AlbedoSpace, Protocol};
use crate::result::PictureValues;
use crate::result::key::Surfaces;
use crate::scene::{BaseColors, MaskedRegion, SceneTask, ScoreSheet, regions};
use crate::truth::{ViewTruth, true_maps};

struct Predicted {
    pictures: MaterialPictures,
    /// The base colour as it is, and scaled by [`channel_scales`].
    albedos: [(PictureKind, ColorPicture); 2],
}

impl Predicted {
    fn new(pictures: MaterialPictures, truth: &ViewTruth) -> Self {
        let raw = &pictures.base_color;
        let aligned = scaled(raw, channel_scales(raw, &truth.albedo, &truth.valid));
        let albedos = [
            (PictureKind::Albedo, ColorPicture::new(raw.clone())),
            (PictureKind::AlbedoAligned, ColorPicture::new(aligned)),
        ];
        Self { pictures, albedos }
    }
}

/// The truth of a view, and what is shared between submissions and protocols.
struct Truth<'a> {
    view: &'a ViewTruth,
    albedo: ColorPicture,
    regions: Vec<MaskedRegion>,
}

/// Gets a view, its number, the pictures of every submission and the base colour of the true atlases.
type EachView<'a> = dyn FnMut(&View, usize, &[MaterialPictures], &Picture<LinearRgb>) -> Result<(), EvalError> + 'a;

impl SceneTask<'_> {
    /// Errors of texels; they are the same under every protocol.
    pub(crate) fn score_texels(&self, sheets: &mut [Vec<ScoreSheet>]) -> Result<(), EvalError> {
        let found = texture_space(self.open, self.scene, self.predictions, self.pictures, self.progress)?;
        for (sheets, errors) in sheets.iter_mut().zip(found) {
            for sheet in sheets {
                sheet.score.texels = errors.clone();
            }
        }
        Ok(())
    }

    /// Pictures of base colour, roughness and metallic, under the `protocols` of these numbers. Returns the
    /// base colours of the true atlases and of each submission.
    pub(crate) fn score_materials(
        &self,
        truths: &[ViewTruth],
        protocols: &[usize],
        sheets: &mut [Vec<ScoreSheet>],
    ) -> Result<BaseColors, EvalError> {
        self.each_view(&mut |view, at, pictures, true_base_color| {
            for (kept, (submission, pictures)) in
                self.pictures.into_iter().flat_map(|kept| pictures.iter().enumerate().map(move |at| (kept, at)))
            {
                kept.keep_maps(submission, (&self.scene.id, &view.id), pictures, true_base_color)?;
            }
            let truth = &truths[at];
            let predicted: Vec<Predicted> =
                pictures.par_iter().map(|pictures| Predicted::new(pictures.clone(), truth)).collect();
            let truth = Truth { view: truth, albedo: ColorPicture::new(truth.albedo.clone()), regions: regions(truth) };
            let jobs: Vec<(usize, usize)> =
                protocols.iter().flat_map(|&p| (0..sheets.len()).map(move |s| (s, p))).collect();
            let measured: Vec<_> = jobs
                .par_iter()
                .map(|&(s, p)| self.material_values(&self.protocols[p], view, &predicted[s], &truth))
                .collect();
            for ((s, p), values) in jobs.into_iter().zip(measured) {
                let sheet = &mut sheets[s][p];
                sheet.score.pictures.extend(values?);
                for (kind, albedo) in &predicted[s].albedos {
                    let pair = [albedo, &truth.albedo];
                    let error = |k: usize| match self.protocols[p].albedo_space {
                        AlbedoSpace::Linear => mean_square(pair.map(|albedo| albedo.linear.pixels()[k].0)),
                        AlbedoSpace::Srgb => mean_square(pair.map(|albedo| albedo.encoded.pixels()[k].0)),
                    };
                    sheet.errors.add(*kind, &view.id, &truth.view.instances, &truth.regions, error);
                }
            }
            Ok(())
        })
    }

    /// The base colours of the true atlases and of each submission, in every view.
    pub(crate) fn base_colors(&self) -> Result<BaseColors, EvalError> {
        self.each_view(&mut |_, _, _, _| Ok(()))
    }

    /// Looks all maps up in every view; `each` gets the submissions' pictures and the base colour of the true atlases.
    fn each_view(&self, each: &mut EachView<'_>) -> Result<BaseColors, EvalError> {
        let blank = vec![Vec::new(); self.predictions.len()];
        let mut base_colors = BaseColors { truth: Vec::new(), predicted: blank };
        let true_maps = true_maps(&self.open.folder, self.scene)?;
        let all: Vec<&PredictedScene> = self.predictions.iter().chain([&true_maps]).collect();
        for (at, view) in self.views.iter().enumerate() {
            (self.progress)(Report::step(&format!("scene {}: materials", self.scene.id), at, self.views.len()));
            let mut pictures = material_pictures(self.open, &view.camera, &all, Places::AsTruth);
            let truth = pictures.pop().expect("the truth comes last").base_color;
            each(view, at, &pictures, &truth)?;
            base_colors.truth.push(truth);
            for (base_colors, pictures) in base_colors.predicted.iter_mut().zip(pictures) {
                base_colors.push(pictures.base_color);
            }
        }
        Ok(base_colors)
    }

    /// All metrics of a view's raw albedo, aligned albedo, roughness and metallic. The scale of the aligned albedo is
    /// fitted over all valid pixels and is the same for every region.
    fn material_values(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: &Predicted,
        truth: &Truth<'_>,
    ) -> Result<Vec<PictureValues>, EvalError> {
        let mut all = Vec::new();
        let Predicted { pictures, albedos } = predicted;
        for region in &truth.regions {
            let (mask, whole) = (&region.mask, region.is_whole());
            let blank = |kind| region.values(&self.scene.id, &view.id, kind, None);
            if region.surfaces == Surfaces::All {
                for (kind, albedo) in albedos {
                    let mut values = blank(*kind);
                    let found = measure_albedo(protocol, self.lpips, albedo, &truth.albedo, mask, whole, &mut values);
                    self.locate_error(view, found)?;
                    all.push(values);
                }
            }
            let source = &self.scene.source;
            let scalars = [
                (PictureKind::Roughness, source.states_roughness, &pictures.roughness, &truth.view.roughness),
                (PictureKind::Metallic, source.states_metallic, &pictures.metallic, &truth.view.metallic),
            ];
            for (kind, _, picture, truth) in scalars.into_iter().filter(|(_, is_stated, ..)| *is_stated) {
                let mut values = blank(kind);
                self.locate_error(view, measure_scalar(picture, truth, mask, &mut values))?;
                all.push(values);
            }
        }
        Ok(all)
    }
}

/// MSE and PSNR of an albedo picture over the mask. Where the mask holds the `whole` view, also the metrics of whole
/// views.
pub fn measure_albedo(
    protocol: &Protocol,
    lpips: Option<&Lpips>,
    prediction: &ColorPicture,
    reference: &ColorPicture,
    mask: &Mask,
    whole: bool,
    values: &mut PictureValues,
) -> Result<(), MetricError> {
    let Some(error) = albedo_mse(protocol, prediction, reference, mask)? else { return Ok(()) };
    let Psnr { db, exact } = Psnr::from_mse(error)?;
    values.values.extend([(Metric::Mse, error), (Metric::Psnr, db)]);
    values.exact = exact;
    if whole {
        let mask_rule = protocol.mask_rule;
        let pair = EncodedPair { prediction: &prediction.encoded, reference, mask, mask_rule, lpips };
        measure_whole_view(protocol, Some(&prediction.linear), &pair, values)?;
    }
    Ok(())
}

/// MSE of an albedo picture over the mask, in the protocol's space; absent if no pixel counts.
pub fn albedo_mse(
    protocol: &Protocol,
    prediction: &ColorPicture,
    reference: &ColorPicture,
    mask: &Mask,
) -> Result<Option<f64>, MetricError> {
    match protocol.albedo_space {
        AlbedoSpace::Linear => mse(&prediction.linear, &reference.linear, Some(mask)),
        AlbedoSpace::Srgb => mse(&prediction.encoded, &reference.encoded, Some(mask)),
    }
}

fn mean_square([a, b]: [[f32; 3]; 2]) -> f64 {
    (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>() / 3.0
}

/// Adds the metrics of whole views that the picture's kind has. Renders have no linear prediction.
pub(crate) fn measure_whole_view(
    protocol: &Protocol,
    linear: Option<&Picture<LinearRgb>>,
    pair: &EncodedPair<'_>,
    values: &mut PictureValues,
) -> Result<(), MetricError> {
    for metric in Metric::of(values.picture.kind) {
        let value = match (&metric.row().measure, linear) {
            (Measure::Encoded(measure), _) => measure(pair)?,
            (Measure::Linear(measure), Some(linear)) => measure(linear, &pair.reference.linear, pair.mask)?,
            _ => None,
        };
        let steps = 10_f64.powi(protocol.rounded_decimals as i32);
        let stated = |value: f64| match metric.row().stated {
            Stated::Exactly => value,
            Stated::Rounded { .. } => (value * steps).round() / steps,
        };
        values.values.extend(value.map(|value| (metric, stated(value))));
    }
    Ok(())
}

/// The errors of a picture of roughness or metallic over the mask, of the values as they are: they are not light and
/// have no peak, so there is no PSNR, nor a similarity of pictures.
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
    for metric in Metric::of(values.picture.kind) {
        let value = match metric.row().measure {
            Measure::Scalars(measure) => measure(&close, reference, Some(mask))?,
            // One number is enough to say how far off mirrors and metals are.
            Measure::SquaredError if values.picture.surfaces == Surfaces::All => mse(&close, reference, Some(mask))?,
            _ => None,
        };
        values.values.extend(value.map(|value| (metric, value)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use mateval_dataset::{SceneId, ViewId};

    use crate::metric::PictureKind;
    use crate::result::key::{PictureName, Region};

    use super::*;

    fn blank(kind: PictureKind) -> PictureValues {
        let (scene, view) = (SceneId::new("s").unwrap(), ViewId::new("input").unwrap());
        PictureValues::new(scene, view, PictureName::whole(kind), Region::Valid, 600)
    }

    #[test]
    fn truth_is_exact_and_an_empty_mask_has_no_value() {
        let protocol = Protocol::named("mateval-3").unwrap();
        let truth =
            ColorPicture::new(Picture::from_fn(40, 30, |x, y| LinearRgb([x as f32 / 40.0, y as f32 / 30.0, 0.3])));
        let measured = |mask: &Mask| {
            let mut values = blank(PictureKind::Albedo);
            measure_albedo(&protocol, None, &truth, &truth, mask, true, &mut values).unwrap();
            values
        };
        let found = measured(&Picture::from_fn(40, 30, |x, _| x >= 20));
        assert!(found.exact && found.values[&Metric::Psnr] == 100.0 && found.values[&Metric::DeltaE] == 0.0);
        assert!(measured(&Picture::filled(40, 30, false)).values.is_empty());
    }

    /// A tenth off everywhere, by hand; and half a byte's step, which is nothing.
    #[test]
    fn scalars_are_compared_as_they_are() {
        let reference = Picture::from_fn(40, 30, |x, y| (x as f32 + y as f32) / 100.0);
        let mask = Picture::from_fn(40, 30, |x, _| x >= 20);
        let measured = |by: f32| {
            let mut values = blank(PictureKind::Roughness);
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
