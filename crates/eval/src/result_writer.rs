//! Scores of all scenes as a result lists them: flat, each value by its key.

use std::collections::BTreeMap;

use mateval_scene::SceneId;

use crate::means::{means, summary_noise};
use crate::measure::Measured;
use crate::metric::Metric;
use crate::protocol::Protocol;
use crate::result::{PictureValue, ProtocolResult, PsnrNoise};
use crate::result_key::ResultKey;
use crate::scene_score::{NoiseScore, SceneScore, ViewScore};

/// The scores of one submission under one protocol, scene by scene, as a result holds them.
pub(crate) fn protocol_result(
    protocol: &Protocol,
    fingerprint: String,
    scores: Vec<(SceneId, SceneScore)>,
) -> ProtocolResult {
    let (mut pictures, mut texels, mut instances) = (Vec::new(), Vec::new(), Vec::new());
    let (mut noise, mut companions, mut fits) = (BTreeMap::new(), BTreeMap::new(), BTreeMap::new());
    for (scene, score) in scores {
        pictures.extend(score.views.into_iter().flat_map(|view| picture_values(&scene, view)));
        texels.extend(score.texels);
        instances.extend(score.instances);
        if !score.noise.is_empty() {
            noise.insert(scene.clone(), score.noise.into_iter().map(keyed).collect());
        }
        if !score.companions.is_empty() {
            companions.insert(scene.clone(), score.companions);
        }
        fits.extend(score.fit.map(|fit| (scene, fit)));
    }
    let (scenes, summary) = means(&pictures, &texels);
    ProtocolResult {
        protocol: protocol.clone(),
        fingerprint,
        summary,
        scenes,
        summary_noise: summary_noise(&noise),
        noise,
        companions,
        fits,
        pictures,
        texels,
        instances,
    }
}

fn picture_values(scene: &SceneId, ViewScore { view, pictures }: ViewScore) -> Vec<PictureValue> {
    let mut values = Vec::new();
    for picture in pictures {
        values.extend(picture.metrics.into_iter().map(|Measured { metric, value, exact, noise, count }| {
            PictureValue {
                scene: scene.clone(),
                view: view.clone(),
                picture: picture.picture,
                lighting: picture.lighting,
                region: picture.region,
                metric,
                value,
                exact,
                noise,
                count,
            }
        }));
    }
    values
}

fn keyed(NoiseScore { picture, views, noise }: NoiseScore) -> (ResultKey, PsnrNoise) {
    (ResultKey { picture, views, metric: Metric::Psnr }, noise)
}
