//! Only an unchanged result is confirmed: if a digit, texel or constant differs, the reason is reported.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_baselines::bounds;
use mateval_dataset::json;
use mateval_dataset::open::Dataset;
use mateval_eval::protocol::Protocol;
use mateval_eval::result::{RESULT_FORMAT, ResultFile};
use mateval_eval::score::{LpipsWeights, ScorePlan, score};
use mateval_eval::verify::{VerificationFile, VerifyPlan, verify};
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Picture, Wrap, png_io};
use serde_json::Value;

use super::sample::built;
use mateval_testkit::kept_folder;

/// A dataset without renders, so that everything in a protocol is measured within seconds.
struct Scored {
    dataset: Dataset,
    submission: PathBuf,
    result: Value,
}

static SCORED: LazyLock<Scored> = LazyLock::new(|| {
    let dataset = Dataset::open(&built()).unwrap();
    let submission = kept_folder("verify").join("grey");
    bounds::write_grey(&dataset, &submission, false).unwrap();
    let protocols = vec![Protocol::named("mateval-3").unwrap()];
    let plan = ScorePlan::new(&dataset, vec![&submission], protocols, missing(), "test");
    let result = score(&plan, &|_| ()).unwrap().remove(0);
    Scored { submission, result: serde_json::to_value(result).unwrap(), dataset }
});

fn missing() -> LpipsWeights {
    LpipsWeights::Missing { reason: "not asked for".to_owned(), fix: String::new() }
}

fn verified(result: &Value, submission: &Path) -> VerificationFile {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("RESULT.json");
    json::write(&path, result).unwrap();
    let plan = VerifyPlan {
        result: &path,
        submission,
        dataset: &SCORED.dataset,
        lpips: missing(),
        tool: "test".to_owned(),
        jobs: 1,
    };
    verify(plan, &|_| ()).unwrap()
}

/// Code and place of all findings of a result that is not confirmed.
fn refused(result: &Value, submission: &Path) -> Vec<(String, String)> {
    let found = verified(result, submission);
    assert!(!found.confirmed, "{found:?}");
    found.findings.into_iter().map(|finding| (finding.code, finding.place)).collect()
}

fn one(code: &str, place: &str) -> Vec<(String, String)> {
    vec![(code.to_owned(), place.to_owned())]
}

#[test]
fn a_clean_result_is_confirmed() {
    let found = verified(&SCORED.result, &SCORED.submission);
    assert!(found.confirmed && found.findings.is_empty() && found.differences == 0, "{found:?}");
}

#[test]
fn a_changed_digit_is_found() {
    for place in ["/protocols/mateval-3/instances/0/mse", "/protocols/mateval-3/texels/0/observed/area_m2"] {
        let mut changed = SCORED.result.clone();
        let value = changed.pointer_mut(place).unwrap();
        let number = value.as_f64().unwrap();
        *value = f64::from_bits(number.to_bits() + 1).into();
        assert_eq!(refused(&changed, &SCORED.submission), one("differs", place));
    }
}

/// A mean that does not follow from what is below it is refused before anything is computed, with its place.
#[test]
fn a_result_that_contradicts_itself_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("RESULT.json");
    let base = "/protocols/mateval-3";
    for place in ["summary/albedo.input.mse", "scenes/room/albedo.novel.ssim", "pictures/0/values/psnr"] {
        let mut changed = SCORED.result.clone();
        let value = changed.pointer_mut(&format!("{base}/{place}")).unwrap();
        *value = (value.as_f64().unwrap() * 1.25).into();
        json::write(&path, &changed).unwrap();
        let error = ResultFile::read(&path).unwrap_err().to_string();
        let shown = if place.starts_with("pictures") { "/scenes/living/albedo." } else { place };
        assert!(error.contains(base) && error.contains(shown) && error.contains("changed by hand"), "{error}");
        assert!(error.contains("mateval eval score"), "{error}");
    }
    json::write(&path, &SCORED.result).unwrap();
    ResultFile::read(&path).unwrap();
}

#[test]
fn another_constant_is_found() {
    let mut changed = SCORED.result.clone();
    changed["protocols"]["mateval-3"]["protocol"]["light"]["relit"]["least_share"] = 0.03.into();
    let place = "/protocols/mateval-3/protocol/light/relit/least_share";
    assert_eq!(refused(&changed, &SCORED.submission), one("other_protocol", place));
    changed["dataset"]["manifest_sha256"] = "0".into();
    let both = refused(&changed, &SCORED.submission);
    assert_eq!(both, [one("other_dataset", "/dataset/manifest_sha256"), one("other_protocol", place)].concat());
}

#[test]
fn a_result_of_another_version_is_named_as_such() {
    let mut older = SCORED.result.clone();
    older["format"] = "mateval-result/2".into();
    older["protocols"]["mateval-3"]["start_radiance"] = 1.into();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("RESULT.json");
    json::write(&path, &older).unwrap();
    let error = ResultFile::read(&path).unwrap_err().to_string();
    assert!(error.contains("RESULT.json") && error.contains("'mateval-result/2'"), "{error}");
    assert!(error.contains(&format!("'{RESULT_FORMAT}'")), "{error}");
}

#[test]
fn another_texel_is_found() {
    let changed = tempfile::tempdir().unwrap();
    let submission = changed.path().join("grey");
    bounds::write_grey(&SCORED.dataset, &submission, false).unwrap();
    // The twin: a copy is the same submission.
    assert!(verified(&SCORED.result, &submission).confirmed);
    let scene = submission.join("scenes/room");
    let instance = std::fs::read_dir(&scene).unwrap().map(|entry| entry.unwrap().path()).min().unwrap();
    let path = instance.join("base_color.png");
    let texture = read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap();
    let byte = |v: f32| (v * 255.0).round() as u8;
    let mut texels = Picture::from_fn(texture.width(), texture.height(), |x, y| texture.texel(x, y).map(byte));
    texels.set(0, 0, [7, 8, 9]);
    png_io::write_rgb_bytes(&path, &texels).unwrap();
    assert_eq!(refused(&SCORED.result, &submission), one("other_submission", "/submission/sha256"));
}
