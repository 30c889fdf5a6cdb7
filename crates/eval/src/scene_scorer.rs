//! Submissions scored on one scene: materials, texels, then light.

use crate::error::EvalError;
use crate::light_score::score_light;
use crate::scene_order::SceneOrder;
use crate::scene_score::{SceneScore, Sheet};
use crate::truth::ViewTruth;

/// By submission, then by protocol.
pub(crate) fn score_scene(order: &SceneOrder<'_>) -> Result<Vec<Vec<SceneScore>>, EvalError> {
    let truths = order.views.iter().map(|view| ViewTruth::read(order.folder, view)).collect::<Result<Vec<_>, _>>()?;
    let blank = || order.protocols.iter().map(|_| Sheet::default()).collect();
    let mut sheets: Vec<Vec<Sheet>> = order.predictions.iter().map(|_| blank()).collect();
    order.score_materials(&truths, &mut sheets)?;
    order.score_texels(&mut sheets)?;
    if let Some(renderer) = order.renderer {
        for at in 0..order.protocols.len() {
            score_light(order, renderer, &truths, at, &mut sheets)?;
        }
    }
    let finish = |sheet: Sheet| SceneScore { instances: sheet.errors.finish(order.scene), ..sheet.score };
    Ok(sheets.into_iter().map(|sheets| sheets.into_iter().map(finish).collect()).collect())
}
