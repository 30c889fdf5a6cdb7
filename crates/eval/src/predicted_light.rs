//! Renders of predictions under each light of a protocol.
//!
//! In: a scene with its truth, predictions, the rules. Out, for each prediction: four independent quarters of every view
//! under every light, and the radiances that were fitted.
//!
//! Predictions that agree in roughness and metallic share paths, and the scene's companions travel along. A pilot render,
//! with samples of its own, determines how the companions correct each prediction and how many samples it needs. Radiances
//! are fitted on two further streams of samples (`fitted_mixes`), one for each half, so that the noise of the fit adds no
//! bias to the squared error. A prediction's pictures are the same, bit for bit, whichever others are rendered with it.

use std::collections::BTreeMap;

use mateval_image::LinearRgb;
use mateval_light::light_stage;
use mateval_scene::dataset::View;
use mateval_scene::{Progress, SceneLights};
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::{StageLight, ViewsRender};

use crate::batch_mixes::BatchMixes;
use crate::companion_pictures::{CompanionPictures, HALVES};
use crate::companions::{COMPANIONS, Companions};
use crate::control_variate::Coefficients;
use crate::error::EvalError;
use crate::fitted_mixes::{FittedMixes, MixFit};
use crate::fitted_radiances::FittedRadiances;
use crate::light_pass::{LightPass, PassPictures};
use crate::light_rules::{LightRules, Track};
use crate::lit_scene::LitScene;
use crate::pilot::{Pilot, run_pilot};
use crate::pilot_view::pilot_views;
use crate::relit::{LightingName, group_shares};
use crate::rendered_view::{RenderedView, of_companions, picture_of, without_companions};
use crate::stored_light::StoredLight;
use crate::view_set::PassName;

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
    /// For track `fitted`, the views under the radiances that each of two streams of samples was fitted to: [`Self::views`]
    /// have half A of the first and half B of the second.
    pub of_fits: Option<[Vec<RenderedView>; 2]>,
}

/// The largest amount of memory that the pictures of one batch of predictions take, in bytes.
const BATCH_BYTES: u64 = 850 << 20;

/// Finds the converged pictures of the companions for a pass, or makes them.
pub(crate) type FindCompanions<'a> = dyn Fn(&LightPass<'_>, &Companions) -> Result<CompanionPictures, EvalError> + 'a;

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
        let pass = LightPass::of_own_lights(PassName::Own, lit, rules, PassPictures::Fixed(fixed), progress);
        let shares = group_shares(&pass.companion_mixes(), &lit.photo.group_light);
        let world = &lit.world.with_group_shares(&lit.photo.view.camera, &shares);
        let pass = pass.sampled_in(world, shares);
        Renderer { lit, rules, pass, predictions, find_companions }.render(each)?;
    }
    if has(Track::Fitted) && lit.scene.lights == SceneLights::Own {
        let pass = LightPass::of_own_lights(PassName::Fitted, lit, rules, PassPictures::Fitted, progress);
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
        // Without lights nothing is to be corrected.
        let known = self.lit.companions.filter(|_| !self.pass.lights.is_empty());
        let companions = known.map(|companions| (self.find_companions)(&self.pass, companions)).transpose()?;
        let fits = self.fits(&all, companions.as_ref())?;
        let planned = self.plan(&all, &fits, companions.as_ref())?;
        for batch in self.batches(&all, |index| planned[index].samples, |count| self.quarters_bytes(count)) {
            let quarters = self.quarters(&batch, &fits, &planned)?;
            self.finish(&batch, &fits, &planned, companions.as_ref(), quarters, each)?;
        }
        Ok(())
    }

    /// The fit of each prediction's lights; none in a pass whose weights are fixed.
    fn fits(&self, all: &[usize], companions: Option<&CompanionPictures>) -> Result<Vec<FittedMixes>, EvalError> {
        let mut fits = BTreeMap::new();
        if let PassPictures::Fixed(_) = self.pass.pictures {
            return Ok(Vec::new());
        }
        for batch in self.batches(all, |_| self.rules.fit.samples, |count| self.basis_bytes(count)) {
            let fit = MixFit {
                lit: self.lit,
                rules: self.rules,
                pass: &self.pass,
                companions,
                batch: &batch,
                predictions: self.predictions_of(&batch),
            };
            fits.extend(batch.iter().copied().zip(fit.run()?));
        }
        Ok(fits.into_values().collect())
    }

    /// What the pilot finds about each prediction.
    fn plan(
        &self,
        all: &[usize],
        fits: &[FittedMixes],
        companions: Option<&CompanionPictures>,
    ) -> Result<Vec<Planned>, EvalError> {
        let mut planned = BTreeMap::new();
        for batch in self.batches(all, |_| self.rules.noise.pilot_samples, |count| self.quarters_bytes(count)) {
            let pilot = Pilot {
                lit: self.lit,
                rules: &self.rules.noise,
                pass: &self.pass,
                companions,
                predictions: self.predictions_of(&batch),
                mixes: &self.mixes(&batch, fits),
                views: pilot_views(&self.rules.noise, self.lit, &batch),
            };
            for (&index, (samples, coefficients)) in batch.iter().zip(run_pilot(&pilot)?) {
                planned.insert(index, Planned { samples, coefficients });
            }
        }
        Ok(planned.into_values().collect())
    }

    /// The quarters of every prediction of a batch.
    fn quarters(&self, batch: &[usize], fits: &[FittedMixes], planned: &[Planned]) -> Result<Quarters, EvalError> {
        let (samples, mixes) = (planned[batch[0]].samples, self.mixes(batch, fits));
        let predictions = self.predictions_of(batch);
        let blank = vec![vec![RenderedView::empty(); self.lit.views.len()]; mixes.pictures()];
        let (mut views, mut not_finite) = (vec![blank; batch.len()], vec![0; batch.len()]);
        for quarter in ["a1", "a2", "b1", "b2"] {
            let what = format!("{} light, {samples} samples, quarter {quarter}", self.pass.name);
            let cameras = self.lit.cameras();
            let renders = self.pass.trace(&predictions, &mixes.all, &cameras, (samples / 2).max(1), quarter, &what)?;
            for (at, &index) in batch.iter().enumerate() {
                not_finite[at] += renders[at].stats.not_finite;
                for (picture, views) in views[at].iter_mut().enumerate() {
                    let coefficients = &planned[index].coefficients[picture];
                    self.add_quarter(&renders, (at, index), mixes.place(at, picture), coefficients, views);
                }
            }
        }
        Ok(Quarters { views, not_finite })
    }

    /// Adds one picture of a render, of prediction `at` of its batch, as the next quarter of each view.
    fn add_quarter(
        &self,
        renders: &[ViewsRender],
        (at, index): (usize, usize),
        picture: usize,
        coefficients: &Coefficients,
        views: &mut [RenderedView],
    ) {
        let exposure = self.lit.scene.exposure;
        for (view, rendered) in views.iter_mut().enumerate() {
            let of = |variant: usize| picture_of(&renders[variant], view, picture);
            rendered.add_quarter(if self.lit.companions.is_none() || self.pass.lights.is_empty() {
                StoredLight::exposed(of(at), exposure)
            } else {
                // The companions come after the predictions.
                let companions = std::array::from_fn(|j| of(renders.len() - COMPANIONS + j));
                let ratio = &self.lit.ratio(index, view);
                without_companions(of(at), companions, coefficients, ratio, exposure)
            });
        }
    }

    /// Adds the converged companions to every view and passes the predictions on.
    fn finish(
        &self,
        batch: &[usize],
        fits: &[FittedMixes],
        planned: &[Planned],
        companions: Option<&CompanionPictures>,
        Quarters { mut views, not_finite }: Quarters,
        each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>,
    ) -> Result<(), EvalError> {
        if let Some(companions) = companions {
            let (mixes, kept) = (self.mixes(batch, fits), self.pass.companion_mixes().len());
            for (view, shown) in self.lit.views.iter().enumerate() {
                let mut halves: Vec<Vec<Vec<StoredLight>>> = Vec::new();
                for half in 0..HALVES.len() {
                    let converged = companions.read(&shown.id, half, kept)?;
                    let of = |(at, &index): (usize, &usize)| {
                        let ratio = self.lit.ratio(index, view);
                        let picture = |picture: usize| {
                            let companions = self.pass.converged(&converged, picture, mixes.mix(at, picture));
                            let coefficients = &planned[index].coefficients[picture];
                            of_companions(&companions, coefficients, &ratio)
                        };
                        (0..mixes.pictures()).map(picture).collect()
                    };
                    halves.push(batch.iter().enumerate().map(of).collect());
                }
                let second = halves.pop().expect("there are two halves");
                let first = halves.pop().expect("there are two halves");
                for (pictures, halves) in views.iter_mut().zip(first.into_iter().zip(second)) {
                    for (picture, (a, b)) in pictures.iter_mut().zip(halves.0.into_iter().zip(halves.1)) {
                        picture[view].set_companions([a, b]);
                    }
                }
            }
        }
        for ((&index, pictures), not_finite) in batch.iter().zip(views).zip(not_finite) {
            let fit = fits.get(index).map(|fit| fit.radiances.clone());
            let pictures = self.named(pictures);
            each(index, PredictedLight { pictures, fit, samples: planned[index].samples, not_finite })?;
        }
        Ok(())
    }

    /// The pictures of a prediction by track and lighting.
    fn named(&self, pictures: Vec<Vec<RenderedView>>) -> Vec<LitPicture> {
        match &self.pass.pictures {
            PassPictures::Fixed(names) => {
                let named = names.iter().zip(pictures);
                let named =
                    named.map(|(&(track, lighting), views)| LitPicture { track, lighting, views, of_fits: None });
                named.collect()
            }
            PassPictures::Fitted => {
                let mut streams = pictures.into_iter();
                let of_fits: [Vec<RenderedView>; 2] =
                    std::array::from_fn(|_| streams.next().expect("there is a picture for each stream"));
                let pairs = of_fits[0].iter().zip(&of_fits[1]);
                let views = pairs.map(|(a, b)| RenderedView::of_halves(a, b)).collect();
                vec![LitPicture { track: Track::Fitted, lighting: None, views, of_fits: Some(of_fits) }]
            }
        }
    }

    fn predictions_of(&self, batch: &[usize]) -> Vec<&PredictedScene> {
        batch.iter().map(|&index| &self.predictions[index]).collect()
    }

    /// The weights of the lights in a batch's pictures.
    fn mixes(&self, batch: &[usize], fits: &[FittedMixes]) -> BatchMixes {
        match self.pass.pictures {
            PassPictures::Fixed(_) => BatchMixes::shared(self.pass.companion_mixes()),
            PassPictures::Fitted => BatchMixes::own(batch.iter().map(|&index| fits[index].streams.to_vec()).collect()),
        }
    }

    /// Predictions that share paths: they agree in roughness, metallic and number of samples. A batch holds as many as the
    /// tracer takes at once and as fit in memory, by the bytes that a number of predictions needs.
    fn batches(&self, all: &[usize], samples: impl Fn(usize) -> u32, bytes: impl Fn(usize) -> u64) -> Vec<Vec<usize>> {
        let mut alike: BTreeMap<(&str, u32), Vec<usize>> = BTreeMap::new();
        for &index in all {
            let prediction = &self.predictions[index];
            let companions = self.lit.companions.filter(|companions| companions.scatter_like(prediction));
            let scattering = companions.map_or(prediction, |companions| &companions.truth);
            alike.entry((&scattering.scattering_key, samples(index))).or_default().push(index);
        }
        let at_once = mateval_tracer::repaint::MOST_PREDICTIONS_AT_ONCE - self.companion_count();
        let most = (1..=at_once).rev().find(|&count| bytes(count) <= BATCH_BYTES).unwrap_or(1);
        alike.into_values().flat_map(|alike| alike.chunks(most).map(<[usize]>::to_vec).collect::<Vec<_>>()).collect()
    }

    fn companion_count(&self) -> usize {
        if self.lit.companions.is_some() { COMPANIONS } else { 0 }
    }

    /// Memory of the quarters of this many predictions: a render, and all quarters as they are stored. (The companions'
    /// halves take the render's place when it is gone.)
    fn quarters_bytes(&self, count: usize) -> u64 {
        let each = self.pass.pictures.names().len();
        let in_render = if matches!(self.pass.pictures, PassPictures::Fixed(_)) { each } else { each * count };
        let rendered = ((count + self.companion_count()) * in_render) as u64 * RENDERED_BYTES;
        let pixels: u64 = self.lit.views.iter().map(|view| pixels(view)).sum();
        pixels * (rendered + (4 * count * each) as u64 * STORED_BYTES)
    }

    /// Memory of the light bases of this many predictions: both renders of the pilot, or a render with its converged companions
    /// and both streams' bases.
    fn basis_bytes(&self, count: usize) -> u64 {
        let (with, companions) = (count + self.companion_count(), self.companion_count());
        let pictures = (2 * with).max(with + companions + 2 * count) * self.pass.lights.len();
        pixels(self.lit.photo.view) * pictures as u64 * RENDERED_BYTES
    }
}

/// Bytes of a pixel of a render.
const RENDERED_BYTES: u64 = size_of::<LinearRgb>() as u64;

/// Bytes of a pixel of [`StoredLight`].
const STORED_BYTES: u64 = 6;

fn pixels(view: &View) -> u64 {
    u64::from(view.camera.intrinsics.width) * u64::from(view.camera.intrinsics.height)
}
