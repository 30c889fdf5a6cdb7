//! The paper's light: radiances fitted to the photo, and renders compared with those of the photo's renderer.
//!
//! A method's light is unknown, so the paper fits the radiances of a light stage (3D-FRONT) or of the scene's own
//! emitters (Bitterli) until the predicted materials look like the photo. Light is linear in emission: one set of paths
//! shows the input view under each light alone. Two independent streams of paths give two fits, one for each half of
//! the render, so that the noise of the fit adds no bias to the squared error; the difference of the errors under
//! either fit shows its noise. The truth is another renderer's picture, so nothing travels along and nothing is exact.
//!
//! Photos of a captured room are compared in the same way. Light is fitted to the input photo alone. If the exposure of
//! another photo is not known, renders are multiplied by the factor that fits them to it best. A flash moves with the
//! camera, so that every view with one has a world of its own.

use mateval_dataset::layout::INPUT;
use mateval_dataset::{Camera, RendererId, SceneLights, ViewId};
use mateval_image::{LinearRgb, Mask, Picture, SrgbRgb, exr_io};
use mateval_light::light_fit::{FitTarget, LightFit, TwoStreamFit, fit_two_streams};
use mateval_light::light_stage::{self, FLASH};
use mateval_light::photo_pixels::{PhotoRules, exposure_factor};
use mateval_metrics::scaled;
use mateval_tracer::{LightBasis, LightMix, Lighting, Repaint, StageLight, ViewsRender, World};
use rayon::prelude::*;

use crate::error::EvalError;
use crate::light::difference::{LightDifference, ViewGuides, encoded, guided_mean, mean_of};
use crate::light::shared_paths::{SharedPaths, ViewQuarters, batches, picture_of};
use crate::metric::ColorPicture;
use crate::protocol::{Protocol, Track};
use crate::scene::{BaseColors, LitSink, LitViews, SceneTask};
use crate::truth::{ViewTruth, photo_of_renderer, sized};

/// What renders under fitted lights are compared with, by view.
pub(crate) struct Photos {
    /// Linear radiance before exposure.
    pictures: Vec<Picture<LinearRgb>>,
    /// The pixels that determine the exposure of a photo; absent if that is known.
    free: Vec<Option<Mask>>,
    /// The fit takes a channel of the input photo that is at least 1 at this exposure as clipped.
    clipping_exposure: f64,
}

impl Photos {
    pub(crate) fn of_renderer(task: &SceneTask<'_>, renderer: &RendererId) -> Result<Self, EvalError> {
        let pictures = task.views.iter().map(|view| photo_of_renderer(&task.open.folder, renderer, view));
        Ok(Self {
            pictures: pictures.collect::<Result<_, _>>()?,
            free: vec![None; task.views.len()],
            clipping_exposure: task.scene.exposure,
        })
    }

    /// The photos of a captured scene, and for each photo the pixels that count.
    pub(crate) fn of_capture(
        task: &SceneTask<'_>,
        truths: &[ViewTruth],
        rules: &PhotoRules,
    ) -> Result<(Self, Vec<Mask>), EvalError> {
        let exposure_of = |view: &ViewId| task.scene.clipping_exposure(view);
        let clipping_exposure = exposure_of(&task.input_view()?.id) / rules.clipped_from.min(1.0);
        let mut photos = Self { pictures: Vec::new(), free: Vec::new(), clipping_exposure };
        let mut all_counted = Vec::new();
        for (view, truth) in task.views.iter().zip(truths) {
            let shown = task.open.folder.view(&view.id);
            let is_input = view.id.as_str() == INPUT;
            let file = if is_input { shown.join("rgb.exr") } else { task.open.folder.novel_photo(&view.id) };
            let photo = sized(view, exr_io::read_linear(&file)?)?;
            let depth = sized(view, exr_io::read_scalar(&shown.join("depth.exr"))?)?;
            let counted = rules.counted(&photo, exposure_of(&view.id), &depth, &truth.valid);
            photos.pictures.push(photo);
            let novel = task.scene.novel_photos.get(&view.id).filter(|_| !is_input);
            let is_free = novel.is_some_and(|photo| photo.relative_exposure.is_none());
            photos.free.push(is_free.then(|| counted.clone()));
            all_counted.push(counted);
        }
        Ok((photos, all_counted))
    }
}

/// Fits every submission's lights to the input photo, renders it under them and compares it with the photos.
pub(crate) fn compare_under_fitted_lights(
    task: &SceneTask<'_>,
    photos: &Photos,
    truths: &[ViewTruth],
    base_colors: &BaseColors,
    protocol: &Protocol,
    each: &mut LitSink<'_>,
) -> Result<(), EvalError> {
    let lit = FittedLights::new(task, protocol)?;
    let exposed = |picture: &Picture<LinearRgb>| scaled(picture, [task.scene.exposure; 3]);
    let free = &photos.free;
    let references: Vec<ColorPicture> = photos.pictures.iter().map(|photo| ColorPicture::new(exposed(photo))).collect();
    let pixels = task.pixels().next().unwrap_or(0);
    // A batch holds a render and four quarters of every prediction under two fits, or two bases of the input view.
    let pictures = (5 * 2 * task.views.len()).max(4 * (lit.names.len() + 1)) as u64;
    let bytes = pictures * pixels * size_of::<LinearRgb>() as u64;
    let all: Vec<usize> = (0..task.predictions.len()).collect();
    for batch in batches(task.predictions, &all, 0, bytes) {
        let predictions: Vec<_> = batch.iter().map(|&index| &task.predictions[index]).collect();
        let repaint = lit.input_paths(task, protocol)?.repaint(&predictions, None)?;
        let fits = lit.fit(&repaint, task, truths, photos, protocol)?;
        let (quarters, not_finite) = lit.quarters(&repaint, &fits, task, protocol, &exposed)?;
        for (at, (&index, fit)) in batch.iter().zip(fits).enumerate() {
            let [first, second] = &quarters[at];
            let ratios = base_colors.ratios(index);
            let guides = ViewGuides { truths, ratios: &ratios, references: &references };
            // The first half under the first fit, the second under the second.
            let both: Vec<[&Picture<LinearRgb>; 4]> =
                first.iter().zip(second).map(|(a, b)| [&a[0], &a[1], &b[2], &b[3]]).collect();
            let under = |quarters: &[Vec<Picture<LinearRgb>>]| {
                let views: Vec<_> = quarters.iter().map(|view| [0, 1, 2, 3].map(|at| &view[at])).collect();
                plain_differences(&views, &guides, free)
            };
            let of_fits = Some([under(first), under(second)]);
            let (track, not_finite) = (Track::Fitted, not_finite[at]);
            // The last name is unused if the input photo was taken without a flash, which then has no weight in the
            // fit.
            let names: Vec<String> = lit.names.iter().cloned().chain([FLASH.to_owned()]).collect();
            let fit = Some(fit.radiances(&names, lit.is_stage));
            let views = plain_differences(&both, &guides, free);
            each(index, LitViews { track, lighting: None, references: &references, views, of_fits, fit, not_finite })?;
        }
    }
    Ok(())
}

/// The encoded difference of each half from the photo. The only correction is the exposure of photos whose exposure is
/// `free`.
fn plain_differences(
    views: &[[&Picture<LinearRgb>; 4]],
    guides: &ViewGuides<'_>,
    free: &[Option<Mask>],
) -> Vec<LightDifference> {
    let difference = |a: &Picture<LinearRgb>, b: &Picture<LinearRgb>, factor: f64| {
        Picture::from_fn(a.width(), a.height(), |x, y| {
            let [a, b] = [a, b].map(|picture| picture.get(x, y).0.map(|value| encoded(f64::from(value))));
            SrgbRgb([0, 1, 2].map(|c| (factor * (a[c] - b[c])) as f32))
        })
    };
    let views = views.par_iter().enumerate();
    views
        .map(|(view, quarters)| {
            let guide = guides.of(view);
            let halves = |[a1, a2, b1, b2]: [&Picture<LinearRgb>; 4]| [mean_of(a1, a2), mean_of(b1, b2)];
            let multiplied = free[view].as_ref().map(|counted| {
                let factor = exposure_factor(halves(*quarters).each_ref(), guide.reference, counted);
                quarters.map(|quarter| scaled(quarter, [factor; 3]))
            });
            let quarters = multiplied.as_ref().map_or(*quarters, |multiplied| multiplied.each_ref());
            let ([a1, a2, b1, b2], means) = (quarters, halves(quarters));
            let halves = means.each_ref().map(|mean| difference(mean, guide.reference, 1.0));
            let noise = [difference(a1, a2, 0.5), difference(b1, b2, 0.5)];
            LightDifference { halves, noise, shown: guided_mean(means.each_ref(), &guide).to_srgb() }
        })
        .collect()
}

/// The lights whose radiances are fitted, and a flash.
struct FittedLights {
    /// Worlds with the places of the views that each is rendered for. A view whose photo was taken with a flash has a
    /// world of its own, in which the flash is the last light.
    worlds: Vec<(World, Vec<usize>)>,
    /// The names of the lights, apart from the flash.
    names: Vec<String>,
    is_stage: bool,
    /// The intensity of the flash, where it is known.
    flash: Option<[f64; 3]>,
}

impl FittedLights {
    fn new(task: &SceneTask<'_>, protocol: &Protocol) -> Result<Self, EvalError> {
        if task.scene.lights == SceneLights::Own {
            let names = task.open.world.scene().lights.iter().map(|light| light.name.clone()).collect();
            let worlds = vec![(task.open.world.clone(), (0..task.views.len()).collect())];
            return Ok(Self { worlds, names, is_stage: false, flash: None });
        }
        let stage = light_stage::scene_lights(&protocol.light.stage, task.scene, &task.open.world);
        let mut quads: Vec<StageLight> = stage.iter().map(|named| named.light.clone()).collect();
        let names = stage.into_iter().map(|named| named.name).collect();
        let flash = task.scene.flash.as_ref();
        let has_flash = |view: &usize| flash.is_some_and(|flash| flash.views.contains(&task.views[*view].id));
        let (lit, others): (Vec<usize>, Vec<usize>) = (0..task.views.len()).partition(has_flash);
        let mut worlds = Vec::new();
        if !others.is_empty() {
            worlds.push((task.open.world.on_stage(&quads)?, others));
        }
        if let Some(flash) = flash {
            for view in lit {
                quads.push(light_stage::flash_light(flash, &task.views[view].camera));
                worlds.push((task.open.world.on_stage(&quads)?, vec![view]));
                quads.pop();
            }
        }
        Ok(Self { worlds, names, is_stage: true, flash: flash.and_then(|flash| flash.intensity) })
    }

    /// The paths of the world that shows the input view.
    fn input_paths<'a>(
        &'a self,
        task: &'a SceneTask<'a>,
        protocol: &'a Protocol,
    ) -> Result<SharedPaths<'a>, EvalError> {
        let input = task.views.iter().position(|view| view.id.as_str() == INPUT);
        let shown = input.and_then(|input| self.worlds.iter().find(|(_, views)| views.contains(&input)));
        let (world, _) = shown.ok_or_else(|| EvalError::InputNotTarget { scene: task.scene.id.clone() })?;
        Ok(self.paths(world, task, protocol))
    }

    fn paths<'a>(&'a self, world: &'a World, task: &'a SceneTask<'a>, protocol: &'a Protocol) -> SharedPaths<'a> {
        let pass = if self.is_stage { "stage" } else { "fitted" };
        SharedPaths {
            scene: &task.scene.id,
            world,
            atlases: &task.open.atlases,
            rules: &protocol.light,
            pass: task.set.pass(pass),
            progress: task.progress,
        }
    }

    fn fit(
        &self,
        repaint: &Repaint,
        task: &SceneTask<'_>,
        truths: &[ViewTruth],
        photos: &Photos,
        protocol: &Protocol,
    ) -> Result<Vec<TwoStreamFit>, EvalError> {
        let paths = self.input_paths(task, protocol)?;
        let input = task.input_view()?;
        let place = task.views.iter().position(|view| view.id == input.id);
        let place = place.ok_or_else(|| EvalError::InputNotTarget { scene: task.scene.id.clone() })?;
        let samples = (paths.rules.fit.samples / 2).max(1);
        let bases = |stream: &str| -> Result<Vec<LightBasis>, EvalError> {
            let cameras = std::slice::from_ref(&input.camera);
            let renders = paths.trace(repaint, Lighting::Apart, cameras, samples, stream)?;
            Ok(renders.into_iter().map(|mut render| render.views.remove(0).by_seed.remove(0)).collect())
        };
        let (first, second) = (bases("fit_a")?, bases("fit_b")?);
        let has_flash = paths.world.emitters().groups() > self.names.len();
        let target = FitTarget {
            photo: &photos.pictures[place],
            mask: Some(&truths[place].valid),
            exposure: photos.clipping_exposure,
            known: if has_flash { self.flash.as_slice() } else { &[] },
        };
        let pairs = first.iter().zip(&second);
        Ok(pairs.map(|(a, b)| fit_two_streams(&paths.rules.fit, [a, b], &target)).collect::<Result<_, _>>()?)
    }

    /// The quarters of every prediction under each of its two fits, `exposed`, and the number of contributions of each
    /// that were not finite.
    fn quarters(
        &self,
        repaint: &Repaint,
        fits: &[TwoStreamFit],
        task: &SceneTask<'_>,
        protocol: &Protocol,
        exposed: &(dyn Fn(&Picture<LinearRgb>) -> Picture<LinearRgb> + Sync),
    ) -> Result<(Vec<[ViewQuarters; 2]>, Vec<u64>), EvalError> {
        let blank = || [(); 2].map(|()| vec![Vec::new(); task.views.len()]);
        let mut quarters: Vec<[ViewQuarters; 2]> = fits.iter().map(|_| blank()).collect();
        let mut not_finite = vec![0; fits.len()];
        for (world, views) in &self.worlds {
            let mix = |fit: &TwoStreamFit| fit.streams.iter().map(|stream| self.mix(world, stream)).collect();
            let mixes: Vec<Vec<LightMix>> = fits.iter().map(mix).collect();
            let cameras: Vec<Camera> = views.iter().map(|&view| task.views[view].camera).collect();
            let picture = |renders: &[ViewsRender], at: usize, fit: usize, view: usize| {
                exposed(picture_of(&renders[at], view, fit))
            };
            let paths = self.paths(world, task, protocol);
            let (found, counts) = paths.quarters(repaint, &mixes, &cameras, fits.len(), picture)?;
            for (all, found) in quarters.iter_mut().zip(found) {
                for (all, found) in all.iter_mut().zip(found) {
                    views.iter().zip(found).for_each(|(&view, found)| all[view] = found);
                }
            }
            not_finite.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        Ok((quarters, not_finite))
    }

    /// The weights of a world's lights under a fit to the input view.
    fn mix(&self, world: &World, fit: &LightFit) -> LightMix {
        let (lights, of_flash) = fit.weights.split_at(self.names.len());
        let flash = of_flash.first().copied().or(self.flash);
        lights.iter().copied().chain(flash).take(world.emitters().groups()).collect()
    }
}
