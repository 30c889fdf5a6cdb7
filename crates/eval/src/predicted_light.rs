//! Renders of predictions under each light of a protocol.
//!
//! In: a scene with its truth, predictions, the rules. Out, for each prediction: two independent halves of every view under
//! every light, and the radiances that were fitted.
//!
//! Predictions that agree in roughness and metallic share paths. A pilot render, with samples of its own, determines how
//! many samples each prediction needs. Radiances are fitted on a third stream of samples, so that the fit does not make the
//! two halves depend on each other. A prediction's pictures are the same, bit for bit, whichever others are rendered with it.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture};
use mateval_scene::dataset::View;
use mateval_scene::{Camera, Progress, SceneLights};
use mateval_tracer::light_basis::DEFAULT_BASIS_BYTES;
use mateval_tracer::{
    Coat, LightBasis, LightGroups, LightMix, Lighting, Repaint, StageLight, ViewsRender, World, render_repainted,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::error::EvalError;
use crate::light_rules::{LightRules, Track};
use crate::lit_scene::{LitScene, Photo};
use crate::pilot::enough_samples;
use crate::relit::LightingName;
use crate::seeds::seed;
use mateval_light::light_fit::{LightFit, fit_lights};
use mateval_light::light_stage;
use mateval_submission::prediction::PredictedScene;

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
    /// Two independent halves of each view, linear, before exposure.
    pub views: Vec<[Picture<LinearRgb>; 2]>,
}

/// Radiances fitted to the input view, with the proof that no others fit better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedRadiances {
    /// Whether they belong to a light stage; otherwise they multiply the radiances of the scene's own emitters.
    pub stage: bool,
    /// The radiance of each light.
    pub lights: Vec<FittedRadiance>,
    /// Mean absolute difference of the averaged pictures, linear, for each channel.
    pub mean_absolute_error: [f64; 3],
    /// Lower bound of that error: no other radiances can have less.
    pub lower_bound: [f64; 3],
}

/// One light's radiance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FittedRadiance {
    /// The light's name.
    pub light: String,
    /// Linear Rec. 709.
    pub radiance: [f64; 3],
}

/// Pictures of a prediction that come from one set of paths.
struct Pass<'a> {
    /// Part of the seeds.
    name: &'static str,
    world: &'a World,
    /// The name of each light.
    lights: Vec<String>,
    on_stage: bool,
    /// Track and lighting of each picture.
    pictures: Vec<(Track, Option<LightingName>)>,
}

/// The weights of a prediction's lights in each picture of a pass, and the fit that they come from.
struct Mixing {
    mixes: Vec<LightMix>,
    fit: Option<FittedRadiances>,
}

/// Renders all predictions under the lights of `rules` and passes each to `each`, pass by pass, with its index in
/// `predictions`. Holds at most [`DEFAULT_BASIS_BYTES`] of pictures at once, or one prediction's if that is more.
pub fn predicted_light(
    lit: &LitScene<'_>,
    rules: &LightRules,
    predictions: &[PredictedScene],
    progress: Progress<'_>,
    each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>,
) -> Result<(), EvalError> {
    let has = |track| rules.tracks.contains(&track);
    let staged = lit.scene.lights == SceneLights::Stage;
    let mut own = Vec::new();
    if has(Track::True) {
        own.push((Track::True, None));
    }
    if has(Track::Fitted) && !staged {
        own.push((Track::Fitted, None));
    }
    if has(Track::Relit) {
        own.extend(lit.lightings.iter().map(|lighting| (Track::Relit, Some(lighting.name))));
    }
    if !own.is_empty() {
        let lights = lit.world.scene().lights.iter().map(|light| light.name.clone()).collect();
        let pass = Pass { name: "own", world: lit.world, lights, on_stage: false, pictures: own };
        Renderer { lit, rules, pass, predictions, progress }.render(each)?;
    }
    if has(Track::Fitted) && staged {
        let stage = light_stage::scene_lights(&rules.stage, lit.scene, lit.world);
        let quads: Vec<StageLight> = stage.iter().map(|named| named.light.clone()).collect();
        let world = lit.world.on_stage(&quads)?;
        let lights = stage.into_iter().map(|named| named.name).collect();
        let pictures = vec![(Track::Fitted, None)];
        let pass = Pass { name: "stage", world: &world, lights, on_stage: true, pictures };
        Renderer { lit, rules, pass, predictions, progress }.render(each)?;
    }
    Ok(())
}

/// One pass over all predictions.
struct Renderer<'a> {
    lit: &'a LitScene<'a>,
    rules: &'a LightRules,
    pass: Pass<'a>,
    predictions: &'a [PredictedScene],
    progress: Progress<'a>,
}

impl Renderer<'_> {
    fn render(&self, each: &mut dyn FnMut(usize, PredictedLight) -> Result<(), EvalError>) -> Result<(), EvalError> {
        let all: Vec<usize> = (0..self.predictions.len()).collect();
        let mixings = self.mixings(&all)?;
        let samples = self.samples(&all, &mixings)?;
        let cameras: Vec<Camera> = self.lit.views.iter().map(|view| view.camera).collect();
        for batch in self.batches(&all, |index| samples[index], 2 * self.pass.pictures.len()) {
            let count = samples[batch[0]];
            let mixes: Vec<Vec<LightMix>> = batch.iter().map(|&index| mixings[index].mixes.clone()).collect();
            let what = format!("scene {}: {} light, {count} samples", self.lit.scene.id, self.pass.name);
            let renders = self.trace(&batch, &cameras, Lighting::Mixed(&mixes), count, &["a", "b"], &what)?;
            for (&index, render) in batch.iter().zip(renders) {
                let fit = mixings[index].fit.clone();
                let not_finite = render.stats.not_finite;
                each(index, PredictedLight { pictures: self.pictures(render), fit, samples: count, not_finite })?;
            }
        }
        Ok(())
    }

    /// Sorts the halves of a render by picture.
    fn pictures(&self, render: ViewsRender) -> Vec<LitPicture> {
        let bases: Vec<Vec<LightBasis>> =
            render.views.into_iter().map(|view| view.halves.into_iter().map(|half| half.basis).collect()).collect();
        let named = self.pass.pictures.iter().enumerate();
        named
            .map(|(at, (track, lighting))| LitPicture {
                track: *track,
                lighting: *lighting,
                views: bases.iter().map(|halves| [0, 1].map(|half| halves[half].pictures()[at].clone())).collect(),
            })
            .collect()
    }

    /// The weights of each prediction's lights; fits radiances where a picture needs them.
    fn mixings(&self, all: &[usize]) -> Result<Vec<Mixing>, EvalError> {
        let fits = if self.pass.pictures.iter().any(|(track, _)| *track == Track::Fitted) {
            self.fits(all)?.into_iter().map(Some).collect()
        } else {
            vec![None; all.len()]
        };
        let ones: LightMix = vec![[1.0; 3]; self.pass.lights.len()];
        let mixing = |fit: Option<FittedRadiances>| {
            let fitted = fit.as_ref().map(|fit| fit.lights.iter().map(|light| light.radiance).collect::<LightMix>());
            let mix = |(track, lighting): &(Track, Option<LightingName>)| match track {
                Track::True => ones.clone(),
                Track::Fitted => fitted.clone().expect("a pass with this track was fitted"),
                Track::Relit => {
                    let relit = self.lit.lightings.iter().find(|relit| Some(relit.name) == *lighting);
                    relit.expect("the pass was made of these lightings").weights.clone()
                }
            };
            Mixing { mixes: self.pass.pictures.iter().map(mix).collect(), fit }
        };
        Ok(fits.into_iter().map(mixing).collect())
    }

    /// The fitted radiances of each prediction, from stream `fit` of the input view.
    fn fits(&self, all: &[usize]) -> Result<Vec<FittedRadiances>, EvalError> {
        let Photo { view, light, valid } = &self.lit.photo;
        let lights = self.pass.lights.len();
        let groups = LightGroups::apart(lights);
        let mut fits = BTreeMap::new();
        let samples = self.rules.fit.samples;
        for batch in self.batches(all, |_| samples, lights) {
            let what = format!("scene {}: light basis", self.lit.scene.id);
            let renders = self.trace(&batch, &[view.camera], Lighting::Apart(&groups), samples, &["fit"], &what)?;
            for (&index, render) in batch.iter().zip(renders) {
                let basis = &render.views[0].halves[0].basis;
                let fit = fit_lights(&self.rules.fit, basis, light, Some(valid))?;
                fits.insert(index, self.radiances(fit));
            }
        }
        Ok(fits.into_values().collect())
    }

    fn radiances(&self, fit: LightFit) -> FittedRadiances {
        let lights = self.pass.lights.iter().zip(&fit.weights);
        let rows = |channel: usize| fit.channels[channel].dual.len().max(1) as f64;
        FittedRadiances {
            stage: self.pass.on_stage,
            lights: lights
                .map(|(light, radiance)| FittedRadiance { light: light.clone(), radiance: *radiance })
                .collect(),
            mean_absolute_error: [0, 1, 2].map(|c| fit.channels[c].sum / rows(c)),
            lower_bound: [0, 1, 2].map(|c| fit.channels[c].bound / rows(c)),
        }
    }

    /// Samples per pixel of each half that each prediction needs.
    fn samples(&self, all: &[usize], mixings: &[Mixing]) -> Result<Vec<u32>, EvalError> {
        let noise = &self.rules.noise;
        let cameras: Vec<Camera> = self.lit.views.iter().map(|view| view.camera).collect();
        // Relit pictures are sums of the same paths: the samples that the others need are enough.
        let watched: Vec<usize> =
            (0..self.pass.pictures.len()).filter(|&at| self.pass.pictures[at].0 != Track::Relit).collect();
        if watched.is_empty() || noise.least_samples >= noise.most_samples {
            return Ok(vec![noise.least_samples; all.len()]);
        }
        let mut samples = vec![noise.least_samples; all.len()];
        for batch in self.batches(all, |_| noise.pilot_samples, 2 * watched.len()) {
            let chosen = |index: usize| watched.iter().map(|&at| mixings[index].mixes[at].clone()).collect();
            let mixes: Vec<Vec<LightMix>> = batch.iter().map(|&index| chosen(index)).collect();
            let what = format!("scene {}: {} pilot", self.lit.scene.id, self.pass.name);
            let streams = ["pilot_a", "pilot_b"];
            let renders =
                self.trace(&batch, &cameras, Lighting::Mixed(&mixes), noise.pilot_samples, &streams, &what)?;
            for (&index, render) in batch.iter().zip(&renders) {
                for at in 0..watched.len() {
                    samples[index] = samples[index].max(enough_samples(noise, self.lit, render, at)?);
                }
            }
        }
        Ok(samples)
    }

    /// Predictions that share paths: they agree in roughness, metallic and number of samples. A batch holds as many as fit in
    /// memory, with `pictures` of all views each.
    fn batches(&self, all: &[usize], samples: impl Fn(usize) -> u32, pictures: usize) -> Vec<Vec<usize>> {
        let mut alike: BTreeMap<(&str, u32), Vec<usize>> = BTreeMap::new();
        for &index in all {
            alike.entry((&self.predictions[index].scattering_key, samples(index))).or_default().push(index);
        }
        let pixels = |view: &&View| u64::from(view.camera.intrinsics.width) * u64::from(view.camera.intrinsics.height);
        let pixels: u64 = self.lit.views.iter().map(pixels).sum();
        let bytes = (size_of::<LinearRgb>() * pictures) as u64 * pixels;
        let most = (DEFAULT_BASIS_BYTES / bytes.max(1)).max(1) as usize;
        alike.into_values().flat_map(|alike| alike.chunks(most).map(<[usize]>::to_vec).collect::<Vec<_>>()).collect()
    }

    fn trace(
        &self,
        batch: &[usize],
        cameras: &[Camera],
        lighting: Lighting<'_>,
        samples: u32,
        streams: &[&str],
        what: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let repaint = self.repaint(batch)?;
        let seeds: Vec<u64> = streams.iter().map(|stream| seed(&self.lit.scene.id, self.pass.name, stream)).collect();
        let settings = self.rules.settings(samples);
        let shown = |done: usize, all: usize| (self.progress)(what, done, all);
        let which = 0..batch.len();
        Ok(render_repainted(self.pass.world, &repaint, which, cameras, lighting, &settings, &seeds, &shown)?)
    }

    fn repaint(&self, batch: &[usize]) -> Result<Repaint, EvalError> {
        let coat = |surface: usize| {
            let materials = batch.iter().map(|&index| self.predictions[index].materials[surface].as_ref());
            let materials: Vec<_> = materials.collect::<Option<_>>()?;
            Some(Coat {
                base_colors: materials.iter().map(|material| material.base_color.clone()).collect(),
                roughness: materials[0].roughness.clone(),
                metallic: materials[0].metallic.clone(),
            })
        };
        let coats = (0..self.lit.atlases.len()).map(coat).collect();
        Ok(Repaint::new(self.pass.world, self.lit.atlases, coats, self.rules.flavour)?)
    }
}
