//! Renders of predictions that share paths.
//!
//! Predictions that agree in roughness and metallic differ in base colour alone, on which no decision along a path
//! depends: they travel along the same paths, each with its own colours. So does the truth, also where its roughness
//! and metallic are others: directions then come from both densities in equal parts, and each of both is weighted by
//! its own. A prediction's pictures are the same, bit for bit, whichever others are rendered with it.

use std::collections::BTreeMap;

use mateval_dataset::{Camera, Progress, Report, SceneId, TriangleMesh, splitmix64};
use mateval_image::{LinearRgb, Picture};
use mateval_submission::prediction::{PredictedMaterial, PredictedScene};
use mateval_tracer::{
    LightMix, Lighting, RenderSettings, Repaint, Scattering, SurfaceMaps, ViewsRender, World, render_repainted,
};
use rayon::prelude::*;

use crate::error::EvalError;
use crate::protocol::LightRules;

/// By view, then by quarter.
pub(crate) type ViewQuarters = Vec<Vec<Picture<LinearRgb>>>;

/// The four independent renders of a prediction: both quarters of the first half, then of the second.
pub(crate) const QUARTERS: [&str; 4] = ["a1", "a2", "b1", "b2"];

/// The largest amount of memory that the pictures of one batch of predictions take, in bytes.
const BATCH_BYTES: u64 = 850 << 20;

/// A scene under some lights, whose paths have seeds of their own.
pub(crate) struct SharedPaths<'a> {
    pub(crate) scene: &'a SceneId,
    pub(crate) world: &'a World,
    /// The meshes of `instances.glb`, one for each surface of the world.
    pub(crate) atlases: &'a [TriangleMesh],
    pub(crate) rules: &'a LightRules,
    /// The name of this job, part of the seeds: a set of views under some lights. Each of its streams has one seed.
    pub(crate) pass: String,
    pub(crate) progress: Progress<'a>,
}

impl SharedPaths<'_> {
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
        let LightRules { max_bounces, roulette_start, roulette_survival, .. } = *self.rules;
        let settings = RenderSettings { samples, max_bounces, roulette_start, roulette_survival, ..Default::default() };
        let shown = |done: usize, all: usize| (self.progress)(Report::step(&what, done, all));
        Ok(render_repainted(self.world, repaint, cameras, lighting, &settings, &seeds, &shown)?)
    }

    /// The quarters of the first `predictions` that travel, by prediction, light mix and view, and the number of
    /// contributions of each that were not finite. A quarter has half the samples of a half, rounded down, but one at the
    /// least. `picture` makes the picture of (prediction, mix, view) from one stream's renders of everything that travels.
    pub(crate) fn quarters(
        &self,
        repaint: &Repaint,
        mixes: &[Vec<LightMix>],
        cameras: &[Camera],
        predictions: usize,
        picture: impl Fn(&[ViewsRender], usize, usize, usize) -> Picture<LinearRgb> + Sync,
    ) -> Result<(Vec<Vec<ViewQuarters>>, Vec<u64>), EvalError> {
        let mut quarters = vec![vec![vec![Vec::new(); cameras.len()]; mixes[0].len()]; predictions];
        let mut not_finite = vec![0; predictions];
        let samples = (self.rules.samples.each_half / 2).max(1);
        for stream in QUARTERS {
            let renders = self.trace(repaint, Lighting::Mixed(mixes), cameras, samples, stream)?;
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
        splitmix64::seed_of(&format!("{}/{}/{}/{stream}", self.rules.samples.seed, self.scene, self.pass))
    }

    /// The materials that travel together. Predictions agree in roughness and metallic; those of the truth may be
    /// others.
    pub(crate) fn repaint(
        &self,
        predictions: &[&PredictedScene],
        truth: Option<&PredictedScene>,
    ) -> Result<Repaint, EvalError> {
        let all: Vec<&PredictedScene> = predictions.iter().copied().chain(truth).collect();
        let first = all.first().expect("there is something to render");
        let scattering = |scene: &PredictedScene, surface: usize| {
            let PredictedMaterial { roughness, metallic, .. } = scene.materials[surface].clone()?;
            Some(Scattering { roughness, metallic })
        };
        let maps = |surface: usize| {
            let base_colors = all.iter().map(|scene| Some(scene.materials[surface].as_ref()?.base_color.clone()));
            Some(SurfaceMaps {
                base_colors: base_colors.collect::<Option<_>>()?,
                scattering: scattering(first, surface)?,
            })
        };
        let surfaces = 0..self.atlases.len();
        let maps = surfaces.clone().map(maps).collect();
        let repaint = Repaint::new(self.world, self.atlases, maps, self.rules.flavour)?;
        match truth.filter(|truth| truth.scattering_key != first.scattering_key) {
            None => Ok(repaint),
            Some(truth) => {
                let second = surfaces.map(|surface| scattering(truth, surface)).collect();
                Ok(repaint.with_second(predictions.len(), second)?)
            }
        }
    }
}

/// Groups `predictions` (numbers of `all`) that share paths: those that agree in roughness and metallic, as many as the
/// tracer takes at once beside what travels `along` and as fit in memory, where each takes `bytes`.
pub(crate) fn batches(all: &[PredictedScene], predictions: &[usize], along: usize, bytes: u64) -> Vec<Vec<usize>> {
    let mut alike: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
    for &index in predictions {
        alike.entry(&all[index].scattering_key).or_default().push(index);
    }
    let at_once = mateval_tracer::repaint::MOST_PREDICTIONS_AT_ONCE - along;
    let in_memory = (BATCH_BYTES / bytes.max(1)).saturating_sub(along as u64);
    let most = at_once.min(in_memory.max(1) as usize);
    alike.into_values().flat_map(|alike| alike.chunks(most).map(<[usize]>::to_vec).collect::<Vec<_>>()).collect()
}

/// A picture of one view. Every stream has one seed, so the tracer's list of halves holds one.
pub(crate) fn picture_of(render: &ViewsRender, view: usize, picture: usize) -> &Picture<LinearRgb> {
    &render.views[view].by_seed[0].pictures()[picture]
}
