//! The photos of captured rooms as cameras take them: of another exposure, with a flash, clipped, and without measured
//! colours. The stand-in is that of `capture`.

use std::sync::Arc;

use glam::DVec3;
use mateval_baselines::bounds;
use mateval_baselines::delight::CandidateLights;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::nn::{self, NnOptions};
use mateval_dataset::dataset::{Flash, SceneFile};
use mateval_dataset::material::PrincipledFlavour;
use mateval_dataset::measured::MeasurementsFile;
use mateval_dataset::open::Dataset;
use mateval_dataset::reference::{Emission, LightGroup, Surface, SurfaceIndex};
use mateval_dataset::{Camera, SceneId, ViewId, json};
use mateval_eval::metric::PictureKind;
use mateval_eval::result::key::Region;
use mateval_eval::result::{PictureValues, ResultFile};
use mateval_eval::truth::OpenScene;
use mateval_image::{LinearRgb, Picture, exr_io};
use mateval_testkit::kept_folder;
use mateval_testkit::scenes::{grey, material, principled, sphere};
use mateval_tracer::{RenderSettings, World, render};

use super::capture::{
    CAPTURES, SOURCE, built, captured, entry, fitted, label, ordinary, scored, true_mean, words, write_one_colored,
    write_photos,
};

/// A photo of half the exposure, which a table states, is compared without a free factor and scores as one of the same
/// exposure does. Its twin states an eighth, which makes the photo four times too bright, and a free factor makes up for
/// both.
#[test]
fn a_stated_exposure_is_that_of_the_photo() {
    let exposure = |time_s: f64| format!("{{ time_s = {time_s}, iso = 100, f_number = 2.8 }}");
    // The photo of the fourth view is half as bright as the input photo.
    let scene = |id: &str, novel: Option<f64>| {
        let table = novel.map(|time_s| {
            format!("exposures = {{ image_0001 = {}, image_0004 = {} }}", exposure(0.02), exposure(time_s))
        });
        entry(id, "transforms.json", &format!("novel = [\"image_0004\"]\n{}", table.unwrap_or_default()))
    };
    let entries = scene("right", Some(0.01)) + &scene("wrong", Some(0.0025)) + &scene("free", None);
    let captures = built("capture_exposures", &entries).unwrap();
    let relative = |at: usize| captures.scenes[at].novel_photos.values().next().unwrap().relative_exposure;
    assert!((relative(0).unwrap() - 0.5).abs() < 1e-12 && (relative(1).unwrap() - 0.125).abs() < 1e-12);
    assert_eq!(relative(2), None);
    let found = mateval_prep::verify::verify(&captures.root, &|_| ()).unwrap();
    assert!(found.iter().all(|finding| finding.severity != mateval_dataset::Severity::Error), "{found:?}");
    let out = kept_folder("capture_exposed").join("true");
    write_one_colored(&captures, &out, label, true_mean);
    let result = scored(&captures, &out, "capture-1");
    let [right, wrong, free] = ["right", "wrong", "free"].map(|id| fitted(captured(&result), id)[1]);
    assert!(right > wrong + 5.0, "{right} {wrong}");
    // With a free factor the photo keeps half the brightness, and differences from it are smaller.
    assert!(free > right - 1.0, "{right} {free}; {wrong}");
    let refused = |exposures: &str, words: &str| {
        let found = built("capture_no_exposures", &entry("a", "transforms.json", exposures)).err().unwrap().to_string();
        assert!(found.contains(words), "{exposures}: {found}");
    };
    refused(&format!("exposures = {{ other = {} }}", exposure(0.01)), "exposures.other = 0.01 s at ISO 100 and f/2.8");
    refused(&format!("exposures = {{ image_0001 = {} }}", exposure(0.0)), "expected time_s of 0.000001 to 10000, iso");
    refused("exif = true\nnovel = [\"image_0002\"]", "'images/image_0001.png' states no exposure in its EXIF data");
}

/// A capture in which nobody measured colours is scored by its photos, and the result states it. Its twin has both.
#[test]
fn a_capture_without_measured_colours_is_scored_by_its_photos() {
    let whole = |id: &str| entry(id, "transforms.json", "novel = [\"image_0002\"]");
    let without = |id: &str| whole(id).replace("measured = \"measured.json\"\n", "");
    let scores = |name: &str, entries: &str| {
        let captures = built(name, entries).unwrap();
        let found = mateval_prep::verify::verify(&captures.root, &|_| ()).unwrap();
        assert!(found.iter().all(|finding| finding.severity != mateval_dataset::Severity::Error), "{found:?}");
        let out = kept_folder(name).join("grey");
        bounds::write_grey(&captures, &out, false).unwrap();
        scored(&captures, &out, "capture-1")
    };
    let has_measured =
        |result: &ResultFile| captured(result).summary.keys().any(|key| key.picture.kind == PictureKind::Measured);
    let is_missing =
        |result: &ResultFile| result.missing.iter().any(|missing| missing.metric.to_string() == "measured");
    let noted = |result: &ResultFile| {
        let notes = result.findings.iter().filter(|finding| finding.code == "no_measured");
        notes.map(|finding| finding.file.clone()).collect::<Vec<_>>()
    };
    let alone = scores("capture_unmeasured", &without("a"));
    assert!(!has_measured(&alone) && is_missing(&alone) && captured(&alone).measured.is_empty());
    assert_eq!(noted(&alone), ["scenes/a"]);
    let psnr =
        ["rgb_fitted.input.psnr", "rgb_fitted.novel.psnr"].map(|key| captured(&alone).summary[&key.parse().unwrap()]);
    assert!(psnr.iter().all(|psnr| *psnr > 5.0), "{psnr:?}");
    let both = scores("capture_half_measured", &(whole("a") + &without("b")));
    assert!(has_measured(&both) && !is_missing(&both));
    assert_eq!(noted(&both), ["scenes/b"]);
    let nothing = without("a").replace("novel = [\"image_0002\"]", "");
    let refused = built("capture_nothing", &nothing).err().unwrap().to_string();
    assert!(refused.contains("measured = none: expected `measured`, or photos in `novel`"), "{refused}");
}

/// The place of the flash from the camera, and its intensity before [`write_flash_photos`] scales it.
const FLASH_OFFSET_M: [f64; 3] = [0.0, 0.15, 0.02];
const FLASH_COLOR: [f64; 3] = [4.0, 3.6, 3.0];
/// The base colour of the room in these photos, with the roughness that a submission has by default.
const PAINT: [f32; 3] = [0.5, 0.35, 0.2];

/// Photos of the first and last views in the folder `flash`, where a small glowing ball beside the camera is the only
/// light of the room, which is painted in one colour. The second photo has half the exposure. Returns the intensity of
/// the ball.
fn write_flash_photos() -> [f64; 3] {
    let (dataset, scene) = ordinary();
    let room = OpenScene::read(dataset, scene).unwrap().world;
    let photo = |camera: &Camera| {
        let centre = camera.position() + camera.rotation() * DVec3::from_array(FLASH_OFFSET_M);
        let ball = sphere(centre.as_vec3(), 0.01, 16);
        // The shadow of a ball is a quarter of its surface.
        let radiance = FLASH_COLOR.map(|intensity| (4.0 * intensity / ball.area()) as f32);
        let mut lit = room.scene().clone();
        let paint = lit.add_material(material(principled(PAINT, 0.5, 0.0, PrincipledFlavour::Blender)));
        lit.surfaces.iter_mut().for_each(|surface| surface.material = paint);
        let material = lit.add_material(grey(0.0));
        let surfaces = vec![SurfaceIndex(lit.surfaces.len())];
        lit.surfaces.push(Surface { name: "ball".to_owned(), mesh: ball, material });
        let emission = Emission::Area { surfaces, radiance, map: None, two_sided: false };
        lit.lights = vec![LightGroup { name: "ball".to_owned(), emission, camera_visible: true }];
        let settings = RenderSettings { samples: 128, ..RenderSettings::default() };
        render(&World::new(Arc::new(lit)).unwrap(), camera, &settings, &|_, _| ()).unwrap().picture
    };
    let pictures = [&scene.views[0], &scene.views[4]].map(|view| photo(&view.camera));
    // Little of the photo is clipped.
    let pixels = pictures[0].pixels();
    let mean = pixels.iter().map(|pixel| pixel.luminance()).sum::<f64>() / pixels.len() as f64;
    let scale = 0.2 / (mean * scene.exposure);
    let exposed = |(picture, factor): (&Picture<LinearRgb>, f64)| {
        picture.map(|LinearRgb(rgb)| words(rgb.map(|v| (f64::from(v) * scale * factor * scene.exposure) as f32)))
    };
    write_photos(&SOURCE.join("flash"), pictures.iter().zip([1.0, 0.5]).map(exposed));
    FLASH_COLOR.map(|intensity| intensity * scale)
}

/// Under a known flash that is the only light, nothing is fitted: the true colour shows the photos, and at a wrong
/// intensity it does not. A flash of unknown intensity is fitted. `delight` finds the colours by the flash.
#[test]
fn a_flash_at_the_camera_lights_renders_and_photos() {
    let intensity = write_flash_photos();
    let keys = |flash: &str| format!("novel = [\"image_0002\"]\nflash = {{ offset_m = {FLASH_OFFSET_M:?}, {flash} }}");
    let known = |factor: f64| {
        let intensity = intensity.map(|v| v * factor);
        format!("intensity = {intensity:?}, only_light = true")
    };
    let mut measured: MeasurementsFile = json::read(&SOURCE.join("measured.json")).unwrap();
    measured.regions.iter_mut().for_each(|region| region.color = PAINT.map(f64::from));
    json::write(&SOURCE.join("flash_measured.json"), &measured).unwrap();
    let scene = |id: &str, more: &str| {
        let entry = entry(id, "flash.json", more).replace("\"images\"", "\"flash\"");
        entry.replace("\"measured.json\"", "\"flash_measured.json\"")
    };
    // The second photo was taken by the camera of the last view.
    let mut transforms: serde_json::Value = json::read(&SOURCE.join("transforms.json")).unwrap();
    transforms["frames"][2]["transform_matrix"] = transforms["frames"][5]["transform_matrix"].clone();
    std::fs::write(SOURCE.join("flash.json"), transforms.to_string()).unwrap();
    let entries = [
        scene("known", &keys(&known(1.0))),
        scene("bright", &keys(&known(3.0))),
        scene("fitted", &keys("only_light = true")),
        scene("unstated", "novel = [\"image_0002\"]"),
    ];
    let dataset = built("capture_flash", &entries.concat()).unwrap();
    let found = mateval_prep::verify::verify(&dataset.root, &|_| ()).unwrap();
    assert!(found.iter().all(|finding| finding.severity != mateval_dataset::Severity::Error), "{found:?}");
    let folder = kept_folder("capture_flashed");
    write_one_colored(&dataset, &folder.join("true"), label, |_| PAINT);
    let result = scored(&dataset, &folder.join("true"), "capture-1");
    let psnr = |id: &str| fitted(captured(&result), id);
    let lights = |id: &str| &captured(&result).fits[&SceneId::new(id).unwrap()].lights;
    for view in [0, 1] {
        let all = ["known", "bright", "fitted", "unstated"].map(|id| (id, psnr(id), lights(id)));
        assert!(psnr("known")[view] > 25.0, "{view}: {all:?}");
        assert!((psnr("fitted")[view] - psnr("known")[view]).abs() < 1.5, "{all:?}");
    }
    assert!(psnr("bright")[0] < psnr("known")[0] - 5.0, "{:?} {:?}", psnr("bright"), psnr("known"));
    for (id, factor) in [("known", 1.0), ("bright", 3.0)] {
        let [light] = &lights(id)[..] else { panic!("{:?}", lights(id)) };
        assert!(light.light == "flash" && light.spread == [0.0; 3], "{light:?}");
        assert!((0..3).all(|c| (light.radiance[c] / intensity[c] / factor - 1.0).abs() < 1e-9), "{light:?}");
    }
    let [light] = &lights("fitted")[..] else { panic!("{:?}", lights("fitted")) };
    // The scan has no smooth normals, which shows most near the camera, where it is brightest: 0.82 to 0.90 was found.
    assert!((0..3).all(|c| (light.radiance[c] / intensity[c] - 1.0).abs() < 0.2), "{light:?} {intensity:?}");
    assert!(lights("unstated").iter().all(|light| light.light != "flash") && !lights("unstated").is_empty());
    // A photo without its light.
    let delta_e = |name: &str, estimate: EstimateSource| -> [f64; 2] {
        let out = folder.join(name);
        nn::write(&dataset, &out, false, &estimate, &NnOptions::default(), &|_| ()).unwrap();
        let result = scored(&dataset, &out, "capture-1");
        let key = "measured.input.region_delta_e".parse().unwrap();
        ["known", "unstated"].map(|id| captured(&result).scenes[&SceneId::new(id).unwrap()][&key])
    };
    let [photo, _] = delta_e("photo", EstimateSource::Input);
    let [known, unstated] = delta_e("delight", EstimateSource::Delight(CandidateLights::Room));
    assert!(known < 0.7 * photo && known < unstated, "photo {photo}, flash {known}, unstated {unstated}");
}

#[test]
fn flashes_that_contradict_their_photos_are_refused() {
    let refused = |flash: &str, words: &str| {
        let more = format!("novel = [\"image_0002\"]\nflash = {{ {flash} }}");
        let found = built("capture_no_flash", &entry("a", "transforms.json", &more)).err().unwrap().to_string();
        assert!(found.contains(words), "{flash}: {found}");
    };
    let at = "offset_m = [0, 0.1, 0]";
    refused("offset_m = [0, 3, 0]", "flash.offset_m = [0.0, 3.0, 0.0]: expected a place of at most 2 m");
    refused(&format!("{at}, intensity = [0, 0, 0]"), "flash.intensity = [0.0, 0.0, 0.0]: expected numbers of");
    refused(&format!("{at}, intensity = [1e30, 1, 1]"), "expected numbers of 0.000001 to 1000000, or 0");
    refused(&format!("{at}, photos = [\"9\"]"), "flash.photos = [\"9\"]: expected names of photos");
    let novel_alone = format!("{at}, photos = [\"image_0002\"]");
    refused(&novel_alone, "flash.intensity = none: expected an intensity");
    refused(&format!("{novel_alone}, intensity = [1, 1, 1], only_light = true"), "flash.only_light = true");
    // The same faults in a dataset are errors.
    let copy = kept_folder("capture_flash_changed");
    mateval_testkit::copy_folder(&CAPTURES.root, &copy);
    let path = Dataset::open(&copy).unwrap().folder(&SceneId::new("idr").unwrap()).scene_file();
    let mut scene: SceneFile = json::read(&path).unwrap();
    let views = vec![ViewId::new("novel_7").unwrap()];
    scene.flash = Some(Flash { offset_m: [9.0, 0.0, 0.0], intensity: None, views, only_light: false });
    json::write(&path, &scene).unwrap();
    let found = mateval_prep::verify::verify(&copy, &|_| ()).unwrap();
    for place in ["/flash/offset_m", "/flash/views/0", "/flash/intensity"] {
        assert!(found.iter().any(|finding| finding.place == place), "{place}: {found:?}");
    }
}

/// Photos of floating-point numbers that are clipped at a fifth of white. If the capture states it, clipped pixels do not
/// count, and the share that is left out rises; if it does not, they count.
#[test]
fn clipped_pixels_of_linear_photos_do_not_count() {
    let white = 0.2 / ordinary().1.exposure;
    std::fs::create_dir_all(SOURCE.join("linear")).unwrap();
    let (dataset, scene) = ordinary();
    let renderer = dataset.photo_renderer(scene).unwrap();
    for (view, number) in scene.views.iter().zip(1..=2) {
        let path = dataset.folder(&scene.id).render(renderer, &view.id).join("rgb.exr");
        let clipped = exr_io::read_linear(&path)
            .unwrap()
            .map(|LinearRgb(rgb)| LinearRgb(rgb.map(|v| v.clamp(0.0, white as f32))));
        let path = SOURCE.join(format!("linear/image_{number:04}.exr"));
        exr_io::write_linear(&path, &clipped, exr_io::Precision::Float).unwrap();
    }
    let scene = |id: &str, more: &str| {
        let more = format!("novel = [\"image_0002\"]\n{more}");
        let entry = entry(id, "transforms.json", &more).replace("\"images\"", "\"linear\"");
        // The measured colours are those of other photos.
        entry.replace("measured = \"measured.json\"\n", "")
    };
    let entries = scene("stated", &format!("white = {white:?}")) + &scene("unstated", "");
    let captures = built("capture_linear", &entries).unwrap();
    let written = captures.scenes[0].photo.as_ref().unwrap().white.unwrap();
    assert!((written / white - 1.0).abs() < 1e-12, "{written} {white}");
    // The white of the input photo is not that of a view without a photo.
    let exposure = |view: &str| captures.scenes[0].clipping_exposure(&ViewId::new(view).unwrap());
    assert!(exposure("input") > exposure("other") && exposure("other") == captures.scenes[0].exposure);
    let out = kept_folder("capture_linear_true").join("true");
    write_one_colored(&captures, &out, label, true_mean);
    let result = scored(&captures, &out, "capture-1");
    let left_out = |id: &str| -> Vec<f64> {
        let is_wanted = |picture: &&PictureValues| picture.scene.as_str() == id && picture.picture.kind.is_light();
        let whole = captured(&result).pictures.iter().filter(is_wanted);
        whole.filter(|picture| picture.region == Region::Valid).map(|picture| picture.left_out.unwrap()).collect()
    };
    let (stated, unstated) = (left_out("stated"), left_out("unstated"));
    assert!(stated.len() == 2 && unstated.len() == 2);
    assert!(
        stated.iter().zip(&unstated).all(|(stated, unstated)| *stated > unstated + 0.01),
        "{stated:?} {unstated:?}"
    );
    // Integers have their own white.
    let integers = entry("a", "transforms.json", "white = 1.0");
    let refused = built("capture_white", &integers).err().unwrap().to_string();
    assert!(refused.contains("holds integers") && refused.contains("leave out `white`"), "{refused}");
    let all = built("capture_all_white", &scene("a", "white = 1e-9"));
    assert!(all.err().unwrap().to_string().contains("reach `white`"));
    let refused = built("capture_no_white", &entry("a", "transforms.json", "white = 0")).err().unwrap().to_string();
    assert!(refused.contains("white = 0: expected a number above 0"), "{refused}");
}
