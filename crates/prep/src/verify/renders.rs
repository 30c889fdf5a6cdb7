//! Checks what a scene is rendered with: the photo renderer's pictures, that every view has them, at its size, and that
//! the input view shows one of them; the photo of a scene that is not rendered; and the scorer's reference, with which
//! scores under light compare.

use std::path::Path;

use mateval_dataset::dataset::{DatasetFile, Photo, PhotoEncoding, SceneFile};
use mateval_dataset::layout::{INPUT, SCORER_JSON, SceneFolder, WHOLE_SCENE};
use mateval_dataset::render_file::{RenderFile, SCORER_FORMAT, ScorerFile, light_inputs_sha256};
use mateval_dataset::{Finding, RendererId, Severity, json};
use mateval_files::untrusted::sha256_of_file;
use mateval_image::{LinearRgb, exr_io};

use super::scene::check_schema;
use crate::scene_meshes::Faults;

/// Radiance times exposure below which every channel of an 8-bit sRGB picture is 0: half a step of the linear part of
/// the transfer curve.
const BLACK: f32 = 0.5 / 255.0 / 12.92;

/// Reports an input picture that is black. A black group of lights is no fault: the sky of a closed room reaches
/// nothing.
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

/// Reports every view whose renders are missing, unreadable, of another size than its camera's picture, or of another
/// kind of device than the first view's.
pub(super) fn check_renders(folder: &SceneFolder, scene: &SceneFile, renderer: &RendererId, faults: &mut Faults) {
    check_light(folder, scene, faults);
    let has_truth = folder.truth().is_dir();
    let mut first_device = None;
    for view in &scene.views {
        if has_truth {
            let file = format!("ground_truth/renders/{renderer}/{}/render.json", view.id);
            check_schema::<RenderFile>(folder.path(), &file, faults);
            // One that cannot be read has been reported.
            if let Ok(found) = json::read::<RenderFile>(&folder.path().join(&file)) {
                let device = found.device.map_or("cpu", |device| device.kind.word());
                let first = *first_device.get_or_insert(device);
                if device != first {
                    let message = format!(
                        "{device} rendered this view and {first} another; pictures of two kinds of devices differ by \
                         more than noise: render the scene again with --force"
                    );
                    faults.add("mixed_devices", &file, "/device", message);
                }
            }
            let k = view.camera.intrinsics;
            let expected = (k.width as usize, k.height as usize);
            for name in ["rgb_a.exr", "rgb_b.exr", "rgb.exr"] {
                let file = format!("ground_truth/renders/{renderer}/{}/{name}", view.id);
                let path = folder.render(renderer, &view.id).join(name);
                let Some(picture) = faults.read(&file, exr_io::read_linear(&path)) else { continue };
                if (picture.width(), picture.height()) != expected {
                    faults.add("wrong_size", &file, "", format!("expected {}x{} pixels", expected.0, expected.1));
                }
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

/// Reports photos whose file the source does not list, renders that should not exist, and pictures of photos that are
/// missing, unreadable or of another size than the camera's. Photos of novel views are checked if the ground truth exists.
pub(super) fn check_photos(folder: &SceneFolder, scene: &SceneFile, photo: &Photo, faults: &mut Faults) {
    if folder.truth().join("renders").exists() {
        faults.add("unexpected_renders", "ground_truth/renders", "", "expected none, since the scene has a photo");
    }
    let input = scene.view(INPUT).map(|input| (input, photo, format!("views/{INPUT}/rgb.exr"), "/photo".to_owned()));
    let novel = scene.views.iter().filter_map(|view| Some((view, scene.novel_photos.get(&view.id)?)));
    let novel = novel.filter(|_| folder.truth().is_dir()).map(|(view, photo)| {
        (view, photo, format!("ground_truth/views/{}/photo.exr", view.id), format!("/novel_photos/{}", view.id))
    });
    let is_split = folder.path().join(WHOLE_SCENE).exists();
    for (view, photo, file, place) in input.into_iter().chain(novel) {
        // Where a dataset was split, the public scene lists no hash of a withheld photo, because it could be looked up.
        let is_withheld = is_split && view.id.as_str() != INPUT;
        if !is_withheld && !scene.source.files.iter().any(|file| file.path == photo.file) {
            let message = "expected one of the files in /source/files";
            faults.add("unlisted_photo", "scene.json", format!("{place}/file"), message);
        }
        let is_white = |white: f64| photo.encoding == PhotoEncoding::Linear && white > 0.0 && white.is_finite();
        if photo.white.is_some_and(|white| !is_white(white)) {
            let message = "expected a finite number above 0, and only of a photo of floating-point numbers";
            faults.add("bad_white", "scene.json", format!("{place}/white"), message);
        }
        let is_relative = |ratio: f64| view.id.as_str() != INPUT && ratio > 0.0 && ratio.is_finite();
        if photo.relative_exposure.is_some_and(|ratio| !is_relative(ratio)) {
            let message = "expected a finite number above 0, and none of the input photo";
            faults.add("bad_exposure", "scene.json", format!("{place}/relative_exposure"), message);
        }
        let Some(shown) = faults.read(&file, exr_io::read_linear(&folder.path().join(&file))) else { continue };
        let k = view.camera.intrinsics;
        if (shown.width(), shown.height()) != (k.width as usize, k.height as usize) {
            faults.add("wrong_size", &file, "", format!("expected {}x{} pixels", k.width, k.height));
        }
    }
}

/// The folder of the reference, relative to the scene's.
const FOLDER: &str = "ground_truth/renders/scorer";

/// Reports a reference that was made from other files of the scene than the manifest lists, and one whose pictures are
/// not those that it lists. Where there is none, scores under light cannot be computed: a warning, if the dataset's
/// pictures are rendered. Without the ground truth there is nothing to check; a scene with a photo from elsewhere has
/// no renders.
pub(super) fn check_scorer(
    root: &Path,
    folder: &SceneFolder,
    dataset: &DatasetFile,
    scene: &SceneFile,
    faults: &mut Faults,
) {
    if scene.photo.is_some() || !folder.truth().is_dir() {
        return;
    }
    let action = format!("run `mateval prep render --only scorer --scene {} {}`", scene.id, root.display());
    let found = |severity, code: &str, file: &str, place: &str, message: String| {
        Finding::new(
            severity,
            code,
            format!("scenes/{}/{file}", scene.id),
            place,
            message,
            format!("{action}, then `mateval prep finish {}`", root.display()),
        )
    };
    if !folder.scorer().exists() {
        if dataset.photo_renderer.is_some() {
            let message = "the scene has no reference, without which light is not scored".to_owned();
            faults.all.push(found(Severity::Warning, "missing_reference", FOLDER, "", message));
        }
        return;
    }
    let list = format!("{FOLDER}/{SCORER_JSON}");
    let stale =
        |file: &str, place: &str, message: String| found(Severity::Error, "stale_reference", file, place, message);
    let path = folder.scorer().join(SCORER_JSON);
    if !path.is_file() {
        faults.all.push(stale(&list, "", "missing: the render was cut off".to_owned()));
        return;
    }
    check_schema::<ScorerFile>(folder.path(), &list, faults);
    let file = match json::read_format::<ScorerFile>(&path, SCORER_FORMAT) {
        Ok(file) => file,
        Err(error) => return faults.all.push(stale(&list, "", error.to_string())),
    };
    // A manifest that cannot be read has been reported.
    if light_inputs_sha256(root, &scene.id).is_ok_and(|inputs| inputs != file.inputs_sha256) {
        let message = "the pictures were made from other files of the scene than the manifest lists";
        faults.all.push(stale(&list, "/inputs_sha256", message.to_owned()));
    }
    for (name, listed) in &file.files {
        let picture = format!("{FOLDER}/{name}");
        match sha256_of_file(&folder.scorer().join(name)) {
            Ok(sha256) if sha256 == *listed => {}
            Ok(sha256) => {
                let message = format!("SHA-256 is {sha256}, but {SCORER_JSON} lists {listed}");
                faults.all.push(stale(&picture, "", message));
            }
            Err(error) => faults.all.push(stale(&picture, "", error.to_string())),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use mateval_dataset::{RendererId, manifest};
    use mateval_files::untrusted::sha256_of_bytes;

    use super::*;

    #[test]
    fn references_that_are_missing_stale_or_changed_are_reported() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        let example = include_str!("../../../../dataset_spec/examples/scene.json");
        let scene: SceneFile = json::parse(Path::new("scene.json"), example.as_bytes()).unwrap();
        let folder = SceneFolder::of(root, &scene.id);
        let mut dataset = DatasetFile::new("", "", "", vec![scene.id.clone()]);
        let found = |dataset: &DatasetFile| {
            let mut faults = Faults::default();
            check_scorer(root, &folder, dataset, &scene, &mut faults);
            let in_scene = |file: &str| file.strip_prefix(&format!("scenes/{}/", scene.id)).unwrap().to_owned();
            let short = |fault: Finding| format!("{} {}{}", fault.code, in_scene(&fault.file), fault.place);
            faults.all.into_iter().map(short).collect::<Vec<_>>()
        };
        std::fs::create_dir_all(folder.truth()).unwrap();
        std::fs::write(folder.lights(), "one lamp").unwrap();
        manifest::write(root).unwrap();
        assert_eq!(found(&dataset), [""; 0], "nothing is rendered yet");
        dataset.photo_renderer = Some(RendererId::new("builtin").unwrap());
        assert_eq!(found(&dataset), ["missing_reference ground_truth/renders/scorer"]);

        let picture = folder.scorer().join("input/group_00.exr");
        std::fs::create_dir_all(picture.parent().unwrap()).unwrap();
        std::fs::write(&picture, "light").unwrap();
        assert_eq!(found(&dataset), ["stale_reference ground_truth/renders/scorer/scorer.json"]);
        let file = ScorerFile {
            format: SCORER_FORMAT.to_owned(),
            version: 1,
            inputs_sha256: light_inputs_sha256(root, &scene.id).unwrap(),
            samples_each_half: 1,
            seeds: Default::default(),
            lights: vec!["lamp".to_owned()],
            variance: BTreeMap::new(),
            files: [("input/group_00.exr".to_owned(), sha256_of_bytes(b"light"))].into(),
        };
        json::write(&folder.scorer().join(SCORER_JSON), &file).unwrap();
        assert_eq!(found(&dataset), [""; 0]);
        manifest::write(root).unwrap();
        assert_eq!(found(&dataset), [""; 0], "the reference is no input of itself");

        std::fs::write(&picture, "other light").unwrap();
        std::fs::write(folder.lights(), "two lamps").unwrap();
        manifest::write(root).unwrap();
        let stale = ["scorer.json/inputs_sha256", "input/group_00.exr"];
        assert_eq!(found(&dataset), stale.map(|file| format!("stale_reference ground_truth/renders/scorer/{file}")));
        std::fs::remove_file(&picture).unwrap();
        assert_eq!(found(&dataset).len(), 2, "a missing picture");
    }
}
