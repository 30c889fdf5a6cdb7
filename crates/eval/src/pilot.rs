//! The number of samples that a prediction needs, estimated from the noise of a few.

use mateval_metrics::{NoiseFreeMse, NoisePsnr, noise_free_mse, psnr_mean_error};
use mateval_scene::layout::INPUT;
use mateval_tracer::ViewsRender;

use crate::error::EvalError;
use crate::light_rules::NoiseRules;
use crate::lit_scene::LitScene;
use crate::rgb::EncodedLight;

/// Samples per pixel of each half that bring the noise of picture number `picture` of the pilot's render under its bound,
/// in the mean PSNR of the input view and in that of the novel views.
pub(crate) fn enough_samples(
    rules: &NoiseRules,
    lit: &LitScene<'_>,
    render: &ViewsRender,
    picture: usize,
) -> Result<u32, EvalError> {
    let mut kinds: [Vec<NoiseFreeMse>; 2] = Default::default();
    for (at, view) in lit.views.iter().enumerate() {
        let halves = [0, 1].map(|half| &render.views[at].halves[half].basis.pictures()[picture]);
        let [a, b] = halves.map(|half| EncodedLight::half(half, lit.scene.exposure));
        let prediction = mateval_metrics::Halves { a: &a, b: &b };
        let mse = noise_free_mse(prediction, lit.references[at].halves(), &lit.truths[at].valid, &lit.blocks[at]);
        let (scene, view_id) = (lit.scene.id.clone(), view.id.clone());
        let mse = mse.map_err(|source| EvalError::Metric { scene, view: view_id, source })?;
        kinds[usize::from(view.id.as_str() != INPUT)].extend(mse);
    }
    let kinds = kinds.iter().filter(|mses| !mses.is_empty());
    let needed = kinds.map(|mses| samples_under_bound(rules, psnr_mean_error(&mses.iter().collect::<Vec<_>>())));
    Ok(needed.max().unwrap_or(rules.least_samples))
}

/// Samples that bring the noise under its bound, since variance is inversely proportional to their number. Without a
/// `pilot`, where an estimated error was not above 0, the answer is the most samples that the rules allow.
pub fn samples_under_bound(rules: &NoiseRules, pilot: Option<NoisePsnr>) -> u32 {
    let Some(NoisePsnr { prediction, reference, .. }) = pilot else { return rules.most_samples };
    let bound = rules.target_db.max(rules.truth_share * reference);
    let needed = f64::from(rules.pilot_samples) * (prediction / bound) * (prediction / bound);
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
        let noise = Protocol::named("mateval-1").unwrap().light.noise;
        let samples = |prediction: f64, reference: f64| {
            let error = NoisePsnr { total: prediction, prediction, reference };
            samples_under_bound(&noise, Some(error))
        };
        assert_eq!(samples(0.001, 0.0), 16);
        // Two and a half times the bound at 4 samples: 6.25 times as many, and the next power of two.
        assert_eq!(samples(0.05, 0.0), 32);
        assert_eq!(samples(0.039, 0.0), 16);
        assert_eq!(samples(1.0, 0.0), noise.most_samples);
        // A truth with 0.08 dB of its own: as much will do.
        assert_eq!((samples(0.08, 0.08), samples(0.2, 0.08)), (16, 32));
        assert_eq!(samples_under_bound(&noise, None), noise.most_samples);
    }
}
