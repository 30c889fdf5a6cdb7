//! Renders of predictions under each light of a protocol.
//!
//! In: a scene with its truth, predictions, the rules. Out, for each prediction: four independent quarters of every view
//! under every light, and the radiances that were fitted.
//!
//! Predictions that agree in roughness and metallic share paths, and the scene's companions travel along. A pilot render,
//! with samples of its own, determines how the companions correct each prediction and how many samples it needs. Radiances
//! are fitted on a further stream of samples, so that the fit does not make the quarters depend on each other. A
//! prediction's pictures are the same, bit for bit, whichever others are rendered with it.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture};
use mateval_light::light_fit::{FitTarget, LightFit, fit_lights};
use mateval_light::light_stage;
use mateval_scene::dataset::View;
use mateval_scene::{Progress, SceneLights};
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::{LightGroups, LightMix, Lighting, StageLight, ViewsRender};

use crate::companion_pictures::CompanionPictures;
use crate::companions::{COMPANIONS, Companions};
use crate::control_variate::Coefficients;
use crate::error::EvalError;
use crate::fitted_radiances::{FittedRadiance, FittedRadiances};
use crate::light_pass::{LightPass, PassPictures};
use crate::light_rules::{LightRules, Track};
use crate::lit_scene::{LitScene, Photo};
use crate::pilot::{Pilot, run_pilot};
use crate::relit::LightingName;
use crate::rendered_view::{RenderedView, of_companions, picture_of, without_companions};
use crate::stored_light::StoredLight;

/// A prediction rendered under some of the lights.
pub struct PredictedLight {
    /// One for each light.
    pub pictures: Vec<LitPicture>,
    /// The fitted radiances; none where no picture needs them.
    pub fit: Option<FittedRadiances>,
    /// Samples per pixel of each half.
    pub samples: u32,
    /// Number of contributions that were not finite and count as no light, in all its pictures except pilot and fit.
    pub not_finite: u64,
}

/// A prediction under one light.
pub struct LitPicture {
    /// Its track.
    pub track: Track,
    /// The name of the lighting, for track `relit`.
    pub lighting: Option<LightingName>,
    /// One for each view.
    pub views: Vec<RenderedView>,
}

/// The largest amount of memory that the pictures of one batch of predictions take.
const BATCH_BYTES: u64 = 900 << 20;

/// Finds the converged pictures of the companions for a pass, or makes them.
pub(crate) type FindCompanions<'a> =
    dyn Fn(&LightPass<'_>, &Companions, &[LightMix]) -> Result<CompanionPictures, EvalError> + 'a;

/// Renders all predictions under the lights of `rules` and passes each to `each`, pass by pass, with its index in
/// `predictions`.
pub(crate) fn predicted_light(
    lit: &LitScene<'_>,
    rules: &LightRules,
    predictions: &[PredictedScene],
    find_companions: &FindCompanions<'_>,
    progress: Progress<'_>,
    each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>,
) -> Result<(), EvalError> {
    let has = |track| rules.tracks.contains(&track);
    let mut fixed = Vec::new();
    if has(Track::True) {
        fixed.push((Track::True, None));
    }
    if has(Track::Relit) {
        fixed.extend(lit.lightings.iter().map(|lighting| (Track::Relit, Some(lighting.name))));
    }
    if !fixed.is_empty() {
        let pass = LightPass::of_own_lights("own", lit, rules, PassPictures::Fixed(fixed), progress);
        Renderer { lit, rules, pass, predictions, find_companions }.render(each)?;
    }
    if has(Track::Fitted) && lit.scene.lights == SceneLights::Own {
        let pass = LightPass::of_own_lights("fitted", lit, rules, PassPictures::Fitted, progress);
        Renderer { lit, rules, pass, predictions, find_companions }.render(each)?;
    }
    if has(Track::Fitted) && lit.scene.lights == SceneLights::Stage {
        let stage = light_stage::scene_lights(&rules.stage, lit.scene, lit.world);
        let quads: Vec<StageLight> = stage.iter().map(|named| named.light.clone()).collect();
        let world = lit.world.on_stage(&quads)?;
        let lights = stage.into_iter().map(|named| named.name).collect();
        let pass = LightPass::on_stage(&world, lights, lit, rules, progress);
        Renderer { lit, rules, pass, predictions, find_companions }.render(each)?;
    }
    Ok(())
}

/// One pass over all predictions.
struct Renderer<'a> {
    lit: &'a LitScene<'a>,
    rules: &'a LightRules,
    pass: LightPass<'a>,
    predictions: &'a [PredictedScene],
    find_companions: &'a FindCompanions<'a>,
}

/// The weights of a prediction's lights in each picture of a pass, and the fit that they come from.
#[derive(Clone)]
struct Mixing {
    mixes: Vec<LightMix>,
    fit: Option<FittedRadiances>,
}

/// How one prediction is rendered: by the pilot.
struct Planned {
    samples: u32,
    /// The companions' coefficients of each picture.
    coefficients: Vec<Coefficients>,
}

/// The renders of a batch of predictions.
struct Quarters {
    /// By prediction, picture and view, without what their paths show of the companions.
    views: Vec<Vec<Vec<RenderedView>>>,
    /// For each prediction, the number of contributions that were not finite.
    not_finite: Vec<u64>,
}

impl Renderer<'_> {
    fn render(&self, each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>) -> Result<(), EvalError> {
        let all: Vec<usize> = (0..self.predictions.len()).collect();
        let mixings = self.mixings(&all)?;
        let find = |companions| (self.find_companions)(&self.pass, companions, &self.pass.fixed_mixes());
        let companions = self.pass.companions().map(find).transpose()?;
        let planned = self.plan(&all, &mixings, companions.as_ref())?;
        for batch in self.batches(&all, |index| planned[index].samples) {
            let quarters = self.quarters(&batch, &mixings, &planned)?;
            self.finish(&batch, &mixings, &planned, companions.as_ref(), quarters, each)?;
        }
        Ok(())
    }

    /// What the pilot finds about each prediction.
    fn plan(
        &self,
        all: &[usize],
        mixings: &[Mixing],
        companions: Option<&CompanionPictures>,
    ) -> Result<Vec<Planned>, EvalError> {
        let mut planned = BTreeMap::new();
        for batch in self.batches(all, |_| self.rules.noise.pilot_samples) {
            let pilot = Pilot {
                lit: self.lit,
                rules: &self.rules.noise,
                pass: &self.pass,
                companions,
                batch: &batch,
                predictions: batch.iter().map(|&index| &self.predictions[index]).collect(),
                mixes: batch.iter().map(|&index| mixings[index].mixes.clone()).collect(),
            };
            for (&index, (samples, coefficients)) in batch.iter().zip(run_pilot(&pilot)?) {
                planned.insert(index, Planned { samples, coefficients });
            }
        }
        Ok(planned.into_values().collect())
    }

    /// The quarters of every prediction of a batch.
    fn quarters(&self, batch: &[usize], mixings: &[Mixing], planned: &[Planned]) -> Result<Quarters, EvalError> {
        let samples = planned[batch[0]].samples;
        let mixes: Vec<Vec<LightMix>> = batch.iter().map(|&index| mixings[index].mixes.clone()).collect();
        let predictions: Vec<&PredictedScene> = batch.iter().map(|&index| &self.predictions[index]).collect();
        let blank = vec![vec![RenderedView::empty(); self.lit.views.len()]; mixes[0].len()];
        let (mut views, mut not_finite) = (vec![blank; batch.len()], vec![0; batch.len()]);
        for quarter in ["a1", "a2", "b1", "b2"] {
            let what = format!("{} light, {samples} samples, quarter {quarter}", self.pass.name);
            let cameras = self.lit.cameras();
            let renders = self.pass.trace(&predictions, &mixes, &cameras, (samples / 2).max(1), quarter, &what)?;
            for (at, &index) in batch.iter().enumerate() {
                not_finite[at] += renders[at].stats.not_finite;
                let coefficients = &planned[index].coefficients;
                self.add_quarter(&renders, at, index, batch.len(), coefficients, &mut views[at]);
            }
        }
        Ok(Quarters { views, not_finite })
    }

    fn add_quarter(
        &self,
        renders: &[ViewsRender],
        at: usize,
        index: usize,
        predictions: usize,
        coefficients: &[Coefficients],
        pictures: &mut [Vec<RenderedView>],
    ) {
        let exposure = self.lit.scene.exposure;
        for (picture, views) in pictures.iter_mut().enumerate() {
            for (view, rendered) in views.iter_mut().enumerate() {
                let of = |variant: usize| picture_of(&renders[variant], view, picture);
                rendered.add_quarter(if renders.len() == predictions {
                    StoredLight::exposed(of(at), exposure)
                } else {
                    let companions = std::array::from_fn(|j| of(predictions + j));
                    let ratio = &self.lit.ratios[index][view];
                    without_companions(of(at), companions, &coefficients[picture], ratio, exposure)
                });
            }
        }
    }

    /// Adds the converged companions to every view and passes the predictions on.
    fn finish(
        &self,
        batch: &[usize],
        mixings: &[Mixing],
        planned: &[Planned],
        companions: Option<&CompanionPictures>,
        Quarters { mut views, not_finite }: Quarters,
        each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>,
    ) -> Result<(), EvalError> {
        if let Some(companions) = companions {
            for (at, view) in self.lit.views.iter().enumerate() {
                let [a, b] = [0, 1].map(|half| companions.read(&view.id, half, views[0].len()));
                let (a, b) = (a?, b?);
                for (&index, pictures) in batch.iter().zip(&mut views) {
                    let ratio = &self.lit.ratios[index][at];
                    for (picture, rendered) in pictures.iter_mut().enumerate() {
                        let coefficients = &planned[index].coefficients[picture];
                        let half = |half: &Vec<[Picture<LinearRgb>; COMPANIONS]>| {
                            of_companions(&half[picture], coefficients, ratio)
                        };
                        rendered[at].set_companions([half(&a), half(&b)]);
                    }
                }
            }
        }
        for ((&index, pictures), not_finite) in batch.iter().zip(views).zip(not_finite) {
            let names = self.pass.pictures.names();
            let named = names.into_iter().zip(pictures);
            let pictures = named.map(|((track, lighting), views)| LitPicture { track, lighting, views }).collect();
            let fit = mixings[index].fit.clone();
            each(index, PredictedLight { pictures, fit, samples: planned[index].samples, not_finite })?;
        }
        Ok(())
    }

    /// The weights of each prediction's lights; fits radiances where a picture needs them.
    fn mixings(&self, all: &[usize]) -> Result<Vec<Mixing>, EvalError> {
        if let PassPictures::Fixed(_) = self.pass.pictures {
            let mixing = Mixing { mixes: self.pass.fixed_mixes(), fit: None };
            return Ok(vec![mixing; all.len()]);
        }
        let mixing = |fit: FittedRadiances| Mixing {
            mixes: vec![fit.lights.iter().map(|light| light.radiance).collect()],
            fit: Some(fit),
        };
        Ok(self.fits(all)?.into_iter().map(mixing).collect())
    }

    /// The fitted radiances of each prediction, from stream `fit` of the input view.
    fn fits(&self, all: &[usize]) -> Result<Vec<FittedRadiances>, EvalError> {
        let Photo { view, light, valid } = &self.lit.photo;
        let target = FitTarget { photo: light, mask: Some(valid), exposure: self.lit.scene.exposure };
        let groups = LightGroups::apart(self.pass.lights.len());
        let mut fits = BTreeMap::new();
        let samples = self.rules.fit.samples;
        for batch in self.batches(all, |_| samples) {
            let predictions: Vec<&PredictedScene> = batch.iter().map(|&index| &self.predictions[index]).collect();
            let lighting = Lighting::Apart(&groups);
            let renders =
                self.pass.trace_alone(&predictions, lighting, &[view.camera], samples, "fit", "light basis")?;
            for (&index, render) in batch.iter().zip(renders) {
                let basis = &render.views[0].halves[0].basis;
                let fit = fit_lights(&self.rules.fit, basis, &target)?;
                fits.insert(index, self.radiances(fit));
            }
        }
        Ok(fits.into_values().collect())
    }

    fn radiances(&self, fit: LightFit) -> FittedRadiances {
        let lights = self.pass.lights.iter().zip(&fit.weights);
        let squares = fit.squares.max(1) as f64;
        FittedRadiances {
            stage: self.pass.on_stage,
            lights: lights
                .map(|(light, radiance)| FittedRadiance { light: light.clone(), radiance: *radiance })
                .collect(),
            mean_absolute_error: [0, 1, 2].map(|c| fit.channels[c].misfit / squares),
            ridge: [0, 1, 2].map(|c| fit.channels[c].ridge / squares),
            lower_bound: [0, 1, 2].map(|c| fit.channels[c].bound / squares),
        }
    }

    /// Predictions that share paths: they agree in roughness, metallic and number of samples. A batch holds as many as the
    /// tracer takes at once and as fit in memory.
    fn batches(&self, all: &[usize], samples: impl Fn(usize) -> u32) -> Vec<Vec<usize>> {
        let mut alike: BTreeMap<(&str, u32), Vec<usize>> = BTreeMap::new();
        for &index in all {
            alike.entry((&self.predictions[index].scattering_key, samples(index))).or_default().push(index);
        }
        let pixels = |view: &&View| u64::from(view.camera.intrinsics.width) * u64::from(view.camera.intrinsics.height);
        let pixels: u64 = self.lit.views.iter().map(pixels).sum();
        let one = size_of::<LinearRgb>() as u64 * self.pass.pictures.names().len() as u64 * pixels;
        let extra = if self.pass.companions().is_some() { COMPANIONS } else { 0 };
        let in_memory = (BATCH_BYTES / (2 * one).max(1)) as usize;
        let most = in_memory.min(mateval_tracer::repaint::MOST_PREDICTIONS_AT_ONCE).saturating_sub(extra).max(1);
        alike.into_values().flat_map(|alike| alike.chunks(most).map(<[usize]>::to_vec).collect::<Vec<_>>()).collect()
    }
}
