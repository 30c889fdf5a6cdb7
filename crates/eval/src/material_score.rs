//! Submissions compared with a scene's truth without light: pictures of maps, and texels.

use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::submission::Map;
use rayon::prelude::*;

use crate::alignment::{channel_scales, scaled};
use crate::error::EvalError;
use crate::instance_errors::InstanceErrors;
use crate::material_pictures::{MaterialPictures, material_pictures};
use crate::measure::{albedo_metrics, scalar_metrics};
use crate::protocol::{AlbedoSpace, Protocol};
use crate::result::{InstanceTexelErrors, TexelErrors};
use crate::result_key::{PictureKind, Region, Views};
use crate::scene_score::{PictureScore, ScoreSheet};
use crate::scene_task::{MaskedRegion, SceneTask, regions};
use crate::texture_space::{InstanceTexels, TexelSums, texture_space};
use crate::truth::ViewTruth;

/// One submission's pictures of a view.
#[derive(Clone, Copy)]
struct Predicted<'a> {
    pictures: &'a MaterialPictures,
    /// The base colour, scaled by [`channel_scales`].
    aligned: &'a Picture<LinearRgb>,
}

impl<'a> Predicted<'a> {
    fn albedos(self) -> [(PictureKind, &'a Picture<LinearRgb>); 2] {
        [(PictureKind::Albedo, &self.pictures.base_color), (PictureKind::AlbedoAligned, self.aligned)]
    }
}

impl SceneTask<'_> {
    /// Pictures of base colour, roughness and metallic.
    pub(crate) fn score_materials(
        &self,
        truths: &[ViewTruth],
        sheets: &mut [Vec<ScoreSheet>],
    ) -> Result<(), EvalError> {
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
                sheet.score.add(&view.id, values?);
                self.material_errors(&self.protocols[p], view, predicted[s], truth, &mut sheet.errors);
            }
        }
        Ok(())
    }

    /// All metrics of a view's raw albedo, aligned albedo, roughness and metallic. The scale of the aligned albedo is fitted
    /// over all valid pixels and is the same for every region.
    fn material_values(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: Predicted<'_>,
        truth: &ViewTruth,
        regions: &[MaskedRegion],
    ) -> Result<Vec<PictureScore>, EvalError> {
        let mut values = Vec::new();
        for region in regions {
            for (kind, picture) in predicted.albedos() {
                let found = albedo_metrics(protocol, self.lpips, picture, &truth.albedo, &region.mask);
                values.push(region.score(kind, None, self.locate_error(view, found)?));
            }
            let scalars = [
                (PictureKind::Roughness, &predicted.pictures.roughness, &truth.roughness),
                (PictureKind::Metallic, &predicted.pictures.metallic, &truth.metallic),
            ];
            for (kind, picture, truth) in scalars {
                let found = scalar_metrics(protocol, picture, truth, &region.mask);
                values.push(region.score(kind, None, self.locate_error(view, found)?));
            }
        }
        Ok(values)
    }

    /// Adds the squared errors of raw and aligned albedo to the sums by instance.
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

    /// Errors of texels; they are the same under every protocol.
    pub(crate) fn score_texels(&self, sheets: &mut [Vec<ScoreSheet>]) -> Result<(), EvalError> {
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
