//! Checks the photo renderer's pictures: that every view has them, at its size, and that the input view shows one of them.

use mateval_image::{LinearRgb, exr_io};
use mateval_scene::RendererId;
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::{INPUT, SceneFolder};

use super::schema;
use mateval_prep::faults::Faults;
use mateval_scene::render_file::RenderFile;

/// Radiance times exposure below which every channel of an 8-bit sRGB picture is 0: half a step of the linear part of the
/// transfer curve.
const BLACK: f32 = 0.5 / 255.0 / 12.92;

/// Reports an input picture that is black. A black group of lights is no fault: the sky of a closed room reaches nothing.
fn check_light(folder: &SceneFolder, scene: &SceneFile, faults: &mut Faults) {
    let Some(view) = scene.view(INPUT) else { return };
    // A picture that cannot be read has been reported.
    let Ok(picture) = exr_io::read_linear(&folder.view(&view.id).join("rgb.exr")) else { return };
    let exposure = scene.exposure as f32;
    if picture.pixels().iter().all(|LinearRgb(rgb)| rgb.iter().all(|value| value * exposure < BLACK)) {
        let message = "the photo is black: no light reaches it; build the scene again, which says why";
        faults.add("black_photo", &format!("views/{INPUT}/rgb.exr"), "", message);
    }
}

/// Reports every view whose renders are missing, unreadable or of another size than its camera's picture.
pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, renderer: &RendererId, faults: &mut Faults) {
    check_light(folder, scene, faults);
    for view in &scene.views {
        if folder.truth().is_dir() {
            let file = format!("ground_truth/renders/{renderer}/{}/render.json", view.id);
            schema::check::<RenderFile>(folder.path(), &file, faults);
        }
        let k = view.camera.intrinsics;
        let expected = (k.width as usize, k.height as usize);
        for name in ["rgb_a.exr", "rgb_b.exr", "rgb.exr"] {
            let file = format!("ground_truth/renders/{renderer}/{}/{name}", view.id);
            let path = folder.render(renderer, &view.id).join(name);
            if !folder.truth().is_dir() {
                continue;
            }
            let Some(picture) = faults.read(&file, exr_io::read_linear(&path)) else { continue };
            if (picture.width(), picture.height()) != expected {
                faults.add("wrong_size", &file, "", format!("expected {}x{} pixels", expected.0, expected.1));
            }
        }
        if view.id.as_str() == INPUT {
            let file = format!("views/{INPUT}/rgb.exr");
            let path = folder.view(&view.id).join("rgb.exr");
            let Some(shown) = faults.read(&file, exr_io::read_linear(&path)) else { continue };
            let render = exr_io::read_linear(&folder.render(renderer, &view.id).join("rgb.exr"));
            if render.is_ok_and(|render| render != shown) {
                let message =
                    format!("differs from ground_truth/renders/{renderer}/{INPUT}/rgb.exr, which it must equal");
                faults.add("wrong_input", &file, "", message);
            }
        }
    }
}
