//! Checks the scored renders: that every view has them, at its size, and that the input view shows one of them.

use mateval_image::{LinearRgb, Picture, exr_io};
use mateval_scene::RendererId;
use mateval_scene::dataset::{SceneFile, View};
use mateval_scene::layout::{INPUT, SceneFolder};

use super::schema;
use mateval_prep::faults::Faults;
use mateval_scene::render_file::RenderFile;

/// Reports an input picture that is black where it is scored, and groups of light that no view shows.
fn check_light(folder: &SceneFolder, scene: &SceneFile, renderer: &RendererId, faults: &mut Faults) {
    let is_black = |picture: &Picture<LinearRgb>| picture.pixels().iter().all(|LinearRgb(rgb)| *rgb == [0.0; 3]);
    // Pictures that cannot be read have been reported.
    let input = scene.view(INPUT).map(|view| folder.view(&view.id).join("rgb.exr"));
    if input.and_then(|path| exr_io::read_linear(&path).ok()).is_some_and(|picture| is_black(&picture)) {
        let message = "the photo is black: no light reaches it; build the scene again, which says why";
        faults.add("black_photo", &format!("views/{INPUT}/rgb.exr"), "", message);
        return;
    }
    for group in 0.. {
        let path = |view: &View| folder.render(renderer, &view.id).join(format!("group_{group:02}.exr"));
        let mut pictures = scene.views.iter().map(path).filter(|path| path.is_file()).peekable();
        if pictures.peek().is_none() {
            break;
        }
        if pictures.all(|path| exr_io::read_linear(&path).is_ok_and(|picture| is_black(&picture))) {
            let file = format!("ground_truth/renders/{renderer}");
            faults.add(
                "black_group",
                &file,
                "",
                format!("group_{group:02} is black in every view: its light reaches none"),
            );
        }
    }
}

/// Reports every view whose renders are missing, unreadable or of another size than its camera's picture.
pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, renderer: &RendererId, faults: &mut Faults) {
    check_light(folder, scene, renderer, faults);
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
