//! `mateval demo`: its output, and how it resumes.

use std::path::Path;
use std::process::Command;

use mateval_testkit::copy_folder;

use super::command::{mateval, run};
use super::resume::kill_when;

/// Of the truth alone, whose score traces no path. `tools/test_demo.sh` runs the whole demo, with a ceiling.
fn demo(out: &Path) -> Command {
    let mut command = mateval();
    command.args(["demo", "--renderer", "builtin", "--samples", "1", "--baselines", "gt", "--out"]).arg(out);
    command
}

/// Whether a picture of an input view has been begun.
fn is_rendering(out: &Path) -> bool {
    let scenes = std::fs::read_dir(out.join("dataset/scenes")).into_iter().flatten().flatten();
    scenes.map(|scene| scene.path()).any(|scene| scene.join("ground_truth/renders/builtin/input/rgb_a.exr").is_file())
}

#[test]
fn it_says_what_it_made_resumes_and_refuses_other_folders() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("my demo");
    kill_when(&mut demo(&out), || is_rendering(&out));
    let first = run(&mut demo(&out)).ends_with(0);
    let steps = first.stderr.lines().filter(|line| line.contains("/6 ")).count();
    assert_eq!(steps, 6, "{}", first.stderr);
    for text in [&first.stderr, &first.stdout] {
        assert!(!text.contains("finding") && !text.contains("error"), "{text}");
    }
    let table = first.stdout.split("The leaderboard").next().unwrap();
    assert!(table.lines().all(|line| line.chars().count() <= 80) && table.contains("gt"), "{table}");

    // The board has the light that the score compared, which is the truth's.
    let picture = |method: &str, kind: &str| {
        std::fs::read(out.join("leaderboard/pictures").join(method).join("room/input").join(kind)).unwrap()
    };
    assert_eq!(picture("gt", "rgb_true.png"), picture("_truth", "rgb_true.png"));
    assert_ne!(picture("gt", "rgb_true.png"), picture("gt", "rgb_true-error.png"));

    // As after an interruption: only missing files are made again, with the same bytes. The truth's result takes a
    // moment, since no path is traced for it.
    let result = out.join("results/gt.json");
    let whole = std::fs::read(&result).unwrap();
    std::fs::remove_file(&result).unwrap();
    std::fs::remove_dir_all(out.join("leaderboard")).unwrap();
    let second = run(&mut demo(&out)).ends_with(0);
    assert!(second.stderr.contains("10 kept"), "{}", second.stderr);
    assert_eq!(second.stdout, first.stdout);
    assert_eq!(std::fs::read(&result).unwrap(), whole);

    // The three commands that it ends with, pasted into a shell.
    let (_, commands) = first.stdout.split_once("on a board:\n\n").unwrap();
    assert_eq!(commands.lines().filter(|line| line.starts_with("  mateval ")).count(), 3, "{commands}");
    let program = mateval().get_program().to_owned();
    let paste = |commands: &str| {
        let mut shell = Command::new("sh");
        shell.args(["-euc", &format!("mateval() {{ \"$0\" \"$@\"; }}\n{commands}")]).arg(&program);
        run(&mut shell).ends_with(0);
    };
    let (make, score_and_rank) = commands.split_at(commands.find("  mateval eval score").unwrap());
    paste(make);
    // With the truth's maps in place of the baseline's, since scoring other maps traces paths for minutes.
    let [made, truth] = ["median-photo", "gt"].map(|name| out.join("submissions").join(name).join("scenes"));
    std::fs::remove_dir_all(&made).unwrap();
    copy_folder(&truth, &made);
    paste(score_and_rank);

    run(mateval().args(["demo", "--renderer", "builtin", "--samples", "2", "--out"]).arg(&out))
        .ends_with(2)
        .says("holds a demo that was run with other options");
    std::fs::write(out.join("demo.json"), "{").unwrap();
    run(&mut demo(&out)).ends_with(2).says("does not hold a demo").says("demo.json");
    let other = folder.path().join("other");
    std::fs::create_dir(&other).unwrap();
    std::fs::write(other.join("thesis.tex"), "").unwrap();
    run(demo(&other).arg("--force")).ends_with(2).says("does not hold a demo");
    assert!(other.join("thesis.tex").exists());
}

/// Without such a choice, a demo falls back to the built-in renderer.
#[test]
fn a_blender_that_is_named_must_be_usable() {
    let folder = tempfile::tempdir().unwrap();
    let (out, absent) = (folder.path().join("demo"), folder.path().join("no/blender"));
    let mut by_option = mateval();
    by_option.args(["demo", "--out"]).arg(&out).arg("--blender").arg(&absent);
    let mut by_variable = mateval();
    by_variable.args(["demo", "--out"]).arg(&out).env("MATEVAL_BLENDER", &absent);
    for (command, origin) in [(&mut by_option, "--blender"), (&mut by_variable, "MATEVAL_BLENDER")] {
        run(command).ends_with(2).says(&format!("error: {origin} is '{}', which does not exist", absent.display()));
    }
    assert!(!out.exists());
}
