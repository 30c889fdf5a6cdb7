//! Submissions compared with a scene's truth without light: pictures of maps, and texels.

use mateval_image::{LinearRgb, Picture};
use mateval_scene::Report;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::submission::Map;
use rayon::prelude::*;

use crate::alignment::{channel_scales, scaled};
use crate::error::EvalError;
use crate::instance_errors::InstanceErrors;
use crate::material_pictures::{MaterialPictures, material_pictures};
use crate::measure::{Albedo, AlbedoReference, albedo_metrics, scalar_metrics, unstated_scalar_metrics};
use crate::protocol::{AlbedoSpace, Protocol};
use crate::result::{InstanceTexelErrors, TexelErrors};
use crate::result_key::{PictureKind, Region, Views};
use crate::scene_score::{PictureScore, ScoreSheet};
use crate::scene_task::{MaskedRegion, SceneTask, regions};
use crate::texture_space::{InstanceTexels, TexelSums, texture_space};
use crate::truth::ViewTruth;

/// One submission's pictures of a view.
struct Predicted {
    pictures: MaterialPictures,
    /// The base colour as it is, and scaled by [`channel_scales`].
    albedos: [(PictureKind, Albedo); 2],
}

impl Predicted {
    fn new(pictures: MaterialPictures, truth: &ViewTruth) -> Self {
        let raw = &pictures.base_color;
        let aligned = scaled(raw, channel_scales(raw, &truth.albedo, &truth.valid));
        let albedos =
            [(PictureKind::Albedo, Albedo::new(raw.clone())), (PictureKind::AlbedoAligned, Albedo::new(aligned))];
        Self { pictures, albedos }
    }
}

/// The truth of a view, and what is shared between submissions and protocols.
struct Truth<'a> {
    view: &'a ViewTruth,
    albedo: AlbedoReference,
    regions: Vec<MaskedRegion>,
}

impl SceneTask<'_> {
    /// Pictures of base colour, roughness and metallic. Returns the base colours of each submission, by view.
    pub(crate) fn score_materials(
        &self,
        truths: &[ViewTruth],
        sheets: &mut [Vec<ScoreSheet>],
    ) -> Result<Vec<Vec<Picture<LinearRgb>>>, EvalError> {
        let mut base_colors: Vec<Vec<Picture<LinearRgb>>> = vec![Vec::new(); self.predictions.len()];
        for (at, (view, truth)) in self.views.iter().zip(truths).enumerate() {
            (self.progress)(Report::step(&format!("scene {}: materials", self.scene.id), at, self.views.len()));
            let pictures = material_pictures(self.world, self.atlases, &view.camera, self.predictions);
            let predicted: Vec<Predicted> =
                pictures.into_par_iter().map(|pictures| Predicted::new(pictures, truth)).collect();
            let albedo = AlbedoReference::new(truth.albedo.clone());
            let truth = Truth { view: truth, albedo, regions: regions(truth) };
            let jobs: Vec<(usize, usize)> =
                (0..sheets.len()).flat_map(|s| (0..self.protocols.len()).map(move |p| (s, p))).collect();
            let measured: Vec<_> = jobs
                .par_iter()
                .map(|&(s, p)| self.material_values(&self.protocols[p], view, &predicted[s], &truth))
                .collect();
            for ((s, p), values) in jobs.into_iter().zip(measured) {
                let sheet = &mut sheets[s][p];
                sheet.score.add(&view.id, values?);
                self.material_errors(&self.protocols[p], view, &predicted[s], &truth, &mut sheet.errors);
            }
            for (base_colors, predicted) in base_colors.iter_mut().zip(predicted) {
                base_colors.push(predicted.pictures.base_color);
            }
        }
        Ok(base_colors)
    }

    /// All metrics of a view's raw albedo, aligned albedo, roughness and metallic. The scale of the aligned albedo is fitted
    /// over all valid pixels and is the same for every region.
    fn material_values(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: &Predicted,
        truth: &Truth<'_>,
    ) -> Result<Vec<PictureScore>, EvalError> {
        let mut values = Vec::new();
        for region in &truth.regions {
            for (kind, albedo) in &predicted.albedos {
                let found = albedo_metrics(protocol, self.lpips, albedo, &truth.albedo, &region.mask);
                values.push(region.score(*kind, None, self.locate_error(view, found)?));
            }
            let Predicted { pictures, .. } = predicted;
            let source = &self.scene.source;
            let scalars = [
                (PictureKind::Roughness, source.states_roughness, &pictures.roughness, &truth.view.roughness),
                (PictureKind::Metallic, source.states_metallic, &pictures.metallic, &truth.view.metallic),
            ];
            for (kind, is_stated, picture, truth) in scalars {
                let found = match is_stated {
                    true => self.locate_error(view, scalar_metrics(protocol, picture, truth, &region.mask))?,
                    false => unstated_scalar_metrics(),
                };
                values.push(region.score(kind, None, found));
            }
        }
        Ok(values)
    }

    /// Adds the squared errors of raw and aligned albedo to the sums by instance.
    fn material_errors(
        &self,
        protocol: &Protocol,
        view: &View,
        predicted: &Predicted,
        truth: &Truth<'_>,
        errors: &mut InstanceErrors,
    ) {
        let ViewTruth { instances, valid, unobserved, .. } = truth.view;
        for (kind, albedo) in &predicted.albedos {
            let (of, reference) = (albedo, &truth.albedo.albedo);
            let error = |k: usize| match protocol.albedo_space {
                AlbedoSpace::Linear => mean_square(of.linear.pixels()[k].0, reference.linear.pixels()[k].0),
                AlbedoSpace::Srgb => mean_square(of.encoded.pixels()[k].0, reference.encoded.pixels()[k].0),
            };
            errors.add(*kind, Views::of(&view.id, Region::Valid), instances, valid, error);
            if let Some(unobserved) = unobserved {
                errors.add(*kind, Views::of(&view.id, Region::Unobserved), instances, unobserved, error);
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

fn mean_square(a: [f32; 3], b: [f32; 3]) -> f64 {
    (0..3).map(|c| (f64::from(a[c]) - f64::from(b[c])).powi(2)).sum::<f64>() / 3.0
}

fn texel_errors(scene: &SceneFile, instance: &InstanceTexels) -> InstanceTexelErrors {
    // A constant of the source's reader is no truth to compare with.
    let stated = |is_stated: bool, mse: Option<f64>| mse.filter(|_| is_stated);
    let errors = |sums: &TexelSums| TexelErrors {
        area_m2: sums.area_m2,
        base_color_mse: sums.mse(Map::BaseColor),
        roughness_mse: stated(scene.source.states_roughness, sums.mse(Map::Roughness)),
        metallic_mse: stated(scene.source.states_metallic, sums.mse(Map::Metallic)),
    };
    InstanceTexelErrors {
        scene: scene.id.clone(),
        instance: instance.instance.clone(),
        observed: errors(&instance.observed),
        unobserved: errors(&instance.unobserved),
    }
}
