//! The metrics of predictions under light: of each region of every view, and of each instance.

use mateval_dataset::dataset::View;
use mateval_dataset::layout::INPUT;
use mateval_dataset::{Camera, SceneId};
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_light::photo_pixels::PhotoRules;
use mateval_metrics::{MetricError, Psnr};
use mateval_tracer::shared_centre::noise_blocks;
use rayon::prelude::*;

use crate::error::EvalError;
use crate::light::difference::LightDifference;
use crate::light::fitted_lights::{Photos, compare_under_fitted_lights};
use crate::light::mse::LightMse;
use crate::light::own_lights::compare_under_own_lights;
use crate::materials::score::measure_whole_view;
use crate::metric::{EncodedPair, Metric, PictureKind};
use crate::protocol::{Protocol, Track};
use crate::result::PictureValues;
use crate::result::key::{Region, Surfaces};
use crate::scene::{BaseColors, LitSink, LitViews, MaskedRegion, SceneTask, ScoreSheet, SeenLight, regions};
use crate::truth::{ViewSet, ViewTruth};

/// Scores every submission under the lights of protocol number `at`.
pub(crate) fn score_light(
    task: &SceneTask<'_>,
    truths: &[ViewTruth],
    base_colors: &BaseColors,
    at: usize,
    sheets: &mut [Vec<ScoreSheet>],
) -> Result<(), EvalError> {
    let protocol = &task.protocols[at];
    let meter = LightMeter::new(task, truths, truths.iter().map(regions).collect(), protocol);
    let mut each = |submission: usize, lit: LitViews| {
        meter.show(submission, &lit)?;
        meter.measure(&lit, &mut sheets[submission][at])
    };
    compare_under_lights(task, truths, base_colors, protocol, &mut each)
}

/// Renders every submission under each light of the protocol whose reference the dataset holds, and passes it on.
pub(crate) fn compare_under_lights(
    task: &SceneTask<'_>,
    truths: &[ViewTruth],
    base_colors: &BaseColors,
    protocol: &Protocol,
    each: &mut LitSink<'_>,
) -> Result<(), EvalError> {
    let tracks = &protocol.light.tracks;
    if let Some(reference) = task.reference.filter(|_| tracks.contains(&Track::True)) {
        compare_under_own_lights(task, reference, truths, base_colors, protocol, each)?;
    }
    if let Some(renderer) = task.renderer.filter(|_| tracks.contains(&Track::Fitted)) {
        let photos = Photos::of_renderer(task, renderer)?;
        compare_under_fitted_lights(task, &photos, truths, base_colors, protocol, each)?;
    }
    Ok(())
}

/// Scores every submission against the photos of a captured scene, by protocol number `at`. Its lights are fitted to
/// the input photo.
pub(crate) fn score_photos(
    task: &SceneTask<'_>,
    rules: &PhotoRules,
    at: usize,
    sheets: &mut [Vec<ScoreSheet>],
) -> Result<(), EvalError> {
    let is_photo = |view: &&View| view.id.as_str() == INPUT || task.scene.novel_photos.contains_key(&view.id);
    let task = SceneTask { views: task.views.iter().copied().filter(is_photo).collect(), ..task.clone() };
    let truths = task.truths()?;
    let (photos, counted) = Photos::of_capture(&task, &truths, rules)?;
    let narrowed = |(truth, counted): (&ViewTruth, &Mask)| {
        regions(truth).into_iter().map(|region| region.narrowed(counted)).collect::<Vec<_>>()
    };
    let narrowed = truths.iter().zip(&counted).map(narrowed).collect();
    // True base colours are not known. Black on both sides makes every ratio 1.
    let black = |truth: &ViewTruth| Picture::filled(truth.valid.width(), truth.valid.height(), LinearRgb([0.0; 3]));
    let truth: Vec<_> = truths.iter().map(black).collect();
    let base_colors = BaseColors { predicted: vec![truth.clone(); task.predictions.len()], truth };
    let meter = LightMeter::new(&task, &truths, narrowed, &task.protocols[at]);
    let mut each = |submission: usize, lit: LitViews| meter.measure(&lit, &mut sheets[submission][at]);
    compare_under_fitted_lights(&task, &photos, &truths, &base_colors, &task.protocols[at], &mut each)
}

struct LightMeter<'a> {
    task: &'a SceneTask<'a>,
    protocol: &'a Protocol,
    truths: &'a [ViewTruth],
    regions: Vec<Vec<MaskedRegion>>,
    blocks: Vec<Picture<u64>>,
}

impl<'a> LightMeter<'a> {
    fn new(
        task: &'a SceneTask<'a>,
        truths: &'a [ViewTruth],
        regions: Vec<Vec<MaskedRegion>>,
        protocol: &'a Protocol,
    ) -> Self {
        let cameras: Vec<Camera> = task.views.iter().map(|view| view.camera).collect();
        let blocks = noise_blocks(&cameras, protocol.light.samples.block_pixels);
        Self { task, protocol, truths, regions, blocks }
    }

    fn measure(&self, lit: &LitViews<'_>, sheet: &mut ScoreSheet) -> Result<(), EvalError> {
        let kind = lit.track.row().picture;
        // Only the scene's own light is scored on specular surfaces.
        let is_wanted = |region: &&MaskedRegion| match region.surfaces {
            Surfaces::All => true,
            Surfaces::Specular => kind == PictureKind::RgbTrue && region.region == Region::Valid,
        };
        let jobs: Vec<(usize, &MaskedRegion)> = (0..self.regions.len())
            .flat_map(|view| self.regions[view].iter().filter(is_wanted).map(move |region| (view, region)))
            .collect();
        let measured: Vec<_> = jobs.par_iter().map(|&(view, region)| self.values(lit, kind, view, region)).collect();
        for (&(view, _), measured) in jobs.iter().zip(measured) {
            let view = self.task.views[view];
            let (values, mse) = self.task.locate_error(view, measured)?;
            sheet.light_mses.entry(values.key(Metric::Psnr)).or_default().extend(mse);
            sheet.score.pictures.push(values);
        }
        sheet.score.fit = lit.fit.clone().or(sheet.score.fit.take());
        sheet.score.not_finite += lit.not_finite;
        if lit.track.row().is_shown {
            self.add_instance_errors(kind, &lit.views, sheet);
        }
        Ok(())
    }

    /// Passes the views from the input view's place to the plan's sink, where pages show the track.
    fn show(&self, submission: usize, lit: &LitViews<'_>) -> Result<(), EvalError> {
        let is_shown = lit.track.row().is_shown && self.task.set == ViewSet::Turned;
        let Some(seen) = self.task.seen.filter(|_| is_shown) else { return Ok(()) };
        for (at, view) in self.task.views.iter().enumerate() {
            seen(&SeenLight {
                submission,
                scene: &self.task.scene.id,
                view: &view.id,
                kind: lit.track.row().picture,
                valid: &self.truths[at].valid,
                reference: &lit.references[at].encoded,
                prediction: &lit.views[at].shown,
            })?;
        }
        Ok(())
    }

    /// The values of one region of a view, and its error with the noise by block.
    fn values(
        &self,
        lit: &LitViews<'_>,
        kind: PictureKind,
        view: usize,
        region: &MaskedRegion,
    ) -> Result<(PictureValues, Option<LightMse>), MetricError> {
        let (found, blocks) = (&lit.views[view], &self.blocks[view]);
        let mut mse = LightMse::new(found, &region.mask, blocks)?;
        if let (Some(mse), Some(fits)) = (&mut mse, &lit.of_fits) {
            let [a, b] = fits.each_ref().map(|fit| LightMse::new(&fit[view], &region.mask, blocks));
            mse.common = a?.zip(b?).map_or(0.0, |(a, b)| (a.mse - b.mse) / 2.0);
        }
        let scene: &SceneId = &self.task.scene.id;
        let mut values = region.values(scene, &self.task.views[view].id, kind, lit.lighting);
        if let Some(mse) = &mse {
            let Psnr { db, exact } = mse.psnr()?;
            values.values.extend([(Metric::Mse, mse.mse), (Metric::Psnr, db)]);
            values.mse_error = Some(mse.standard_error());
            (values.exact, values.lower_bound) = (exact, mse.is_lower_bound());
        }
        if region.is_whole() && mse.is_some() {
            let pair = EncodedPair {
                prediction: &found.shown,
                reference: &lit.references[view],
                mask: &region.mask,
                mask_rule: self.protocol.mask_rule,
                lpips: self.task.lpips,
            };
            measure_whole_view(self.protocol, None, &pair, &mut values)?;
        }
        Ok((values, mse))
    }

    fn add_instance_errors(&self, kind: PictureKind, found: &[LightDifference], sheet: &mut ScoreSheet) {
        for (at, (view, found)) in self.task.views.iter().zip(found).enumerate() {
            let error = |k: usize| {
                let [x, y] = found.halves.each_ref().map(|half| half.pixels()[k].0.map(f64::from));
                (0..3).map(|c| x[c] * y[c]).sum::<f64>() / 3.0
            };
            sheet.errors.add(kind, &view.id, &self.truths[at].instances, &self.regions[at], error);
        }
    }
}
