//! Submissions scored on one scene.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb};
use mateval_metrics::{Lpips, MetricError};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::SceneFolder;
use mateval_scene::submission::Map;
use mateval_scene::{Progress, RendererId, TriangleMesh};
use mateval_tracer::World;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::alignment::{channel_scales, scaled};
use crate::error::EvalError;
use crate::instance_errors::InstanceErrors;
use crate::light_score::score_light;
use crate::material_pictures::{MaterialPictures, material_pictures};
use crate::measure::{Measured, albedo_metrics, scalar_metrics};
use crate::predicted_light::FittedRadiances;
use crate::protocol::{AlbedoSpace, Protocol};
use crate::relit::LightingName;
use crate::result::{InstancePixelErrors, InstanceTexelErrors, PictureValue, PsnrNoise, TexelErrors};
use crate::result_key::{PictureKind, PictureName, Region, ResultKey, Surfaces, Views};
use crate::texture_space::{InstanceTexels, TexelSums, texture_space};
use crate::truth::{ViewTruth, intersection};
use mateval_submission::prediction::PredictedScene;

/// What one submission got in one scene under one protocol.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SceneScore {
    pub(crate) pictures: Vec<PictureValue>,
    pub(crate) texels: Vec<InstanceTexelErrors>,
    pub(crate) instances: Vec<InstancePixelErrors>,
    pub(crate) noise: BTreeMap<ResultKey, PsnrNoise>,
    pub(crate) fit: Option<FittedRadiances>,
    /// Contributions of light that were not finite and count as none.
    pub(crate) not_finite: u64,
}

/// A scene, its predictions and the rules.
pub(crate) struct SceneOrder<'a> {
    pub(crate) scene: &'a SceneFile,
    pub(crate) folder: &'a SceneFolder,
    pub(crate) world: &'a World,
    pub(crate) atlases: &'a [TriangleMesh],
    /// Those that are scored.
    pub(crate) views: Vec<&'a View>,
    pub(crate) predictions: &'a [PredictedScene],
    pub(crate) protocols: &'a [Protocol],
    pub(crate) lpips: Option<&'a Lpips>,
    /// Whose renders light is compared with; none leaves light out.
    pub(crate) renderer: Option<&'a RendererId>,
    pub(crate) progress: Progress<'a>,
}

/// Some of a view's pixels.
pub(crate) struct MaskedRegion {
    pub(crate) region: Region,
    pub(crate) surfaces: Surfaces,
    pub(crate) mask: Mask,
}

/// What a view shows of one submission.
#[derive(Clone, Copy)]
struct Predicted<'a> {
    pictures: &'a MaterialPictures,
    /// Its base colour, scaled.
    aligned: &'a Picture<LinearRgb>,
}

impl<'a> Predicted<'a> {
    fn albedos(self) -> [(PictureKind, &'a Picture<LinearRgb>); 2] {
        [(PictureKind::Albedo, &self.pictures.base_color), (PictureKind::AlbedoAligned, self.aligned)]
    }
}

/// Scores on the way, of one submission and protocol.
#[derive(Default)]
pub(crate) struct Sheet {
    pub(crate) score: SceneScore,
    pub(crate) errors: InstanceErrors,
}

/// By submission, then by protocol.
pub(crate) fn score_scene(order: &SceneOrder<'_>) -> Result<Vec<Vec<SceneScore>>, EvalError> {
    let truths = order.views.iter().map(|view| ViewTruth::read(order.folder, view)).collect::<Result<Vec<_>, _>>()?;
    let blank = || order.protocols.iter().map(|_| Sheet::default()).collect();
    let mut sheets: Vec<Vec<Sheet>> = order.predictions.iter().map(|_| blank()).collect();
    order.materials(&truths, &mut sheets)?;
    order.texels(&mut sheets)?;
    if let Some(renderer) = order.renderer {
        for at in 0..order.protocols.len() {
            score_light(order, renderer, &truths, at, &mut sheets)?;
        }
    }
    let finish = |sheet: Sheet| SceneScore { instances: sheet.errors.finish(order.scene), ..sheet.score };
    Ok(sheets.into_iter().map(|sheets| sheets.into_iter().map(finish).collect()).collect())
}

impl SceneOrder<'_> {
    /// Pictures of base colour, roughness and metallic.
    fn materials(&self, truths: &[ViewTruth], sheets: &mut [Vec<Sheet>]) -> Result<(), EvalError> {
        for (at, (view, truth)) in self.views.iter().zip(truths).enumerate() {
            (self.progress)(&format!("scene {}: materials", self.scene.id), at, self.views.len());
            let pictures = material_pictures(self.world, self.atlases, &view.camera, self.predictions);
            let regions = regions(truth);
            let aligned: Vec<_> = pictures.iter().map(|pictures| aligned(pictures, truth)).collect();
            let predicted: Vec<Predicted<'_>> =
                pictures.iter().zip(&aligned).map(|(pictures, aligned)| Predicted { pictures, aligned }).collect();
            let jobs: Vec<(usize, usize)> =
                (0..sheets.len()).flat_map(|s| (0..self.protocols.len()).map(move |p| (s, p))).collect();
            let measured: Vec<_> = jobs
                .par_iter()
                .map(|&(s, p)| self.material_values(&self.protocols[p], view, predicted[s], truth, &regions))
                .collect();
            for ((s, p), values) in jobs.into_iter().zip(measured) {
                let sheet = &mut sheets[s][p];
                sheet.score.pictures.extend(values?);
                self.material_errors(&self.protocols[p], view, predicted[s], truth, &mut sheet.errors);
            }
        }
        Ok(())
    }

    /// All metrics of a view's albedo (raw and aligned, which keeps its picture's scale everywhere), roughness, metallic.
    fn material_values(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: Predicted<'_>,
        truth: &ViewTruth,
        regions: &[MaskedRegion],
    ) -> Result<Vec<PictureValue>, EvalError> {
        let mut values = Vec::new();
        for region in regions {
            for (kind, picture) in predicted.albedos() {
                let found = albedo_metrics(protocol, self.lpips, picture, &truth.albedo, &region.mask);
                values.extend(self.values(view, region, kind, None, self.or_named(view, found)?));
            }
            let scalars = [
                (PictureKind::Roughness, &predicted.pictures.roughness, &truth.roughness),
                (PictureKind::Metallic, &predicted.pictures.metallic, &truth.metallic),
            ];
            for (kind, picture, truth) in scalars {
                let found = scalar_metrics(protocol, picture, truth, &region.mask);
                values.extend(self.values(view, region, kind, None, self.or_named(view, found)?));
            }
        }
        Ok(values)
    }

    fn material_errors(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: Predicted<'_>,
        truth: &ViewTruth,
        errors: &mut InstanceErrors,
    ) {
        for (kind, picture) in predicted.albedos() {
            let spaces = match protocol.albedo_space {
                AlbedoSpace::Linear => [picture.clone(), truth.albedo.clone()],
                AlbedoSpace::Srgb => [picture, &truth.albedo].map(|p| p.to_srgb().map(|SrgbRgb(v)| LinearRgb(v))),
            };
            let error = |k: usize| mean_square(spaces[0].pixels()[k].0, spaces[1].pixels()[k].0);
            errors.add(kind, Views::of(&view.id, Region::Valid), &truth.instances, &truth.valid, error);
            if let Some(unobserved) = &truth.unobserved {
                errors.add(kind, Views::Unobserved, &truth.instances, unobserved, error);
            }
        }
    }

    fn texels(&self, sheets: &mut [Vec<Sheet>]) -> Result<(), EvalError> {
        let found = texture_space(self.folder, self.scene, self.world, self.atlases, self.predictions, self.progress)?;
        for (sheets, instances) in sheets.iter_mut().zip(found) {
            let errors: Vec<InstanceTexelErrors> =
                instances.iter().map(|instance| texel_errors(self.scene, instance)).collect();
            for sheet in sheets {
                sheet.score.texels = errors.clone();
            }
        }
        Ok(())
    }

    pub(crate) fn values(
        &self,
        view: &View,
        region: &MaskedRegion,
        kind: PictureKind,
        lighting: Option<LightingName>,
        measured: Vec<Measured>,
    ) -> Vec<PictureValue> {
        let value = |measured: Measured| PictureValue {
            scene: self.scene.id.clone(),
            view: view.id.clone(),
            picture: PictureName { kind, surfaces: region.surfaces },
            lighting,
            region: region.region,
            metric: measured.metric,
            value: measured.value,
            exact: measured.exact,
            noise: measured.noise,
            count: measured.count,
        };
        measured.into_iter().map(value).collect()
    }

    /// An error of a metric, with where it was.
    pub(crate) fn or_named<T>(&self, view: &View, found: Result<T, MetricError>) -> Result<T, EvalError> {
        found.map_err(|source| EvalError::Metric { scene: self.scene.id.clone(), view: view.id.clone(), source })
    }
}

/// The regions of a view that have values of their own.
pub(crate) fn regions(truth: &ViewTruth) -> Vec<MaskedRegion> {
    let mut regions = vec![MaskedRegion { region: Region::Valid, surfaces: Surfaces::All, mask: truth.valid.clone() }];
    let unobserved = truth.unobserved.as_ref();
    regions.extend(unobserved.map(|mask| MaskedRegion {
        region: Region::Unobserved,
        surfaces: Surfaces::All,
        mask: mask.clone(),
    }));
    if let Some(specular) = &truth.specular {
        regions.push(MaskedRegion { region: Region::Valid, surfaces: Surfaces::Specular, mask: specular.clone() });
        regions.extend(unobserved.map(|mask| MaskedRegion {
            region: Region::Unobserved,
            surfaces: Surfaces::Specular,
            mask: intersection(mask, specular),
        }));
    }
    regions
}

fn aligned(predicted: &MaterialPictures, truth: &ViewTruth) -> Picture<LinearRgb> {
    scaled(&predicted.base_color, channel_scales(&predicted.base_color, &truth.albedo, &truth.valid))
}

fn mean_square(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>() / 3.0
}

fn texel_errors(scene: &SceneFile, instance: &InstanceTexels) -> InstanceTexelErrors {
    let errors = |sums: &TexelSums| TexelErrors {
        area_m2: sums.area_m2,
        base_color_mse: sums.mse(Map::BaseColor),
        roughness_mse: sums.mse(Map::Roughness),
        metallic_mse: sums.mse(Map::Metallic),
    };
    InstanceTexelErrors {
        scene: scene.id.clone(),
        instance: instance.instance.clone(),
        observed: errors(&instance.observed),
        unobserved: errors(&instance.unobserved),
    }
}
