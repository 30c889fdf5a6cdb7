//! A disk that is full or refuses writes: exit code 2, the path and the reason, and no half-written file in the place
//! of a finished one. A limit on file sizes (`ulimit -f`) stands in for the disk, because writes beyond it fail
//! likewise.

use std::path::Path;
use std::process::{Command, Stdio};

use super::command::{Run, baseline, build, mateval, render, run, score, verify};
use super::sample::{SMALL, copied_dataset, dataset, files_below, manifest, unrendered, write_source};

/// Runs the command with every file limited to this number of blocks of 512 bytes. The signal for a larger file is
/// ignored, so that the write fails instead.
fn limited(blocks: usize, command: &Command) -> Run {
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f \"$0\" && exec \"$@\"", &blocks.to_string()]);
    shell.arg(command.get_program()).args(command.get_args()).stdin(Stdio::null());
    run(&mut shell)
}

/// Partial files below the folder, hidden ones included. A failed write must leave none.
fn partial_files(root: &Path) -> Vec<String> {
    let names = files_below(root).into_iter().map(|file| file.display().to_string());
    names.filter(|name| name.ends_with(".partial")).collect()
}

#[test]
fn a_build_fails_cleanly_and_resumes_when_the_disk_has_space() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
    let whole = folder.path().join("whole");
    run(&mut build(&recipe, &whole)).ends_with(0);
    let out = folder.path().join("dataset");
    for blocks in [0, 1, 8, 40] {
        let failed = limited(blocks, &build(&recipe, &out)).ends_with(2);
        assert!(failed.error().contains("cannot write '") && failed.error().contains("dataset"), "{}", failed.stderr);
        assert_eq!(failed.stdout, "");
        assert!(!out.join("dataset.json").exists() && !out.join("MANIFEST.sha256").exists());
        assert_eq!(partial_files(folder.path()), [""; 0]);
        run(&mut verify(&out)).ends_with(2);
    }
    run(&mut build(&recipe, &out)).ends_with(0);
    assert!(manifest(&out) == manifest(&whole));
    // The twin: under a sufficient limit it succeeds.
    assert_eq!(limited(1 << 20, &build(&recipe, &folder.path().join("roomy"))).code, Some(0));
}

#[test]
fn a_render_fails_cleanly_and_resumes() {
    let copy = copied_dataset();
    std::fs::remove_dir_all(copy.path().join("scenes/room/ground_truth/renders/builtin")).unwrap();
    // Enough for the list of the scene's files, which is kept first.
    let failed = limited(140, &render(copy.path(), 1)).ends_with(2);
    assert!(failed.error().contains("cannot write '") && failed.error().contains("rgb"), "{}", failed.stderr);
    assert_eq!(partial_files(copy.path()), [""; 0]);
    run(&mut render(copy.path(), 1)).ends_with(0);
    assert!(manifest(copy.path()) == manifest(dataset()));
}

#[test]
fn submissions_and_results_are_complete_or_absent() {
    let folder = tempfile::tempdir().unwrap();
    let (submission, result) = (folder.path().join("gt"), folder.path().join("RESULT.json"));
    let failed = limited(0, &baseline("gt", unrendered(), &submission)).ends_with(2);
    assert!(failed.error().contains("base_color.png"), "{}", failed.stderr);
    assert!(!submission.exists());
    run(&mut baseline("gt", unrendered(), &submission)).ends_with(0);
    let failed = limited(2, &score(&submission, unrendered(), &result)).ends_with(2);
    assert!(failed.error().contains("RESULT.json"), "{}", failed.stderr);
    assert!(!result.exists());
    assert_eq!(partial_files(folder.path()), [""; 0]);
}

/// Nobody can write to a path below a file, not even root.
#[test]
fn a_place_that_cannot_be_written_to() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
    let file = folder.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let below = file.join("out");
    let mut sample = mateval();
    sample.arg("sample").arg(&below);
    let mut demo = mateval();
    demo.args(["demo", "--renderer", "builtin", "--out"]).arg(&below);
    for mut command in [build(&recipe, &below), baseline("grey", dataset(), &below), sample, demo] {
        let failed = run(&mut command).ends_with(2);
        assert!(failed.error().contains("file/"), "{}", failed.stderr);
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
}

/// A result that cannot be printed is an error; a reader that has closed the pipe is not.
#[test]
fn a_full_stdout() {
    let words = ["eval", "image", "--format", "json"];
    let picture = dataset().join("scenes/room/views/input/rgb.png");
    let command = || {
        let mut command = mateval();
        command.args(words).arg(&picture).arg(&picture);
        command
    };
    let full = || std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let help = |words: &[&str]| {
        let mut command = mateval();
        command.args(words);
        command
    };
    for mut command in [command(), help(&["--help"]), help(&["--version"]), help(&["eval", "score", "--help"])] {
        let child = command.stdout(full()).stderr(Stdio::piped()).spawn().unwrap();
        let failed = Run::of(child.wait_with_output().unwrap()).ends_with(2);
        assert!(failed.error().starts_with("error: cannot write to stdout: "), "{command:?}: {}", failed.stderr);

        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let closed = Run::of(child.wait_with_output().unwrap()).ends_with(0);
        assert_eq!(closed.stderr, "", "{command:?}");
    }
}
