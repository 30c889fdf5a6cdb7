//! A hidden split: two trees of one dataset, and a commitment that no other truth matches.

use std::path::Path;

use super::command::{Run, baseline, run, run_words, score, verify};
use super::sample::{copied_dataset, dataset, files_below, manifest};
use mateval_testkit::copy_folder;

fn publish(dataset: &Path, out: &Path) -> Run {
    let (public, private) = (out.join("public"), out.join("private"));
    let words = ["prep", "publish", "--withhold", "ground_truth", "--public"].map(Path::new);
    run_words(words.into_iter().chain([public.as_path(), Path::new("--private"), private.as_path(), dataset]))
}

fn commitment(run: &Run) -> &str {
    run.stdout.lines().find_map(|line| line.strip_prefix("commitment ")).unwrap()
}

#[test]
fn the_two_trees_together_are_the_dataset() {
    let out = tempfile::tempdir().unwrap();
    let published = publish(dataset(), out.path()).ends_with(0);
    let [public, private] = ["public", "private"].map(|name| out.path().join(name));
    let (shown, hidden) = (files_below(&public), files_below(&private));
    let is_truth = |path: &Path| path.components().nth(2).is_some_and(|part| part.as_os_str() == "ground_truth");
    assert!(shown.len() > 20 && !shown.iter().any(|path| is_truth(path)), "{shown:?}");
    assert!(hidden.len() > 20 && hidden.iter().all(|path| is_truth(path)), "{hidden:?}");
    assert_eq!(manifest(&public), manifest(dataset()));
    run(&mut verify(&public)).ends_with(0);
    // The public tree is enough to make submissions.
    let [grey, nn, result] = ["grey", "nn", "grey.json"].map(|name| out.path().join(name));
    run(&mut baseline("grey", &public, &grey)).ends_with(0);
    run(baseline("nn", &public, &nn).args(["--estimate", "input"])).ends_with(0);
    run(&mut score(&grey, &public, &result)).ends_with(2).says("this needs the whole dataset");
    // The commitment can be computed from the public tree.
    let lines = manifest(&public);
    let lines: String =
        lines.lines().filter(|line| line.contains("/ground_truth/")).map(|line| format!("{line}\n")).collect();
    assert_eq!(commitment(&published), mateval_files::untrusted::sha256_of_bytes(lines.as_bytes()));
    copy_folder(&private, &public);
    // What `prep` keeps for itself is not published.
    let whole: Vec<_> = files_below(dataset()).into_iter().filter(|file| !file.starts_with(".build")).collect();
    assert_eq!(files_below(&public), whole);
    for file in whole {
        assert!(
            std::fs::read(public.join(&file)).unwrap() == std::fs::read(dataset().join(&file)).unwrap(),
            "{file:?}"
        );
    }
}

#[test]
fn another_truth_has_another_commitment() {
    let (out, changed) = (tempfile::tempdir().unwrap(), copied_dataset());
    let published = publish(dataset(), &out.path().join("a")).ends_with(0);
    let truth = changed.path().join("scenes/room/ground_truth/lights.json");
    std::fs::write(&truth, std::fs::read_to_string(&truth).unwrap() + " ").unwrap();
    // The files do not match the manifest: nothing is published.
    publish(changed.path(), &out.path().join("b")).ends_with(2).says("changed_file");
    assert!(!out.path().join("b").exists() || files_below(&out.path().join("b")).is_empty());
    mateval_dataset::manifest::write(changed.path()).unwrap();
    let other = publish(changed.path(), &out.path().join("b")).ends_with(0);
    assert_ne!(commitment(&published), commitment(&other));
}

#[test]
fn nothing_is_overwritten_and_the_two_folders_must_differ() {
    let out = tempfile::tempdir().unwrap();
    publish(dataset(), out.path()).ends_with(0);
    publish(dataset(), out.path()).ends_with(2).says("--force");
    let one = out.path().join("one");
    let words = ["prep", "publish", "--withhold", "ground_truth", "--public"].map(Path::new);
    run_words(words.into_iter().chain([one.as_path(), Path::new("--private"), one.as_path(), dataset()]))
        .ends_with(2)
        .says("not be withheld");
    // A public tree has no ground truth to withhold.
    publish(&out.path().join("public"), &out.path().join("again")).ends_with(2);
}
