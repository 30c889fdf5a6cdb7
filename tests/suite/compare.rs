//! `prep compare`: a twin of the sample's pictures, rendered by our own tracer with other seeds, agrees; every fault
//! that another renderer's pictures may have is found and named.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, LazyLock};

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::material::{ColorInput, MaterialModel};
use mateval_dataset::reference::ReferenceScene;
use mateval_dataset::render_file::RenderFile;
use mateval_dataset::render_file::RenderNoise;
use mateval_dataset::{RendererId, SceneId, reference};
use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, Texels, Texture, png_io};
use mateval_prep::compare::file::{CompareFile, Quantity, State};
use mateval_prep::render::RendererKind;
use mateval_prep::views::{SeenTriangle, ViewScene, base_color_at_centres};
use mateval_tracer::{RenderSettings, World, render_views};

use super::command::{mateval, run};
use super::planted::{rehash, roll};
use super::sample::{dataset, files_below, own_materials};
use mateval_testkit::{copy_folder, kept_folder};

/// Samples a pixel of each half, theirs and ours. At 96x72 pixels, three standard errors of a tile are then two to four
/// times the bound of 1 %, and those of a picture's mean are 0.5 to 0.8 % (under the lamp alone 1.5 to 2.2 %). The
/// tests can therefore detect faults of 1.5 % in means under the ceiling's light, and of 5 % in single tiles.
const SAMPLES: u32 = 64;

/// So few samples that the lamp's light is lost in noise.
const FEW_SAMPLES: u32 = 16;

/// `mateval prep compare DATASET`.
fn compare(dataset: &Path, samples: u32) -> Command {
    let mut command = mateval();
    command.args(["prep", "compare", "--samples", &samples.to_string()]).arg(dataset);
    command
}

fn room(dataset: &Path) -> SceneFolder {
    SceneFolder::of(dataset, &SceneId::new("room").unwrap())
}

fn views(dataset: &Path) -> Vec<View> {
    mateval_dataset::json::read::<SceneFile>(&room(dataset).scene_file()).unwrap().views
}

fn their_folder(dataset: &Path, view: &str) -> PathBuf {
    let view = mateval_dataset::ViewId::new(view).unwrap();
    room(dataset).render(&RendererId::new("blender").unwrap(), &view)
}

/// A copy of the sample with the source's own materials. With `lambert`, every material is replaced by Lambert with its base colour.
fn own_copy(lambert: bool) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(own_materials(), copy.path());
    if lambert {
        let mut scene = reference::read(&room(copy.path())).unwrap();
        let textures = scene.texture_list();
        for material in &mut scene.materials {
            let flat = material.appearance(&textures, Default::default()).map_or([0.5; 3], |seen| seen.base_color);
            let reflectance = match material.model {
                MaterialModel::Plastic { diffuse_reflectance, .. } => diffuse_reflectance,
                MaterialModel::Diffuse { reflectance, .. } => reflectance,
                _ => ColorInput::Constant(flat),
            };
            material.model = MaterialModel::Diffuse { reflectance, alpha: None };
        }
        reference::write(&room(copy.path()), &scene).unwrap();
        rehash(copy.path());
    }
    copy
}

/// The part of each triangle that our own pictures show.
fn parts(dataset: &Path, scene: &ViewScene<'_>) -> BTreeMap<(usize, usize), u16> {
    let mut parts = BTreeMap::new();
    let views = views(dataset);
    for view in &views {
        let (geometry, _) = scene.pictures(&view.camera, &views[0].camera);
        let ids = png_io::read_ids(&room(dataset).view(&view.id).join("part.png")).unwrap();
        for (seen, id) in geometry.triangle.pixels().iter().zip(ids.pixels()) {
            parts.extend(seen.map(|seen| ((seen.surface.0, seen.triangle), *id)));
        }
    }
    parts
}

/// Writes the files of `prep render --renderer blender`, rendered by our own tracer: `scene` as `cameras` see it.
fn write_twin(dataset: &Path, scene: ReferenceScene, cameras: &[View], samples: u32) {
    let reference = Arc::new(scene);
    let world = World::new(reference.clone()).unwrap();
    let instances: Vec<u16> = (1..=reference.surfaces.len() as u16).collect();
    let scored = reference.surfaces.iter().map(|s| reference.materials[s.material.0].has_appearance());
    let scored: Vec<bool> = scored.collect();
    let pictures = ViewScene::new(&reference, &world, &instances, &scored);
    let parts = parts(dataset, &pictures);
    let settings = RenderSettings { samples, ..Default::default() };
    let centres: Vec<_> = cameras.iter().map(|view| view.camera).collect();
    let light = render_views(&world, &centres, &settings, &[71, 72], &|_, _| ()).unwrap();
    for (view, light) in cameras.iter().zip(&light.views) {
        let folder = their_folder(dataset, view.id.as_str());
        std::fs::create_dir_all(&folder).unwrap();
        let write = |name: &str, a: &Picture<LinearRgb>, b: &Picture<LinearRgb>| {
            let mean = Picture::from_fn(a.width(), a.height(), |x, y| {
                LinearRgb([0, 1, 2].map(|c| (a.get(x, y).0[c] + b.get(x, y).0[c]) / 2.0))
            });
            for (suffix, picture) in [("_a", a), ("_b", b), ("", &mean)] {
                exr_io::write_linear(&folder.join(format!("{name}{suffix}.exr")), picture, Precision::Float).unwrap();
            }
        };
        let [a, b] = [&light.halves[0], &light.halves[1]];
        write("rgb", &a.sum(), &b.sum());
        for (at, (a, b)) in a.pictures().iter().zip(b.pictures()).enumerate() {
            write(&format!("group_{at:02}"), a, b);
        }
        let (geometry, _) = pictures.pictures(&view.camera, &cameras[0].camera);
        let part = |seen: Option<SeenTriangle>| seen.and_then(|s| parts.get(&(s.surface.0, s.triangle)).copied());
        exr_io::write_linear(
            &folder.join("base_color.exr"),
            &base_color_at_centres(&world, &view.camera),
            Precision::Float,
        )
        .unwrap();
        exr_io::write_scalar(&folder.join("depth.exr"), &geometry.depth, Precision::Float).unwrap();
        exr_io::write_normal(&folder.join("normal.exr"), &geometry.normal, Precision::Half).unwrap();
        png_io::write_ids(&folder.join("instance.png"), &geometry.instance).unwrap();
        png_io::write_ids(&folder.join("part.png"), &geometry.triangle.map(|seen| part(seen).unwrap_or(0))).unwrap();
        let render = RenderFile {
            renderer: RendererKind::Blender.id(),
            renderer_version: None,
            device: None,
            samples_each_half: samples,
            seeds: [71, 72].map(|seed| format!("{seed:016x}")),
            max_bounces: settings.max_bounces,
            capped_throughput: None,
            denoiser: "none".to_owned(),
            noise: RenderNoise::of([&a.sum(), &b.sum()], &a.sum()),
            approximations: Vec::new(),
        };
        mateval_dataset::json::write(&folder.join("render.json"), &render).unwrap();
    }
}

fn with_twin(name: &str, lambert: bool) -> PathBuf {
    let copy = own_copy(lambert);
    let scene = reference::read(&room(copy.path())).unwrap();
    write_twin(copy.path(), scene, &views(copy.path()), SAMPLES);
    let kept = kept_folder(name);
    copy_folder(copy.path(), &kept);
    kept
}

/// A Lambert copy with a correct twin; tests must not write to it.
static LAMBERT: LazyLock<PathBuf> = LazyLock::new(|| with_twin("compare-lambert", true));

/// The sample's own materials, likewise.
static MIXED: LazyLock<PathBuf> = LazyLock::new(|| with_twin("compare-mixed", false));

fn copied(dataset: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(dataset, folder.path());
    folder
}

/// The output of `--format json`.
fn found(dataset: &Path, samples: u32, code: i32) -> CompareFile {
    let run = run(compare(dataset, samples).args(["--format", "json"])).ends_with(code);
    serde_json::from_str(&run.stdout).unwrap()
}

/// The checks of a view that do not agree: picture and quantity, in the order of the checks.
fn faults(file: &CompareFile, view: &str) -> Vec<String> {
    let checks = file.checks().filter(|(_, of, check)| of.as_str() == view && check.state == State::Differs);
    checks.map(|(_, _, check)| format!("{} {:?}", check.picture, check.quantity)).collect()
}

#[track_caller]
fn check_holds(faults: &[String], expected: &[&str]) {
    for fault in expected {
        assert!(faults.iter().any(|found| found == fault), "no '{fault}' in {faults:?}");
    }
}

/// Changes a colour picture of a view.
fn edit_light(dataset: &Path, view: &str, file: &str, change: impl Fn(usize, LinearRgb) -> LinearRgb) {
    let path = their_folder(dataset, view).join(file);
    let mut picture = exr_io::read_linear(&path).unwrap();
    for (at, pixel) in picture.pixels_mut().iter_mut().enumerate() {
        *pixel = change(at, *pixel);
    }
    exr_io::write_linear(&path, &picture, Precision::Float).unwrap();
}

fn times(LinearRgb(rgb): LinearRgb, factor: f32) -> LinearRgb {
    LinearRgb(rgb.map(|v| factor * v))
}

#[test]
fn a_correct_twin_agrees() {
    let page = tempfile::tempdir().unwrap();
    let out = page.path().join("page");
    let found = run(compare(&LAMBERT, SAMPLES).arg("--out").arg(&out)).ends_with(0);
    assert!(
        found.stdout.ends_with("\nblender agrees with the built-in tracer: 75 of 75 checks agree\n"),
        "{}",
        found.stdout
    );
    let file: CompareFile = mateval_dataset::json::read(&out.join("compare.json")).unwrap();
    let scene = &file.scenes[0];
    assert_eq!((file.agrees, scene.tile_bound, scene.samples_each_half), (true, 0.01, SAMPLES));
    let lights = || scene.views.iter().flat_map(|view| &view.light);
    assert!(lights().count() == 20 && lights().all(|light| light.tiles.count == 30 && light.apart.is_empty()));
    check_page(&out, &file);
    // A comparison is replaced only with --force, and other files never.
    let mut again = compare(&LAMBERT, 1);
    run(again.arg("--out").arg(&out)).ends_with(2).says("add --force to overwrite it");
    let mut other = compare(&LAMBERT, 1);
    run(other.arg("--force").arg("--out").arg(page.path())).ends_with(2).says("is not a comparison");
}

/// Every picture of the page exists, each existing picture is shown, and the page loads nothing from other sites.
fn check_page(out: &Path, file: &CompareFile) {
    let html = std::fs::read_to_string(out.join("index.html")).unwrap().replace("&#x2f;", "/");
    let shown: Vec<PathBuf> =
        html.split("<img src=\"").skip(1).map(|rest| rest.split('"').next().unwrap().into()).collect();
    let mut sorted = shown.clone();
    sorted.sort();
    let pictures: Vec<PathBuf> =
        files_below(out).into_iter().filter(|file| file.extension().unwrap() == "png").collect();
    assert_eq!(sorted, pictures);
    // Four pictures of each light; of geometry, three of each of five.
    assert_eq!(shown.len(), 5 * (4 * 4 + 5 * 3));
    assert!(
        !html.contains("http:")
            && !html.contains("https:")
            && html.contains(&mateval_prep::compare::tables::verdict(file))
    );
}

/// The sample's own materials: tiles with plastic and glass do not decide; in the others the lamp is too noisy, which
/// does not pass.
#[test]
fn other_materials_do_not_decide_and_noise_does_not_pass() {
    let file = found(&MIXED, FEW_SAMPLES, 1);
    let scene = &file.scenes[0];
    assert_eq!(scene.tile_bound, 0.02);
    let words: Vec<&str> = scene.kinds.iter().map(|kind| kind.word()).collect();
    assert_eq!(words, ["lambert", "conductor", "plastic", "dielectric"]);
    for light in scene.views.iter().flat_map(|view| &view.light) {
        let apart: usize = light.apart.iter().map(|apart| apart.count).sum();
        assert!(light.tiles.count + apart == 30 && apart > 15, "{light:?}");
    }
    let states: Vec<State> = file.checks().map(|(_, _, check)| check.state).collect();
    assert!(states.iter().all(|state| matches!(state, State::Agrees | State::TooNoisy)), "{states:?}");
    let narrow = mateval_prep::compare::tables::text(&file, Some(80));
    assert!(narrow.lines().all(|line| line.chars().count() <= 80), "{narrow}");
    let state = |picture, quantity| scene.views[0].check(picture, quantity).unwrap().state;
    assert_eq!(state("rgb", Quantity::TilesOver), State::Agrees);
    assert_eq!(state("group_00", Quantity::MeanDifference), State::TooNoisy);
}

/// Errors that name the cause: nothing to compare, a missing scene, a page inside the dataset.
#[test]
fn what_cannot_be_compared() {
    let nothing = "has no pictures by blender of scene 'room'; run `mateval prep render DATASET --renderer blender`";
    run(&mut compare(dataset(), 1)).ends_with(2).says(nothing);
    run(compare(dataset(), 1).args(["--scene", "attic"])).ends_with(2).says("has no scene 'attic'");
    run(compare(dataset(), 1).args(["--scene", "Room"])).ends_with(2).says("tip: did you mean 'room'?");
    let copy = copied(&LAMBERT);
    for inside in ["page", "scenes/page", "scenes/new/page"] {
        let out = copy.path().join(inside);
        run(compare(copy.path(), 1).arg("--out").arg(&out)).ends_with(2).says("would lie in the dataset");
        assert!(!out.exists());
    }
}

/// Five faults of whole views.
#[test]
fn other_pictures_are_found() {
    let copy = copied(&LAMBERT);
    let (dataset, views) = (copy.path(), views(&LAMBERT));
    // `input`: the textures of the materials are mirrored.
    write_twin(dataset, mirrored(reference::read(&room(dataset)).unwrap()), &views[..1], SAMPLES);
    // `up_left` and `up_right` are swapped.
    let [left, right] = ["up_left", "up_right"].map(|view| their_folder(dataset, view));
    let aside = left.with_file_name("aside");
    for (from, to) in [(&left, &aside), (&right, &left), (&aside, &right)] {
        std::fs::rename(from, to).unwrap();
    }
    // `down_left`: its camera is rolled by a degree.
    let mut rolled = serde_json::to_value(&views[3]).unwrap();
    roll(&mut rolled, 1.0);
    let rolled: View = serde_json::from_value(rolled).unwrap();
    write_twin(dataset, reference::read(&room(dataset)).unwrap(), &[rolled], SAMPLES);
    // `down_right`: a tone curve like Filmic's; the groups are unchanged.
    for file in ["rgb_a.exr", "rgb_b.exr", "rgb.exr"] {
        edit_light(dataset, "down_right", file, |_, LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * 1.1 / (v + 0.3))));
    }
    let file = found(dataset, SAMPLES, 1);
    check_holds(&faults(&file, "input"), &["base_color PsnrDb", "group_01 TilesOver"]);
    for view in ["up_left", "up_right"] {
        check_holds(
            &faults(&file, view),
            &["base_color PsnrDb", "instance EqualShare", "part EqualShare", "depth MedianM", "rgb TilesOver"],
        );
    }
    check_holds(&faults(&file, "down_left"), &["base_color PsnrDb", "depth MedianM"]);
    check_holds(
        &faults(&file, "down_right"),
        &["rgb TilesOver", "rgb MeanDifference", "rgb_a GroupSum", "rgb_b GroupSum"],
    );
}

/// Mirrors every texture of a material, but not that of the environment.
fn mirrored(mut scene: ReferenceScene) -> ReferenceScene {
    let used: Vec<usize> = scene.materials.iter().flat_map(|m| m.lookups()).map(|lookup| lookup.texture.0).collect();
    assert!(used.len() > 2);
    for at in used {
        let texture = &scene.textures[at].texture;
        let Texels::Srgb8(texels) = texture.texels() else { panic!("a texture of another kind") };
        let rows = texels.chunks(texture.width()).flat_map(|row| row.iter().rev().copied()).collect();
        scene.textures[at].texture =
            Texture::new(texture.width(), texture.height(), Texels::Srgb8(rows), texture.wrap()).unwrap();
    }
    scene
}

/// Five faults of single pictures.
#[test]
fn wrong_lights_are_found() {
    let copy = copied(&LAMBERT);
    let dataset = copy.path();
    let group = |view: &str, file: &str| exr_io::read_linear(&their_folder(dataset, view).join(file)).unwrap();
    // `input`: RGB lacks the lamp, although it has a group.
    for half in ["_a", "_b", ""] {
        let lamp = group("input", &format!("group_00{half}.exr"));
        edit_light(dataset, "input", &format!("rgb{half}.exr"), |at, LinearRgb(rgb)| {
            LinearRgb([0, 1, 2].map(|c| rgb[c] - lamp.pixels()[at].0[c]))
        });
        // `up_left`: the ceiling's group is black.
        edit_light(dataset, "up_left", &format!("group_01{half}.exr"), |_, _| LinearRgb::default());
        // `up_right`: the ceiling is 3 % too dim, in its group and in RGB.
        let ceiling = group("up_right", &format!("group_01{half}.exr"));
        edit_light(dataset, "up_right", &format!("group_01{half}.exr"), |_, pixel| times(pixel, 0.97));
        edit_light(dataset, "up_right", &format!("rgb{half}.exr"), |at, LinearRgb(rgb)| {
            LinearRgb([0, 1, 2].map(|c| rgb[c] - 0.03 * ceiling.pixels()[at].0[c]))
        });
    }
    // `down_left`: one file is missing, one is truncated, one has another size.
    let folder = their_folder(dataset, "down_left");
    std::fs::remove_file(folder.join("group_00_b.exr")).unwrap();
    let bytes = std::fs::read(folder.join("depth.exr")).unwrap();
    std::fs::write(folder.join("depth.exr"), &bytes[..bytes.len() / 2]).unwrap();
    png_io::write_ids(&folder.join("part.png"), &Picture::filled(95, 72, 1)).unwrap();
    // `down_right` was not finished.
    std::fs::remove_file(their_folder(dataset, "down_right").join("render.json")).unwrap();
    let file = found(dataset, SAMPLES, 1);
    check_holds(&faults(&file, "input"), &["rgb TilesOver", "rgb MeanDifference", "rgb_a GroupSum", "rgb_b GroupSum"]);
    assert_eq!(faults(&file, "input").len(), 4);
    check_holds(&faults(&file, "up_left"), &["group_01 TilesOver", "group_01 MeanDifference", "rgb_a GroupSum"]);
    assert_eq!(faults(&file, "up_left").len(), 4);
    check_holds(&faults(&file, "up_right"), &["group_01 MeanDifference"]);
    assert!(!faults(&file, "up_right").iter().any(|fault| fault.contains("GroupSum")));
    assert_eq!(faults(&file, "down_left"), [""; 0]);
    let other = |view: &str| -> Vec<(String, State)> {
        let checks = file.checks().filter(|(_, of, check)| of.as_str() == view && check.state != State::Agrees);
        checks.map(|(_, _, check)| (check.picture.clone(), check.state)).collect()
    };
    let expected = [("part", State::Unreadable), ("depth", State::Unreadable), ("group_00", State::Missing)];
    assert_eq!(other("down_left"), expected.map(|(picture, state)| (picture.to_owned(), state)));
    assert_eq!(other("down_right"), [("render".to_owned(), State::Missing)]);
}
