//! The README's numbers against a run.

use super::command::{build, run, run_words};

/// The demo's dataset at its own size; renders change no albedo score and are left out.
#[test]
fn its_table_is_what_the_demo_prints() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    run_words([std::path::Path::new("sample"), &path("source")]).ends_with(0);
    run(&mut build(&path("source/recipe.toml"), &path("dataset"))).ends_with(0);
    let readme = include_str!("../../README.md");
    for method in ["gt", "nn", "grey"] {
        let (submission, result) = (path(method), path(&format!("{method}.json")));
        let words = ["baseline", method, "--dataset"].map(std::path::PathBuf::from);
        run_words(words.into_iter().chain([path("dataset"), "--out".into(), submission.clone()])).ends_with(0);
        let words = ["eval".into(), "score".into(), submission, "--dataset".into(), path("dataset"), "--out".into()];
        run_words(words.into_iter().chain([result.clone()])).ends_with(0);
        let row = readme_row(method, &std::fs::read_to_string(result).unwrap());
        assert!(readme.contains(&row), "README.md lacks '{row}'");
        // A number that is off in its last digit would be noticed.
        let wrong = row.replace(['4', '6', '8'], "5");
        assert!(wrong != row && !readme.contains(&wrong), "{wrong}");
    }
}

/// The end of the method's row in the README.
fn readme_row(method: &str, result: &str) -> String {
    let result: serde_json::Value = serde_json::from_str(result).unwrap();
    let summary = &result["protocols"]["mateval-1"]["summary"];
    let [input, novel] = ["albedo.input.psnr", "albedo.novel.psnr"].map(|key| summary[key].as_f64().unwrap());
    let what = match method {
        "gt" => "the ceiling",
        "nn" => "by nearest neighbours",
        _ => "the floor",
    };
    format!("{what}) | {input:.2} | {novel:.2} |")
}
