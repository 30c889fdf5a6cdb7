//! Submissions scored on one scene: materials, texels, then light.

use crate::error::EvalError;
use crate::light_score::score_light;
use crate::scene_score::{SceneScore, ScoreSheet};
use crate::scene_task::SceneTask;
use crate::truth::ViewTruth;

/// Scores every submission under every protocol. Returns the scores by submission, then by protocol.
pub(crate) fn score_scene(task: &SceneTask<'_>) -> Result<Vec<Vec<SceneScore>>, EvalError> {
    let truths = task.views.iter().map(|view| ViewTruth::read(task.folder, view)).collect::<Result<Vec<_>, _>>()?;
    let blank = || task.protocols.iter().map(|_| ScoreSheet::default()).collect();
    let mut sheets: Vec<Vec<ScoreSheet>> = task.predictions.iter().map(|_| blank()).collect();
    let base_colors = task.score_materials(&truths, &mut sheets)?;
    task.score_texels(&mut sheets)?;
    if let Some(renderer) = task.renderer {
        for at in 0..task.protocols.len() {
            score_light(task, renderer, &truths, &base_colors, at, &mut sheets)?;
        }
    }
    let finish = |sheet: ScoreSheet| SceneScore { instances: sheet.errors.finish(task.scene), ..sheet.score };
    Ok(sheets.into_iter().map(|sheets| sheets.into_iter().map(finish).collect()).collect())
}
