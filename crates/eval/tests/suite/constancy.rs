//! Constancy on the sample's twins: the truth is constant, the photo is not, its de-lit picture is more constant, and
//! grey or a paler copy gain nothing.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_baselines::bounds;
use mateval_baselines::delight::CandidateLights;
use mateval_baselines::estimate_source::EstimateSource;
use mateval_baselines::nn::{self, NnOptions};
use mateval_dataset::lighting::LightingName;
use mateval_eval::protocol::Protocol;
use mateval_eval::result::{Constancy, ResultFile};
use mateval_eval::score::{LpipsWeights, ScorePlan};
use mateval_image::transfer::{byte_from_unit, linear_from_srgb, srgb_from_linear};
use mateval_image::{LUMINANCE, png_io};
use mateval_testkit::sample_dataset::twins;
use mateval_testkit::{copy_folder, kept_folder};

use super::sample::{plan, scored};

/// `mateval-3` without light, which says nothing about constancy.
fn unlit() -> Protocol {
    let mut protocol = Protocol::named("mateval-3").unwrap();
    protocol.light.tracks.clear();
    protocol
}

fn results(submissions: &[&Path]) -> Vec<ResultFile> {
    let lpips = LpipsWeights::Missing { reason: "not asked for".to_owned(), fix: String::new() };
    scored(&ScorePlan::new(twins(), submissions.to_vec(), vec![unlit()], lpips, "test"))
}

/// Folders of the submissions by name.
static SUBMISSIONS: LazyLock<BTreeMap<&str, PathBuf>> = LazyLock::new(|| {
    let folder = kept_folder("constancy");
    let lifted = |name: &str, estimate: EstimateSource| {
        nn::write(twins(), &folder.join(name), false, &estimate, &NnOptions::default(), &|_| ()).unwrap();
    };
    bounds::write_truth(twins(), &folder.join("gt"), false).unwrap();
    bounds::write_grey(twins(), &folder.join("grey"), false).unwrap();
    lifted("photo", EstimateSource::Input);
    lifted("delight", EstimateSource::Delight(CandidateLights::Room));
    for (name, keep) in [("pale", 0.3), ("colourless", 0.0)] {
        copy_folder(&folder.join("photo"), &folder.join(name));
        desaturate(&folder.join(name), keep);
    }
    ["gt", "grey", "photo", "delight", "pale", "colourless"].map(|name| (name, folder.join(name))).into()
});

static SCORED: LazyLock<BTreeMap<&str, ResultFile>> = LazyLock::new(|| {
    let paths: Vec<&Path> = SUBMISSIONS.values().map(PathBuf::as_path).collect();
    SUBMISSIONS.keys().copied().zip(results(&paths)).collect()
});

/// Keeps this share of the colour of every base colour below `folder`, and its luminance.
fn desaturate(folder: &Path, keep: f32) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            desaturate(&path, keep);
        } else if path.file_name().is_some_and(|name| name == "base_color.png") {
            let pale = png_io::read_rgb_bytes(&path).unwrap().map(|bytes| {
                let linear = bytes.map(|byte| linear_from_srgb(f32::from(byte) / 255.0));
                let luminance: f64 = (0..3).map(|c| LUMINANCE[c] * f64::from(linear[c])).sum();
                linear.map(|v| byte_from_unit(srgb_from_linear(luminance as f32 + keep * (v - luminance as f32))))
            });
            png_io::write_rgb_bytes(&path, &pale).unwrap();
        }
    }
}

fn families(name: &str) -> &'static [Constancy] {
    &SCORED[name].constancy
}

#[test]
fn the_truth_is_constant_and_grey_has_no_contrast() {
    let expected = [LightingName::WarmCool, LightingName::Alone(1), LightingName::Alone(2)];
    for family in families("gt") {
        assert_eq!(family.lightings, expected);
        for deviation in [&family.raw, &family.aligned] {
            assert_eq!((deviation.linear, deviation.delta_e, deviation.relative), (0.0, 0.0, Some(0.0)));
        }
        assert_eq!((family.mean_mse, family.mean_delta_e), (0.0, 0.0));
        assert!(family.area_m2 > 1.0);
    }
    for family in families("grey") {
        assert_eq!((family.raw.linear, family.raw.relative, family.aligned.relative), (0.0, None, None));
        assert!(family.mean_mse > 0.01);
    }
    assert_eq!((families("gt").len(), families("grey").len()), (2, 2));
}

/// In each scene, by CIEDE2000 and relative to contrast. The linear deviation alone does not say so: the photo is dark.
#[test]
fn the_photo_is_worst_and_its_delit_picture_in_between() {
    for (photo, delight) in families("photo").iter().zip(families("delight")) {
        for (photo, delight) in [(&photo.raw, &delight.raw), (&photo.aligned, &delight.aligned)] {
            assert!(0.0 < delight.delta_e && delight.delta_e < photo.delta_e, "{delight:?} {photo:?}");
            assert!(delight.relative.unwrap() < photo.relative.unwrap(), "{delight:?} {photo:?}");
        }
        assert!(delight.mean_mse < photo.mean_mse);
    }
    assert_eq!(families("delight").len(), 2);
}

/// A copy of three tenths of the colour deviates less, and no less relative to its contrast; one of none has no value.
#[test]
fn a_paler_copy_gains_nothing() {
    for (photo, pale) in families("photo").iter().zip(families("pale")) {
        assert!(pale.raw.chroma.deviation < 0.5 * photo.raw.chroma.deviation, "the unguarded number falls");
        let [photo, pale] = [photo, pale].map(|family| family.raw.relative.unwrap());
        // Bytes round the colours of the copy more coarsely.
        assert!((pale / photo - 1.0).abs() < 0.03, "{pale} {photo}");
    }
    assert!(families("colourless").iter().all(|family| family.raw.relative.is_none() && family.raw.linear > 0.0));
}

/// Twins are no scenes of the ordinary numbers, and these are what they are without twins.
#[test]
fn ordinary_numbers_know_no_twins() {
    let result = &SCORED["photo"];
    let scenes: Vec<&str> = result.dataset.scenes.iter().map(|scene| scene.as_str()).collect();
    assert_eq!((scenes, result.dataset.total_scenes), (vec!["living", "room"], 2));
    let plain = scored(&plan(&[&SUBMISSIONS["photo"]], &unlit(), &[])).remove(0);
    assert!(plain.constancy.is_empty());
    let [with, without] = [result, &plain].map(|result| &result.protocols["mateval-3"]);
    assert_eq!((&with.summary, &with.pictures, &with.texels), (&without.summary, &without.pictures, &without.texels));
    assert_ne!(with.fingerprint, without.fingerprint, "another dataset");
}

/// A submission without one of the twins is scored without constancy in that scene, and a note says so.
#[test]
fn a_missing_twin_is_stated() {
    let folder = tempfile::tempdir().unwrap();
    let submission = folder.path().join("partial");
    copy_folder(&SUBMISSIONS["gt"], &submission);
    std::fs::remove_dir_all(submission.join("scenes/room--alone_1")).unwrap();
    let result = results(&[&submission]).remove(0);
    let known: Vec<&str> = result.constancy.iter().map(|family| family.scene.as_str()).collect();
    assert_eq!(known, ["living"]);
    let notes: Vec<&str> =
        result.findings.iter().filter(|f| f.code == "twin_not_predicted").map(|f| &*f.file).collect();
    assert_eq!(notes, ["scenes/room--alone_1"]);
    assert!(SCORED["gt"].findings.iter().all(|finding| finding.code != "twin_not_predicted"));
    assert_ne!(result.submission.sha256, SCORED["gt"].submission.sha256, "twins belong to the hash");
}

/// Threads change no bit, the cache gives the same numbers, and a relative number that was changed by hand is refused.
#[test]
fn constancy_is_reproduced_and_checked() {
    let folder = tempfile::tempdir().unwrap();
    let lpips = || LpipsWeights::Missing { reason: "not asked for".to_owned(), fix: String::new() };
    let paths = || vec![SUBMISSIONS["photo"].as_path()];
    let plan = |only_cached| ScorePlan {
        cache: Some(folder.path()),
        only_cached,
        ..ScorePlan::new(twins(), paths(), vec![unlit()], lpips(), "test")
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let first = pool.install(|| scored(&plan(false))).remove(0);
    assert_eq!(first.constancy, SCORED["photo"].constancy);
    assert_eq!(scored(&plan(true)).remove(0).constancy, first.constancy);

    let path = folder.path().join("RESULT.json");
    mateval_dataset::json::write(&path, &first).unwrap();
    assert_eq!(ResultFile::read(&path).unwrap().constancy, first.constancy);
    let mut changed = first;
    changed.constancy[1].raw.relative = Some(0.001);
    mateval_dataset::json::write(&path, &changed).unwrap();
    let error = ResultFile::read(&path).unwrap_err().to_string();
    assert!(error.contains("/constancy/1/raw/relative"), "{error}");
}
