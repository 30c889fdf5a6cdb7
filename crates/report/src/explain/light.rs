//! The worst instances under each light, from the result alone.

use std::collections::BTreeMap;

use mateval_scene::{InstanceId, SceneId};

use super::file::LightShare;
use super::plan::WORST;
use mateval_eval::result::ProtocolResult;
use mateval_eval::result_key::{PictureKind, Views};

/// The kinds of renders for which results hold errors of instances.
pub(super) const LIGHTS: [PictureKind; 2] = [PictureKind::RgbTrue, PictureKind::RgbFitted];

/// For each kind of render, the [`WORST`] instances with the largest shares of the scene's squared error in the input
/// view and the novel views, the largest first.
pub(super) fn worst(scores: &ProtocolResult, scene: &SceneId) -> Vec<LightShare> {
    LIGHTS.into_iter().flat_map(|picture| of_kind(scores, scene, picture)).collect()
}

fn of_kind(scores: &ProtocolResult, scene: &SceneId, picture: PictureKind) -> Vec<LightShare> {
    let mut sums: BTreeMap<&InstanceId, (f64, usize, Option<String>)> = BTreeMap::new();
    let of_scene = scores.instances.iter().filter(|errors| errors.scene == *scene && errors.picture == picture);
    for errors in of_scene.filter(|errors| matches!(errors.views, Views::Input | Views::Novel)) {
        let sum = sums.entry(&errors.instance).or_insert_with(|| (0.0, 0, errors.category.clone()));
        sum.0 += errors.mse * errors.pixels as f64;
        sum.1 += errors.pixels;
    }
    let total: f64 = sums.values().map(|(sum, ..)| sum).sum();
    let share = |(instance, (sum, pixels, category)): (&InstanceId, (f64, usize, Option<String>))| LightShare {
        picture,
        instance: instance.clone(),
        category,
        pixels,
        mse: sum / pixels as f64,
        share: sum / total,
    };
    // Without an error above the noise, shares are undefined.
    let mut shares: Vec<LightShare> = if total > 0.0 { sums.into_iter().map(share).collect() } else { Vec::new() };
    shares.sort_by(|a, b| b.share.total_cmp(&a.share).then_with(|| a.instance.cmp(&b.instance)));
    shares.truncate(WORST);
    shares
}
