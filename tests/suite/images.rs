//! `eval image` against the values of scikit-image and lpips in `metrics/expected.json` of the real inputs, which
//! states how they were computed.

use std::path::Path;

use mateval_image::Picture;
use mateval_testkit::{report_missing, shared_data};
use serde_json::Value;

use super::command::{mateval, run};
use super::sample::json;

/// Keys of expected.json, and the path of the same value in the output of `eval image`.
const PLAIN: [(&str, &str); 3] = [("mse", "/mse"), ("psnr", "/psnr"), ("ssim", "/ssim")];
const MASKED: [(&str, &str); 5] = [
    ("masked_mse", "/masked/mse"),
    ("masked_psnr", "/masked/psnr"),
    ("masked_ssim_valid_windows", "/masked/ssim_inside"),
    ("valid_windows", "/masked/ssim_windows"),
    ("blackfill_ssim", "/masked/ssim_black_fill"),
];
/// Keys that are followed by the network's name; each run has one network.
const NETS: [(&str, &str); 2] = [("lpips", "/lpips/0"), ("blackfill_lpips", "/masked/lpips_black_fill/0")];

/// The values of `eval image` for a prediction; none if the weights of LPIPS are missing, which is then printed.
fn values(folder: &Path, prediction: &str, case: &Value, mask: Option<&str>, net: &str) -> Option<Value> {
    let mut command = mateval();
    command.args(["eval", "image", "--format", "json", "--net", net]);
    command.arg(folder.join(prediction)).arg(folder.join(case["reference"].as_str().unwrap()));
    if let Some(mask) = mask {
        command.arg("--mask").arg(folder.join(mask));
    }
    let printed: Value = serde_json::from_str(&run(&mut command).ends_with(0).stdout).unwrap();
    if printed["missing"] != Value::Array(Vec::new()) {
        report_missing(&format!("lpips_{net} of {prediction}: {}", printed["missing"][0]["fix"]));
        return None;
    }
    Some(printed["values"].clone())
}

/// The values of a case that differ from the expected ones, and the number of compared values.
fn compare(found: &Value, case: &Value, net: &str) -> (Vec<String>, usize) {
    let relative = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
    let near = |slack: f64| move |a: f64, b: f64| (a - b).abs() <= slack;
    let (mut wrong, mut count) = (Vec::new(), 0);
    let mut check = |key: &str, found: Option<&Value>, agree: &dyn Fn(f64, f64) -> bool| {
        let Some(expected) = case[key].as_f64() else { return };
        count += 1;
        let found = found.and_then(Value::as_f64);
        if !found.is_some_and(|found| agree(found, expected)) {
            wrong.push(format!("{key}: {found:?}, expected {expected}"));
        }
    };
    for (key, place) in PLAIN.into_iter().chain(MASKED) {
        let found = found.pointer(place);
        if key.contains("ssim") { check(key, found, &near(1e-6)) } else { check(key, found, &relative) }
    }
    for (key, place) in NETS {
        let named = found.pointer(place).filter(|entry| entry["metric"] == format!("lpips_{net}"));
        check(&format!("{key}_{net}"), named.map(|entry| &entry["value"]), &near(2e-5));
    }
    (wrong, count)
}

fn cases() -> Option<(std::path::PathBuf, Vec<Value>)> {
    let file = shared_data("metrics/expected.json")?;
    let cases = json(&file)["cases"].as_array().unwrap().clone();
    assert_eq!(cases.len(), 12);
    Some((file.parent().unwrap().to_owned(), cases))
}

/// All differences over these cases, and the number of compared values.
fn check_cases(folder: &Path, cases: &[Value], net: &str) -> Option<(Vec<String>, usize)> {
    let (mut wrong, mut count) = (Vec::new(), 0);
    for case in cases {
        let prediction = case["prediction"].as_str().unwrap();
        let found = values(folder, prediction, case, case["mask"].as_str(), net)?;
        let (case_wrong, case_count) = compare(&found, case, net);
        wrong.extend(case_wrong.into_iter().map(|text| format!("{prediction}: {text}")));
        count += case_count;
    }
    Some((wrong, count))
}

#[test]
fn every_value_of_the_reference_is_reproduced() {
    let Some((folder, cases)) = cases() else { return };
    let Some((wrong, count)) = check_cases(&folder, &cases, "alex") else { return };
    assert_eq!(wrong, [""; 0]);
    // Ten cases with a mask and ten values each, two without (LPIPS alone).
    assert_eq!(count, 10 * 10 + 2);
}

/// VGG takes seconds a picture here; the crate's own tests check all of its values.
#[test]
fn vgg_is_reproduced() {
    let Some((folder, cases)) = cases() else { return };
    let two = [&cases[0], &cases[10]].map(Value::clone);
    let Some((wrong, count)) = check_cases(&folder, &two, "vgg") else { return };
    assert_eq!(wrong, [""; 0]);
    assert_eq!(count, 10 + 1);
}

/// The twin: with another prediction every value differs, with another mask every masked value.
#[test]
fn another_prediction_or_mask_fails() {
    let Some((folder, cases)) = cases() else { return };
    let (case, other) = (&cases[0], &cases[1]);
    let mask = case["mask"].as_str();
    let Some(swapped) = values(&folder, other["prediction"].as_str().unwrap(), case, mask, "alex") else { return };
    let (wrong, count) = compare(&swapped, case, "alex");
    // The number of windows depends on the mask alone.
    assert_eq!((wrong.len(), count), (9, 10), "{wrong:?}");

    let halved = tempfile::tempdir().unwrap();
    let other_mask = halved.path().join("mask.png");
    let whole = mateval_image::png_io::read_mask(&folder.join(mask.unwrap())).unwrap();
    let half = Picture::from_fn(whole.width(), whole.height(), |x, y| x > whole.width() / 2 && whole.get(x, y));
    mateval_image::png_io::write_mask(&other_mask, &half).unwrap();
    let other_mask = other_mask.to_str();
    let Some(swapped) = values(&folder, case["prediction"].as_str().unwrap(), case, other_mask, "alex") else { return };
    let (wrong, _) = compare(&swapped, case, "alex");
    let plain = |text: &String| PLAIN.iter().any(|(key, _)| text.starts_with(key)) || text.starts_with("lpips");
    assert!(wrong.len() == 6 && !wrong.iter().any(plain), "{wrong:?}");
}

/// Tests without real inputs: a picture equals itself, and pictures of two sizes are refused.
#[test]
fn the_same_picture_twice() {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.png", "b.png"].map(|name| folder.path().join(name));
    for (path, side) in [(&a, 64), (&b, 63)] {
        let picture = Picture::from_fn(side, 64, |x, y| [x as u8, y as u8, 77]);
        mateval_image::png_io::write_rgb_bytes(path, &picture).unwrap();
    }
    let same = run(mateval().args(["eval", "image", "--format", "json"]).args([&a, &a])).ends_with(0);
    let printed: Value = serde_json::from_str(&same.stdout).unwrap();
    let value = |key: &str| printed["values"][key].as_f64().unwrap();
    assert_eq!([value("mse"), value("psnr"), value("ssim")], [0.0, 100.0, 1.0]);
    run(mateval().args(["eval", "image"]).args([&a, &b])).ends_with(2).says("a.png").says("63x64");
}
