//! Submissions compared with a scene's truth without light: pictures of maps, and texels.

use mateval_image::{LinearRgb, Picture};
use mateval_scene::Report;
use mateval_scene::dataset::{SceneFile, View};
use mateval_submission::prediction::PredictedScene;
use rayon::prelude::*;

use crate::alignment::{channel_scales, scaled};
use crate::error::EvalError;
use crate::light::true_maps::true_maps;
use crate::material_pictures::{MaterialPictures, material_pictures};
use crate::measure::{Albedo, AlbedoReference, measure_albedo, measure_scalar};
use crate::metric::Metric;
use crate::protocol::{AlbedoSpace, Protocol};
use crate::result::{InstanceTexelErrors, PictureValues, TexelErrors};
use crate::result_key::{PictureKind, Region, Surfaces, Views};
use crate::scene_score::InstanceErrors;
use crate::scene_score::ScoreSheet;
use crate::scene_task::{BaseColors, MaskedRegion, SceneTask, regions};
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

/// Gets a view, its number, the pictures of every submission and the base colour of the true atlases.
type EachView<'a> = dyn FnMut(&View, usize, &[MaterialPictures], &Picture<LinearRgb>) -> Result<(), EvalError> + 'a;

impl SceneTask<'_> {
    /// Pictures of base colour, roughness and metallic, under the protocols that are `wanted` by their numbers. Returns the base
    /// colours of the true atlases and of each submission.
    pub(crate) fn score_materials(
        &self,
        truths: &[ViewTruth],
        wanted: &(impl Fn(usize) -> bool + Sync),
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
            let albedo = AlbedoReference::new(truth.albedo.clone());
            let truth = Truth { view: truth, albedo, regions: regions(truth) };
            let protocols = (0..self.protocols.len()).filter(|&p| wanted(p));
            let jobs: Vec<(usize, usize)> = protocols.flat_map(|p| (0..sheets.len()).map(move |s| (s, p))).collect();
            let measured: Vec<_> = jobs
                .par_iter()
                .map(|&(s, p)| self.material_values(&self.protocols[p], view, &predicted[s], &truth))
                .collect();
            for ((s, p), values) in jobs.into_iter().zip(measured) {
                let sheet = &mut sheets[s][p];
                sheet.score.pictures.extend(values?);
                self.material_errors(&self.protocols[p], view, &predicted[s], &truth, &mut sheet.errors);
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
        let true_maps = true_maps(self.folder, self.scene)?;
        let all: Vec<&PredictedScene> = self.predictions.iter().chain([&true_maps]).collect();
        for (at, view) in self.views.iter().enumerate() {
            (self.progress)(Report::step(&format!("scene {}: materials", self.scene.id), at, self.views.len()));
            let mut pictures = material_pictures(self.world, self.atlases, &view.camera, &all);
            let truth = pictures.pop().expect("the truth comes last").base_color;
            each(view, at, &pictures, &truth)?;
            base_colors.truth.push(truth);
            for (base_colors, pictures) in base_colors.predicted.iter_mut().zip(pictures) {
                base_colors.push(pictures.base_color);
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
                if region.surfaces == Surfaces::Specular {
                    // One number is enough to say how far off mirrors and metals are.
                    values.values.remove(&Metric::Mse);
                }
                all.push(values);
            }
        }
        Ok(all)
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
        let found = texture_space(
            self.folder,
            self.scene,
            self.world,
            self.atlases,
            self.predictions,
            self.pictures,
            self.progress,
        )?;
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
    let errors = |sums: &TexelSums| TexelErrors { area_m2: sums.area_m2, base_color_mse: sums.mse() };
    InstanceTexelErrors {
        scene: scene.id.clone(),
        instance: instance.instance.clone(),
        observed: errors(&instance.observed),
        unobserved: errors(&instance.unobserved),
    }
}
