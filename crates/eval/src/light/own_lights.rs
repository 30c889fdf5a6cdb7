//! Predictions under the scene's own emitters, compared with R.

use mateval_dataset::Camera;
use mateval_dataset::dataset::View;
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::lighting::{LightingName, light_of, weighted};
use mateval_image::{LinearRgb, Picture, png_io};
use mateval_tracer::emitter::group_shares::shares_for;
use mateval_tracer::{LightMix, ViewsRender, World};

use crate::error::EvalError;
use crate::light::difference::{ViewGuides, corrected_quarter};
use crate::light::reference::StoredReference;
use crate::light::shared_paths::{QUARTERS, SharedPaths, ViewQuarters, batches, picture_of};
use crate::metric::ColorPicture;
use crate::protocol::{Protocol, Track};
use crate::scene::{BaseColors, LitSink, LitViews, SceneTask};
use crate::truth::{ViewTruth, true_maps};

struct OwnLighting {
    track: Track,
    name: Option<LightingName>,
    mix: LightMix,
    /// R by view, exposed.
    references: Vec<ColorPicture>,
}

/// Renders every submission together with the truth under the scene's own emitters, in every lighting of the protocol,
/// and compares it with R.
pub(super) fn compare_under_own_lights(
    task: &SceneTask<'_>,
    reference: &StoredReference,
    truths: &[ViewTruth],
    base_colors: &BaseColors,
    protocol: &Protocol,
    each: &mut LitSink<'_>,
) -> Result<(), EvalError> {
    let rules = &protocol.light;
    let (lightings, group_light) = own_lightings(task, reference, protocol)?;
    let mixes: Vec<LightMix> = lightings.iter().map(|lighting| lighting.mix.clone()).collect();
    let input = task.input_view()?;
    // Other shares of samples than R has: the expectation is the same, and the noise is less.
    let world: World = task.open.world.with_group_shares(&input.camera, &shares_for(&mixes, &group_light));
    let (scene, atlases, progress) = (&task.scene.id, &task.open.atlases, task.progress);
    let paths = SharedPaths { scene, world: &world, atlases, rules, pass: task.set.pass("own"), progress };
    let truth = true_maps(&task.open.folder, task.scene)?;
    let cameras: Vec<Camera> = task.views.iter().map(|view| view.camera).collect();
    // A batch holds a render and four quarters of every prediction.
    let bytes = 5 * (lightings.len() as u64) * task.pixels().sum::<u64>() * size_of::<LinearRgb>() as u64;
    let mut compare = |index, ratios: &[_], lighting: &OwnLighting, quarters: ViewQuarters, not_finite| {
        let guides = ViewGuides { truths, ratios, references: &lighting.references };
        if let Some(kept) = task.pictures {
            for (at, (view, quarters)) in task.views.iter().zip(&quarters).enumerate() {
                let light = (lighting.track, lighting.name);
                kept.keep_light(index, (scene, &view.id), light, quarters, &guides.of(at))?;
            }
        }
        let OwnLighting { track, name, references, .. } = lighting;
        let (track, lighting, views) = (*track, *name, guides.differences(&quarters));
        each(index, LitViews { track, lighting, references, views, of_fits: None, fit: None, not_finite })
    };
    // Where a prediction is the truth texel by texel, every m is R (see `difference`), so no path is traced. The same
    // values stored otherwise are traced and give the same.
    let is_truth = |&index: &usize| task.predictions[index].materials == truth.materials;
    let (exact, traced): (Vec<usize>, Vec<usize>) = (0..task.predictions.len()).partition(is_truth);
    for index in exact {
        let ratios = base_colors.ratios(index);
        for lighting in &lightings {
            let quarters = lighting.references.iter().map(|reference| vec![reference.linear.clone(); QUARTERS.len()]);
            compare(index, &ratios, lighting, quarters.collect(), 0)?;
        }
    }
    // The truth travels along.
    for batch in batches(task.predictions, &traced, 1, bytes) {
        let predictions: Vec<_> = batch.iter().map(|&index| &task.predictions[index]).collect();
        let repaint = paths.repaint(&predictions, Some(&truth))?;
        let mixes = vec![mixes.clone(); repaint.predictions()];
        let ratios: Vec<Vec<Picture<LinearRgb>>> = batch.iter().map(|&index| base_colors.ratios(index)).collect();
        let corrected = |renders: &[ViewsRender], prediction: usize, lighting: usize, view: usize| {
            // The truth travels last.
            let [own, truth] = [prediction, batch.len()].map(|at| picture_of(&renders[at], view, lighting));
            let (reference, ratio) = (&lightings[lighting].references[view].linear, &ratios[prediction][view]);
            corrected_quarter(own, truth, task.scene.exposure, reference, ratio)
        };
        let (mut quarters, mut not_finite) = paths.quarters(&repaint, &mixes, &cameras, batch.len(), corrected)?;
        for (at, &index) in batch.iter().enumerate() {
            for (place, lighting) in lightings.iter().enumerate() {
                // One set of paths serves all lightings: its count goes to the first.
                let not_finite = std::mem::take(&mut not_finite[at]);
                compare(index, &ratios[at], lighting, std::mem::take(&mut quarters[at][place]), not_finite)?;
            }
        }
    }
    Ok(())
}

/// The light of each group in R's input view, which decides the scene's lightings.
pub(crate) fn light_of_groups(
    folder: &SceneFolder,
    input: &View,
    reference: &StoredReference,
) -> Result<Vec<[f64; 3]>, EvalError> {
    let valid = png_io::read_mask(&folder.view(&input.id).join("valid.png"))?;
    Ok(reference.groups(input)?.iter().map(|group| light_of(group, &valid)).collect())
}

/// The lightings of the protocol with R in each view, and the light of each group in R's input view.
fn own_lightings(
    task: &SceneTask<'_>,
    reference: &StoredReference,
    protocol: &Protocol,
) -> Result<(Vec<OwnLighting>, Vec<[f64; 3]>), EvalError> {
    let group_light = light_of_groups(&task.open.folder, task.input_view()?, reference)?;
    let groups = task.open.world.emitters().groups();
    if group_light.len() != groups {
        let what = format!("it has {} light groups, the scene has {groups}", group_light.len());
        return Err(EvalError::reference(task.dataset, task.scene, what));
    }
    let mut all = Vec::new();
    for &track in Track::ALL.iter().filter(|track| protocol.light.tracks.contains(track)) {
        let of_track = protocol.light.lightings_of(track, &group_light).into_iter();
        all.extend(of_track.map(|(name, mix)| OwnLighting { track, name, mix, references: Vec::new() }));
    }
    for view in &task.views {
        let groups = reference.groups(view)?;
        let k = view.camera.intrinsics;
        let size = [k.width as usize, k.height as usize];
        for lighting in &mut all {
            let picture = weighted(&groups, &lighting.mix, task.scene.exposure, size);
            lighting.references.push(ColorPicture::new(picture));
        }
    }
    Ok((all, group_light))
}
