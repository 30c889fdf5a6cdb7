//! Complete output of short runs: exit code, stdout and stderr.

use super::command::{Run, mateval, run};

/// Runs the command in an empty folder and compares its complete output with the expected one; no file may remain
/// there.
#[track_caller]
fn check(words: &[&str], code: i32, stdout: &str, stderr: &str) {
    let folder = tempfile::tempdir().unwrap();
    let found = run(mateval().current_dir(folder.path()).args(words));
    assert_eq!(found, Run { code: Some(code), stdout: stdout.to_owned(), stderr: stderr.to_owned() }, "{words:?}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "{words:?} left files behind");
}

#[test]
fn the_version() {
    check(&["--version"], 0, concat!("mateval ", env!("CARGO_PKG_VERSION"), "\n"), "");
}

#[test]
fn inputs_that_do_not_exist() {
    let not_there = "No such file or directory (os error 2)";
    let no_dataset = "'nowhere' is not a dataset: the folder does not exist";
    let cases: [(&[&str], &str, &str); 12] = [
        (
            &["prep", "build", "mini.toml", "--out", "out"],
            "cannot build the dataset: cannot read 'mini.toml'",
            not_there,
        ),
        (&["prep", "render", "nowhere"], "cannot render the dataset", no_dataset),
        (&["prep", "compare", "nowhere", "--out", "page"], "cannot compare the dataset's pictures", no_dataset),
        (&["prep", "verify", "nowhere"], "cannot verify 'nowhere'", no_dataset),
        (&["prep", "stats", "nowhere"], "cannot open the dataset", no_dataset),
        (
            &["prep", "export", "nowhere", "--as", "mitsuba", "--scene", "room", "--out", "out"],
            "cannot export to Mitsuba",
            no_dataset,
        ),
        (&["prep", "export", "nowhere", "--as", "tar", "--out", "out"], "cannot export the dataset", no_dataset),
        (&["eval", "image", "a.png", "b.png"], "cannot read 'a.png'", not_there),
        (&["eval", "lint", "grey", "--dataset", "nowhere"], "cannot open the dataset", no_dataset),
        (&["eval", "tables", "RESULT.json"], "cannot read 'RESULT.json'", not_there),
        (&["eval", "leaderboard", "RESULT.json", "--out", "site"], "cannot read 'RESULT.json'", not_there),
        (
            &["eval", "score", "grey", "--dataset", "nowhere", "--out", "RESULT.json"],
            "cannot open the dataset",
            no_dataset,
        ),
    ];
    for (words, tried, found) in cases {
        check(words, 2, "", &format!("error: {tried}: {found}\n"));
    }
}

#[test]
fn unknown_arguments() {
    let error = "error: unrecognized subcommand 'gray'\n\n  tip: a similar subcommand exists: 'grey'\n\n\
                 Usage: mateval baseline <COMMAND>\n\nFor more information, try '--help'.\n";
    check(&["baseline", "gray", "--dataset", "d", "--out", "o"], 2, "", error);
    let error = "error: invalid value '../up' for '--scene <SCENE>': '../up' is not an id: expected 1 to 64 \
                 lower-case letters (a-z), digits, '-' and '_', beginning with a letter or a digit\n\n  \
                 tip: `mateval prep stats DATASET` lists the ids of a dataset's scenes\n\nFor more information, try '--help'.\n";
    check(&["prep", "render", "d", "--scene", "../up"], 2, "", error);
    // Commands without their group, by the tree of commands.
    for (words, tip) in [
        (&["score"][..], "`mateval eval score`"),
        (&["leaderboard", "r.json"], "`mateval eval leaderboard`"),
        (&["verify"], "`mateval prep verify` or `mateval eval verify`"),
        (&["prep", "lint", "--out", "x"], "`mateval eval lint`"),
        (&["eval", "prep"], "`mateval prep`"),
    ] {
        run(mateval().args(words)).ends_with(2).says(&format!("tip: did you mean {tip}?\n"));
    }
}

/// Both end up in files that other programs read.
#[test]
fn names_and_addresses_for_the_hub_are_checked() {
    for (dataset, url, expected) in [
        ("rooms", "https://example.org", "expected OWNER/NAME"),
        ("a/b/c", "https://example.org", "expected OWNER/NAME"),
        ("a/\"b", "https://example.org", "expected OWNER/NAME"),
        ("a/b", "example.org", "begins with https://"),
        // The twin is sound, and there is no result.
        ("a/b", "https://example.org", "cannot read 'r.json'"),
    ] {
        let words = ["eval", "leaderboard", "r.json", "--out", "o", "--hub-dataset", dataset, "--url", url];
        run(mateval().args(words)).ends_with(2).says(expected);
    }
}

/// Memory and time grow with the samples, so a typing error must not ask for a thousand million.
#[test]
fn samples_have_a_bound() {
    for words in [&["demo"][..], &["prep", "render", "d"], &["prep", "compare", "d"]] {
        for samples in ["0", "65537"] {
            let error = format!(
                "error: invalid value '{samples}' for '--samples <SAMPLES>': {samples} is not in 1..=65536\n\n\
                 For more information, try '--help'.\n"
            );
            check(&[words, &["--samples", samples]].concat(), 2, "", &error);
        }
    }
}

#[test]
fn missing_arguments() {
    let error = "error: the following required arguments were not provided:\n  --dataset <DATASET>\n  --out <OUT>\n  \
                 <SUBMISSION>...\n\nUsage: mateval eval score --dataset <DATASET> --out <OUT> <SUBMISSION>...\n\n\
                 For more information, try '--help'.\n";
    check(&["eval", "score"], 2, "", error);
}

/// Every subcommand has a help text.
#[test]
fn every_subcommand_has_help() {
    let subcommands: [&[&str]; 18] = [
        &["demo"],
        &["sample"],
        &["prep"],
        &["prep", "build"],
        &["prep", "survey"],
        &["prep", "render"],
        &["prep", "compare"],
        &["prep", "verify"],
        &["prep", "stats"],
        &["completions"],
        &["prep", "export"],
        &["baseline"],
        &["eval", "image"],
        &["eval", "lint"],
        &["eval", "score"],
        &["eval", "tables"],
        &["eval", "explain"],
        &["eval", "leaderboard"],
    ];
    for words in subcommands {
        let shown = run(mateval().args(words).arg("--help")).ends_with(0);
        let usage = format!("Usage: mateval {}", words.join(" "));
        assert!(shown.stdout.contains(&usage) && shown.stderr.is_empty(), "{words:?}:\n{}", shown.stdout);
    }
    run(mateval().arg("no-such-thing")).ends_with(2).says("unrecognized subcommand 'no-such-thing'");
}

#[test]
fn completions_name_the_commands() {
    for (shell, start) in [("bash", "_mateval()"), ("zsh", "#compdef mateval"), ("fish", "# Print an optspec")] {
        let found = run(mateval().args(["completions", shell]));
        assert_eq!((found.code, found.stderr.as_str()), (Some(0), ""));
        assert!(found.stdout.starts_with(start) && found.stdout.contains("leaderboard"), "{}", found.stdout);
    }
}
