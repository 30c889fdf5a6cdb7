//! The novel views of a recipe, as turns of the input camera.

use mateval_scene::ViewId;
use serde::Deserialize;

/// A novel view: the input camera turned about its own axes.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Offset {
    /// The view's id.
    pub id: ViewId,
    /// Degrees about X; up is positive.
    pub x_deg: f64,
    /// Degrees about Y, after X; left is positive.
    pub y_deg: f64,
}

/// The paper's four views, turned by five degrees about each axis.
pub(crate) fn default_views() -> Vec<Offset> {
    [("up_left", 5.0, 5.0), ("up_right", 5.0, -5.0), ("down_left", -5.0, 5.0), ("down_right", -5.0, -5.0)]
        .map(|(id, x_deg, y_deg)| Offset { id: ViewId::new(id).expect("our own ids are ids"), x_deg, y_deg })
        .to_vec()
}
