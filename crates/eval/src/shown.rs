//! Pictures of submissions beside the truth, for pages.

use std::collections::BTreeMap;
use std::path::Path;

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::INPUT;
use mateval_dataset::lighting::LightingName;
use mateval_dataset::open::Dataset;
use mateval_dataset::{Progress, TriangleMesh, ViewId};
use mateval_image::{LinearRgb, Picture, SrgbRgb};
use mateval_submission::atlas::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};

use crate::error::EvalError;
use crate::light::own_lights::light_of_groups;
use crate::light::reference::StoredReference;
use crate::light::score::compare_under_lights;
use crate::materials::pictures::{Places, material_pictures};
use crate::protocol::{Protocol, Track};
use crate::scene::SceneTask;
use crate::truth::{OpenScene, ViewSet, ViewTruth, scored_views};

/// The truth and every submission's albedo of one view, linear.
pub struct SceneAlbedo {
    pub truth: ViewTruth,
    /// One for each submission, in the given order.
    pub predicted: Vec<Picture<LinearRgb>>,
}

/// The views of a scene that are scored, in the scene's order.
pub fn scene_albedo(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
) -> Result<Vec<SceneAlbedo>, EvalError> {
    scene.check_materials_known()?;
    let open = OpenScene::read(dataset, scene)?;
    let predictions = predictions_of(submissions, scene, &open.atlases)?;
    let view = |view: &View| {
        let predictions: Vec<_> = predictions.iter().collect();
        let pictures = material_pictures(&open, &view.camera, &predictions, Places::AsTruth);
        let predicted = pictures.into_iter().map(|pictures| pictures.base_color).collect();
        Ok(SceneAlbedo { truth: ViewTruth::read(&open.folder, view)?, predicted })
    };
    scored_views(dataset, scene)?.into_iter().map(view).collect()
}

fn predictions_of(
    submissions: &[&Path],
    scene: &SceneFile,
    atlases: &[TriangleMesh],
) -> Result<Vec<PredictedScene>, EvalError> {
    let atlases = AtlasMeshes::in_memory(atlases);
    Ok(submissions.iter().map(|path| read_scene(path, scene, &atlases)).collect::<Result<_, _>>()?)
}

/// The truth's light and every submission's of one view, clipped and encoded for display.
pub struct SceneLight {
    pub id: ViewId,
    pub truth: ViewTruth,
    /// What submissions are compared with.
    pub reference: Picture<SrgbRgb>,
    /// One for each submission, in the given order.
    pub predicted: Vec<Picture<SrgbRgb>>,
}

/// The views of a scene that are scored and share the input view's place, in the scene's order: in the lighting, or in
/// the first of the protocol's tracks. Empty if the scene has no such lighting; fails if the dataset has no reference.
pub fn scene_light(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
    protocol: &Protocol,
    lighting: Option<LightingName>,
    progress: Progress<'_>,
) -> Result<Vec<SceneLight>, EvalError> {
    let open = OpenScene::read(dataset, scene)?;
    let predictions = predictions_of(submissions, scene, &open.atlases)?;
    let reference = StoredReference::listed(dataset, scene)?;
    let task = SceneTask {
        dataset,
        scene,
        open: &open,
        views: ViewSet::Turned.of(&scored_views(dataset, scene)?),
        set: ViewSet::Turned,
        predictions: &predictions,
        protocols: std::slice::from_ref(protocol),
        lpips: None,
        reference: reference.as_ref(),
        renderer: dataset.photo_renderer(scene),
        pictures: None,
        seen: None,
        progress,
    };
    let truths = task.truths()?;
    let base_colors = task.base_colors()?;
    let track = if lighting.is_some() { Some(Track::Relit) } else { protocol.light.tracks.first().copied() };
    // By view, and by submission and view: submissions arrive in any order.
    let mut references = Vec::new();
    let mut predicted: BTreeMap<usize, Vec<Picture<SrgbRgb>>> = BTreeMap::new();
    compare_under_lights(&task, &truths, &base_colors, protocol, &mut |submission, light| {
        if Some(light.track) == track && light.lighting == lighting {
            if references.is_empty() {
                references = light.references.iter().map(|reference| reference.encoded.clone()).collect();
            }
            predicted.insert(submission, light.views.into_iter().map(|view| view.shown).collect());
        }
        Ok(())
    })?;
    if references.is_empty() && !submissions.is_empty() && (lighting.is_none() || task.reference.is_none()) {
        return Err(EvalError::NoPhotoRenderer { dataset: dataset.root.clone() });
    }
    let rows = truths.into_iter().zip(references).enumerate();
    let row = |(at, (truth, reference)): (usize, (ViewTruth, Picture<SrgbRgb>))| SceneLight {
        id: task.views[at].id.clone(),
        truth,
        reference,
        predicted: predicted.values().map(|views| views[at].clone()).collect(),
    };
    Ok(rows.map(row).collect())
}

/// The lightings of a scene besides its own light that [`scene_light`] takes. Fails if the dataset has no reference of
/// the scene.
pub fn scene_lightings(
    dataset: &Dataset,
    scene: &SceneFile,
    protocol: &Protocol,
) -> Result<Vec<LightingName>, EvalError> {
    if !protocol.light.tracks.contains(&Track::Relit) {
        return Ok(Vec::new());
    }
    let Some(reference) = StoredReference::listed(dataset, scene)? else {
        return Err(EvalError::NoPhotoRenderer { dataset: dataset.root.clone() });
    };
    let input = scene.view(INPUT).ok_or_else(|| EvalError::no_input_view(&scene.id))?;
    let group_light = light_of_groups(&dataset.folder(&scene.id), input, &reference)?;
    let lightings = protocol.light.lightings_of(Track::Relit, &group_light);
    Ok(lightings.into_iter().filter_map(|(name, _)| name).collect())
}
