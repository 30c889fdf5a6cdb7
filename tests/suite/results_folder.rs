//! A leaderboard from a folder of results, by the command of the workflow in `dataset_spec/guides/board.yml`.

use std::path::Path;

use super::command::{Run, mateval, run};
use super::sample::json;
use super::scores::{result, scored};

/// The words of the workflow's `mateval` command.
fn words() -> Vec<String> {
    let recipe =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("dataset_spec/guides/board.yml")).unwrap();
    let line = recipe.lines().find_map(|line| line.trim().strip_prefix("- run: mateval ")).unwrap();
    line.split_whitespace().map(str::to_owned).collect()
}

fn run_workflow(folder: &Path) -> Run {
    run(mateval().args(words()).current_dir(folder))
}

fn make_keys(folder: &Path) {
    run(mateval().args(["key", "new", "keeper.key"]).current_dir(folder)).ends_with(0);
}

/// Verifies a result of the folder and signs that.
fn verify(folder: &Path, name: &str, submission: &str) {
    let file = ["json", "JSON"].map(|ending| folder.join("results").join(name).with_extension(ending));
    let mut command = mateval();
    command.args(["eval", "verify", "--sign", "keeper.key", "--submission"]).arg(scored(submission));
    command.arg("--dataset").arg(scored("dataset")).arg(file.iter().find(|file| file.exists()).unwrap());
    command.arg("--out").arg(file[0].with_extension("verified.json")).current_dir(folder);
    run(&mut command).ends_with(0);
}

#[test]
fn the_workflow_builds_the_board_and_refuses_a_changed_result() {
    let folder = tempfile::tempdir().unwrap();
    make_keys(folder.path());
    let results = folder.path().join("results");
    std::fs::create_dir_all(results.join("grey")).unwrap();
    std::fs::copy(result("gt"), results.join("ceiling.json")).unwrap();
    std::fs::copy(result("grey"), results.join("grey/RESULT.json")).unwrap();
    // A ceiling that anybody may have written is none.
    run_workflow(folder.path()).ends_with(2).says("unverified_ceiling");
    verify(folder.path(), "ceiling", "gt");
    let silent = "the page 'About' states no contact, licence, paper or date";
    run_workflow(folder.path()).ends_with(0).says(silent);
    let board = json(&folder.path().join("site/downloads/leaderboard.json"));
    assert_eq!(board["methods"].as_array().unwrap().len(), 1);
    assert_eq!(board["methods"][0]["verified"], "claimed");
    std::fs::rename(results.join("grey/RESULT.json"), results.join("grey.JSON")).unwrap();
    verify(folder.path(), "grey", "grey");
    // What systems leave behind is named, and no obstacle.
    std::fs::create_dir(results.join(".ipynb_checkpoints")).unwrap();
    std::fs::write(results.join("._grey.json"), "x").unwrap();
    std::fs::remove_dir_all(folder.path().join("site")).unwrap();
    std::fs::write(results.join("about.md"), "Contact: keeper@example.org").unwrap();
    let done = run_workflow(folder.path()).ends_with(0).says("skipped 'results/._grey.json'");
    assert!(!done.stderr.contains(silent), "{}", done.stderr);
    let board = json(&folder.path().join("site/downloads/leaderboard.json"));
    assert_eq!(board["methods"][0]["verified"], "confirmed");
    assert_eq!(board["ceiling"]["method"], "gt");

    std::fs::remove_dir_all(folder.path().join("site")).unwrap();
    let mut changed = json(&result("grey"));
    (changed["method"], changed["submission"]["sha256"]) = ("another".into(), "0".repeat(64).into());
    changed["protocols"]["mateval-3"]["fingerprint"] = "another".into();
    std::fs::write(results.join("changed.json"), changed.to_string()).unwrap();
    run_workflow(folder.path()).ends_with(2).says("it was changed");
    assert!(!folder.path().join("site").exists());

    std::fs::remove_dir_all(&results).unwrap();
    std::fs::create_dir(&results).unwrap();
    run_workflow(folder.path()).ends_with(2).says("holds no result");
}

/// A result of the folder with another method's name and submission.
fn changed(place: &Path, method: &str, sha256: &str) {
    let mut result = json(&result("grey"));
    (result["method"], result["submission"]["sha256"]) = (method.into(), sha256.into());
    std::fs::write(place, result.to_string()).unwrap();
}

/// All of the faults are reported at once, each in a line with its file.
#[test]
fn results_that_cannot_share_a_board_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    make_keys(folder.path());
    let results = folder.path().join("results");
    std::fs::create_dir(&results).unwrap();
    for (name, method, sha256) in
        [("a", "one", "1"), ("b", "one", "2"), ("c", "two", "1"), ("d", "safe\u{202e}gpj", "3"), ("e", "", "4")]
    {
        changed(&results.join(name).with_extension("json"), method, sha256);
    }
    std::fs::write(results.join("package.json"), r#"{"name": "board"}"#).unwrap();
    let refused = run_workflow(folder.path()).ends_with(2);
    for (code, file) in [
        ("repeated_name", "b"),
        ("repeated_submission", "c"),
        ("bad_method_name", "d"),
        ("no_method_name", "e"),
        ("unfit_file", "package"),
    ] {
        let line = format!("error [{code}] 'results/{file}.json'");
        assert_eq!(refused.stderr.matches(&line).count(), 1, "{line}: {}", refused.stderr);
    }
    let refused = refused.says("a folder of results holds NAME.json");
    assert!(
        !refused.stderr.contains("mateval prep verify") && !refused.stderr.contains('\u{202e}'),
        "{}",
        refused.stderr
    );
    assert!(!folder.path().join("site").exists());
}

#[test]
fn the_refusal_to_replace_a_foreign_folder_says_once_what_failed() {
    let folder = tempfile::tempdir().unwrap();
    make_keys(folder.path());
    std::fs::create_dir_all(folder.path().join("results")).unwrap();
    std::fs::copy(result("grey"), folder.path().join("results/grey.json")).unwrap();
    std::fs::create_dir(folder.path().join("site")).unwrap();
    std::fs::write(folder.path().join("site/mine.txt"), "mine").unwrap();
    let refused = run_workflow(folder.path()).ends_with(2).says("exists and is not a leaderboard");
    assert_eq!(refused.stderr.matches("cannot write the leaderboard").count(), 1, "{}", refused.stderr);
}
