//! Submissions compared with a scene's truth under light.

use std::collections::BTreeMap;

use mateval_image::{Picture, SrgbRgb};
use mateval_metrics::{MetricError, NoiseFreeMse, psnr_mean_error};
use mateval_scene::dataset::View;
use mateval_scene::layout::INPUT;
use mateval_scene::{Camera, RendererId};
use rayon::prelude::*;

use crate::error::EvalError;
use crate::instance_errors::InstanceErrors;
use crate::light_rules::{NoiseRules, Track};
use crate::lit_scene::{LitScene, Photo};
use crate::noise_blocks::noise_blocks;
use crate::predicted_light::{LitPicture, PredictedLight, predicted_light};
use crate::protocol::Protocol;
use crate::relit::{LightingName, RelitLighting, lightings};
use crate::result::{NoiseState, PsnrNoise};
use crate::result_key::{PictureKind, PictureName, Region, Views};
use crate::rgb::{EncodedLight, LightReference, RgbMeasured, rgb_metrics};
use crate::scene_score::{NoiseScore, ScoreSheet};
use crate::scene_task::{MaskedRegion, SceneTask, regions};
use crate::truth::{RgbTruth, ViewTruth};

/// Scores every submission under the lights of protocol number `at`; `renderer` made the truth's pictures.
pub(crate) fn score_light(
    task: &SceneTask<'_>,
    renderer: &RendererId,
    truths: &[ViewTruth],
    at: usize,
    sheets: &mut [Vec<ScoreSheet>],
) -> Result<(), EvalError> {
    let scorer = LightScorer::new(task, renderer, truths, &task.protocols[at])?;
    scorer.predict(&mut |submission, light| scorer.measure(light, &mut sheets[submission][at]))
}

/// A view's light, exposed, clipped and encoded for display.
pub struct ShownLight {
    /// The truth.
    pub truth: Picture<SrgbRgb>,
    /// One for each submission.
    pub predicted: Vec<Picture<SrgbRgb>>,
}

/// The truth's light and every submission's in each view, for display, in the first track of the first protocol.
pub(crate) fn shown_light(
    task: &SceneTask<'_>,
    renderer: &RendererId,
    truths: &[ViewTruth],
) -> Result<Vec<ShownLight>, EvalError> {
    let scorer = LightScorer::new(task, renderer, truths, &task.protocols[0])?;
    // Predictions arrive in any order.
    let mut predicted = BTreeMap::new();
    scorer.predict(&mut |submission, light| {
        let first = light.pictures.first().into_iter().flat_map(|picture| &picture.views);
        let shown = |halves| EncodedLight::of_prediction(halves, task.scene.exposure).shown();
        predicted.insert(submission, first.map(shown).collect::<Vec<_>>());
        Ok(())
    })?;
    let references = scorer.references[&None].iter().enumerate();
    let of_view = |at: usize| predicted.values().map(|views| views[at].clone()).collect();
    let shown = |(at, reference): (usize, &LightReference)| ShownLight {
        truth: reference.shown().clone(),
        predicted: of_view(at),
    };
    Ok(references.map(shown).collect())
}

/// Scores the renders of predictions against the truth, under one protocol.
struct LightScorer<'a> {
    task: &'a SceneTask<'a>,
    protocol: &'a Protocol,
    truths: &'a [ViewTruth],
    photo: Photo<'a>,
    lightings: Vec<RelitLighting>,
    /// The regions of each view.
    regions: Vec<Vec<MaskedRegion>>,
    /// The references of each lighting (none: the scene's own lights) and view.
    references: BTreeMap<Option<LightingName>, Vec<LightReference>>,
    /// The noise blocks of each view.
    blocks: Vec<Picture<u32>>,
}

impl<'a> LightScorer<'a> {
    fn new(
        task: &'a SceneTask<'a>,
        renderer: &RendererId,
        truths: &'a [ViewTruth],
        protocol: &'a Protocol,
    ) -> Result<Self, EvalError> {
        let own = task.views.iter().map(|view| RgbTruth::read(task.folder, renderer, view));
        let own = own.collect::<Result<Vec<_>, _>>()?;
        let photo = photo(task, truths, &own)?;
        let lightings = if protocol.light.tracks.contains(&Track::Relit) {
            let group = |group| RgbTruth::shown_of_group(task.folder, renderer, photo.view, group);
            let groups = (0..task.world.emitters().groups()).map(group).collect::<Result<Vec<_>, EvalError>>()?;
            lightings(&protocol.light.relit, &groups, photo.valid)
        } else {
            Vec::new()
        };
        let cameras: Vec<Camera> = task.views.iter().map(|view| view.camera).collect();
        Ok(Self {
            task,
            protocol,
            truths,
            photo,
            regions: truths.iter().map(regions).collect(),
            references: references(task, renderer, protocol, &own, &lightings)?,
            blocks: noise_blocks(&protocol.light.noise, &cameras),
            lightings,
        })
    }

    /// Renders every submission and passes it to `each` with its number.
    fn predict(&self, each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>) -> Result<(), EvalError> {
        let task = self.task;
        let lit = LitScene {
            scene: task.scene,
            world: task.world,
            atlases: task.atlases,
            views: task.views.clone(),
            truths: self.truths,
            references: &self.references[&None],
            blocks: &self.blocks,
            photo: self.photo.clone(),
            lightings: self.lightings.clone(),
        };
        predicted_light(&lit, &self.protocol.light, task.predictions, task.progress, each)
    }

    fn measure(&self, light: PredictedLight, sheet: &mut ScoreSheet) -> Result<(), EvalError> {
        let PredictedLight { pictures, fit, samples, not_finite } = light;
        for picture in &pictures {
            self.measure_picture(picture, samples, sheet)?;
        }
        if fit.is_some() {
            sheet.score.fit = fit;
        }
        sheet.score.not_finite += not_finite;
        Ok(())
    }

    fn measure_picture(&self, picture: &LitPicture, samples: u32, sheet: &mut ScoreSheet) -> Result<(), EvalError> {
        let task = self.task;
        let kind = picture.track.picture();
        let lights: Vec<EncodedLight> =
            picture.views.par_iter().map(|halves| EncodedLight::of_prediction(halves, task.scene.exposure)).collect();
        let references = &self.references[&picture.lighting];
        let jobs: Vec<(usize, &MaskedRegion)> = self
            .regions
            .iter()
            .enumerate()
            .flat_map(|(view, regions)| regions.iter().map(move |region| (view, region)))
            .collect();
        let measured: Vec<Result<RgbMeasured, MetricError>> = jobs
            .par_iter()
            .map(|&(view, region)| {
                let (light, reference, blocks) = (&lights[view], &references[view], &self.blocks[view]);
                rgb_metrics(self.protocol, task.lpips, light, reference, &region.mask, blocks)
            })
            .collect();
        let mut errors: BTreeMap<(PictureName, Views), Vec<NoiseFreeMse>> = BTreeMap::new();
        for (&(view, region), measured) in jobs.iter().zip(measured) {
            let view = task.views[view];
            let RgbMeasured { values, mse } = task.locate_error(view, measured)?;
            let score = region.score(kind, picture.lighting, values);
            errors.entry((score.picture, Views::of(&view.id, region.region))).or_default().extend(mse);
            sheet.score.add(&view.id, vec![score]);
        }
        if picture.track != Track::Relit {
            let rules = &self.protocol.light.noise;
            let measured = errors.into_iter().filter(|(_, mses)| !mses.is_empty());
            sheet.score.noise.extend(measured.map(|((picture, views), mses)| NoiseScore {
                picture,
                views,
                noise: psnr_noise(rules, &mses, samples),
            }));
            self.add_errors(kind, &lights, references, &mut sheet.errors);
        }
        Ok(())
    }

    fn add_errors(
        &self,
        kind: PictureKind,
        lights: &[EncodedLight],
        references: &[LightReference],
        errors: &mut InstanceErrors,
    ) {
        let pairs = lights.iter().zip(references);
        for ((view, truth), (light, reference)) in self.task.views.iter().zip(self.truths).zip(pairs) {
            let error = |k: usize| light.noise_free_square(reference, k);
            errors.add(kind, Views::of(&view.id, Region::Valid), &truth.instances, &truth.valid, error);
            if let Some(unobserved) = &truth.unobserved {
                errors.add(kind, Views::Unobserved, &truth.instances, unobserved, error);
            }
        }
    }
}

fn photo<'a>(task: &SceneTask<'a>, truths: &'a [ViewTruth], own: &[RgbTruth]) -> Result<Photo<'a>, EvalError> {
    let scene = || task.scene.id.clone();
    let view = task.scene.view(INPUT).ok_or_else(|| EvalError::NoInputView { scene: scene() })?;
    let place = task.views.iter().position(|scored| scored.id == view.id);
    let place = place.ok_or_else(|| EvalError::InputNotTarget { scene: scene() })?;
    Ok(Photo { view, light: own[place].shown.clone(), valid: &truths[place].valid })
}

fn references(
    task: &SceneTask<'_>,
    renderer: &RendererId,
    protocol: &Protocol,
    own: &[RgbTruth],
    lightings: &[RelitLighting],
) -> Result<BTreeMap<Option<LightingName>, Vec<LightReference>>, EvalError> {
    let reference = |view: &View, truth: &RgbTruth| {
        task.locate_error(view, LightReference::new(protocol, task.lpips, truth, task.scene.exposure))
    };
    let own: Vec<LightReference> =
        task.views.iter().zip(own).map(|(view, truth)| reference(view, truth)).collect::<Result<_, _>>()?;
    let mut references = BTreeMap::from([(None, own)]);
    for view in &task.views {
        let relit = RgbTruth::relit(task.folder, renderer, view, lightings)?;
        for (lighting, truth) in lightings.iter().zip(&relit) {
            references.entry(Some(lighting.name)).or_default().push(reference(view, truth)?);
        }
    }
    Ok(references)
}

/// The noise in the mean PSNR of some views, and why it is as large as it is.
fn psnr_noise(rules: &NoiseRules, views: &[NoiseFreeMse], samples: u32) -> PsnrNoise {
    let noise = psnr_mean_error(&views.iter().collect::<Vec<_>>());
    let state = match &noise {
        Some(noise) if noise.prediction <= rules.target_db && noise.reference <= rules.target_db => {
            NoiseState::Certified
        }
        Some(noise) if noise.prediction <= rules.target_db.max(rules.truth_share * noise.reference) => {
            NoiseState::LimitedByTruth
        }
        _ if samples >= rules.most_samples => NoiseState::SampleCap,
        _ => NoiseState::AboveTarget,
    };
    PsnrNoise {
        standard_error_db: noise.as_ref().map(|noise| noise.total),
        own_db: noise.as_ref().map(|noise| noise.prediction),
        truth_db: noise.as_ref().map(|noise| noise.reference),
        samples,
        state,
    }
}
