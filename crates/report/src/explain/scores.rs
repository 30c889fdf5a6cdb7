//! Scores that put the explanation in context: those of the albedo after scaling alone, with one scale for each
//! picture, each instance or the whole scene; and the worst instances under each light, from the result alone.

use std::collections::BTreeMap;

use mateval_dataset::{InstanceId, SceneId};
use mateval_eval::materials::score::albedo_mse;
use mateval_eval::metric::{ColorPicture, PictureKind};
use mateval_eval::protocol::Protocol;
use mateval_eval::result::ProtocolResult;
use mateval_eval::result::key::Views;
use mateval_eval::shown::SceneAlbedo;
use mateval_image::{LinearRgb, Mask, Picture};
use mateval_metrics::scaled;
use mateval_metrics::{MetricError, Psnr};

use super::file::{AlignedBy, AlignmentScores, LightShare};
use super::kinds::best_scale;
use crate::error::ReportError;

/// How many of the worst instances are listed and shown.
pub(super) const WORST: usize = 10;

/// The kinds of renders for which results hold errors of instances.
pub(super) const LIGHTS: [PictureKind; 2] = [PictureKind::RgbTrue, PictureKind::RgbFitted];

const ALL: [AlignedBy; 6] = [
    AlignedBy::None,
    AlignedBy::PictureAndChannel,
    AlignedBy::Scene,
    AlignedBy::SceneAndChannel,
    AlignedBy::Instance,
    AlignedBy::InstanceAndChannel,
];

/// The scale of each channel, by owner.
type Scales = BTreeMap<Owner, [f64; 3]>;

/// What has scales of its own: number of the view and index of the instance, each 0 if all of them share the scales.
type Owner = (usize, u16);

/// The scores with each kind of scales: first in the input view, then in the novel views, then in their unobserved
/// pixels.
pub(super) fn alignments(
    scene: &SceneId,
    protocol: &Protocol,
    views: &[SceneAlbedo],
) -> Result<Vec<AlignmentScores>, ReportError> {
    let named = |source| ReportError::Metric { what: format!("scene '{scene}'"), source };
    let mut scores = Vec::new();
    for by in ALL {
        scores.extend(scores_with(by, protocol, views).map_err(named)?);
    }
    Ok(scores)
}

fn scores_with(by: AlignedBy, protocol: &Protocol, views: &[SceneAlbedo]) -> Result<Vec<AlignmentScores>, MetricError> {
    let scales = scales(by, views);
    let mut values: BTreeMap<Views, Vec<f64>> = BTreeMap::new();
    for (number, view) in views.iter().enumerate() {
        let aligned = ColorPicture::new(aligned(by, &scales, number, view));
        let truth = ColorPicture::new(view.truth.albedo.clone());
        // Only the input view has no unobserved pixels.
        let whole = if view.truth.unobserved.is_none() { Views::Input } else { Views::Novel };
        let regions = [(whole, Some(&view.truth.valid)), (Views::Unobserved, view.truth.unobserved.as_ref())];
        for (name, mask) in regions {
            let Some(mask) = mask else { continue };
            let mse = albedo_mse(protocol, &aligned, &truth, mask)?;
            values.entry(name).or_default().extend(mse);
        }
    }
    let score = |(views, values): (Views, Vec<f64>)| {
        let psnr = values.iter().map(|mse| Ok(Psnr::from_mse(*mse)?.db)).collect::<Result<Vec<f64>, MetricError>>()?;
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        Ok(AlignmentScores { scales: by, views, mse: mean(&values), psnr: mean(&psnr) })
    };
    values.into_iter().filter(|(_, values)| !values.is_empty()).map(score).collect()
}

fn owner(by: AlignedBy, view: usize, instance: u16) -> Owner {
    match by {
        AlignedBy::None | AlignedBy::Scene | AlignedBy::SceneAndChannel => (0, 0),
        AlignedBy::PictureAndChannel => (view, 0),
        AlignedBy::Instance | AlignedBy::InstanceAndChannel => (0, instance),
    }
}

/// The scales with the least squared error over the valid pixels.
fn scales(by: AlignedBy, views: &[SceneAlbedo]) -> Scales {
    let mut sums: BTreeMap<Owner, [[f64; 3]; 2]> = BTreeMap::new();
    for (number, view) in views.iter().enumerate() {
        for at in counted(&view.truth.valid) {
            let sums = sums.entry(owner(by, number, view.truth.instances.pixels()[at])).or_default();
            let (truth, predicted) = (view.truth.albedo.pixels()[at].0, view.predicted[0].pixels()[at].0);
            for c in 0..3 {
                sums[0][c] += f64::from(truth[c]) * f64::from(predicted[c]);
                sums[1][c] += f64::from(predicted[c]) * f64::from(predicted[c]);
            }
        }
    }
    let best = |[products, squares]: [[f64; 3]; 2]| match by {
        AlignedBy::None => [1.0; 3],
        AlignedBy::Scene | AlignedBy::Instance => [best_scale(products.iter().sum(), squares.iter().sum()); 3],
        _ => std::array::from_fn(|c| best_scale(products[c], squares[c])),
    };
    sums.into_iter().map(|(owner, sums)| (owner, best(sums))).collect()
}

fn counted(mask: &Mask) -> impl Iterator<Item = usize> {
    mask.pixels().iter().enumerate().filter(|(_, counts)| **counts).map(|(at, _)| at)
}

fn aligned(by: AlignedBy, scales: &Scales, number: usize, view: &SceneAlbedo) -> Picture<LinearRgb> {
    let predicted = &view.predicted[0];
    if by == AlignedBy::None {
        return predicted.clone();
    }
    if by == AlignedBy::PictureAndChannel {
        return scaled(predicted, scales.get(&(number, 0)).copied().unwrap_or([1.0; 3]));
    }
    let mut aligned = predicted.clone();
    for at in counted(&view.truth.valid) {
        let scales = scales[&owner(by, number, view.truth.instances.pixels()[at])];
        let LinearRgb(rgb) = predicted.pixels()[at];
        aligned.pixels_mut()[at] = LinearRgb(std::array::from_fn(|c| (f64::from(rgb[c]) * scales[c]) as f32));
    }
    aligned
}

/// For each kind of render, the [`WORST`] instances with the largest shares of the scene's squared error in the input
/// view and the novel views, the largest first.
pub(super) fn worst_under_lights(scores: &ProtocolResult, scene: &SceneId) -> Vec<LightShare> {
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

#[cfg(test)]
mod tests {
    use mateval_eval::truth::ViewTruth;
    use mateval_image::Normal;

    use super::*;

    /// Two views in which instances 1 and 2 have a half and a fourth of their true brightness.
    fn views() -> Vec<SceneAlbedo> {
        let view = |number: usize| {
            let albedo = Picture::from_fn(6, 4, |x, y| LinearRgb([0.1 * (1 + x) as f32, 0.2 * (1 + y) as f32, 0.5]));
            let factor = |x: usize| if x < 3 { 0.5 } else { 0.25 };
            let predicted = Picture::from_fn(6, 4, |x, y| LinearRgb(albedo.get(x, y).0.map(|v| v * factor(x))));
            let scalar = Picture::filled(6, 4, 0.0);
            let truth = ViewTruth {
                albedo,
                roughness: scalar.clone(),
                metallic: scalar,
                valid: Picture::filled(6, 4, true),
                unobserved: (number > 0).then(|| Picture::from_fn(6, 4, |x, _| x == 5)),
                specular: None,
                instances: Picture::from_fn(6, 4, |x, _| if x < 3 { 1 } else { 2 }),
                normals: Picture::filled(6, 4, Normal::default()),
            };
            SceneAlbedo { truth, predicted: vec![predicted] }
        };
        vec![view(0), view(1)]
    }

    #[test]
    fn scales_of_instances_remove_errors_that_a_scale_of_the_scene_cannot() {
        let protocol = Protocol::named("mateval-3").unwrap();
        let scores = alignments(&SceneId::new("s").unwrap(), &protocol, &views()).unwrap();
        assert_eq!(scores.len(), 6 * 3);
        let mse = |by: AlignedBy, views: Views| {
            scores.iter().find(|score| score.scales == by && score.views == views).unwrap().mse
        };
        for views in [Views::Input, Views::Novel, Views::Unobserved] {
            assert!(mse(AlignedBy::Instance, views) < 1e-12);
            assert!(mse(AlignedBy::InstanceAndChannel, views) < 1e-12);
            assert!(mse(AlignedBy::Scene, views) > 1e-3);
        }
        assert!(mse(AlignedBy::SceneAndChannel, Views::Input) <= mse(AlignedBy::Scene, Views::Input));
        assert!(mse(AlignedBy::Scene, Views::Input) < mse(AlignedBy::None, Views::Input));
    }
}
