//! The pilot of a batch of predictions: a render of few samples that says how the companions correct each prediction, and
//! how many samples it needs. Its pixels are larger than those of the views (`pilot_view`): its four streams together cost
//! one sample per pixel of a view.

use std::collections::BTreeMap;
use std::ops::Range;

use mateval_image::{LinearRgb, Picture};
use mateval_metrics::{Halves, NoiseFreeMse, NoisePsnr, encoded_reference, noise_free_mse, psnr_mean_error};
use mateval_scene::Camera;
use mateval_scene::layout::INPUT;
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::ViewsRender;

use crate::batch_mixes::BatchMixes;
use crate::companion_pictures::{CompanionPictures, Lightings};
use crate::companions::COMPANIONS;
use crate::control_variate::{Coefficients, Regression};
use crate::error::EvalError;
use crate::light_pass::{LightPass, PassPictures};
use crate::light_rules::{NoiseRules, Track};
use crate::lit_scene::LitScene;
use crate::pilot_view::{PilotView, enlarged_pixels};
use crate::rendered_view::{RenderedView, of_companions, picture_of, without_companions};
use crate::rgb::{encode_noisy, encoded_render};
use crate::stored_light::StoredLight;

/// The input of a pilot.
pub(crate) struct Pilot<'a> {
    pub(crate) lit: &'a LitScene<'a>,
    pub(crate) rules: &'a NoiseRules,
    pub(crate) pass: &'a LightPass<'a>,
    pub(crate) companions: Option<&'a CompanionPictures>,
    pub(crate) predictions: Vec<&'a PredictedScene>,
    pub(crate) mixes: &'a BatchMixes,
    /// The views with large pixels, and the ratios of the predictions' base colours.
    pub(crate) views: Vec<PilotView>,
}

/// Samples per pixel of a half, and the companions' coefficients of each picture.
type PilotFinding = (u32, Vec<Coefficients>);

/// One stream of a pilot: by variant, picture of the render and view.
struct Stream(Vec<Vec<Vec<StoredLight>>>);

/// Runs a pilot; one answer for each prediction.
pub(crate) fn run_pilot(pilot: &Pilot<'_>) -> Result<Vec<PilotFinding>, EvalError> {
    let (samples, pictures) = (pilot.rules.pilot_samples / 2, pilot.mixes.pictures());
    let trace = |stream: &str| {
        let what = format!("{} pilot, stream {stream}", pilot.pass.name);
        let stream = format!("pilot_{stream}");
        pilot.pass.trace(&pilot.predictions, &pilot.mixes.all, &pilot.cameras(), samples.max(1), &stream, &what)
    };
    // The first half determines the coefficients. Each stream is then reduced to its corrected pictures.
    let first = ["a1", "a2"].map(|stream| trace(stream).map(|renders| Stream::of(&renders, pilot.lit.scene.exposure)));
    let [a1, a2] = first;
    let (a1, a2) = (a1?, a2?);
    let mut coefficients = Vec::new();
    for at in 0..pilot.predictions.len() {
        coefficients.push(pilot.coefficients(at, [&a1, &a2]));
    }
    let mut views = pilot.blank(pictures);
    for stream in [a1, a2] {
        pilot.add(&stream, &coefficients, &mut views);
    }
    for stream in ["b1", "b2"] {
        let stream = Stream::of(&trace(stream)?, pilot.lit.scene.exposure);
        pilot.add(&stream, &coefficients, &mut views);
    }
    pilot.add_companions(&coefficients, &mut views)?;
    let mut found = Vec::new();
    for (coefficients, views) in coefficients.into_iter().zip(views) {
        found.push((pilot.enough_samples(&views)?, coefficients));
    }
    Ok(found)
}

impl Stream {
    fn of(renders: &[ViewsRender], exposure: f64) -> Self {
        let pictures = |render: &ViewsRender| {
            let count = render.views[0].halves[0].basis.pictures().len();
            let view = |view: usize, picture: usize| StoredLight::exposed(picture_of(render, view, picture), exposure);
            (0..count).map(|p| (0..render.views.len()).map(|v| view(v, p)).collect()).collect()
        };
        Self(renders.iter().map(pictures).collect())
    }
}

impl Pilot<'_> {
    fn cameras(&self) -> Vec<Camera> {
        self.views.iter().map(|view| view.camera).collect()
    }

    fn blank(&self, pictures: usize) -> Vec<Vec<Vec<RenderedView>>> {
        vec![vec![vec![RenderedView::empty(); self.lit.views.len()]; pictures]; self.predictions.len()]
    }

    /// The companions' coefficients of each picture of a prediction, from two streams. Both pictures of a fit have the same,
    /// so that their difference shows the fit and not the paths.
    fn coefficients(&self, at: usize, streams: [&Stream; 2]) -> Vec<Coefficients> {
        let pictures = self.mixes.pictures();
        let regressed = |range: Range<usize>| {
            let mut regression = Regression::default();
            if self.companions.is_some() {
                range.for_each(|picture| self.add_rows(at, picture, streams, &mut regression));
            }
            regression.solve()
        };
        match self.pass.pictures {
            PassPictures::Fixed(_) => (0..pictures).map(|picture| regressed(picture..picture + 1)).collect(),
            PassPictures::Fitted => vec![regressed(0..pictures); pictures],
        }
    }

    /// Adds the valid pixels of a picture in all views.
    fn add_rows(&self, at: usize, picture: usize, [one, other]: [&Stream; 2], regression: &mut Regression) {
        let (first, place) = (self.predictions.len(), self.mixes.place(at, picture));
        for (view, PilotView { valid, ratios, .. }) in self.views.iter().enumerate() {
            for k in (0..valid.pixels().len()).filter(|&k| valid.pixels()[k]) {
                let of = |variant: usize| [one, other].map(|stream| stream.0[variant][place][view].at(k));
                let [p, q] = of(at);
                let companions: [[f64; 3]; COMPANIONS] = std::array::from_fn(|j| {
                    let [f, g] = of(first + j);
                    [0, 1, 2].map(|c| f64::from(ratios[at].pixels()[k].0[c]) * (f[c] - g[c]))
                });
                let (difference, mean) = ([0, 1, 2].map(|c| p[c] - q[c]), [0, 1, 2].map(|c| 0.5 * (p[c] + q[c])));
                regression.add(difference, companions, mean);
            }
        }
    }

    /// Adds a stream as the next quarter of every prediction's pictures.
    fn add(&self, stream: &Stream, coefficients: &[Vec<Coefficients>], views: &mut [Vec<Vec<RenderedView>>]) {
        let first = self.predictions.len();
        for (at, pictures) in views.iter_mut().enumerate() {
            for (picture, views) in pictures.iter_mut().enumerate() {
                for (view, rendered) in views.iter_mut().enumerate() {
                    let of = |variant: usize| &stream.0[variant][self.mixes.place(at, picture)][view];
                    if self.companions.is_none() {
                        rendered.add_quarter(of(at).clone());
                        continue;
                    }
                    let companions: [Picture<LinearRgb>; COMPANIONS] = std::array::from_fn(|j| of(first + j).picture());
                    let ratio = &self.views[view].ratios[at];
                    // Streams are exposed already.
                    let rest = without_companions(
                        &of(at).picture(),
                        companions.each_ref(),
                        &coefficients[at][picture],
                        ratio,
                        1.0,
                    );
                    rendered.add_quarter(rest);
                }
            }
        }
    }

    fn add_companions(
        &self,
        coefficients: &[Vec<Coefficients>],
        views: &mut [Vec<Vec<RenderedView>>],
    ) -> Result<(), EvalError> {
        let Some(companions) = self.companions else { return Ok(()) };
        for (view, shown) in self.lit.views.iter().enumerate() {
            let kept = self.pass.companion_mixes().len();
            let side = self.rules.pilot_pixels as usize;
            let read = |half: usize| -> Result<Lightings<Picture<LinearRgb>>, EvalError> {
                let lightings = companions.read(&shown.id, half, kept)?.into_iter();
                Ok(lightings.map(|lighting| lighting.map(|picture| enlarged_pixels(&picture, side))).collect())
            };
            let (a, b) = (read(0)?, read(1)?);
            for (at, pictures) in views.iter_mut().enumerate() {
                let ratio = &self.views[view].ratios[at];
                for (picture, rendered) in pictures.iter_mut().enumerate() {
                    let half = |half: &Lightings<Picture<LinearRgb>>| {
                        let converged = self.pass.converged(half, picture, self.mixes.mix(at, picture));
                        of_companions(&converged, &coefficients[at][picture], ratio)
                    };
                    rendered[view].set_companions([half(&a), half(&b)]);
                }
            }
        }
        Ok(())
    }

    /// Samples that bring the noise of every mean PSNR of a result under its bound: of the input view and of the novel views,
    /// in each track.
    fn enough_samples(&self, pictures: &[Vec<RenderedView>]) -> Result<u32, EvalError> {
        let mut means: BTreeMap<(Track, bool), Vec<NoiseFreeMse>> = BTreeMap::new();
        for ((track, lighting), views) in self.pass.pictures.names().into_iter().zip(pictures) {
            for (at, view) in self.lit.views.iter().enumerate() {
                let locate = |source| {
                    let (scene, view) = (self.lit.scene.id.clone(), view.id.clone());
                    EvalError::Metric { scene, view, source }
                };
                let light = encoded_render(&views[at]).map_err(locate)?;
                let PilotView { valid, blocks, truths, .. } = &self.views[at];
                let [a, b] = &truths[&lighting];
                let [a, b] = encoded_reference(Halves { a, b }, encode_noisy).map_err(locate)?;
                let mse = noise_free_mse(&light, Halves { a: &a, b: &b }, valid, blocks).map_err(locate)?;
                means.entry((track, view.id.as_str() == INPUT)).or_default().extend(mse);
            }
        }
        let needed = means.values().filter(|mses| !mses.is_empty()).map(|mses| {
            let error = psnr_mean_error(&mses.iter().collect::<Vec<_>>());
            samples_under_bound(self.rules, error, self.rules.allowed_db(mses))
        });
        Ok(needed.max().unwrap_or(self.rules.least_samples))
    }
}

/// Samples that bring the noise under its bound. Variance is inversely proportional to the number of paths, and that of
/// products of both halves' noise also to the number of samples per pixel. `pilot` is the standard error of the pilot's mean PSNR (none: its pictures equal the
/// truth's without noise), `allowed` the error that is small enough ([`NoiseRules::allowed_db`]).
pub fn samples_under_bound(rules: &NoiseRules, pilot: Option<NoisePsnr>, allowed: f64) -> u32 {
    let Some(NoisePsnr { paths, products, shared, reference, .. }) = pilot else { return rules.least_samples };
    let bound = allowed.max(rules.truth_share * shared.hypot(reference));
    let is_enough = |samples: u32| {
        let (samples, pixels) =
            (f64::from(rules.pilot_samples) / f64::from(samples), f64::from(rules.pilot_pixels.pow(2)));
        let (product, rest) = (products.powi(2), (paths.powi(2) - products.powi(2)).max(0.0));
        (rest + product * samples) * samples / pixels <= bound.powi(2)
    };
    let mut samples = rules.least_samples;
    while samples < rules.most_samples && !is_enough(samples) {
        samples *= 2;
    }
    samples.min(rules.most_samples)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Protocol;

    #[test]
    fn samples_follow_the_pilot() {
        let noise = Protocol::named("mateval-2").unwrap().light.noise;
        let (least, most, target) = (noise.least_samples, noise.most_samples, noise.target_db);
        let samples = |paths: f64, reference: f64| {
            let error = NoisePsnr { total: paths, paths, products: 0.0, shared: 0.0, reference, common: 0.0 };
            samples_under_bound(&noise, Some(error), target)
        };
        let pixels = f64::from(noise.pilot_pixels.pow(2));
        let times = |factor: f64| f64::sqrt(factor * pixels / f64::from(noise.pilot_samples)) * target;
        assert_eq!(samples(0.001 * target, 0.0), least);
        // As much as `3 * least` samples would bring to the bound: the next doubling.
        assert_eq!(samples(times(3.0 * f64::from(least)), 0.0), 4 * least);
        assert_eq!(samples(1e3 * target, 0.0), most);
        // A truth with as much noise of its own: as much will do.
        assert_eq!(samples(1e3 * target, 1e3 * target), least);
        // Products alone: variance falls with the square of the samples. As much as `3 * least` would bring to the bound.
        let paths = 1.5 * f64::from(least) * target * f64::from(noise.pilot_pixels);
        let products = NoisePsnr { total: paths, paths, products: paths, shared: 0.0, reference: 0.0, common: 0.0 };
        assert_eq!(samples_under_bound(&noise, Some(products), target), 4 * least);
        assert_eq!(samples_under_bound(&noise, None, target), least);
    }
}
