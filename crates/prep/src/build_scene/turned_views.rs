//! The views of a scene: the input camera, and the novel views that turn it about its position.

use mateval_scene::dataset::View;
use mateval_scene::layout::INPUT;
use mateval_scene::{Camera, ViewId};

use crate::recipe::Recipe;

/// The input view, then the novel views: the input camera, turned by each of the recipe's offsets.
pub(super) fn views_of(recipe: &Recipe, camera: Camera) -> Vec<View> {
    let input =
        View { id: ViewId::new(INPUT).expect("our own id is an id"), x_deg: 0.0, y_deg: 0.0, camera, wide: None };
    let turned = recipe.views.iter().map(|offset| View {
        id: offset.id.clone(),
        x_deg: offset.x_deg,
        y_deg: offset.y_deg,
        camera: camera.turned(offset.x_deg, offset.y_deg),
        wide: None,
    });
    std::iter::once(input).chain(turned).collect()
}
