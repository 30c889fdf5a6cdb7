//! Pictures of a scene for display: the truth and every submission.

use std::path::Path;

use mateval_image::{LinearRgb, Picture};
use mateval_scene::companions_file::light_inputs_sha256;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::open::Dataset;
use mateval_scene::{Progress, RendererId, TriangleMesh};

use crate::companion_store::MadeIn;
use crate::error::EvalError;
use crate::light_score::{ShownLight, shown_light};
use crate::material_pictures::material_pictures;
use crate::open_scene::{OpenScene, scored_views};
use crate::protocol::Protocol;
use crate::scene_task::SceneTask;
use crate::truth::ViewTruth;
use crate::view_set::ViewSet;
use mateval_submission::atlas_meshes::AtlasMeshes;
use mateval_submission::prediction::{PredictedScene, read_scene};

/// The truth and every submission's albedo of one view, linear.
pub struct SceneAlbedo {
    /// The truth's pictures and masks.
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
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene, None)?;
    let predictions = predictions_of(submissions, scene, &atlases)?;
    let view = |view: &View| {
        let pictures = material_pictures(&world, &atlases, &view.camera, &predictions);
        let predicted = pictures.into_iter().map(|pictures| pictures.base_color).collect();
        Ok(SceneAlbedo { truth: ViewTruth::read(&folder, view)?, predicted })
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

/// The truth's light and every submission's of one view, for display.
pub struct SceneLight {
    /// The truth's pictures and masks.
    pub truth: ViewTruth,
    /// Truth and submissions, the latter in the given order.
    pub shown: ShownLight,
}

/// The views of a scene that are scored, in the scene's order, in the first of the protocol's tracks.
pub fn scene_light(
    dataset: &Dataset,
    scene: &SceneFile,
    submissions: &[&Path],
    protocol: &Protocol,
    renderer: &RendererId,
    progress: Progress<'_>,
) -> Result<Vec<SceneLight>, EvalError> {
    let OpenScene { folder, world, atlases } = OpenScene::read(dataset, scene, Some(renderer))?;
    let predictions = predictions_of(submissions, scene, &atlases)?;
    let views = scored_views(dataset, scene)?;
    let truths = views.iter().map(|view| ViewTruth::read(&folder, view)).collect::<Result<Vec<_>, _>>()?;
    let task = SceneTask {
        scene,
        folder: &folder,
        world: &world,
        atlases: &atlases,
        views,
        set: ViewSet::Turned,
        predictions: &predictions,
        protocols: std::slice::from_ref(protocol),
        lpips: None,
        renderer: Some(renderer),
        companions_made_in: MadeIn::ThisRun,
        inputs_sha256: light_inputs_sha256(&dataset.root, &scene.id)?,
        progress,
    };
    let mut base_colors = vec![Vec::new(); predictions.len()];
    for view in &task.views {
        let pictures = material_pictures(&world, &atlases, &view.camera, &predictions);
        base_colors.iter_mut().zip(pictures).for_each(|(views, pictures)| views.push(pictures.base_color));
    }
    let shown = shown_light(&task, renderer, &truths, &base_colors)?;
    let rows = truths.into_iter().zip(shown);
    Ok(rows.map(|(truth, shown)| SceneLight { truth, shown }).collect())
}
