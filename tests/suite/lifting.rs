//! `baseline nn`, `median`: seen texels get the colours of the estimate, no colour is transferred to
//! another instance, and the encodings of estimates are decoded correctly.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_dataset::glb;
use mateval_dataset::uv_atlas::UvAtlas;
use mateval_image::exr_io::{self, Precision};
use mateval_image::transfer::srgb_from_linear;
use mateval_image::{LinearRgb, Picture, png_io};
use serde_json::Value;

use super::command::{Run, baseline, build, mateval, run, score_under};
use super::sample::{json, unrendered, write_source};
use mateval_testkit::{kept_folder, npy};

/// Width and height of the room's pictures, in pixels.
const WIDTH: usize = 96;
const HEIGHT: usize = 72;

/// The sample's room, atlas sizes chosen by the tool. Where these do not matter, [`unrendered`] has smaller ones.
pub static ROOM: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("lifting");
    let recipe = write_source(&folder.join("source"), &format!("resolution = [{WIDTH}, {HEIGHT}]"), &["room"]);
    run(&mut build(&recipe, &folder.join("dataset"))).ends_with(0);
    folder.join("dataset")
});

/// The submission `gt` for the room.
pub static GT: LazyLock<PathBuf> = LazyLock::new(|| {
    let out = kept_folder("lifting-gt").join("gt");
    run(&mut baseline("gt", &ROOM, &out)).ends_with(0);
    out
});

/// The summary of `gt`.
pub static GT_SUMMARY: LazyLock<Value> = LazyLock::new(|| summary_of(&ROOM, &GT));

/// The summary of `nn` with the truth's pictures.
static NN: LazyLock<Value> = LazyLock::new(|| scored(&ROOM, "nn", &[]));

/// Summary of a baseline's score under `mateval-3`, without LPIPS.
fn scored(dataset: &Path, name: &str, words: &[&str]) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let submission = folder.path().join("submission");
    run(baseline(name, dataset, &submission).args(words)).ends_with(0);
    summary_of(dataset, &submission)
}

/// Summary of a submission's score under `mateval-3`, without LPIPS.
pub fn summary_of(dataset: &Path, submission: &Path) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let result = folder.path().join("result.json");
    let mut command = score_under(&["mateval-3"], submission, dataset, &result);
    run(command.env("MATEVAL_CACHE", folder.path().join("no-such-folder"))).ends_with(0);
    json(&result)["protocols"]["mateval-3"]["summary"].clone()
}

pub fn psnr(summary: &Value, key: &str) -> f64 {
    summary[format!("{key}.psnr")].as_f64().unwrap_or_else(|| panic!("no {key} in {summary}"))
}

pub fn truth(dataset: &Path) -> Picture<LinearRgb> {
    exr_io::read_linear(&dataset.join("scenes/room/ground_truth/views/input/albedo.exr")).unwrap()
}

/// A folder with an adapter `a.toml` and one picture of the room that it describes.
fn estimate(encoding: &str, picture: &Picture<LinearRgb>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let adapter = format!("name = \"a\"\n[base_color]\nfiles = [\"{{scene}}.exr\"]\nencoding = \"{encoding}\"\n");
    std::fs::write(folder.path().join("a.toml"), adapter).unwrap();
    exr_io::write_linear(&folder.path().join("room.exr"), picture, Precision::Float).unwrap();
    folder
}

fn lifted_words(folder: &tempfile::TempDir) -> [String; 4] {
    let path = |name: &str| folder.path().join(name).to_string_lossy().into_owned();
    ["--estimate".to_owned(), path(""), "--adapter".to_owned(), path("a.toml")]
}

fn scored_estimate(encoding: &str, picture: &Picture<LinearRgb>) -> Value {
    let folder = estimate(encoding, picture);
    let words = lifted_words(&folder);
    scored(&ROOM, "nn", &words.each_ref().map(String::as_str))
}

#[test]
fn a_lifted_estimate_is_rendered_back_as_the_estimate() {
    let lifted = &*NN;
    assert!(psnr(lifted, "albedo.input") >= 35.0, "{lifted}");
    assert!(psnr(lifted, "albedo.unobserved") < psnr(lifted, "albedo.input"), "{lifted}");
    // Twin: a shift by half a pixel costs more than all other errors together.
    let picture = truth(&ROOM);
    let shifted = Picture::from_fn(picture.width(), picture.height(), |x, y| {
        let (a, b) = (picture.get(x, y).0, picture.get((x + 1).min(picture.width() - 1), y).0);
        LinearRgb(std::array::from_fn(|c| (a[c] + b[c]) / 2.0))
    });
    let shifted = scored_estimate("linear", &shifted);
    assert!(psnr(&shifted, "albedo.input") < 35.0, "{shifted}");
    assert!(psnr(&shifted, "albedo.input") < psnr(lifted, "albedo.input") - 3.0, "{shifted}");
}

#[test]
fn baselines_score_in_the_expected_order() {
    let input = |summary: &Value| psnr(summary, "albedo.input");
    let gt = ["--estimate", "gt"];
    let by_part = [&gt[..], &["--parts"]].concat();
    let [part, instance] = [&by_part[..], &gt].map(|words| input(&scored(&ROOM, "median", words)));
    let (nn, grey) = (input(&NN), input(&scored(&ROOM, "grey", &[])));
    assert!(nn > part + 5.0 && part >= instance && instance > grey + 5.0, "{nn} {part} {instance} {grey}");
}

/// The bytes of all base colours of a submission, by instance.
pub fn base_colors(submission: &Path) -> Vec<(String, Picture<[u8; 3]>)> {
    let mut folders: Vec<PathBuf> =
        std::fs::read_dir(submission.join("scenes/room")).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    let named = |folder: PathBuf| {
        let picture = png_io::read_rgb_bytes(&folder.join("base_color.png")).unwrap();
        (folder.file_name().unwrap().to_string_lossy().into_owned(), picture)
    };
    folders.into_iter().map(named).collect()
}

#[test]
fn three_encodings_of_one_estimate_give_one_atlas() {
    type Encode = fn(f32) -> f32;
    let encodings: [(&str, Encode); 3] =
        [("linear", |v| v), ("srgb", srgb_from_linear), ("gamma22", |v| v.max(0.0).powf(1.0 / 2.2))];
    let folder = tempfile::tempdir().unwrap();
    let picture = truth(unrendered());
    let atlases = encodings.map(|(name, encode)| {
        let estimate = estimate(name, &picture.map(|LinearRgb(rgb)| LinearRgb(rgb.map(encode))));
        let out = folder.path().join(name);
        run(baseline("nn", unrendered(), &out).args(lifted_words(&estimate))).ends_with(0);
        base_colors(&out)
    });
    for other in &atlases[1..] {
        let (mut texels, mut rounded) = (0, 0);
        for ((name, a), (_, b)) in atlases[0].iter().zip(other) {
            for (a, b) in a.pixels().as_flattened().iter().zip(b.pixels().as_flattened()) {
                assert!(a.abs_diff(*b) <= 1, "{name}: {a} {b}");
                texels += 1;
                rounded += usize::from(a != b);
            }
        }
        // Only values on the boundary between two bytes may be rounded differently.
        assert!(rounded * 1000 < texels, "{rounded} of {texels}");
    }
    // Twin: a wrong encoding changes the result.
    let wrong = estimate("srgb", &picture);
    let out = folder.path().join("wrong");
    run(baseline("nn", unrendered(), &out).args(lifted_words(&wrong))).ends_with(0);
    assert!(atlases[0] != base_colors(&out));
}

/// A red and a green box that touch, a blue sheet a millimetre in front of a yellow one, and a mirror that reflects
/// all.
const BOXES: &str = r#"<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="60"/><transform name="to_world">
<lookat origin="0.3, 0.4, 4" target="0, 0, 0" up="0, 1, 0"/></transform>
<film type="hdrfilm"><integer name="width" value="96"/><integer name="height" value="72"/></film></sensor>
<shape type="cube" id="red"><transform name="to_world"><scale value="0.4"/><translate x="-0.4"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.1, 0.1"/></bsdf></shape>
<shape type="cube" id="green"><transform name="to_world"><scale value="0.4"/><translate x="0.4"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.1, 0.8, 0.1"/></bsdf></shape>
<shape type="rectangle" id="blue"><transform name="to_world"><scale value="3"/><translate z="-1"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.1, 0.1, 0.8"/></bsdf></shape>
<shape type="rectangle" id="yellow"><transform name="to_world"><scale value="2.9"/><translate z="-1.001"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.8, 0.8, 0.1"/></bsdf></shape>
<shape type="rectangle" id="mirror"><transform name="to_world"><scale x="0.5" y="0.5"/><rotate y="1" angle="40"/>
<translate x="-1.3" y="0.3" z="0.2"/></transform>
<bsdf type="conductor"><string name="material" value="none"/></bsdf></shape>
<shape type="rectangle" id="lamp"><transform name="to_world"><rotate x="1" angle="90"/><translate y="2.5"/></transform>
<bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf>
<emitter type="area"><rgb name="radiance" value="5"/></emitter></shape>
</scene>"#;

pub fn boxes() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("boxes.xml"), BOXES).unwrap();
    let recipe = folder.path().join("recipe.toml");
    let text = "name = \"boxes\"\nmaterials = \"source\"\nviews = []\natlas_size = 128\n[[scene]]\nid = \"room\"\nbitterli = \"boxes.xml\"\n";
    std::fs::write(&recipe, text).unwrap();
    let dataset = folder.path().join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    (folder, dataset)
}

/// Whether all texels that an instance looks up are within a byte of the colour.
pub fn is_all(dataset: &Path, submission: &Path, instance: &str, linear: [f32; 3]) -> bool {
    let nodes = glb::read(&dataset.join("scenes/room/geometry/instances.glb")).unwrap();
    let mesh = &nodes.iter().find(|node| node.name == instance).unwrap().mesh;
    let path = submission.join("scenes/room").join(instance).join("base_color.png");
    let picture = png_io::read_rgb_bytes(&path).unwrap();
    let atlas = UvAtlas::new(mesh, picture.width());
    let expected = linear.map(|v| (srgb_from_linear(v) * 255.0).round());
    let places = (0..picture.width()).flat_map(|x| (0..picture.height()).map(move |y| (x, y)));
    let near = |(x, y)| (0..3).all(|c| (f32::from(picture.get(x, y)[c]) - expected[c]).abs() <= 1.0);
    places.filter(|&(x, y)| atlas.owner(x, y).is_some()).all(near)
}

#[test]
fn no_colour_is_transferred_between_instances() {
    let (folder, dataset) = boxes();
    let grey = [0.5; 3];
    let expected = [
        ("red", [0.8, 0.1, 0.1]),
        ("green", [0.1, 0.8, 0.1]),
        ("blue", [0.1, 0.1, 0.8]),
        ("yellow", grey),
        ("mirror", [1.0; 3]),
    ];
    for (name, words) in
        [("one", &["--neighbours", "1"][..]), ("three", &["--neighbours", "3", "--normal-weight", "0.5"])]
    {
        let out = folder.path().join(name);
        run(baseline("nn", &dataset, &out).args(words)).ends_with(0);
        for (instance, color) in expected {
            assert!(is_all(&dataset, &out, instance, color), "{name} {instance}");
        }
    }
    // Twin: with --any-instance, the sheet behind takes the colour of the sheet in front of it.
    let out = folder.path().join("any");
    run(baseline("nn", &dataset, &out).arg("--any-instance")).ends_with(0);
    assert!(!is_all(&dataset, &out, "yellow", grey));
    let out = folder.path().join("median");
    run(baseline("median", &dataset, &out).args(["--estimate", "gt"])).ends_with(0);
    for (instance, color) in expected {
        assert!(is_all(&dataset, &out, instance, color), "median {instance}");
    }
}

#[test]
fn an_estimate_may_lack_maps_of_its_adapter() {
    let folder = tempfile::tempdir().unwrap();
    let [estimates, out] = ["estimates", "out"].map(|name| folder.path().join(name));
    std::fs::create_dir_all(estimates.join("room")).unwrap();
    let picture = truth(unrendered()).map(|LinearRgb(rgb)| rgb.map(|v| (srgb_from_linear(v) * 255.0).round() as u8));
    png_io::write_rgb_bytes(&estimates.join("room/base_color.png"), &picture).unwrap();
    png_io::write_rgb_bytes(&estimates.join("room/metallic.png"), &picture.map(|_| [255; 3])).unwrap();
    run(baseline("nn", unrendered(), &out).arg("--estimate").arg(&estimates)).ends_with(0);
    let said = json(&out.join("submission.json"))["description"].as_str().unwrap().to_owned();
    assert!(said.contains("base_color of 1 scene, roughness of none, metallic of 1 scene"), "{said}");
    let floor = out.join("scenes/room/floor");
    assert!(floor.join("metallic.png").is_file() && !floor.join("roughness.png").exists());
    // Twin: base colour is not optional.
    std::fs::remove_file(estimates.join("room/base_color.png")).unwrap();
    run(baseline("nn", unrendered(), &folder.path().join("none")).arg("--estimate").arg(&estimates))
        .ends_with(2)
        .says("base_color.png");
}

/// Columns: the truth and two submissions; rows: five views, and the colour scale below the errors.
#[test]
fn pictures_are_side_by_side() {
    let folder = tempfile::tempdir().unwrap();
    let [grey, out] = ["grey", "out"].map(|name| folder.path().join(name));
    run(&mut baseline("grey", &ROOM, &grey)).ends_with(0);
    let mut command = mateval();
    command.args(["eval", "pictures"]).args([&*GT, &grey]).arg("--dataset").arg(&*ROOM).arg("--out").arg(&out);
    run(&mut command).ends_with(0).prints("room-albedo-error.png");
    let read = |name: &str| png_io::read_rgb_bytes(&out.join(name)).unwrap();
    let (albedo, error) = (read("room-albedo.png"), read("room-albedo-error.png"));
    assert_eq!((albedo.width(), albedo.height()), (3 * WIDTH + 2 * 4, 5 * HEIGHT + 4 * 4));
    assert_eq!((error.width(), error.height()), (2 * WIDTH + 4, 5 * HEIGHT + 5 * 4 + 12));
    // The error maps of the truth's own submission are nearly black, those of the grey one are not.
    let brightness = |left: usize| -> u64 {
        let places = (left..left + WIDTH).flat_map(|x| (0..HEIGHT).map(move |y| (x, y)));
        places.map(|(x, y)| error.get(x, y).iter().map(|v| u64::from(*v)).sum::<u64>()).sum()
    };
    assert!(brightness(0) * 20 < brightness(WIDTH + 4), "{} {}", brightness(0), brightness(WIDTH + 4));
    run(&mut command).ends_with(2).says("--force");
    run(command.arg("--force")).ends_with(0);
}

/// Twice as wide as the view is.
#[test]
fn other_proportions_are_refused() {
    let picture = truth(&ROOM);
    let wide = Picture::from_fn(2 * picture.width(), picture.height(), |x, y| picture.get(x / 2, y));
    let estimate = estimate("linear", &wide);
    let out = estimate.path().join("out");
    run(baseline("nn", &ROOM, &out).args(lifted_words(&estimate)))
        .ends_with(2)
        .says("expected the same proportions, within 5 %")
        .says("placement = \"stretched\"");
    assert!(!out.exists());
}

#[test]
fn an_estimate_that_cannot_be_lifted_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let nn = |words: &[&str]| -> Run { run(baseline("nn", &ROOM, &out).args(words)).ends_with(2) };
    nn(&["--estimate", "no-such-folder"]).says("expected gt, input, delight or a folder");
    nn(&["--estimate", "input"]).says("run `mateval prep render`");
    nn(&["--estimate", "gt", "--adapter", "rgbx"]).says("give --estimate FOLDER");
    nn(&["--normal-weight", "1e300"]).says("expected 0 to 100 m");
    let inside = ROOM.join("scenes/room/mine");
    run(&mut baseline("grey", &ROOM, &inside)).ends_with(2).says("would lie in the dataset");
    assert!(!inside.exists());
    let here = folder.path().to_string_lossy().into_owned();
    nn(&["--estimate", &here, "--adapter", "marigold"]).says("albedo.png");
    nn(&["--estimate", &here, "--adapter", "no-such"]).says("colorful-shading");
    let mut command = mateval();
    command.args(["baseline", "median", "--parts", "--part-set", "none", "--estimate", "gt", "--dataset"]).arg(&*ROOM);
    run(command.arg("--out").arg(&out)).ends_with(2).says("no part set 'none'");
    assert!(!out.exists());
}

#[test]
fn texgen_files_are_exported_and_its_textures_imported() {
    let folder = tempfile::tempdir().unwrap();
    let (objects, results) = (folder.path().join("objects"), folder.path().join("results"));
    let mut command = mateval();
    command.args(["baseline", "texgen-export", "--dataset"]).arg(&*ROOM).arg("--out").arg(&objects);
    run(&mut command).ends_with(0);

    // The stand-in for TEXGen copies the partial atlas and paints unseen texels: red in the lower half, green in the
    // upper.
    std::fs::create_dir(&results).unwrap();
    let list = std::fs::read_to_string(objects.join("objects.jsonl")).unwrap();
    let ids: Vec<String> = list
        .lines()
        .map(|line| serde_json::from_str::<Value>(line).unwrap()["id"].as_str().unwrap().to_owned())
        .collect();
    assert!(ids.len() > 10, "{ids:?}");
    for id in &ids {
        let object = objects.join(&id[..2]).join(id);
        let partial = png_io::read_rgb_bytes(&object.join("model.png")).unwrap();
        let seen = png_io::read_mask(&object.join("mask_partial.png")).unwrap();
        assert_eq!((partial.width(), partial.height()), (1024, 1024));
        let lower = |y: usize| if y >= 512 { [255, 0, 0] } else { [0, 255, 0] };
        let painted = Picture::from_fn(1024, 1024, |x, y| if seen.get(x, y) { partial.get(x, y) } else { lower(y) });
        png_io::write_rgb_bytes(&results.join(format!("{id}.png")), &painted).unwrap();
        let mesh = std::fs::read_to_string(object.join("model.obj")).unwrap();
        assert!(mesh.lines().any(|line| line.starts_with("vt ")) && object.join("position.exr").is_file());
        assert_eq!(png_io::read_rgb_bytes(&object.join("picture.png")).unwrap().width(), 512);
    }
    let [imported, nn] = ["imported", "nn"].map(|name| folder.path().join(name));
    let import = || {
        let mut command = baseline("texgen-import", &ROOM, &imported);
        command.args(["--estimate", "gt"]).arg(&results);
        command
    };
    run(&mut import()).ends_with(0);
    run(&mut baseline("nn", &ROOM, &nn)).ends_with(0);
    let (mut kept, mut painted) = (0, [0; 2]);
    for ((name, ours), (_, theirs)) in base_colors(&nn).iter().zip(&base_colors(&imported)) {
        assert_eq!((ours.width(), ours.height()), (theirs.width(), theirs.height()), "{name}");
        for (at, (a, b)) in ours.pixels().iter().zip(theirs.pixels()).enumerate() {
            let half = usize::from(at / ours.width() < ours.height() / 2);
            match b {
                [255, 0, 0] | [0, 255, 0] => painted[half] += usize::from(b[half] == 255),
                _ => kept += usize::from(a == b),
            }
        }
    }
    // All texels have one of the two colours, except at the seam between them and where 1024 texels a side do not
    // resolve the surface.
    let all: usize = base_colors(&nn).iter().map(|(_, picture)| picture.pixels().len()).sum();
    assert!(kept * 10 > all && painted.iter().all(|half| half * 20 > all), "{kept} {painted:?} of {all}");
    assert!((kept + painted[0] + painted[1]) * 100 > all * 95, "{kept} {painted:?} of {all}");

    std::fs::remove_dir_all(&results).unwrap();
    std::fs::create_dir(&results).unwrap();
    run(import().arg("--force")).ends_with(2).says("living-00012.png");
}

#[test]
fn partfield_meshes_are_exported_and_its_labels_become_a_second_set_of_parts() {
    let (folder, dataset) = boxes();
    let [meshes, clusters] = ["meshes", "clusters"].map(|name| folder.path().join(name));
    run(mateval().args(["baseline", "partfield-export", "--dataset"]).arg(&dataset).arg("--out").arg(&meshes))
        .ends_with(0);
    let faces = |id: &str| {
        let text = std::fs::read_to_string(meshes.join(id)).unwrap();
        text.lines().filter(|line| line.starts_with("f ")).count()
    };
    assert_eq!((faces("room-00001.obj"), faces("room-00003.obj")), (12, 2));

    std::fs::create_dir(&clusters).unwrap();
    std::fs::write(clusters.join("room-00001_0_03.npy"), npy(&[0_i64, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2], &[12]))
        .unwrap();
    let labels = folder.path().join("labels");
    let import = |out: &Path| {
        let mut command = mateval();
        command.args(["baseline", "partfield-import", "--parts", "5", "--dataset"]).arg(&dataset).arg(&clusters);
        run(command.arg("--out").arg(out))
    };
    assert!(import(&labels).ends_with(0).stdout.contains("labels of 1 instance\n"));
    let recipe = folder.path().join("recipe.toml");
    let text = std::fs::read_to_string(&recipe).unwrap() + "part_labels = { partfield = \"labels/room\" }\n";
    std::fs::write(&recipe, text).unwrap();
    let again = folder.path().join("again");
    run(&mut build(&recipe, &again)).ends_with(0);
    let scene = json(&again.join("scenes/room/scene.json"));
    let parts = scene["part_sets"][0]["parts"].as_array().unwrap();
    assert_eq!(parts.iter().filter(|part| part["instance"] == "red").count(), 3);
    let out = folder.path().join("median");
    let words = ["--estimate", "gt", "--parts", "--part-set", "partfield"];
    run(baseline("median", &again, &out).args(words)).ends_with(0);
    assert!(is_all(&again, &out, "red", [0.8, 0.1, 0.1]));

    std::fs::write(clusters.join("room-00002_0_01.npy"), npy(&[0_i64; 11], &[11])).unwrap();
    let bad = folder.path().join("bad");
    import(&bad).ends_with(2).says("11 labels; 'green' has 12 triangles");
    std::fs::remove_dir_all(&clusters).unwrap();
    import(&bad).ends_with(2).says("living-00012_0_05.npy");
    assert!(!bad.exists());
}
