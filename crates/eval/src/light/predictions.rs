//! Predictions under the scene's own emitters, compared with R.
//!
//! Predictions that agree in roughness and metallic differ in base colour alone, on which no decision along a path depends:
//! they share their paths. The truth can travel along, also where its roughness and metallic are others: directions then come
//! from both densities in equal parts, and each of both is weighted by its own. A prediction's pictures are the same, bit for
//! bit, whichever others are rendered with it.

use std::collections::BTreeMap;

use mateval_image::{LinearRgb, Picture, SrgbRgb, png_io};
use mateval_scene::manifest::sha256_of_bytes;
use mateval_scene::{Camera, Progress, Report, SceneId, TriangleMesh};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene};
use mateval_tracer::noise_filter::Surfaces;
use mateval_tracer::{Coat, LightMix, Lighting, Repaint, Scattering, ViewsRender, World, render_repainted};
use rayon::prelude::*;

use crate::error::EvalError;
use crate::light::difference::{LightDifference, ViewGuide, corrected_quarter, difference};
use crate::light::lighting::{LightingName, group_shares, light_of, lightings};
use crate::light::reference::{StoredReference, weighted};
use crate::protocol::{LightRules, Protocol, Track};
use crate::scene::{BaseColors, SceneTask};
use crate::truth::{ViewTruth, true_maps};
use mateval_light::light_fit::FittedRadiances;
use mateval_metrics::mask_rule::ReferenceFeatures;

/// A prediction under one light, compared with the reference.
pub(crate) struct LitPicture<'a> {
    pub(crate) track: Track,
    /// For track `relit`.
    pub(crate) lighting: Option<LightingName>,
    /// What it is compared with, by view.
    pub(crate) references: &'a [EncodedReference],
    /// By view.
    pub(crate) views: Vec<LightDifference>,
    /// For fitted lights, the views under the lights of each of two fits.
    pub(crate) of_fits: Option<[Vec<LightDifference>; 2]>,
    pub(crate) fit: Option<FittedRadiances>,
    /// Contributions of light that were not finite and count as none.
    pub(crate) not_finite: u64,
}

/// A reference picture, within 0..1 and encoded, with what LPIPS compares of it.
pub(crate) struct EncodedReference {
    pub(crate) picture: Picture<SrgbRgb>,
    pub(crate) features: ReferenceFeatures,
}

impl EncodedReference {
    pub(crate) fn new(exposed: &Picture<LinearRgb>) -> Self {
        Self { picture: exposed.to_srgb(), features: ReferenceFeatures::default() }
    }
}

/// Passes a prediction's picture on, with its number.
pub(crate) type Each<'a> = dyn FnMut(usize, LitPicture<'_>) -> Result<(), EvalError> + 'a;

/// The four quarters of each view.
pub(crate) type ViewQuarters = Vec<Vec<Picture<LinearRgb>>>;

/// One lighting of the scene's own emitters.
struct OwnLighting {
    track: Track,
    name: Option<LightingName>,
    mix: LightMix,
    /// R by view, exposed.
    references: Vec<Picture<LinearRgb>>,
    encoded: Vec<EncodedReference>,
}

/// Renders every submission together with the truth under the scene's own emitters, in every lighting of the protocol, and
/// compares it with R.
pub(super) fn score_own(
    task: &SceneTask<'_>,
    reference: &StoredReference,
    truths: &[ViewTruth],
    base_colors: &BaseColors,
    protocol: &Protocol,
    each: &mut Each<'_>,
) -> Result<(), EvalError> {
    let rules = &protocol.light;
    let (lightings, group_light) = own_lightings(task, reference, protocol)?;
    let mixes: Vec<LightMix> = lightings.iter().map(|lighting| lighting.mix.clone()).collect();
    let input = task.input_view()?;
    let world: World = task.world.with_group_shares(&input.camera, &group_shares(&mixes, &group_light));
    let (scene, atlases, progress) = (&task.scene.id, task.atlases, task.progress);
    let paths = Paths { scene, world: &world, atlases, rules, pass: task.set.pass("own"), progress };
    let truth = true_maps(task.folder, task.scene)?;
    let cameras: Vec<Camera> = task.views.iter().map(|view| view.camera).collect();
    let samples = rules.samples.each_half(task.pixels());
    // A batch holds a render and four quarters of every prediction.
    let bytes = 5 * (lightings.len() as u64) * task.pixels_of_all_views() * size_of::<LinearRgb>() as u64;
    for batch in batches(task.predictions, 1, bytes) {
        let predictions: Vec<_> = batch.iter().map(|&index| &task.predictions[index]).collect();
        let repaint = paths.repaint(&predictions, Some(&truth))?;
        let mixes = vec![mixes.clone(); repaint.predictions()];
        let ratios: Vec<Vec<Picture<LinearRgb>>> = batch.iter().map(|&index| base_colors.ratios(index)).collect();
        let corrected = |renders: &[ViewsRender], prediction: usize, lighting: usize, view: usize| {
            // The truth travels last.
            let [own, truth] = [prediction, batch.len()].map(|at| picture_of(&renders[at], view, lighting));
            let (reference, ratio) = (&lightings[lighting].references[view], &ratios[prediction][view]);
            corrected_quarter(own, truth, task.scene.exposure, reference, ratio)
        };
        let (mut quarters, mut not_finite) =
            paths.quarters(&repaint, &mixes, &cameras, batch.len(), samples, corrected)?;
        for (at, &index) in batch.iter().enumerate() {
            for (picture, lighting) in lightings.iter().enumerate() {
                let quarters = std::mem::take(&mut quarters[at][picture]);
                let guides = Guides { truths, ratios: &ratios[at], references: &lighting.references };
                if let Some(kept) = task.pictures {
                    for (at, (view, quarters)) in task.views.iter().zip(&quarters).enumerate() {
                        let place = (&task.scene.id, &view.id);
                        kept.keep_light(index, place, lighting.name, quarters, &guides.of(at))?;
                    }
                }
                let (track, name) = (lighting.track, lighting.name);
                let views = guides.differences(quarters);
                let references = &lighting.encoded;
                // The scene's count, once.
                let not_finite = std::mem::take(&mut not_finite[at]);
                each(
                    index,
                    LitPicture { track, lighting: name, references, views, of_fits: None, fit: None, not_finite },
                )?;
            }
        }
    }
    Ok(())
}

/// The lightings of the protocol with R in each view, and the light of each group in R's input view.
fn own_lightings(
    task: &SceneTask<'_>,
    reference: &StoredReference,
    protocol: &Protocol,
) -> Result<(Vec<OwnLighting>, Vec<[f64; 3]>), EvalError> {
    let input = task.input_view()?;
    let valid = png_io::read_mask(&task.folder.view(&input.id).join("valid.png"))?;
    let group_light: Vec<[f64; 3]> = reference.groups(input)?.iter().map(|group| light_of(group, &valid)).collect();
    let groups = task.world.emitters().groups();
    if group_light.len() != groups {
        return Err(EvalError::Reference {
            dataset: task.dataset.to_owned(),
            scene: task.scene.id.clone(),
            path: task.folder.scorer(),
            what: format!("it has {} light groups, the scene has {groups}", group_light.len()),
        });
    }
    let mut wanted = vec![(Track::True, None, vec![[1.0; 3]; groups])];
    if protocol.light.tracks.contains(&Track::Relit) {
        let relit = lightings(&protocol.light.relit, &group_light);
        wanted.extend(relit.into_iter().map(|relit| (Track::Relit, Some(relit.name), relit.weights)));
    }
    let blank = |(track, name, mix)| OwnLighting { track, name, mix, references: Vec::new(), encoded: Vec::new() };
    let mut all: Vec<OwnLighting> = wanted.into_iter().map(blank).collect();
    for view in &task.views {
        let groups = reference.groups(view)?;
        let k = view.camera.intrinsics;
        for lighting in &mut all {
            let size = [k.width as usize, k.height as usize];
            let picture = weighted(&groups, &lighting.mix, task.scene.exposure, size);
            lighting.encoded.push(EncodedReference::new(&picture));
            lighting.references.push(picture);
        }
    }
    Ok((all, group_light))
}

/// The four independent renders of a prediction: both quarters of the first half, then of the second.
pub(crate) const QUARTERS: [&str; 4] = ["a1", "a2", "b1", "b2"];

/// The largest amount of memory that the pictures of one batch of predictions take, in bytes.
const BATCH_BYTES: u64 = 850 << 20;

/// A scene under some lights, whose paths have seeds of their own.
pub(crate) struct Paths<'a> {
    pub(crate) scene: &'a SceneId,
    pub(crate) world: &'a World,
    /// The meshes of `instances.glb`, one for each surface of the world.
    pub(crate) atlases: &'a [TriangleMesh],
    pub(crate) rules: &'a LightRules,
    /// The name of the pass, part of the seeds.
    pub(crate) pass: String,
    pub(crate) progress: Progress<'a>,
}

impl Paths<'_> {
    /// One stream of everything that travels: predictions, then the truth.
    pub(crate) fn trace(
        &self,
        repaint: &Repaint,
        lighting: Lighting<'_>,
        cameras: &[Camera],
        samples: u32,
        stream: &str,
    ) -> Result<Vec<ViewsRender>, EvalError> {
        let what = format!("scene {}: {} light, {samples} samples, {stream}", self.scene, self.pass);
        let seeds = [self.seed(stream)];
        let settings = self.rules.settings(samples);
        let shown = |done: usize, all: usize| (self.progress)(Report::step(&what, done, all));
        let which = 0..repaint.predictions();
        Ok(render_repainted(self.world, repaint, which, cameras, lighting, &settings, &seeds, &shown)?)
    }

    /// The quarters of the first `predictions` that travel, by prediction, light mix and view, and the number of contributions of
    /// each that were not finite. Each half has `samples` per pixel, so a quarter has half of them. `picture` makes the picture
    /// of (prediction, mix, view) from one stream's renders of everything that travels.
    pub(crate) fn quarters(
        &self,
        repaint: &Repaint,
        mixes: &[Vec<LightMix>],
        cameras: &[Camera],
        predictions: usize,
        samples: u32,
        picture: impl Fn(&[ViewsRender], usize, usize, usize) -> Picture<LinearRgb> + Sync,
    ) -> Result<(Vec<Vec<ViewQuarters>>, Vec<u64>), EvalError> {
        let mut quarters = vec![vec![vec![Vec::new(); cameras.len()]; mixes[0].len()]; predictions];
        let mut not_finite = vec![0; predictions];
        for stream in QUARTERS {
            let renders = self.trace(repaint, Lighting::Mixed(mixes), cameras, (samples / 2).max(1), stream)?;
            for (prediction, mixes) in quarters.iter_mut().enumerate() {
                not_finite[prediction] += renders[prediction].stats.not_finite;
                for (mix, views) in mixes.iter_mut().enumerate() {
                    let views = views.par_iter_mut().enumerate();
                    views.for_each(|(view, quarters)| quarters.push(picture(&renders, prediction, mix, view)));
                }
            }
        }
        Ok((quarters, not_finite))
    }

    /// The seed of one stream, the same for every prediction.
    pub(crate) fn seed(&self, stream: &str) -> u64 {
        let text = format!("{}/{}/{}/{stream}", self.rules.samples.seed, self.scene, self.pass);
        u64::from_str_radix(&sha256_of_bytes(text.as_bytes())[..16], 16).expect("a hash is hexadecimal")
    }

    /// The materials that travel together. Predictions agree in roughness and metallic; those of the truth may be others.
    pub(crate) fn repaint(
        &self,
        predictions: &[&PredictedScene],
        truth: Option<&PredictedScene>,
    ) -> Result<Repaint, EvalError> {
        let all: Vec<&PredictedScene> = predictions.iter().copied().chain(truth).collect();
        let first = all.first().expect("there is something to render");
        let coat = |surface: usize| {
            let PredictedMaterial { roughness, metallic, .. } = first.materials[surface].clone()?;
            let base_colors = all.iter().map(|scene| Some(scene.materials[surface].as_ref()?.base_color.clone()));
            Some(Coat { base_colors: base_colors.collect::<Option<_>>()?, roughness, metallic })
        };
        let coats: Vec<Option<Coat>> = (0..self.atlases.len()).map(coat).collect();
        let repaint = Repaint::new(self.world, self.atlases, coats, self.rules.flavour)?;
        match truth.filter(|truth| truth.scattering_key != first.scattering_key) {
            None => Ok(repaint),
            Some(truth) => {
                let own = |material: &Option<PredictedMaterial>| {
                    let PredictedMaterial { roughness, metallic, .. } = material.clone()?;
                    Some(Scattering { roughness, metallic })
                };
                Ok(repaint.with_second(predictions.len(), truth.materials.iter().map(own).collect())?)
            }
        }
    }
}

/// Predictions that share paths, by their numbers: those that agree in roughness and metallic, as many as the tracer takes at
/// once beside `others` more and as fit in memory, where each takes `bytes`.
pub(crate) fn batches(predictions: &[PredictedScene], others: usize, bytes: u64) -> Vec<Vec<usize>> {
    let mut alike: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for (index, prediction) in predictions.iter().enumerate() {
        alike.entry(&prediction.scattering_key).or_default().push(index);
    }
    let at_once = mateval_tracer::repaint::MOST_PREDICTIONS_AT_ONCE - others;
    let in_memory = (BATCH_BYTES / bytes.max(1)).saturating_sub(others as u64);
    let most = at_once.min(in_memory.max(1) as usize);
    alike.into_values().flat_map(|alike| alike.chunks(most).map(<[usize]>::to_vec).collect::<Vec<_>>()).collect()
}

/// A picture of one view. Every stream has one seed, so the tracer's list of halves holds one.
pub(crate) fn picture_of(render: &ViewsRender, view: usize, picture: usize) -> &Picture<LinearRgb> {
    &render.views[view].halves[0].basis.pictures()[picture]
}

/// What is known of each view of a prediction in one lighting.
pub(crate) struct Guides<'a> {
    pub(crate) truths: &'a [ViewTruth],
    /// r.
    pub(crate) ratios: &'a [Picture<LinearRgb>],
    /// R, exposed.
    pub(crate) references: &'a [Picture<LinearRgb>],
}

impl Guides<'_> {
    pub(crate) fn of(&self, view: usize) -> ViewGuide<'_> {
        let ViewTruth { instances, normals, valid, .. } = &self.truths[view];
        let surfaces = Surfaces { base_color: None, instances, normals, valid };
        ViewGuide { reference: &self.references[view], ratio: &self.ratios[view], surfaces }
    }

    pub(crate) fn differences(&self, quarters: ViewQuarters) -> Vec<LightDifference> {
        let views = quarters.par_iter().enumerate();
        views.map(|(view, quarters)| difference([0, 1, 2, 3].map(|at| &quarters[at]), &self.of(view))).collect()
    }
}
