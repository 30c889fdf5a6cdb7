//! Predictions under the scene's own emitters, compared with R.

use mateval_image::{LinearRgb, Picture, png_io};
use mateval_scene::Camera;
use mateval_tracer::{LightMix, Lighting, World};
use rayon::prelude::*;

use super::difference::{base_color_ratio, corrected_quarter};
use super::lighting::{LightingName, group_shares, light_of, lightings};
use super::lit_picture::{Each, EncodedReference, Guides, LitPicture, picture_of};
use super::paths::{Paths, QUARTERS, batches};
use super::reference::{StoredReference, weighted};
use super::rules::Track;
use super::true_maps::true_maps;
use crate::error::EvalError;
use crate::protocol::Protocol;
use crate::scene_task::{BaseColors, SceneTask};
use crate::truth::ViewTruth;

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
        let ratios: Vec<Vec<Picture<LinearRgb>>> = batch
            .iter()
            .map(|&index| {
                let pairs = base_colors.predicted[index].iter().zip(&base_colors.truth);
                pairs.map(|(prediction, truth)| base_color_ratio(prediction, truth)).collect()
            })
            .collect();
        // By prediction, lighting and view: the quarters.
        let mut quarters = vec![vec![vec![Vec::new(); task.views.len()]; lightings.len()]; batch.len()];
        let mut not_finite = vec![0; batch.len()];
        for stream in QUARTERS {
            let mut renders = paths.trace(&repaint, Lighting::Mixed(&mixes), &cameras, (samples / 2).max(1), stream)?;
            let truth = renders.pop().expect("the truth travels last");
            for (at, render) in renders.iter().enumerate() {
                not_finite[at] += render.stats.not_finite;
                for (picture, lighting) in lightings.iter().enumerate() {
                    quarters[at][picture].par_iter_mut().enumerate().for_each(|(view, quarters)| {
                        let [own, truth] = [render, &truth].map(|render| picture_of(render, view, picture));
                        let (reference, ratio) = (&lighting.references[view], &ratios[at][view]);
                        quarters.push(corrected_quarter(own, truth, task.scene.exposure, reference, ratio));
                    });
                }
            }
        }
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
