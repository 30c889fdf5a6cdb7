//! Perturbed geometry: level 0 is a copy, higher levels hide the true geometry, and submissions made from them are
//! scored on the true dataset.

use std::path::{Path, PathBuf};
use std::process::Command;

use mateval_dataset::dataset::SceneFile;
use mateval_dataset::layout::SceneFolder;
use mateval_dataset::{SceneId, glb};
use mateval_image::transfer::{byte_from_unit, srgb_from_linear};
use mateval_image::{LinearRgb, exr_io, png_io};
use serde_json::{Value, json};

use super::command::{Run, baseline, mateval, run, score_under, verify};
use super::sample::{files_below, json, unrendered};
use super::stated::dataset;
use mateval_testkit::copy_folder;

fn perturb(dataset: &Path, kind: &str, level: u32, out: &Path) -> Run {
    let mut command = mateval();
    command.args(["prep", "perturb", "--kind", kind, "--level", &level.to_string(), "--seed", "9"]).arg(dataset);
    run(command.arg("--out").arg(out))
}

/// `baseline nn`, with the true base colours of the input view as its estimate, so that only geometry differs.
fn nn(dataset: &Path, estimate: &Path, submission: &Path) -> Command {
    let mut command = baseline("nn", dataset, submission);
    command.arg("--estimate").arg(estimate);
    command
}

/// The folder of that estimate.
fn true_estimate(folder: &Path) -> PathBuf {
    let truth = dataset().join("scenes/room/ground_truth/views/input/albedo.exr");
    let albedo = exr_io::read_linear(&truth).unwrap();
    let bytes = albedo.map(|LinearRgb(rgb)| rgb.map(|v| byte_from_unit(srgb_from_linear(v))));
    let estimate = folder.join("estimate");
    std::fs::create_dir_all(estimate.join("room")).unwrap();
    png_io::write_rgb_bytes(&estimate.join("room/base_color.png"), &bytes).unwrap();
    estimate
}

fn room(dataset: &Path) -> (SceneFolder, SceneFile) {
    let folder = SceneFolder::of(dataset, &SceneId::new("room").unwrap());
    let file = mateval_dataset::json::read(&folder.scene_file()).unwrap();
    (folder, file)
}

/// Files relative to the dataset, without the ground truth and what `prep` keeps for itself.
fn public_files(dataset: &Path) -> Vec<PathBuf> {
    let is_public = |file: &PathBuf| {
        let hidden = [".build", "ground_truth"].map(std::ffi::OsStr::new);
        !file.components().any(|part| hidden.contains(&part.as_os_str()))
    };
    files_below(dataset).into_iter().filter(is_public).collect()
}

#[test]
fn level_zero_is_a_copy() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["pose", "scale", "shape"] {
        let out = folder.path().join(kind);
        perturb(dataset(), kind, 0, &out).ends_with(0).prints("room: 0 pieces of furniture moved");
        let files = public_files(dataset());
        assert!(files.len() > 10, "{files:?}");
        assert_eq!(public_files(&out), files);
        assert_eq!(files_below(&out).len(), files.len());
        for file in files {
            assert!(
                std::fs::read(out.join(&file)).unwrap() == std::fs::read(dataset().join(&file)).unwrap(),
                "{file:?}"
            );
        }
    }
}

/// No file of the copy holds a true position of furniture, and architecture is unchanged. The twin: the true files hold
/// all.
#[test]
fn methods_see_no_true_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let (true_folder, scene) = room(dataset());
    let true_nodes = glb::read(&true_folder.instances()).unwrap();
    let is_furniture: Vec<bool> = scene.instances.iter().map(|instance| instance.role.is_furniture()).collect();
    assert!(is_furniture.iter().filter(|is| **is).count() >= 5);
    let bytes_of = |dataset: &Path| -> Vec<u8> {
        public_files(dataset).iter().flat_map(|file| std::fs::read(dataset.join(file)).unwrap()).collect()
    };
    // Positions as twelve bytes, some of every instance.
    let mut needles: Vec<Vec<u8>> = Vec::new();
    for (node, _) in true_nodes.iter().zip(&is_furniture).filter(|(_, is)| **is) {
        let step = (node.mesh.positions.len() / 20).max(1);
        let places = node.mesh.positions.iter().step_by(step);
        needles.extend(places.map(|place| place.to_array().iter().flat_map(|v| v.to_le_bytes()).collect()));
    }
    let found = |bytes: &[u8]| {
        let mut words: Vec<&[u8]> = bytes.windows(12).collect();
        words.sort_unstable();
        needles.iter().filter(|needle| words.binary_search(&needle.as_slice()).is_ok()).count()
    };
    for (kind, level) in [("pose", 3), ("scale", 2), ("shape", 3)] {
        let out = folder.path().join(kind);
        perturb(dataset(), kind, level, &out).ends_with(0);
        run(&mut verify(&out)).ends_with(0);
        assert!(!out.join("scenes/room/ground_truth").exists());
        assert!(!std::fs::read_to_string(out.join("MANIFEST.sha256")).unwrap().contains("ground_truth"));
        let (moved_folder, _) = room(&out);
        let nodes = glb::read(&moved_folder.instances()).unwrap();
        for ((now, before), is_furniture) in nodes.iter().zip(&true_nodes).zip(&is_furniture) {
            assert_eq!((&now.mesh.triangles, &now.mesh.uvs), (&before.mesh.triangles, &before.mesh.uvs));
            assert_eq!(now.mesh.positions == before.mesh.positions, !is_furniture, "{}", now.name);
        }
        let only = |dataset: &Path| std::fs::read(dataset.join("scenes/room/geometry/instances.glb")).unwrap();
        assert_eq!(found(&only(&out)), 0, "{kind}");
        assert_eq!(found(&only(dataset())), needles.len(), "{kind}");
        let photo = |dataset: &Path| std::fs::read(dataset.join("scenes/room/views/input/rgb.exr")).unwrap();
        assert!(photo(&out) == photo(dataset()));
        let true_hash = json(&dataset().join("dataset.json"))["manifest_sha256"].clone();
        let expected = json!({"perturbation": {"kind": kind, "level": level}, "true_manifest_sha256": true_hash});
        assert_eq!(json(&out.join("dataset.json"))["geometry"], expected);
    }
    // The whole copy of the strongest kind, file by file.
    let bytes = bytes_of(&folder.path().join("pose"));
    assert_eq!(found(&bytes), 0);
}

/// A baseline runs on the copy unchanged, its submission is scored on the true dataset, and tables show the
/// perturbation.
#[test]
fn submissions_are_scored_on_the_true_geometry() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let summary = |submission: &Path| -> (Value, Value) {
        let result = submission.with_extension("json");
        let mut command = score_under(&["mateval-3"], submission, dataset(), &result);
        run(command.env("MATEVAL_CACHE", folder.path())).ends_with(0);
        let result = json(&result);
        (result["protocols"]["mateval-3"]["summary"].clone(), result["submission"]["geometry"].clone())
    };
    perturb(dataset(), "pose", 3, &path("moved")).ends_with(0);
    run(&mut baseline("nn", &path("moved"), &path("none")))
        .ends_with(2)
        .says("no ground truth")
        .says("--estimate input");
    let estimate = true_estimate(folder.path());
    // At level 0 the copy has the manifest of the dataset, whose ground truth is not there.
    perturb(dataset(), "pose", 0, &path("still")).ends_with(0);
    run(&mut nn(&path("still"), &estimate, &path("unmoved"))).ends_with(0);
    run(&mut nn(dataset(), &estimate, &path("true"))).ends_with(0);
    run(&mut nn(&path("moved"), &estimate, &path("fallen"))).ends_with(0);
    let lint = run(mateval().args(["eval", "lint"]).arg(path("fallen")).arg("--dataset").arg(dataset()));
    assert!(!lint.stdout.contains("other_dataset"), "{}", lint.stdout);
    let ((on_true, none), (on_moved, geometry)) = (summary(&path("true")), summary(&path("fallen")));
    assert_eq!((none, geometry), (Value::Null, json!({"kind": "pose", "level": 3})));
    let psnr = |summary: &Value| summary["albedo.input.psnr"].as_f64().unwrap();
    assert!(psnr(&on_true) > psnr(&on_moved) + 0.5, "{on_true} {on_moved}");
    let mut tables = mateval();
    tables.args(["eval", "tables"]).args([path("true.json"), path("fallen.json")]).args(["--format", "csv"]);
    run(&mut tables).ends_with(0).prints("nn-plain (pose 3)");
    let site = path("site");
    let mut board = mateval();
    board.args(["eval", "leaderboard"]).args([path("true.json"), path("fallen.json")]).arg("--out").arg(&site);
    run(&mut board).ends_with(0);
    let page = std::fs::read_to_string(site.join("perturbed.html")).unwrap();
    assert!(
        page.contains("<polyline") && page.contains("level 3") && page.contains("Albedo, input view, PSNR"),
        "{page}"
    );
    let shown = |summary: &Value| format!("<td>{:.2}</td>", psnr(summary));
    assert!(page.contains(&shown(&on_true)) && page.contains(&shown(&on_moved)), "{page}");
    let links = |site: &Path| std::fs::read_to_string(site.join("index.html")).unwrap().contains("perturbed.html");
    assert!(links(&site));
    let board_of = |name: &str| {
        let site = path(&format!("site-{name}"));
        let mut board = mateval();
        run(board.args(["eval", "leaderboard"]).arg(path(name)).arg("--out").arg(&site)).ends_with(0);
        site
    };
    // Of one level alone there is no curve, and without such submissions no page.
    let alone = std::fs::read_to_string(board_of("fallen.json").join("perturbed.html")).unwrap();
    assert!(alone.contains("no curve") && !alone.contains("<polyline"), "{alone}");
    let plain = board_of("true.json");
    assert!(!links(&plain) && !plain.join("perturbed.html").exists());
    // The truth's scores do not depend on what its submission states.
    run(&mut baseline("gt", dataset(), &path("gt"))).ends_with(0);
    copy_folder(&path("gt"), &path("stated"));
    let mut file = json(&path("stated").join("submission.json"));
    file["geometry"] = json!({"kind": "shape", "level": 3});
    std::fs::write(path("stated").join("submission.json"), file.to_string()).unwrap();
    assert_eq!(summary(&path("gt")).0, summary(&path("stated")).0);
}

#[test]
fn what_cannot_be_perturbed_is_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    perturb(dataset(), "scale", 3, &out).ends_with(2).says("scale has the levels 0 to 2, found 3");
    perturb(unrendered(), "scale", 1, &out).ends_with(2).says("no scene with furniture");
    assert!(!out.exists());
    perturb(dataset(), "scale", 1, &out).ends_with(0);
    perturb(dataset(), "scale", 1, &out).ends_with(2).says("already exists");
    perturb(&out, "scale", 1, &folder.path().join("again")).ends_with(2).says("perturbed already");
}
