//! The scored renders: there for every view, of its size, and what the input view shows.

use mateval_image::exr_io;
use mateval_scene::RendererId;
use mateval_scene::dataset::SceneFile;
use mateval_scene::layout::{INPUT, SceneFolder};

use super::{Faults, schema};
use mateval_prep::render::RenderFile;

pub(super) fn check(folder: &SceneFolder, scene: &SceneFile, renderer: &RendererId, faults: &mut Faults) {
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
            let truth = exr_io::read_linear(&folder.render(renderer, &view.id).join("rgb.exr"));
            if truth.is_ok_and(|truth| truth != shown) {
                let message = format!("not the picture of ground_truth/renders/{renderer}/{INPUT}");
                faults.add("wrong_input", &file, "", message);
            }
        }
    }
}
