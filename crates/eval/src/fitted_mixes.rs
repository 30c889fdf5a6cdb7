//! The radiances of lights that are fitted to the input view, for predictions that share paths.
//!
//! Light is linear in emission: one set of paths shows the input view under each light alone, a light basis. Two
//! independent streams of paths give two bases, each corrected by the companions' converged pictures, and two fits. The
//! fitted radiances are their mean; the difference between the pictures under either shows the noise of the fit.

use mateval_image::{LinearRgb, Picture};
use mateval_light::light_fit::{FitTarget, LightFit, fit_two_streams};
use mateval_submission::prediction::PredictedScene;
use mateval_tracer::{LightBasis, LightMix, ViewsRender};

use crate::companion_pictures::{CompanionPictures, HALVES, Lightings};
use crate::companions::COMPANIONS;
use crate::control_variate::{Coefficients, Regression, combined};
use crate::error::EvalError;
use crate::fitted_radiances::{FittedRadiance, FittedRadiances};
use crate::light_pass::LightPass;
use crate::light_rules::LightRules;
use crate::lit_scene::LitScene;
use crate::rendered_view::picture_of;

/// Fits the lights of a pass for a batch of predictions.
pub(crate) struct MixFit<'a> {
    pub(crate) lit: &'a LitScene<'a>,
    pub(crate) rules: &'a LightRules,
    pub(crate) pass: &'a LightPass<'a>,
    pub(crate) companions: Option<&'a CompanionPictures>,
    /// The numbers of the predictions in the scene's list.
    pub(crate) batch: &'a [usize],
    pub(crate) predictions: Vec<&'a PredictedScene>,
}

/// The weights of the lights that one prediction was fitted with.
#[derive(Clone, Debug)]
pub(crate) struct FittedMixes {
    /// Those of each stream.
    pub(crate) streams: [LightMix; 2],
    /// Their mean, with what the result states of the fit.
    pub(crate) radiances: FittedRadiances,
}

impl MixFit<'_> {
    /// The fit of each prediction.
    pub(crate) fn run(&self) -> Result<Vec<FittedMixes>, EvalError> {
        let coefficients = self.coefficients()?;
        let samples = (self.rules.fit.samples / 2).max(1);
        // The bases of both streams, by prediction.
        let mut bases: [Vec<LightBasis>; 2] = Default::default();
        for (half, name) in HALVES.iter().enumerate() {
            let renders = self.trace(samples, &format!("fit_{name}"))?;
            let converged = self.converged(half)?;
            let corrected = coefficients.iter().enumerate();
            bases[half] = corrected.map(|(at, found)| self.basis(&renders, at, converged.as_ref(), found)).collect();
        }
        let photo = &self.lit.photo;
        let target = FitTarget { photo: &photo.light, mask: Some(photo.valid), exposure: self.lit.scene.exposure };
        let [first, second] = &bases;
        let fits = first.iter().zip(second).map(|(first, second)| {
            let fit = fit_two_streams(&self.rules.fit, [first, second], &target)?;
            let radiances = self.radiances(&fit.streams, &fit.weights(), &fit.spread());
            Ok(FittedMixes { streams: fit.streams.map(|stream| stream.weights), radiances })
        });
        fits.collect()
    }

    /// Renders a stream of the input view under each light alone.
    fn trace(&self, samples: u32, stream: &str) -> Result<Vec<ViewsRender>, EvalError> {
        let (camera, what) = (&self.lit.photo.view.camera, format!("light basis, stream {stream}"));
        self.pass.trace_lights(&self.predictions, camera, samples, stream, &what)
    }

    /// The companions' coefficients of each prediction, from a pilot of two samples.
    fn coefficients(&self) -> Result<Vec<Coefficients>, EvalError> {
        if self.companions.is_none() {
            return Ok(vec![Coefficients::default(); self.predictions.len()]);
        }
        let [one, other] = ["fit_pilot_a", "fit_pilot_b"].map(|stream| self.trace(1, stream));
        let streams = [one?, other?];
        Ok((0..self.predictions.len()).map(|at| self.regressed(&streams, at)).collect())
    }

    fn regressed(&self, streams: &[Vec<ViewsRender>; 2], at: usize) -> Coefficients {
        let (photo, lights) = (&self.lit.photo, self.pass.lights.len());
        let ratio = &self.lit.ratio(self.batch[at], photo.place);
        // The scale at which the lights together are about as bright as the photo.
        let sum = |picture: &Picture<LinearRgb>| -> f64 {
            picture.pixels().iter().flat_map(|rgb| rgb.0).map(f64::from).sum()
        };
        let lit: f64 = (0..lights).map(|light| sum(picture_of(&streams[0][at], 0, light))).sum();
        let scale = if lit > 0.0 { sum(&photo.light) / lit } else { 0.0 };
        let mut regression = Regression::default();
        for k in (0..photo.valid.pixels().len()).filter(|&k| photo.valid.pixels()[k]) {
            let pixel = |stream: usize, variant: usize, light: usize| {
                picture_of(&streams[stream][variant], 0, light).pixels()[k].0.map(f64::from)
            };
            let difference = |variant: usize, light: usize| {
                let [a, b] = [pixel(0, variant, light), pixel(1, variant, light)];
                [0, 1, 2].map(|c| scale * (a[c] - b[c]))
            };
            let mut value = [0.0; 3];
            for light in 0..lights {
                let [a, b] = [pixel(0, at, light), pixel(1, at, light)];
                (0..3).for_each(|c| value[c] += self.lit.scene.exposure * scale * (a[c] + b[c]) / 2.0);
            }
            for light in 0..lights {
                let companions: [[f64; 3]; COMPANIONS] = std::array::from_fn(|j| {
                    let difference = difference(self.predictions.len() + j, light);
                    [0, 1, 2].map(|c| f64::from(ratio.pixels()[k].0[c]) * difference[c])
                });
                regression.add(difference(at, light), companions, value);
            }
        }
        regression.solve()
    }

    /// The converged pictures of half `half` in the input view, one light after the other.
    fn converged(&self, half: usize) -> Result<Option<Lightings<Picture<LinearRgb>>>, EvalError> {
        let read =
            |companions: &CompanionPictures| companions.read(&self.lit.photo.view.id, half, self.pass.lights.len());
        self.companions.map(read).transpose()
    }

    /// One prediction's basis, corrected by the companions.
    fn basis(
        &self,
        renders: &[ViewsRender],
        at: usize,
        converged: Option<&Lightings<Picture<LinearRgb>>>,
        coefficients: &Coefficients,
    ) -> LightBasis {
        let photo = &self.lit.photo;
        let ratio = &self.lit.ratio(self.batch[at], photo.place);
        let light = |light: usize| {
            let own = picture_of(&renders[at], 0, light);
            let Some(converged) = converged else { return own.clone() };
            Picture::from_fn(own.width(), own.height(), |x, y| {
                let difference: [[f64; 3]; COMPANIONS] = std::array::from_fn(|j| {
                    // Converged pictures are exposed.
                    let known = converged[light][j].get(x, y).0;
                    let seen = picture_of(&renders[self.predictions.len() + j], 0, light).get(x, y).0;
                    [0, 1, 2].map(|c| f64::from(known[c]) / self.lit.scene.exposure - f64::from(seen[c]))
                });
                let added = combined(coefficients, ratio.get(x, y).0, difference);
                LinearRgb([0, 1, 2].map(|c| (f64::from(own.get(x, y).0[c]) + added[c]) as f32))
            })
        };
        let pictures = (0..self.pass.lights.len()).map(light).collect();
        let (width, height) = (photo.light.width(), photo.light.height());
        LightBasis::new(width, height, pictures).expect("all pictures are of the input view's size")
    }

    fn radiances(&self, streams: &[LightFit; 2], weights: &[[f64; 3]], spread: &[[f64; 3]]) -> FittedRadiances {
        let lights = self.pass.lights.iter().zip(weights.iter().zip(spread));
        let mean =
            |of: &dyn Fn(&LightFit) -> f64| streams.iter().map(|fit| of(fit) / fit.squares.max(1) as f64 / 2.0).sum();
        FittedRadiances {
            stage: self.pass.on_stage,
            lights: lights
                .map(|(light, (radiance, spread))| FittedRadiance {
                    light: light.clone(),
                    radiance: *radiance,
                    spread: *spread,
                })
                .collect(),
            mean_absolute_error: [0, 1, 2].map(|c| mean(&|fit| fit.channels[c].misfit)),
            ridge: [0, 1, 2].map(|c| mean(&|fit| fit.channels[c].ridge)),
            lower_bound: [0, 1, 2].map(|c| mean(&|fit| fit.channels[c].bound)),
        }
    }
}
