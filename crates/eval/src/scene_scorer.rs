//! Submissions scored on one scene: materials, light and texels of the views around the input camera, then the views from
//! other places.

use crate::error::EvalError;
use crate::light_score::score_light;
use crate::scene_score::{SceneScore, ScoreSheet};
use crate::scene_task::SceneTask;
use crate::view_set::ViewSet;

/// Scores every submission under every protocol. Returns the scores by submission, then by protocol.
pub(crate) fn score_scene(task: &SceneTask<'_>) -> Result<Vec<Vec<SceneScore>>, EvalError> {
    let blank = || task.protocols.iter().map(|_| ScoreSheet::default()).collect();
    let mut sheets: Vec<Vec<ScoreSheet>> = task.predictions.iter().map(|_| blank()).collect();
    if let Some(turned) = task.of(ViewSet::Turned) {
        sheets = score_views(&turned)?;
    }
    task.score_texels(&mut sheets)?;
    let are_wanted = task.protocols.iter().any(|protocol| protocol.wide_views);
    if let Some(wide) = task.of(ViewSet::Wide).filter(|_| are_wanted) {
        for (sheets, wide) in sheets.iter_mut().zip(score_views(&wide)?) {
            let wanted = sheets.iter_mut().zip(wide).zip(task.protocols).filter(|(_, protocol)| protocol.wide_views);
            wanted.for_each(|((sheet, wide), _)| sheet.add_wide(wide));
        }
    }
    let finish = |sheet: ScoreSheet| SceneScore { instances: sheet.errors.finish(task.scene), ..sheet.score };
    Ok(sheets.into_iter().map(|sheets| sheets.into_iter().map(finish).collect()).collect())
}

/// Materials and light in one set of views.
fn score_views(task: &SceneTask<'_>) -> Result<Vec<Vec<ScoreSheet>>, EvalError> {
    let truths = task.truths()?;
    let blank = || task.protocols.iter().map(|_| ScoreSheet::default()).collect();
    let mut sheets: Vec<Vec<ScoreSheet>> = task.predictions.iter().map(|_| blank()).collect();
    let base_colors = task.score_materials(&truths, &mut sheets)?;
    if let Some(renderer) = task.renderer {
        for (at, protocol) in task.protocols.iter().enumerate() {
            if task.set == ViewSet::Turned || protocol.wide_views {
                score_light(task, renderer, &truths, &base_colors, at, &mut sheets)?;
            }
        }
    }
    Ok(sheets)
}
