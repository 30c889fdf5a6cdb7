//! A hidden split: two trees of one dataset, a commitment that no other truth matches, and the ways in which truth was
//! once read out of public files: by making it again, by looking its hashes up, out of results, and out of exports.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_files::untrusted::sha256_of_bytes;
use mateval_image::{Picture, png_io};
use mateval_testkit::{copy_folder, kept_folder};

use super::command::{Run, baseline, build, mateval, render, run, run_words, score, verify};
use super::leaks::{Secrets, check_bytes, contents};
use super::sample::{SMALL, copy_source, dataset, files_below, json, manifest, recipe_text, unrendered};

/// `mateval prep publish DATASET --withhold ground_truth` into folders of `out`, with further words.
fn publish(dataset: &Path, out: &Path, words: &[&str]) -> Run {
    let mut command = mateval();
    command.args(["prep", "publish", "--withhold", "ground_truth", "--public"]).arg(out.join("public"));
    run(command.arg("--private").arg(out.join("private")).arg(dataset).args(words))
}

/// A folder with the redressed room in `dataset`, its split in `public` and `private`, both together in `whole`, and
/// the split's commitment in `commitment`.
static SPLIT: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("split");
    copy_source(&folder.join("source"));
    std::fs::write(folder.join("key"), [3; 32]).unwrap();
    let recipe = folder.join("source/redressed.toml");
    // A quarter of the pixels of the other datasets, since scoring this one traces paths.
    let head = SMALL.replace("[96, 72]", "[48, 36]");
    let text = recipe_text(&head, &["room"]) + "redress = { key = \"../key\" }\n";
    std::fs::write(&recipe, text).unwrap();
    run(&mut build(&recipe, &folder.join("dataset"))).ends_with(0);
    run(&mut render(&folder.join("dataset"), 1)).ends_with(0);
    let published = publish(&folder.join("dataset"), &folder, &[]).ends_with(0);
    std::fs::write(folder.join("commitment"), commitment(&published)).unwrap();
    copy_folder(&folder.join("public"), &folder.join("whole"));
    copy_folder(&folder.join("private"), &folder.join("whole"));
    folder
});

static SECRETS: LazyLock<Secrets> = LazyLock::new(|| Secrets::of(&SPLIT.join("private")));

/// The baseline `grey`, made from the public tree, and its result on the whole one.
static GREY: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
    let folder = kept_folder("split-grey");
    let [grey, result] = ["grey", "grey.json"].map(|name| folder.join(name));
    run(&mut baseline("grey", &SPLIT.join("public"), &grey)).ends_with(0);
    run(&mut score(&grey, &SPLIT.join("whole"), &result)).ends_with(0);
    [grey, result]
});

fn commitment(run: &Run) -> &str {
    run.stdout.lines().find_map(|line| line.strip_prefix("commitment ")).unwrap()
}

#[test]
fn both_trees_together_are_a_whole_dataset_of_the_same_identity() {
    let [public, private, whole] = ["public", "private", "whole"].map(|name| SPLIT.join(name));
    let is_truth = |path: &Path| path.components().nth(2).is_some_and(|part| part.as_os_str() == "ground_truth");
    assert!(!files_below(&public).iter().any(|path| is_truth(path)));
    let others: Vec<_> = files_below(&private).into_iter().filter(|path| !is_truth(path)).collect();
    assert_eq!(others, ["commitment.secret", "recipe.toml", "withheld.sha256"].map(PathBuf::from));
    assert_eq!(manifest(&public), manifest(&whole));
    for dataset in [&public, &whole] {
        run(&mut verify(dataset)).ends_with(0);
    }
    // Every file of the original but its lists is in one of both, as it was; `scene.json` lies in the private one.
    for (file, bytes) in contents(&SPLIT.join("dataset")) {
        let name = file.to_string_lossy().replace('\\', "/");
        let place = if name == "scenes/room/scene.json" { "scenes/room/ground_truth/whole_scene.json" } else { &name };
        let is_list = ["MANIFEST.sha256", "dataset.json"].contains(&place) || place.starts_with(".build");
        assert!(is_list || std::fs::read(whole.join(place)).unwrap() == bytes, "{name}");
    }
    // The public tree is enough to make submissions, and the whole one to score them.
    let out = tempfile::tempdir().unwrap();
    let [grey, result] = &*GREY;
    run(&mut score(grey, &public, &out.path().join("grey.json"))).ends_with(2).says("this needs the whole dataset");
    assert!(!json(result)["findings"].to_string().contains("\"error\""));
}

#[test]
fn the_commitment_holds_for_this_truth_alone() {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&SPLIT.join("whole"), copy.path());
    let secret = SPLIT.join("private/commitment.secret");
    let opened = |root: &Path| run(mateval().args(["prep", "verify", "--opened"]).arg(&secret).arg(root));
    assert!(manifest(copy.path()).contains(&std::fs::read_to_string(SPLIT.join("commitment")).unwrap()));
    opened(copy.path()).ends_with(0);
    // Another truth, with a list that fits it.
    let file = "scenes/room/ground_truth/renders/builtin/up_left/render.json";
    let [truth, list] = [file, "withheld.sha256"].map(|name| copy.path().join(name));
    let changed = std::fs::read_to_string(&truth).unwrap() + " ";
    let hash = |text: &str| sha256_of_bytes(text.as_bytes());
    let old = hash(&std::fs::read_to_string(&truth).unwrap());
    std::fs::write(&truth, &changed).unwrap();
    opened(copy.path()).ends_with(1).prints("changed_file");
    std::fs::write(&list, std::fs::read_to_string(&list).unwrap().replace(&old, &hash(&changed))).unwrap();
    opened(copy.path()).ends_with(1).prints("broken_commitment");
    // Without the secret nobody can tell.
    std::fs::remove_file(copy.path().join("commitment.secret")).unwrap();
    run(mateval().args(["prep", "verify"]).arg(copy.path())).ends_with(0);
    // A split is not changed.
    run(mateval().args(["prep", "finish"]).arg(copy.path())).ends_with(2);
}

/// Fault 1 of the design: the recipe, the source's files and the same program made every withheld map again.
#[test]
fn nothing_withheld_can_be_made_again_without_the_key() {
    let public = SPLIT.join("public");
    assert!(!public.join("recipe.toml").exists());
    let scene = json(&public.join("scenes/room/scene.json"));
    assert_eq!((&scene["source"]["files"], &scene["findings"]), (&serde_json::json!([]), &serde_json::json!([])));
    let weak: BTreeSet<&str> =
        scene["redressed"]["weak"].as_array().unwrap().iter().map(|one| one["instance"].as_str().unwrap()).collect();
    let map = |root: &Path, instance: &str| {
        std::fs::read(root.join(format!("scenes/room/ground_truth/materials/{instance}/base_color.png"))).ok()
    };
    let mut compared = 0;
    for instance in scene["instances"].as_array().unwrap().iter().map(|one| one["id"].as_str().unwrap()) {
        let Some(withheld) = map(&SPLIT.join("private"), instance) else { continue };
        if !weak.contains(instance) {
            compared += 1;
            assert!(map(unrendered(), instance).unwrap() != withheld, "{instance} was made again");
        }
    }
    assert!(compared >= 4, "{compared}");
}

/// Fault 2: hashes of withheld maps occur in public datasets. And nothing else of a withheld file is public: not its
/// size, nor a piece of its content.
#[test]
fn the_public_tree_holds_no_hash_size_or_piece_of_a_withheld_file() {
    let [public, private] = ["public", "private"].map(|name| SPLIT.join(name));
    let pieces = check_bytes(&public, &private, unrendered());
    assert!(pieces >= 4, "{pieces}");
    let shown = SECRETS.found_in(&public);
    assert_eq!(shown.leaks, BTreeSet::new());
    assert!(shown.pictures > 20, "{}", shown.pictures);
}

/// The scoring program of a competition, on the layout that Codabench documents: its files give no more away than
/// `eval score --rounded`.
#[test]
fn a_competition_shows_rounded_numbers_alone() {
    let out = tempfile::tempdir().unwrap();
    let [bundle, app, output] = ["bundle", "app", "app/output"].map(|name| out.path().join(name));
    let export = |dataset: &str, words: &[&Path]| {
        let mut command = mateval();
        command.args(["prep", "export", "--as", "codabench", "--image", "example/mateval:1", "--out"]).arg(&bundle);
        run(command.arg(SPLIT.join(dataset)).args(words))
    };
    export("whole", &[]).ends_with(2).says("--with-ground-truth");
    export("public", &[]).ends_with(2).says("give --private FOLDER");
    let private = SPLIT.join("private");
    let with_private = [Path::new("--private"), &private];
    export("public", &with_private).ends_with(2).says("--floor RESULT.json");
    let [_, floor] = &*GREY;
    let words = [&with_private[..], &[Path::new("--floor"), floor]].concat();
    let limits = ["--seconds-a-scene", "601"].map(Path::new);
    export("public", &[&words[..], &limits].concat()).ends_with(2).says("601 s");
    assert!(!bundle.exists());
    export("public", &words).ends_with(0).prints("1 task; it holds the truth");
    assert!(
        !files_below(&bundle).iter().any(|file| file.ends_with("commitment.secret") || file.ends_with("recipe.toml"))
    );

    copy_folder(&bundle.join("data/scoring_program"), &app.join("program"));
    copy_folder(&bundle.join("data/reference_0"), &app.join("input/ref"));
    run(&mut baseline("median", &SPLIT.join("public"), &app.join("input/res/folder"))).ends_with(0);
    std::fs::create_dir_all(&output).unwrap();
    let metadata = std::fs::read_to_string(app.join("program/metadata.yaml")).unwrap();
    assert_eq!(metadata, "command: sh /app/program/score.sh rounded mateval-3\n");
    let paths = std::env::var("PATH").unwrap();
    let bin = Path::new(env!("CARGO_BIN_EXE_mateval")).parent().unwrap();
    let mut program = std::process::Command::new("sh");
    program
        .env("PATH", format!("{}:{paths}", bin.display()))
        .arg(app.join("program/score.sh"))
        .args(["rounded", "mateval-3"]);
    let printed = run(program.arg(app.join("input")).arg(&output)).ends_with(0).stdout;
    assert_eq!((printed.as_str(), files_below(&output).len()), ("", 2));
    assert_eq!(SECRETS.found_in(&output).leaks, BTreeSet::new());
    // The twin holds the truth, for the scoring program.
    assert!(!SECRETS.found_in(&bundle).leaks.is_empty());

    let [whole, rounded] = ["whole.json", "rounded.json"].map(|name| out.path().join(name));
    let mut command = score(&app.join("input/res/folder"), &SPLIT.join("whole"), &whole);
    run(command.arg("--rounded").arg(&rounded).arg("--floor").arg(floor)).ends_with(0);
    let scores = json(&output.join("scores.json"));
    let [whole, rounded] = [json(&whole)["protocols"]["mateval-3"]["summary"].clone(), json(&rounded)];
    let headline = rounded["headline"]["mateval-3"].as_object().unwrap();
    assert_eq!(scores.as_object().unwrap().len(), headline.len());
    let page = std::fs::read_to_string(output.join("detailed_results.html")).unwrap();
    for (key, value) in headline {
        assert_eq!(scores[key.replace('.', "_")].as_f64(), value.as_f64(), "{key}");
        let exact = format!("{:.4}", whole[key].as_f64().unwrap());
        assert!(page.contains(key) && !page.contains(&exact), "{key}");
    }
    // An interval is a further number, which would give more away.
    assert!(!page.contains("<img") && !page.contains("\"instances\"") && !page.contains("interval"), "{page}");
}

/// A box with one photo and one measured colour, below `folder`, as a dataset. `more` follows in the recipe.
fn captured_box(folder: &Path, more: &str) -> PathBuf {
    let corner = |at: u32| [(at & 1) as i32 * 4 - 2, (at >> 1 & 1) as i32 * 3, (at >> 2) as i32 * 3 - 2];
    let vertices: String = (0..8).map(corner).map(|[x, y, z]| format!("{x} {y} {z}\n")).collect();
    let faces = "4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n4 0 2 3 1\n4 4 5 7 6\n";
    let mesh = format!(
        "ply\nformat ascii 1.0\nelement vertex 8\nproperty float x\nproperty float y\nproperty float z\n\
         element face 6\nproperty list uchar int vertex_indices\nend_header\n{vertices}{faces}"
    );
    let cameras = r#"{"fl_x": 30, "fl_y": 30, "cx": 16, "cy": 12, "w": 32, "h": 24, "frames": [{"file_path": "images/1.png",
        "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 1.5], [0, 0, 1, 0.5], [0, 0, 0, 1]]}]}"#;
    let measured = r#"{"format": "mateval-measurements/1", "regions": [{"name": "wall", "photo": "1", "mask": "mask.png",
        "value": 1, "color": [0.5, 0.4, 0.3]}]}"#;
    let recipe = "name = \"box\"\nresolution = [32, 24]\natlas_size = 64\n[[scene]]\nid = \"box\"\n[scene.capture]\n\
                  mesh = \"mesh.ply\"\ncameras = \"cameras.json\"\nphotos = \"images\"\ninput = \"1\"\n\
                  measured = \"measured.json\"\n"
        .to_owned()
        + more;
    std::fs::create_dir_all(folder.join("images")).unwrap();
    for (file, text) in [
        ("mesh.ply", mesh.as_str()),
        ("cameras.json", cameras),
        ("measured.json", measured),
        ("recipe.toml", recipe.as_str()),
    ] {
        std::fs::write(folder.join(file), text).unwrap();
    }
    let photo = Picture::from_fn(32, 24, |x, y| [120 + x as u8, 110 + y as u8, 90]);
    png_io::write_rgb_bytes(&folder.join("images/1.png"), &photo).unwrap();
    let mask = Picture::from_fn(32, 24, |x, y| u8::from((10..20).contains(&x) && (8..16).contains(&y)));
    png_io::write_grey_bytes(&folder.join("mask.png"), &mask).unwrap();
    let dataset = folder.join("dataset");
    run(mateval().args(["prep", "build"]).arg(folder.join("recipe.toml")).arg("--out").arg(&dataset)).ends_with(0);
    dataset
}

/// Captured rooms have a protocol of their own, and a competition's program scores by it.
#[test]
fn a_competition_of_captured_rooms_scores_measured_colours() {
    let out = tempfile::tempdir().unwrap();
    let [bundle, app, output] = ["bundle", "app", "app/output"].map(|name| out.path().join(name));
    let dataset = captured_box(&out.path().join("box"), "");
    let mut command = mateval();
    let words = ["prep", "export", "--as", "codabench", "--image", "example/mateval:1", "--out"];
    command.args(words).arg(&bundle).arg(&dataset);
    run(&mut command).ends_with(0).prints("1 task");
    copy_folder(&bundle.join("data/scoring_program"), &app.join("program"));
    copy_folder(&bundle.join("data/reference_0"), &app.join("input/ref"));
    run(&mut baseline("grey", &dataset, &app.join("input/res"))).ends_with(0);
    std::fs::create_dir_all(&output).unwrap();
    let bin = Path::new(env!("CARGO_BIN_EXE_mateval")).parent().unwrap();
    let mut program = std::process::Command::new("sh");
    program.env("PATH", format!("{}:{}", bin.display(), std::env::var("PATH").unwrap()));
    program.arg(app.join("program/score.sh")).args(["whole", "capture-1"]).arg(app.join("input")).arg(&output);
    run(&mut program).ends_with(0);
    let scores = json(&output.join("scores.json"));
    assert!(scores["measured_input_region_delta_e"].as_f64().is_some_and(|error| error > 1.0), "{scores}");
    let page = std::fs::read_to_string(output.join("detailed_results.html")).unwrap();
    assert!(page.contains("grey") && page.contains("PSNR") && !page.contains("<img"), "{page}");
    let error = format!("{:.4}", scores["measured_input_region_delta_e"].as_f64().unwrap());
    let line = page.lines().find(|line| line.starts_with("measured.input.region_delta_e")).unwrap();
    assert!(line.ends_with(&format!(" {error}  no interval, houses: 1")), "{line}");
}

/// Tars state a flash in `scene.json`; formats of cameras and pictures alone refuse the scene.
#[test]
fn a_flash_is_exported_or_refused_by_name() {
    let out = tempfile::tempdir().unwrap();
    let dataset = captured_box(&out.path().join("box"), "flash = { offset_m = [0, 0.1, 0] }\n");
    assert_eq!(json(&dataset.join("scenes/box/scene.json"))["flash"]["views"], serde_json::json!(["input"]));
    for (format, is_held) in [("tar", true), ("nerfstudio", false), ("colmap", false)] {
        let place = out.path().join(format);
        let mut command = mateval();
        command.args(["prep", "export", "--with-ground-truth", "--as", format, "--out"]).arg(&place).arg(&dataset);
        match is_held {
            true => run(&mut command).ends_with(0),
            false => run(&mut command).ends_with(2).says("the scene 'box' has a flash"),
        };
        assert_eq!(place.exists(), is_held, "{format}");
    }
}

/// Fault 4: the next step of the guide packed the whole dataset without a word.
#[test]
fn nothing_passes_on_the_truth_of_a_hidden_split_without_being_asked() {
    let out = tempfile::tempdir().unwrap();
    for (at, format) in ["tar", "croissant", "huggingface", "nerfstudio", "colmap"].into_iter().enumerate() {
        let export = |dataset: &str| {
            let place = out.path().join(format!("{dataset}-{at}"));
            let mut command = mateval();
            command.args(["prep", "export", "--as", format, "--out"]).arg(&place).arg(SPLIT.join(dataset));
            (command, place)
        };
        // The whole split, and the redressed dataset before it was split.
        for dataset in ["whole", "dataset"] {
            let (mut command, place) = export(dataset);
            run(&mut command).ends_with(2).says("--with-ground-truth");
            assert!(!place.exists(), "{place:?}");
        }
        let (mut command, place) = export("public");
        run(&mut command).ends_with(0);
        let shown = SECRETS.found_in(&place);
        assert_eq!(shown.leaks, BTreeSet::new(), "{format}");
        assert!(shown.pictures > 0, "{format}");
    }
    // The twin: what is packed on request is found.
    let packed = out.path().join("with_truth");
    let mut command = mateval();
    command.args(["prep", "export", "--as", "tar", "--with-ground-truth", "--out"]).arg(&packed);
    run(command.arg(SPLIT.join("whole"))).ends_with(0);
    assert!(SECRETS.found_in(&packed).leaks.len() > 20);
    let report = out.path().join("report");
    let words = |dataset: &str| {
        let mut command = mateval();
        command.args(["prep", "publish"]).arg(SPLIT.join(dataset)).arg("--report").arg(&report);
        command
    };
    run(&mut words("whole")).ends_with(2).says("--with-ground-truth");
    run(&mut words("public")).ends_with(0);
    let text = std::fs::read_to_string(report.join("release.json")).unwrap();
    assert!(text.contains("\"secrecy\": \"secret\"") && text.contains("\"remake\": null"), "{text}");
    assert_eq!(SECRETS.found_in(&report).leaks, BTreeSet::new());
}

/// A folder of pictures of the truth was copied into a site that everybody sees.
#[test]
fn a_board_of_a_hidden_split_shows_its_truth_only_if_asked() {
    let out = tempfile::tempdir().unwrap();
    let [grey, result] = &*GREY;
    let [set, site] = ["set", "site"].map(|name| out.path().join(name));
    let board = |words: &[&str]| {
        let mut command = mateval();
        run(command.args(["eval", "leaderboard"]).arg(result).arg("--out").arg(&site).args(words))
    };
    let withheld = SPLIT.join("private/scenes/room/ground_truth/renders/builtin/up_left/rgb.png");
    for (method, picture) in [("grey", grey.join("scenes/room/floor/base_color.png")), ("_truth", withheld)] {
        let folder = set.join(method).join("room/input");
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::copy(picture, folder.join("albedo.png")).unwrap();
    }
    let pictures = ["--pictures", set.to_str().unwrap()];
    board(&pictures).ends_with(2).says("_truth/room/input/albedo.png").says("--with-ground-truth");
    board(&["--with-ground-truth"]).ends_with(2);
    assert!(!site.exists());
    board(&[&pictures[..], &["--with-ground-truth"]].concat()).ends_with(0);
    let shown = SECRETS.found_in(&site);
    assert!(shown.leaks.iter().any(|(file, _)| file.ends_with("_truth/room/input/albedo.png")), "{:?}", shown.leaks);
    // The twin shows what everybody may see.
    std::fs::remove_dir_all(set.join("_truth")).unwrap();
    board(&[&pictures[..], &["--force"]].concat()).ends_with(0);
    assert!(site.join("pictures/grey/room/input/albedo.png").exists() && !site.join("pictures/_truth").exists());
    let shown = SECRETS.found_in(&site);
    assert_eq!(shown.leaks, BTreeSet::new());
    assert!(shown.pictures > 0);
}

#[test]
fn what_follows_from_public_files_is_not_called_secret() {
    let out = tempfile::tempdir().unwrap();
    publish(dataset(), out.path(), &[]).ends_with(2).says("redress").says("--open-book");
    assert!(!out.path().join("public").exists());
    publish(dataset(), out.path(), &["--open-book"]).ends_with(0).prints("truth withheld, not secret");
    assert_eq!(json(&out.path().join("public/dataset.json"))["withheld"], "not_secret");
    // Nothing is overwritten, and a public tree has nothing to withhold.
    publish(dataset(), out.path(), &["--open-book"]).ends_with(2).says("--force");
    publish(&out.path().join("public"), &out.path().join("again"), &["--open-book"]).ends_with(2);
    let one = out.path().join("one");
    let words = ["prep", "publish", "--open-book", "--withhold", "ground_truth", "--public"].map(Path::new);
    run_words(words.into_iter().chain([one.as_path(), Path::new("--private"), one.as_path(), dataset()]))
        .ends_with(2)
        .says("not be withheld");
}

/// A recipe states that nobody else has the files. Its twin is the public room of the test before.
#[test]
fn a_private_source_is_a_secret() {
    let out = tempfile::tempdir().unwrap();
    let [source, dataset] = ["source", "dataset"].map(|name| out.path().join(name));
    copy_source(&source);
    let recipe = source.join("private.toml");
    std::fs::write(&recipe, recipe_text(SMALL, &["room"]) + "source = \"private\"\n").unwrap();
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let mut tar = mateval();
    tar.args(["prep", "export", "--as", "tar", "--out"]).arg(out.path().join("tar")).arg(&dataset);
    run(&mut tar).ends_with(2).says("--with-ground-truth");
    publish(&dataset, out.path(), &[]).ends_with(0);
    let public = out.path().join("public");
    assert_eq!(json(&public.join("dataset.json"))["withheld"], "secret");
    let scene = json(&public.join("scenes/room/scene.json"));
    assert_eq!((&scene["source"]["private"], &scene["source"]["files"]), (&true.into(), &serde_json::json!([])));
    assert_eq!(json(&super::sample::unrendered().join("scenes/room/scene.json"))["source"].get("private"), None);
}

#[test]
fn a_changed_dataset_is_not_published() {
    let (out, changed) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    copy_folder(unrendered(), changed.path());
    let truth = changed.path().join("scenes/room/ground_truth/lights.json");
    std::fs::write(&truth, std::fs::read_to_string(&truth).unwrap() + " ").unwrap();
    publish(changed.path(), out.path(), &["--open-book"]).ends_with(2).says("changed_file");
    assert!(files_below(out.path()).is_empty());
}
