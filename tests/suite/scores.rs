//! `eval score` on the sample: the truth scores high, grey scores its pinned values, tables separate results
//! that cannot be compared, and missing metrics are reported.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::LazyLock;

use mateval_image::transfer::linear_from_srgb_byte;
use mateval_image::{exr_io, png_io};
use mateval_testkit::report_missing;
use serde_json::Value;

use super::command::{Run, baseline, build, mateval, run, score, score_under};
use super::sample::{json, write_source};
use mateval_testkit::kept_folder;

struct Scored {
    /// Holds `dataset` (160x120 pixels, so that the unobserved strips hold whole SSIM windows; atlas sizes chosen by
    /// the tool), `gt.json` and `grey.json`, all without LPIPS so that the numbers are the same everywhere.
    folder: PathBuf,
    /// How `grey` was scored.
    run_of_grey: Run,
}

static SCORED: LazyLock<Scored> = LazyLock::new(|| {
    let folder = kept_folder("scores");
    let dataset = folder.join("dataset");
    let recipe = write_source(&folder.join("source"), "resolution = [160, 120]", &["room"]);
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let scored = |name: &str| {
        let submission = folder.join(name);
        run(&mut baseline(name, &dataset, &submission)).ends_with(0);
        let mut command = score(&submission, &dataset, &submission.with_extension("json"));
        run(command.env("MATEVAL_CACHE", submission.join("no-such-folder"))).ends_with(0)
    };
    scored("gt");
    let run_of_grey = scored("grey");
    Scored { folder, run_of_grey }
});

/// The dataset, or the submission `grey` or `gt`.
pub fn scored(name: &str) -> PathBuf {
    SCORED.folder.join(name)
}

/// The result of `grey` or `gt`.
pub fn result(method: &str) -> PathBuf {
    scored(method).with_extension("json")
}

fn summary(method: &str, protocol: &str) -> Value {
    json(&result(method))["protocols"][protocol]["summary"].clone()
}

fn value(summary: &Value, key: &str) -> f64 {
    summary[key].as_f64().unwrap_or_else(|| panic!("no {key} in {summary}"))
}

/// The scores of grey under `mateval-3` and under `paper`, which `tests/independent/grey_scores.py` wrote (scikit-image, no
/// code of this project): the prediction is a picture of the one colour that sRGB byte 188 stands for.
fn pinned() -> BTreeMap<String, [f64; 2]> {
    serde_json::from_str(include_str!("../independent/grey_scores.json")).unwrap()
}

/// Keys whose value differs from the pinned one by more than a millionth.
fn off_grey(method: &str) -> Vec<String> {
    let summaries = ["mateval-3", "paper"].map(|protocol| summary(method, protocol));
    let mut off = Vec::new();
    for (key, pinned) in pinned() {
        for (summary, expected) in summaries.iter().zip(pinned) {
            let found = value(summary, &key);
            if (found - expected).abs() > 1e-6 * expected {
                off.push(format!("{key}: {found}, expected {expected}"));
            }
        }
    }
    off
}

#[test]
fn grey_scores_its_pinned_values() {
    assert_eq!(off_grey("grey"), [""; 0]);
    let pinned = pinned().len();
    for protocol in ["mateval-3", "paper"] {
        let grey = summary("grey", protocol);
        let is_whole = |key: &&String| key.starts_with("albedo") && !key.contains("_specular");
        assert_eq!(grey.as_object().unwrap().keys().filter(is_whole).count(), pinned, "a key is not pinned");
    }
    // The twin: the truth has none of these scores.
    assert_eq!(off_grey("gt").len(), 2 * pinned);
}

/// Computes the error of a picture of one colour from the files alone.
#[test]
fn greys_error_is_that_of_one_colour() {
    let room = scored("dataset/scenes/room");
    let albedo = exr_io::read_linear(&room.join("ground_truth/views/input/albedo.exr")).unwrap();
    let valid = png_io::read_mask(&room.join("views/input/valid.png")).unwrap();
    let error_of = |byte: u8| {
        let grey = f64::from(linear_from_srgb_byte(byte));
        let pixels = albedo.pixels().iter().zip(valid.pixels()).filter(|(_, counts)| **counts);
        let errors: Vec<f64> = pixels.flat_map(|(rgb, _)| rgb.0.map(|v| (f64::from(v) - grey).powi(2))).collect();
        errors.iter().sum::<f64>() / errors.len() as f64
    };
    let found = value(&summary("grey", "mateval-3"), "albedo.input.mse");
    assert!((found - error_of(188)).abs() < 1e-6 * found, "{found}, expected {}", error_of(188));
    assert!((found - error_of(187)).abs() > 1e-4 * found);
}

#[test]
fn the_truth_is_far_above_grey() {
    for protocol in ["mateval-3", "paper"] {
        let [gt, grey] = ["gt", "grey"].map(|method| summary(method, protocol));
        for views in ["input", "novel", "unobserved"] {
            let [raw, aligned] = ["albedo", "albedo_aligned"].map(|p| value(&gt, &format!("{p}.{views}.psnr")));
            assert!(raw >= 38.0, "{protocol} {views}: {raw} dB");
            assert!((raw - aligned).abs() < 0.1, "{protocol} {views}: {raw} dB raw, {aligned} dB aligned");
            assert!(value(&grey, &format!("albedo.{views}.psnr")) < raw - 25.0);
            if views != "unobserved" {
                assert!(value(&grey, &format!("albedo.{views}.ssim")) < value(&gt, &format!("albedo.{views}.ssim")));
            }
        }
    }
}

#[test]
fn tables_show_both_and_refuse_other_fingerprints() {
    let shown = run(mateval().args(["eval", "tables"]).args([result("gt"), result("grey")])).ends_with(0);
    let albedo = shown.stdout.split("### Albedo, input view").nth(1).unwrap();
    // Without weights no result has LPIPS, so there is no column for it.
    assert!(!albedo.contains("missing"), "{albedo}");
    let row = albedo.lines().find(|line| line.starts_with("| grey")).unwrap();
    assert!(row.starts_with("| grey | <u>121.930</u> | <u>9.14</u> | <u>0.2931</u> | "), "{row}");
    let row = albedo.lines().find(|line| line.starts_with("| gt")).unwrap();
    assert!(row.starts_with("| gt | **0.0"), "{row}");

    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("other.json");
    let mut changed = json(&result("grey"));
    changed["protocols"]["mateval-3"]["fingerprint"] = "another".into();
    std::fs::write(&other, changed.to_string()).unwrap();
    let refused = run(mateval().args(["eval", "tables"]).args([&result("gt"), &other])).ends_with(2);
    assert_eq!(refused.stdout, "");
    refused.says("different fingerprints").says("score both again");
    run(mateval().args(["eval", "tables"]).arg(other)).ends_with(0);
}

/// The last line of stderr, for whoever sizes a queue; the result states no time.
#[test]
fn scoring_states_what_it_cost() {
    let line = SCORED.run_of_grey.stderr.lines().last().unwrap();
    let start = "1 submission scored on 1 scene in ";
    assert!(line.starts_with(start) && line.contains(" s for the slowest, 'room'; "), "{line}");
    assert!(line.ends_with(" s of processor time"), "{line}");
    // Processor time is measured in hundredths of a second.
    let numbers = line.split_whitespace().filter_map(|word| word.parse::<f64>().ok()).collect::<Vec<_>>();
    let [_, _, wall, per_scene, slowest, processor] = numbers[..] else { panic!("{line}") };
    assert!(wall > 0.0 && per_scene == wall && slowest <= wall && processor > 0.0, "{line}");
}

#[test]
fn lpips_without_weights_is_missing_and_names_the_fix() {
    const FIX: &str = "mateval fetch lpips";
    SCORED.run_of_grey.clone().says("lpips_alex is missing").says(FIX);
    let out = result("grey");
    let result = json(&out);
    assert_eq!(result["missing"][0]["metric"], "lpips_alex");
    assert_eq!(result["missing"][0]["fix"], FIX);
    assert_eq!(result["lpips_weights"], serde_json::json!({ "alex": null }));
    for protocol in ["mateval-3", "paper"] {
        let summary = result["protocols"][protocol]["summary"].as_object().unwrap();
        assert!(!summary.keys().any(|key| key.contains("lpips")));
    }
    // The tables report it too.
    run(mateval().args(["eval", "tables"]).arg(&out)).ends_with(0).says(FIX);
}

/// The twin of the test above: with the weights, the distance exists and the fingerprint differs.
#[test]
fn lpips_with_weights_is_scored() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("RESULT.json");
    run(&mut score_under(&["mateval-3"], &scored("grey"), &scored("dataset"), &out)).ends_with(0);
    let result = json(&out);
    let missing = result["missing"].as_array().unwrap();
    if let Some(lpips) = missing.iter().find(|missing| missing["metric"] == "lpips_alex") {
        report_missing(lpips["reason"].as_str().unwrap());
        return;
    }
    let ours = &result["protocols"]["mateval-3"];
    for key in ["albedo.input.lpips_alex", "albedo_aligned.novel.lpips_alex", "albedo.novel.lpips_alex"] {
        let distance = value(&ours["summary"], key);
        assert!(distance > 0.05 && distance < 2.0, "{key} {distance}");
    }
    // Single values are stored in steps of a millionth.
    let pictures = ours["pictures"].as_array().unwrap();
    let distances: Vec<f64> = pictures.iter().filter_map(|picture| picture["values"]["lpips_alex"].as_f64()).collect();
    assert!(
        distances.len() >= 10
            && distances.iter().all(|value| (value * 1e6).fract().min(1.0 - (value * 1e6).fract()) < 1e-6)
    );
    let without = json(&self::result("grey"));
    assert_ne!(ours["fingerprint"], without["protocols"]["mateval-3"]["fingerprint"]);
    let refused = run(mateval().args(["eval", "tables"]).args([&out, &self::result("gt")]));
    refused.ends_with(2).says("different fingerprints");
}
