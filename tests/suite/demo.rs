//! `mateval demo`: its output, and how it resumes.

use std::path::Path;
use std::process::Command;

use super::command::{mateval, run};

fn demo(out: &Path) -> Command {
    let mut command = mateval();
    command.args(["demo", "--renderer", "builtin", "--samples", "1", "--baselines", "gt,grey", "--out"]).arg(out);
    command
}

#[test]
fn it_says_what_it_made_resumes_and_refuses_other_folders() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("demo");
    let first = run(&mut demo(&out)).ends_with(0);
    let steps = first.stderr.lines().filter(|line| line.contains("/6 ")).count();
    assert_eq!(steps, 6, "{}", first.stderr);
    for text in [&first.stderr, &first.stdout] {
        assert!(!text.contains("finding") && !text.contains("error"), "{text}");
    }
    let table = first.stdout.split("The leaderboard").next().unwrap();
    assert!(table.lines().all(|line| line.chars().count() <= 80) && table.contains("gt (ceiling)"), "{table}");

    // As after an interruption: only missing files are made again, with the same bytes.
    let result = out.join("results/grey.json");
    let whole = std::fs::read(&result).unwrap();
    std::fs::remove_file(&result).unwrap();
    std::fs::remove_dir_all(out.join("leaderboard")).unwrap();
    let second = run(&mut demo(&out)).ends_with(0);
    assert!(second.stderr.contains("10 kept"), "{}", second.stderr);
    assert_eq!(second.stdout, first.stdout);
    assert_eq!(std::fs::read(&result).unwrap(), whole);

    // The three commands that it ends with.
    let whole = first.stdout.replace(" \\\n", " ");
    let commands: Vec<&str> = whole.lines().filter(|line| line.starts_with("  mateval ")).collect();
    assert_eq!(commands.len(), 3, "{}", first.stdout);
    for line in commands {
        run(mateval().args(line.split_whitespace().skip(1))).ends_with(0);
    }

    run(mateval().args(["demo", "--renderer", "builtin", "--samples", "2", "--out"]).arg(&out))
        .ends_with(2)
        .says("holds a demo that was run with other options");
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("thesis.tex"), "").unwrap();
    run(demo(&other).arg("--force")).ends_with(2).says("does not hold a demo");
    assert!(other.join("thesis.tex").exists());
}
