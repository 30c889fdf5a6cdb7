//! `prep compare`: a twin of the sample's pictures, rendered by our own tracer with other seeds, agrees; every fault
//! that another renderer's pictures may have is found and named.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Arc, LazyLock};

use mateval_dataset::dataset::{SceneFile, View};
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::material::{ColorInput, MaterialModel};
use mateval_dataset::mesh::bounds;
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

use serde_json::Value;

use super::command::{mateval, run};
use super::planted::{rehash, roll};
use super::sample::{dataset, files_below, own_materials};
use mateval_testkit::{copy_folder, kept_folder};

/// Samples a pixel of each half, theirs and ours. At 96x72 pixels, three standard errors of a tile are then two to four
/// times the bound of 1 %, and those of a picture's mean are 0.5 to 0.8 % (under the lamp alone 1.5 to 2.2 %, so that
/// some checks of its mean are undecided: a fault of 2 % may hide).
const SAMPLES: u32 = 64;

/// So few samples that the lamp's light is lost in noise.
const FEW_SAMPLES: u32 = 16;

/// `mateval prep compare DATASET` with a number of samples.
fn compare(dataset: &Path, samples: u32) -> Command {
    let mut command = compare_until_decided(dataset);
    command.args(["--samples", &samples.to_string()]);
    command
}

/// `mateval prep compare DATASET`.
fn compare_until_decided(dataset: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "compare"]).arg(dataset);
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
        let [a, b] = [&light.by_seed[0], &light.by_seed[1]];
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

/// The checks of a view that differ: picture and quantity, in the order of the checks.
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

/// Whatever can be decided agrees, which is everything but some checks of the lamp's light, and of the light of a group
/// that single paths of a picture reach.
#[test]
fn a_correct_twin_agrees() {
    let page = tempfile::tempdir().unwrap();
    let out = page.path().join("page");
    let found = run(compare_until_decided(&LAMBERT).arg("--out").arg(&out)).ends_with(0);
    let file: CompareFile = mateval_dataset::json::read(&out.join("compare.json")).unwrap();
    let last = found.stdout.lines().last().unwrap();
    assert_eq!(last, mateval_prep::compare::tables::verdict(&file));
    let agree = 80 - file.undecided;
    let beginning = format!("blender agrees with the built-in tracer: {agree} of 80 checks agree");
    assert!(last.starts_with(&beginning), "{last}");
    let open: Vec<_> = file.checks().filter(|(_, _, check)| check.state != State::Agrees).collect();
    assert!(file.agrees && file.undecided == open.len() && open.len() <= 10, "{open:?}");
    for (_, _, check) in open {
        assert!(
            ["group_00", "group_02"].contains(&check.picture.as_str()) && check.state == State::TooNoisy,
            "{check}"
        );
        assert!(check.to_decide.is_some(), "{check}");
    }
    let scene = &file.scenes[0];
    assert_eq!((scene.tile_bound, scene.passes[0]), (0.01, 16));
    assert!(scene.samples_each_half() <= 4 * SAMPLES, "{:?}", scene.passes);
    let lights = || scene.views.iter().flat_map(|view| &view.light);
    assert!(lights().count() == 20 && lights().all(|light| light.tiles.count == 30 && light.apart.is_empty()));
    check_page(&out, &file);
    let verdict: Value = mateval_dataset::json::read(&LAMBERT.join("compare.json")).unwrap();
    let counts = serde_json::json!({"agree": agree, "differ": 0, "undecided": file.undecided});
    assert_eq!(verdict["scenes"]["room"], counts);
    // A comparison is replaced only with --force, and other files never.
    let mut again = compare(&LAMBERT, 1);
    run(again.arg("--out").arg(&out)).ends_with(2).says("add --force to overwrite it");
    let mut other = compare(&LAMBERT, 1);
    run(other.arg("--force").arg("--out").arg(page.path())).ends_with(2).says("is not a comparison");
}

/// The budget is kept, and below the least number of samples no check of light decides anything: pictures of the lamp
/// alone that are twice too bright pass then, and do not with the twin's budget.
#[test]
fn too_few_samples_decide_nothing() {
    let copy = copied(&LAMBERT);
    for half in ["_a", "_b", ""] {
        edit_light(copy.path(), "input", &format!("group_00{half}.exr"), |_, pixel| times(pixel, 2.0));
    }
    let found = |budget: &str, code: i32| -> CompareFile {
        let mut command = compare_until_decided(copy.path());
        let run = run(command.args(["--format", "json", "--budget", budget])).ends_with(code);
        serde_json::from_str(&run.stdout).unwrap()
    };
    // The sum of groups needs no samples of ours.
    let few = found("8", 1);
    assert_eq!(faults(&few, "input"), ["rgb_a GroupSum", "rgb_b GroupSum"]);
    assert_eq!(few.scenes[0].passes, [8]);
    for (_, _, check) in few.checks() {
        let is_light = matches!(check.quantity, Quantity::TilesOver | Quantity::MeanDifference);
        assert_eq!(check.state == State::TooFew, is_light, "{check}");
    }
    assert_eq!(few.undecided, 40);
    let more = found("24", 1);
    assert!((16..=24).contains(&more.scenes[0].samples_each_half()));
    check_holds(&faults(&more, "input"), &["group_00 TilesOver", "group_00 MeanDifference"]);
    let mut both = compare(copy.path(), 16);
    run(both.args(["--budget", "16"])).ends_with(2).says("cannot be used with");
}

/// Every picture of the pages exists, each existing picture is shown, and the pages load nothing from other sites. Where
/// nothing differs, only the first view has pictures.
fn check_page(out: &Path, file: &CompareFile) {
    let page = |path: &Path| std::fs::read_to_string(path).unwrap().replace("&#x2f;", "/").replace("&#x27;", "'");
    let index = page(&out.join("index.html"));
    assert!(index.contains(&mateval_prep::compare::tables::verdict(file)));
    assert!(index.contains("<a href=\"scenes/room/index.html\">room</a>") && !index.contains("<img"), "{index}");
    let folder = out.join("scenes/room");
    let html = page(&folder.join("index.html"));
    let mut shown: Vec<PathBuf> =
        html.split("<img src=\"").skip(1).map(|rest| folder.join(rest.split('"').next().unwrap())).collect();
    shown.sort();
    let pictures: Vec<PathBuf> = files_below(out)
        .into_iter()
        .filter(|file| file.extension().unwrap() == "png")
        .map(|file| out.join(file))
        .collect();
    assert_eq!(shown, pictures);
    // Four pictures of each light; of geometry, three of each of five.
    assert_eq!(shown.len(), 4 * 4 + 5 * 3);
    assert!([index, html].iter().all(|html| !html.contains("http:") && !html.contains("https:")));
}

/// The sample's own materials: tiles with plastic and glass do not decide; in the others the lamp is too noisy, which is
/// neither for nor against the pictures.
#[test]
fn other_materials_do_not_decide_and_noise_decides_nothing() {
    let file = found(&MIXED, FEW_SAMPLES, 0);
    assert!(file.agrees && file.undecided > 0);
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
    // `down_left`: its camera is rolled by a degree, which silhouettes and depth show with any number of samples.
    let mut rolled = serde_json::to_value(&views[3]).unwrap();
    roll(&mut rolled, 1.0);
    let rolled: View = serde_json::from_value(rolled).unwrap();
    write_twin(dataset, reference::read(&room(dataset)).unwrap(), &[rolled], 1);
    // `down_right`: a tone curve like Filmic's; the groups are unchanged.
    for file in ["rgb_a.exr", "rgb_b.exr", "rgb.exr"] {
        edit_light(dataset, "down_right", file, |_, LinearRgb(rgb)| LinearRgb(rgb.map(|v| v * 1.1 / (v + 0.3))));
    }
    let page = tempfile::tempdir().unwrap();
    let mut command = compare(dataset, SAMPLES);
    let run = run(command.args(["--format", "json", "--out"]).arg(page.path().join("page"))).ends_with(1);
    let file: CompareFile = serde_json::from_str(&run.stdout).unwrap();
    check_holds(&faults(&file, "input"), &["base_color PsnrDb", "group_01 TilesOver"]);
    for view in ["up_left", "up_right"] {
        check_holds(
            &faults(&file, view),
            &["instance EqualShare", "silhouette EqualShare", "part EqualShare", "depth MedianM", "rgb TilesOver"],
        );
    }
    check_holds(&faults(&file, "down_left"), &["silhouette EqualShare", "depth MedianM"]);
    check_holds(
        &faults(&file, "down_right"),
        &["rgb TilesOver", "rgb MeanDifference", "rgb_a GroupSum", "rgb_b GroupSum"],
    );
    // Of a view that is not the first, the page shows what differs.
    let shown = |picture: &str| page.path().join("page/scenes/room/down_right").join(picture).exists();
    assert_eq!(["rgb_ours.png", "depth_ours.png"].map(shown), [true, false]);
}

/// A piece of furniture is moved by 3 cm, and nothing else: its silhouette gives it away in the first view.
#[test]
fn a_moved_piece_is_found() {
    let copy = copied(&LAMBERT);
    let (dataset, views) = (copy.path(), views(&LAMBERT));
    let mut scene = reference::read(&room(dataset)).unwrap();
    // The instance of which the first view shows most, walls and floor aside.
    let ids = png_io::read_ids(&room(dataset).view(&views[0].id).join("instance.png")).unwrap();
    let mut counts: BTreeMap<u16, usize> = BTreeMap::new();
    ids.pixels().iter().filter(|id| **id > 0).for_each(|id| *counts.entry(*id).or_insert(0) += 1);
    let is_piece = |id: u16| {
        let mesh = &scene.surfaces[usize::from(id) - 1].mesh;
        let [low, high] = bounds(mesh.positions.iter().copied()).unwrap();
        (high - low).max_element() < 2.0
    };
    let (piece, pixels) = counts.into_iter().filter(|(id, _)| is_piece(*id)).max_by_key(|(_, count)| *count).unwrap();
    assert!(pixels > 200, "{pixels}");
    let right = views[0].camera.rotation() * glam::DVec3::X;
    let moved = &mut scene.surfaces[usize::from(piece) - 1].mesh;
    moved.positions.iter_mut().for_each(|position| *position += 0.03 * right.as_vec3());
    // Silhouettes do not depend on samples.
    write_twin(dataset, scene, &views[..1], FEW_SAMPLES);
    let file = found(dataset, FEW_SAMPLES, 1);
    check_holds(&faults(&file, "input"), &["silhouette EqualShare"]);
    assert_eq!(faults(&file, "up_left"), [""; 0]);
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
        let checks = file.checks().filter(|(_, of, check)| of.as_str() == view && check.state.is_fault());
        checks.map(|(_, _, check)| (check.picture.clone(), check.state)).collect()
    };
    let expected = [("part", State::Unreadable), ("depth", State::Unreadable), ("group_00", State::Missing)];
    assert_eq!(other("down_left"), expected.map(|(picture, state)| (picture.to_owned(), state)));
    assert_eq!(other("down_right"), [("render".to_owned(), State::Missing)]);
}
