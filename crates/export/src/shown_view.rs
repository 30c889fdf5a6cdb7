//! The views of a scene and their pictures.

use std::path::{Path, PathBuf};

use glam::DVec3;
use mateval_scene::Camera;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::INPUT;
use mateval_scene::open::Dataset;

/// A view that has a picture.
#[derive(Clone, Debug)]
pub struct ShownView<'a> {
    /// The scene.
    pub scene: &'a SceneFile,
    /// The view.
    pub view: &'a View,
    /// Its 8-bit sRGB picture, relative to the dataset.
    pub picture: PathBuf,
}

/// The 8-bit sRGB picture of a view, relative to the dataset: that of the input view, or the reference picture of another
/// view. None where it does not exist, as with withheld ground truth.
pub fn picture(dataset: &Dataset, scene: &SceneFile, view: &View) -> Option<PathBuf> {
    let folder = dataset.folder(&scene.id);
    let file = match (view.id.as_str(), dataset.photo_renderer(scene)) {
        (INPUT, _) => folder.view(&view.id),
        (_, Some(renderer)) => folder.render(renderer, &view.id),
        (_, None) => return None,
    }
    .join("rgb.png");
    let relative = file.strip_prefix(&dataset.root).expect("a scene's files lie in the dataset").to_owned();
    file.is_file().then_some(relative)
}

/// A path as files state it on every system, with forward slashes.
pub fn slashed(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// The views of a scene that have a picture, in its order.
pub fn of_scene<'a>(dataset: &Dataset, scene: &'a SceneFile) -> Vec<ShownView<'a>> {
    let shown = |view: &'a View| Some(ShownView { scene, view, picture: picture(dataset, scene, view)? });
    scene.views.iter().filter_map(shown).collect()
}

/// The view's camera in the space of the scene's source, from which a dataset may have subtracted whole metres.
pub(crate) fn in_source(shown: &ShownView<'_>) -> Camera {
    let shift = DVec3::from(shown.scene.source.shift_m);
    if shift == DVec3::ZERO { shown.view.camera } else { shown.view.camera.moved(shift) }
}
