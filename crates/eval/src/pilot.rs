//! The pilot of a batch of predictions: a render of few samples that says how the companions correct each prediction, and
//! how many samples it needs.

use std::ops::Range;

use mateval_image::{LinearRgb, Picture};
use mateval_metrics::{Halves, NoiseFreeMse, NoisePsnr, NoisyRender, noise_free_mse, psnr_mean_error};
use mateval_scene::layout::INPUT;
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::ViewsRender;

use crate::batch_mixes::BatchMixes;
use crate::companion_pictures::{CompanionPictures, Lightings};
use crate::companions::COMPANIONS;
use crate::control_variate::{Coefficients, Regression};
use crate::error::EvalError;
use crate::light_pass::{LightPass, PassPictures};
use crate::light_rules::NoiseRules;
use crate::lit_scene::LitScene;
use crate::rendered_view::{RenderedView, of_companions, picture_of, without_companions};
use crate::rgb::{EncodedLight, LightReference};
use crate::stored_light::StoredLight;

/// The input of a pilot.
pub(crate) struct Pilot<'a> {
    pub(crate) lit: &'a LitScene<'a>,
    pub(crate) rules: &'a NoiseRules,
    pub(crate) pass: &'a LightPass<'a>,
    pub(crate) companions: Option<&'a CompanionPictures>,
    /// The numbers of the predictions in the scene's list.
    pub(crate) batch: &'a [usize],
    pub(crate) predictions: Vec<&'a PredictedScene>,
    pub(crate) mixes: &'a BatchMixes,
}

/// Samples per pixel of a half, and the companions' coefficients of each picture.
type Found = (u32, Vec<Coefficients>);

/// One stream of a pilot: by variant, picture of the render and view.
struct Stream(Vec<Vec<Vec<StoredLight>>>);

/// Runs a pilot; one answer for each prediction.
pub(crate) fn run_pilot(pilot: &Pilot<'_>) -> Result<Vec<Found>, EvalError> {
    let (samples, pictures) = (pilot.rules.pilot_samples / 2, pilot.mixes.pictures());
    let trace = |stream: &str| {
        let what = format!("{} pilot, stream {stream}", pilot.pass.name);
        pilot.pass.trace(&pilot.predictions, &pilot.mixes.all, samples.max(1), &format!("pilot_{stream}"), &what)
    };
    // The first half gives the coefficients; only the pictures that they leave are kept.
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
        let mut samples = pilot.rules.least_samples;
        for (picture, views) in views.iter().enumerate() {
            samples = samples.max(pilot.enough_samples(picture, views)?);
        }
        found.push((samples, coefficients));
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
        for (view, truth) in self.lit.truths.iter().enumerate() {
            let ratio = &self.lit.ratios[self.batch[at]][view];
            for k in (0..truth.valid.pixels().len()).filter(|&k| truth.valid.pixels()[k]) {
                let of = |variant: usize| [one, other].map(|stream| stream.0[variant][place][view].at(k));
                let [p, q] = of(at);
                let companions: [[f64; 3]; COMPANIONS] = std::array::from_fn(|j| {
                    let [f, g] = of(first + j);
                    [0, 1, 2].map(|c| f64::from(ratio.pixels()[k].0[c]) * (f[c] - g[c]))
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
                    let ratio = &self.lit.ratios[self.batch[at]][view];
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
            let [a, b] = [0, 1].map(|half| companions.read(&shown.id, half, kept));
            let (a, b) = (a?, b?);
            for (at, pictures) in views.iter_mut().enumerate() {
                let ratio = &self.lit.ratios[self.batch[at]][view];
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

    /// Samples that bring the noise of a picture under its bounds, in the input view and in the novel views.
    fn enough_samples(&self, picture: usize, views: &[RenderedView]) -> Result<u32, EvalError> {
        let (_, lighting) = self.pass.pictures.names()[picture];
        let truths = &self.lit.lights[&lighting];
        let mut kinds: [Vec<NoiseFreeMse>; 2] = Default::default();
        let mut variance = 0.0_f64;
        for (at, view) in self.lit.views.iter().enumerate() {
            let locate = |source| {
                let (scene, view) = (self.lit.scene.id.clone(), view.id.clone());
                EvalError::Metric { scene, view, source }
            };
            let light = EncodedLight::of_prediction(&views[at]).map_err(locate)?;
            let [a, b] = LightReference::encoded_halves(&truths[at]).map_err(locate)?;
            let (valid, blocks) = (&self.lit.truths[at].valid, &self.lit.blocks[at]);
            let mse = noise_free_mse(light.render(), Halves { a: &a, b: &b }, valid, blocks).map_err(locate)?;
            variance = variance.max(mean_variance(light.render(), valid));
            kinds[usize::from(view.id.as_str() != INPUT)].extend(mse);
        }
        let kinds = kinds.iter().filter(|mses| !mses.is_empty());
        let errors = kinds.map(|mses| psnr_mean_error(&mses.iter().collect::<Vec<_>>()));
        let needed = errors.map(|error| samples_under_bound(self.rules, error, variance));
        Ok(needed.max().unwrap_or(self.rules.least_samples))
    }
}

/// The mean variance of the values of a half over the pixels of the mask; 0 without such pixels.
fn mean_variance(render: &NoisyRender<mateval_image::SrgbRgb>, mask: &mateval_image::Mask) -> f64 {
    let (mut sum, mut count) = (0.0, 0_usize);
    for half in [&render.a.noise, &render.b.noise] {
        for (pixel, _) in half.pixels().iter().zip(mask.pixels()).filter(|(_, counts)| **counts) {
            sum += pixel.0.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
            count += 3;
        }
    }
    sum / count.max(1) as f64
}

/// Samples that bring the noise under its bounds, since variance is inversely proportional to their number. `pilot` is the
/// standard error of the pilot's mean PSNR (none: its pictures equal the truth's without noise), `variance` the mean
/// variance of its halves.
pub fn samples_under_bound(rules: &NoiseRules, pilot: Option<NoisePsnr>, variance: f64) -> u32 {
    let of_error = pilot.map_or(0.0, |NoisePsnr { paths, shared, reference, .. }| {
        let bound = rules.target_db.max(rules.truth_share * shared.hypot(reference));
        (paths / bound).powi(2)
    });
    let needed = f64::from(rules.pilot_samples) * of_error.max(variance / rules.most_variance);
    let mut samples = rules.least_samples;
    while f64::from(samples) < needed && samples < rules.most_samples {
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
        let samples = |paths: f64, reference: f64, variance: f64| {
            let error = NoisePsnr { total: paths, paths, shared: 0.0, reference, common: 0.0 };
            samples_under_bound(&noise, Some(error), variance * noise.most_variance)
        };
        let times = |factor: f64| f64::sqrt(factor / f64::from(noise.pilot_samples)) * target;
        assert_eq!(samples(0.001 * target, 0.0, 0.0), least);
        // As much as `3 * least` samples would bring to the bound: the next doubling.
        assert_eq!(samples(times(3.0 * f64::from(least)), 0.0, 0.0), 4 * least);
        assert_eq!(samples(1e3 * target, 0.0, 0.0), most);
        // A truth with as much noise of its own: as much will do.
        assert_eq!(samples(1e3 * target, 1e3 * target, 0.0), least);
        // Noise of pixels counts by itself.
        assert_eq!(samples(0.0, 0.0, 3.0 * f64::from(least) / f64::from(noise.pilot_samples)), 4 * least);
        assert_eq!(samples_under_bound(&noise, None, 0.0), least);
    }
}
