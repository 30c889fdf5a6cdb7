//! Checks the photo of a scene that is not rendered.

use mateval_image::exr_io;
use mateval_prep::faults::Faults;
use mateval_scene::dataset::{Photo, SceneFile};
use mateval_scene::layout::{INPUT, SceneFolder};

/// Reports a photo whose file the source does not list, renders that should not exist, and an input picture that is
/// missing, unreadable or of another size than the camera's.
pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, photo: &Photo, faults: &mut Faults) {
    if !scene.source.files.iter().any(|file| file.path == photo.file) {
        faults.add("unlisted_photo", "scene.json", "/photo/file", "expected one of the files in /source/files");
    }
    if folder.truth().join("renders").exists() {
        faults.add("unexpected_renders", "ground_truth/renders", "", "expected none, since the scene has a photo");
    }
    let Some(input) = scene.view(INPUT) else { return };
    let file = format!("views/{INPUT}/rgb.exr");
    let Some(shown) = faults.read(&file, exr_io::read_linear(&folder.view(&input.id).join("rgb.exr"))) else { return };
    let k = input.camera.intrinsics;
    if (shown.width(), shown.height()) != (k.width as usize, k.height as usize) {
        faults.add("wrong_size", &file, "", format!("expected {}x{} pixels", k.width, k.height));
    }
}
