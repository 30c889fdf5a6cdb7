//! Submissions with faults: each fault is named, and a map that cannot be used scores exactly like grey 0.5.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mateval_image::exr_io::{self, Precision};
use mateval_image::{LinearRgb, Picture, png_io};
use serde_json::Value;

use super::command::{baseline, mateval, run, score};
use super::sample::{json, unrendered};

/// `gt` on the shared dataset, for a test to damage.
fn truth(folder: &Path, name: &str) -> PathBuf {
    let submission = folder.join(name);
    run(&mut baseline("gt", unrendered(), &submission)).ends_with(0);
    submission
}

fn base_color(submission: &Path, instance: &str, ending: &str) -> PathBuf {
    submission.join("scenes/room").join(instance).join("base_color").with_extension(ending)
}

/// Scores the submission without LPIPS, which would only take time.
fn scored(submission: &Path) -> Value {
    let out = submission.with_extension("json");
    run(score(submission, unrendered(), &out).env("MATEVAL_CACHE", submission)).ends_with(0);
    json(&out)
}

/// Replaces the map by a grey EXR of the smallest allowed size.
fn make_grey(submission: &Path, instance: &str) {
    std::fs::remove_file(base_color(submission, instance, "png")).unwrap();
    let grey = Picture::filled(64, 64, LinearRgb([0.5; 3]));
    exr_io::write_linear(&base_color(submission, instance, "exr"), &grey, Precision::Float).unwrap();
}

type Fault = (&'static str, &'static str, fn(&Path));

/// An instance, the finding's code, and the change of `gt`.
const FAULTS: [Fault; 7] = [
    ("floor", "missing_map", |root| std::fs::remove_file(base_color(root, "floor", "png")).unwrap()),
    ("rug", "unsound_map", |root| {
        png_io::write_rgb_bytes(&base_color(root, "rug", "png"), &Picture::filled(32, 32, [9; 3])).unwrap();
    }),
    ("sofa", "unsound_map", |root| {
        png_io::write_rgb_bytes(&base_color(root, "sofa", "png"), &Picture::filled(128, 64, [9; 3])).unwrap();
    }),
    ("wall_paper", "ambiguous_map", |root| {
        let grey = Picture::filled(64, 64, LinearRgb([0.1; 3]));
        exr_io::write_linear(&base_color(root, "wall_paper", "exr"), &grey, Precision::Half).unwrap();
    }),
    ("shelf", "unsound_map", |root| {
        let path = base_color(root, "shelf", "png");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
    }),
    ("table", "unsound_map", |root| {
        std::fs::remove_file(base_color(root, "table", "png")).unwrap();
        let nothing = Picture::filled(64, 64, LinearRgb([f32::NAN; 3]));
        exr_io::write_linear(&base_color(root, "table", "exr"), &nothing, Precision::Float).unwrap();
    }),
    ("bowl", "missing_map", |root| std::fs::remove_dir_all(root.join("scenes/room/bowl")).unwrap()),
];

/// All faults in one submission, against another that has grey maps in the same places. That each fault alone is one finding,
/// and has the default of its map, is tested in `mateval_submission::prediction`.
#[test]
fn unusable_maps_score_as_grey() {
    let folder = tempfile::tempdir().unwrap();
    let [whole, damaged, grey] = ["whole", "damaged", "grey"].map(|name| truth(folder.path(), name));
    for (instance, _, damage) in FAULTS {
        damage(&damaged);
        make_grey(&grey, instance);
        // With a missing folder, roughness and metallic are missing too; their defaults show in the light.
        for map in ["roughness.png", "metallic.png"] {
            let file = |submission: &Path| submission.join("scenes/room").join(instance).join(map);
            if !file(&damaged).exists() {
                std::fs::remove_file(file(&grey)).unwrap();
            }
        }
    }
    let [whole, damaged, grey] = [whole, damaged, grey].map(|submission| scored(&submission));
    let codes = |result: &Value| -> BTreeSet<[String; 2]> {
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let file = |finding: &Value| text(&finding["file"]).split('/').nth(2).unwrap().to_owned();
        let findings = result["findings"].as_array().unwrap();
        findings.iter().map(|finding| [file(finding), text(&finding["code"])]).collect()
    };
    assert_eq!(codes(&damaged), FAULTS.map(|(instance, code, _)| [instance, code].map(str::to_owned)).into());
    assert_eq!((codes(&grey), codes(&whole)), (BTreeSet::new(), BTreeSet::new()));
    assert_eq!(damaged["protocols"], grey["protocols"]);
    // The twin: the maps themselves score something else.
    assert_ne!(damaged["protocols"], whole["protocols"]);
}

#[test]
fn findings_are_also_on_stderr() {
    let folder = tempfile::tempdir().unwrap();
    let submission = truth(folder.path(), "gt");
    std::fs::remove_file(base_color(&submission, "floor", "png")).unwrap();
    let run = run(&mut score(&submission, unrendered(), &folder.path().join("RESULT.json"))).ends_with(0);
    run.says("gt: warning [missing_map] 'scenes/room/floor/base_color.png'").says("scored as base colour 0.5");
}

#[test]
fn a_submission_for_another_dataset_is_reported() {
    let folder = tempfile::tempdir().unwrap();
    let submission = truth(folder.path(), "gt");
    super::planted::edit_json(&submission.join("submission.json"), |file| {
        file["dataset_manifest_sha256"] = "0".repeat(64).into();
    });
    assert_eq!(scored(&submission)["findings"][0]["code"], "other_dataset");
}

#[test]
fn inputs_that_cannot_be_scored_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("RESULT.json");
    run(&mut score(folder.path(), unrendered(), &out)).ends_with(2).says("submission.json");
    let submission = truth(folder.path(), "gt");
    let unknown = run(score(&submission, unrendered(), &out).args(["--scene", "kitchen"])).ends_with(2);
    unknown.says("no scene 'kitchen'").says("room");
    let mut command = mateval();
    command.args(["eval", "score", "--protocol", "mine", "--dataset"]).arg(unrendered()).arg("--out").arg(&out);
    run(command.arg(&submission)).ends_with(2).says("no protocol 'mine'");
    assert!(!out.exists());
}
