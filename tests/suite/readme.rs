//! Checks the README's numbers against a run.

use super::command::{build, mateval, run, run_words};

/// Uses the demo's dataset at its own size, without renders, which do not affect albedo scores.
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
        // Without the weights of LPIPS, whose values the table does not show and which take most of the time.
        run(mateval().args(words.into_iter().chain([result.clone()])).env("MATEVAL_CACHE", path("no-such-folder")))
            .ends_with(0);
        let result: serde_json::Value = serde_json::from_slice(&std::fs::read(result).unwrap()).unwrap();
        let row = readme_row(method, &result);
        assert!(readme.contains(&row), "README.md lacks '{row}'");
        // The twin: a result that differs by a hundredth has another row, which the README does not contain.
        let mut wrong = result;
        let summary = &mut wrong["protocols"]["mateval-1"]["summary"];
        summary["albedo.novel.psnr"] = (summary["albedo.novel.psnr"].as_f64().unwrap() + 0.01).into();
        assert!(!readme.contains(&readme_row(method, &wrong)), "the row does not depend on the result");
    }
}

/// The end of the method's row in the README.
fn readme_row(method: &str, result: &serde_json::Value) -> String {
    let summary = &result["protocols"]["mateval-1"]["summary"];
    let [input, novel] = ["albedo.input.psnr", "albedo.novel.psnr"].map(|key| summary[key].as_f64().unwrap());
    let what = match method {
        "gt" => "the ceiling",
        "nn" => "by nearest neighbours",
        _ => "the floor",
    };
    format!("{what}) | {input:.2} | {novel:.2} |")
}
