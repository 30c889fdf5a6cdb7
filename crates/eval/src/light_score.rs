//! Submissions compared with a scene's truth under light.

use std::cell::RefCell;
use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_metrics::{MetricError, NoiseFreeMse, NoisyRender, psnr_mean_error};
use mateval_scene::dataset::View;
use mateval_scene::layout::INPUT;
use mateval_scene::render_file::{RENDER_FILE, RenderFile};
use mateval_scene::{RendererId, json};
use rayon::prelude::*;

use crate::companion_store::CompanionStore;
use crate::companions::Companions;
use crate::error::EvalError;
use crate::instance_errors::InstanceErrors;
use crate::light_pass::LightPass;
use crate::light_rules::{NoiseRules, Track};
use crate::lit_scene::{LitScene, Photo};
use crate::noise_blocks::noise_blocks;
use crate::predicted_light::{LitPicture, PredictedLight, predicted_light};
use crate::protocol::Protocol;
use crate::relit::{LightingName, RelitLighting, light_of, lightings};
use crate::rendered_view::RenderedView;
use crate::result::{NoiseState, PsnrNoise};
use crate::result_key::{PictureKind, PictureName, Region, Views};
use crate::rgb::{EncodedLight, LightReference, RgbMeasured, encoded_render, rgb_metrics};
use crate::scene_score::{NoiseScore, ScoreSheet};
use crate::scene_task::{MaskedRegion, SceneTask, regions};
use crate::shown_render::ViewGuide;
use crate::truth::{RgbTruth, TrueLight, ViewTruth};
use crate::truth_noise::{NoisyLighting, encoded_variance};
use mateval_tracer::noise_filter::Surfaces;

/// Scores every submission under the lights of protocol number `at`; `renderer` made the truth's pictures. `base_colors` are
/// the submissions' in every view.
pub(crate) fn score_light(
    task: &SceneTask<'_>,
    renderer: &RendererId,
    truths: &[ViewTruth],
    base_colors: &[Vec<Picture<LinearRgb>>],
    at: usize,
    sheets: &mut [Vec<ScoreSheet>],
) -> Result<(), EvalError> {
    let companions = companions(task, truths)?;
    let scorer = LightScorer::new(task, renderer, truths, base_colors, Some(&companions), &task.protocols[at])?;
    let used =
        scorer.predict(&mut |submission, light| scorer.measure(submission, light, &mut sheets[submission][at]))?;
    for sheets in sheets {
        let score = &mut sheets[at].score;
        (score.companions, score.noisy_lightings) = (used.clone(), scorer.noisy.clone());
    }
    Ok(())
}

/// Finds or makes the companions' pictures of every pass of protocol number `at`. Returns the hashes of their lists, by pass.
pub(crate) fn keep_companions(
    task: &SceneTask<'_>,
    renderer: &RendererId,
    truths: &[ViewTruth],
    at: usize,
) -> Result<BTreeMap<String, String>, EvalError> {
    let companions = companions(task, truths)?;
    let scorer = LightScorer::new(task, renderer, truths, &[], Some(&companions), &task.protocols[at])?;
    scorer.predict(&mut |_, _| Ok(()))
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
    base_colors: &[Vec<Picture<LinearRgb>>],
) -> Result<Vec<ShownLight>, EvalError> {
    // A display does not need what companions bring.
    let scorer = LightScorer::new(task, renderer, truths, base_colors, None, &task.protocols[0])?;
    // Predictions arrive in any order.
    let mut predicted = BTreeMap::new();
    scorer.predict(&mut |submission, light| {
        let first = light.pictures.first().into_iter().flat_map(|picture| &picture.views);
        let truths = &scorer.lit.lights[&None];
        let shown = first.zip(truths).zip(task.views.iter().enumerate()).map(|((rendered, truth), (at, view))| {
            Ok(task.locate_error(view, scorer.encoded(submission, at, rendered, truth))?.shown())
        });
        predicted.insert(submission, shown.collect::<Result<Vec<_>, EvalError>>()?);
        Ok(())
    })?;
    let truth = &scorer.lit.lights[&None];
    let of_view = |at: usize| predicted.values().map(|views| views[at].clone()).collect();
    let shown = |(at, truth): (usize, &TrueLight)| ShownLight {
        truth: truth.shown.picture().to_srgb(),
        predicted: of_view(at),
    };
    Ok(truth.iter().enumerate().map(shown).collect())
}

/// The scene's companions.
fn companions(task: &SceneTask<'_>, truths: &[ViewTruth]) -> Result<Companions, EvalError> {
    let scene = || task.scene.id.clone();
    let input = task.views.iter().position(|view| view.id.as_str() == INPUT);
    let input = input.ok_or_else(|| EvalError::InputNotTarget { scene: scene() })?;
    Companions::read(task.folder, task.scene, task.world, &truths[input].instances)
}

/// Scores the renders of predictions against the truth, under one protocol.
struct LightScorer<'a> {
    task: &'a SceneTask<'a>,
    protocol: &'a Protocol,
    /// The regions of each view.
    regions: Vec<Vec<MaskedRegion>>,
    lit: LitScene<'a>,
    /// The lightings that are left out.
    noisy: Vec<NoisyLighting>,
    store: CompanionStore<'a>,
}

impl<'a> LightScorer<'a> {
    fn new(
        task: &'a SceneTask<'a>,
        renderer: &RendererId,
        truths: &'a [ViewTruth],
        base_colors: &'a [Vec<Picture<LinearRgb>>],
        companions: Option<&'a Companions>,
        protocol: &'a Protocol,
    ) -> Result<Self, EvalError> {
        let own = task.views.iter().map(|view| RgbTruth::read(task.folder, renderer, view));
        let own = own.collect::<Result<Vec<_>, _>>()?;
        let photo = photo(task, renderer, truths, &own)?;
        let lightings = if protocol.light.tracks.contains(&Track::Relit) {
            lightings(&protocol.light.relit, &photo.group_light)
        } else {
            Vec::new()
        };
        let exposure = task.scene.exposure;
        let own = own.iter().map(|truth| TrueLight::new(truth, exposure)).collect();
        let mut lights: BTreeMap<Option<LightingName>, Vec<TrueLight>> = BTreeMap::from([(None, own)]);
        for view in &task.views {
            let relit = TrueLight::relit(task.folder, renderer, view, &lightings, exposure)?;
            for (lighting, truth) in lightings.iter().zip(relit) {
                lights.entry(Some(lighting.name)).or_default().push(truth);
            }
        }
        // Leave out the lightings whose truth is too noisy.
        let variance =
            |lighting: &RelitLighting| encoded_variance(&lights[&Some(lighting.name)][photo.place], photo.valid);
        let noisy = lightings.iter().map(|relit| NoisyLighting { lighting: relit.name, variance: variance(relit) });
        let too_noisy = |found: &NoisyLighting| found.variance > protocol.light.relit.most_truth_variance;
        let noisy: Vec<NoisyLighting> = noisy.filter(too_noisy).collect();
        let is_scored = |name: LightingName| noisy.iter().all(|noisy| noisy.lighting != name);
        let lightings: Vec<RelitLighting> = lightings.into_iter().filter(|relit| is_scored(relit.name)).collect();
        lights.retain(|name, _| name.is_none_or(is_scored));
        let lit = LitScene {
            scene: task.scene,
            world: task.world,
            atlases: task.atlases,
            views: task.views.clone(),
            set: task.set,
            truths,
            lights,
            truth_samples: truth_samples(task, renderer)?,
            blocks: Vec::new(),
            photo,
            lightings,
            companions,
            base_colors,
        };
        let lit = LitScene { blocks: noise_blocks(&protocol.light.noise, &lit.cameras()), ..lit };
        let of_dataset = task.folder.companions();
        let store = CompanionStore::new(of_dataset, task.companions_made_in, task.inputs_sha256.clone());
        Ok(Self { task, protocol, regions: truths.iter().map(regions).collect(), lit, noisy, store })
    }

    /// Renders every submission and passes it to `each` with its number. Returns the hashes of the companions' pictures that
    /// were used, by pass.
    fn predict(
        &self,
        each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>,
    ) -> Result<BTreeMap<String, String>, EvalError> {
        let (rules, progress) = (&self.protocol.light, self.task.progress);
        let used = RefCell::new(BTreeMap::new());
        let find = |pass: &LightPass<'_>, companions: &Companions| {
            let found = self.store.find(&self.lit, rules, pass, companions, progress)?;
            used.borrow_mut().insert(pass.name.to_owned(), found.sha256.clone());
            Ok(found)
        };
        predicted_light(&self.lit, rules, self.task.predictions, &find, progress, each)?;
        Ok(used.into_inner())
    }

    /// A view of a prediction, encoded.
    fn encoded(
        &self,
        submission: usize,
        view: usize,
        rendered: &RenderedView,
        truth: &TrueLight,
    ) -> Result<EncodedLight, MetricError> {
        let ViewTruth { instances, normals, valid, .. } = &self.lit.truths[view];
        let (ratio, base_color) = (&self.lit.ratio(submission, view), &self.lit.base_colors[submission][view]);
        let truth = &truth.shown.picture();
        let surfaces = Surfaces { base_color, instances, normals, valid };
        EncodedLight::of_prediction(rendered, &ViewGuide { truth, ratio, surfaces })
    }

    fn measure(&self, submission: usize, light: PredictedLight, sheet: &mut ScoreSheet) -> Result<(), EvalError> {
        let PredictedLight { pictures, fit, samples, not_finite } = light;
        let mut errors: BTreeMap<(PictureName, Views), Vec<NoiseFreeMse>> = BTreeMap::new();
        for picture in &pictures {
            self.measure_picture(submission, picture, &mut errors, sheet)?;
        }
        let rules = &self.protocol.light.noise;
        let measured = errors.into_iter().filter(|(_, mses)| !mses.is_empty());
        sheet.score.noise.extend(measured.map(|((picture, views), mses)| NoiseScore {
            picture,
            views,
            noise: psnr_noise(rules, &mses, samples),
        }));
        if fit.is_some() {
            sheet.score.fit = fit;
        }
        sheet.score.not_finite += not_finite;
        Ok(())
    }

    fn measure_picture(
        &self,
        submission: usize,
        picture: &LitPicture,
        errors: &mut BTreeMap<(PictureName, Views), Vec<NoiseFreeMse>>,
        sheet: &mut ScoreSheet,
    ) -> Result<(), EvalError> {
        let task = self.task;
        let kind = picture.track.picture();
        let truths = &self.lit.lights[&picture.lighting];
        let pairs: Vec<Result<ComparedLight, MetricError>> = picture
            .views
            .par_iter()
            .zip(truths)
            .enumerate()
            .map(|(view, (rendered, truth))| {
                let of_fits = picture.of_fits.as_ref().map(|[a, b]| -> Result<_, MetricError> {
                    Ok([encoded_render(&a[view])?, encoded_render(&b[view])?])
                });
                Ok(ComparedLight {
                    light: self.encoded(submission, view, rendered, truth)?,
                    of_fits: of_fits.transpose()?,
                    reference: LightReference::new(self.protocol, task.lpips, truth)?,
                })
            })
            .collect();
        let pairs = pairs.into_iter().zip(&task.views).map(|(pair, view)| task.locate_error(view, pair));
        let pairs: Vec<ComparedLight> = pairs.collect::<Result<_, _>>()?;
        let jobs: Vec<(usize, &MaskedRegion)> = self
            .regions
            .iter()
            .enumerate()
            .flat_map(|(view, regions)| regions.iter().map(move |region| (view, region)))
            .collect();
        let measured: Vec<Result<RgbMeasured, MetricError>> = jobs
            .par_iter()
            .map(|&(view, region)| {
                let (ComparedLight { light, of_fits, reference }, blocks) = (&pairs[view], &self.lit.blocks[view]);
                rgb_metrics(self.protocol, task.lpips, light, of_fits.as_ref(), reference, &region.mask, blocks)
            })
            .collect();
        for (&(view, region), measured) in jobs.iter().zip(measured) {
            let view = task.views[view];
            let RgbMeasured { values, mse } = task.locate_error(view, measured)?;
            let score = region.score(kind, picture.lighting, values);
            errors.entry((score.picture, Views::of(&view.id, region.region))).or_default().extend(mse);
            sheet.score.add(&view.id, vec![score]);
        }
        if picture.track != Track::Relit {
            self.add_errors(kind, &pairs, &mut sheet.errors);
        }
        Ok(())
    }

    fn add_errors(&self, kind: PictureKind, pairs: &[ComparedLight], errors: &mut InstanceErrors) {
        for ((view, truth), pair) in self.task.views.iter().zip(self.lit.truths).zip(pairs) {
            let ComparedLight { light, reference, .. } = pair;
            let error = |k: usize| light.noise_free_square(reference, k);
            errors.add(kind, Views::of(&view.id, Region::Valid), &truth.instances, &truth.valid, error);
            if let Some(unobserved) = &truth.unobserved {
                errors.add(kind, Views::of(&view.id, Region::Unobserved), &truth.instances, unobserved, error);
            }
        }
    }
}

/// A view of a prediction and of the truth, encoded.
struct ComparedLight {
    light: EncodedLight,
    /// The prediction under the lights that each of two streams was fitted to.
    of_fits: Option<[NoisyRender<SrgbRgb>; 2]>,
    reference: LightReference,
}

/// The smallest number of samples of the truth's halves.
fn truth_samples(task: &SceneTask<'_>, renderer: &RendererId) -> Result<u32, EvalError> {
    let of_view = |view: &&View| -> Result<u32, EvalError> {
        let file: RenderFile = json::read(&task.folder.render(renderer, &view.id).join(RENDER_FILE))?;
        Ok(file.samples_each_half)
    };
    let samples = task.views.iter().map(of_view).collect::<Result<Vec<_>, _>>()?;
    Ok(samples.into_iter().min().unwrap_or(0))
}

fn photo<'a>(
    task: &SceneTask<'a>,
    renderer: &RendererId,
    truths: &'a [ViewTruth],
    own: &[RgbTruth],
) -> Result<Photo<'a>, EvalError> {
    let scene = || task.scene.id.clone();
    let view = task.scene.view(INPUT).ok_or_else(|| EvalError::NoInputView { scene: scene() })?;
    let place = task.views.iter().position(|scored| scored.id == view.id);
    let place = place.ok_or_else(|| EvalError::InputNotTarget { scene: scene() })?;
    let valid = &truths[place].valid;
    let group = |group| Ok(light_of(&RgbTruth::shown_of_group(task.folder, renderer, view, group)?, valid));
    let group_light = (0..task.world.emitters().groups()).map(group).collect::<Result<_, EvalError>>()?;
    Ok(Photo { view, place, light: own[place].shown.clone(), valid, group_light })
}

/// The noise in the mean PSNR of some pictures, and why it is as large as it is.
fn psnr_noise(rules: &NoiseRules, pictures: &[NoiseFreeMse], samples: u32) -> PsnrNoise {
    let noise = psnr_mean_error(&pictures.iter().collect::<Vec<_>>());
    // Without any noise there is nothing to certify.
    let state = noise.as_ref().map_or(NoiseState::Certified, |noise| {
        let fixed = noise.shared.hypot(noise.reference).hypot(noise.common);
        let allowed = rules.allowed_db(pictures);
        if noise.paths <= allowed && fixed <= allowed {
            NoiseState::Certified
        } else if noise.paths <= allowed.max(rules.truth_share * fixed) {
            NoiseState::LimitedByTruth
        } else if samples >= rules.most_samples {
            NoiseState::SampleCap
        } else {
            NoiseState::AboveTarget
        }
    });
    let is_bound = |picture: &NoiseFreeMse| picture.mse < picture.bounded();
    let noise = noise.as_ref();
    PsnrNoise {
        standard_error_db: noise.filter(|_| !pictures.iter().any(is_bound)).map(|noise| noise.total),
        own_db: noise.map(|noise| noise.paths),
        companions_db: noise.map(|noise| noise.shared),
        truth_db: noise.map(|noise| noise.reference),
        fit_db: noise.map(|noise| noise.common),
        samples,
        state,
    }
}
