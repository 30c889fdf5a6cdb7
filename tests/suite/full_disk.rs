//! A disk that is full or refuses: exit code 2, the path and the reason, and nothing half-written at a finished file's
//! place. A limit on file sizes (`ulimit -f`) stands for the disk: writes beyond it fail just the same.

use std::path::Path;
use std::process::{Command, Stdio};

use super::command::{Run, baseline, build, mateval, render, run, score, verify};
use super::sample::{SMALL, copied_dataset, dataset, files_below, manifest, write_source};

/// The command with every file limited to so many blocks of 512 bytes; the signal that would tell is ignored, so that the
/// write fails.
fn limited(blocks: usize, command: &Command) -> Run {
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f \"$0\" && exec \"$@\"", &blocks.to_string()]);
    shell.arg(command.get_program()).args(command.get_args()).stdin(Stdio::null());
    run(&mut shell)
}

/// What a failed write leaves: nothing under a name that ends in `.partial`, be it only hidden.
fn partial_files(root: &Path) -> Vec<String> {
    let names = files_below(root).into_iter().map(|file| file.display().to_string());
    names.filter(|name| name.ends_with(".partial")).collect()
}

#[test]
fn a_build_fails_cleanly_and_goes_on_when_there_is_room() {
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
    // The twin: a limit that everything fits into is none.
    assert_eq!(limited(1 << 20, &build(&recipe, &folder.path().join("roomy"))).code, Some(0));
}

#[test]
fn a_render_fails_cleanly_and_goes_on() {
    let copy = copied_dataset();
    std::fs::remove_dir_all(copy.path().join("scenes/room/ground_truth/renders")).unwrap();
    let failed = limited(8, &render(copy.path(), 1)).ends_with(2);
    assert!(failed.error().contains("cannot write '") && failed.error().contains("rgb"), "{}", failed.stderr);
    assert_eq!(partial_files(copy.path()), [""; 0]);
    run(&mut render(copy.path(), 1)).ends_with(0);
    assert!(manifest(copy.path()) == manifest(dataset()));
}

#[test]
fn submissions_and_results_are_whole_or_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let (submission, result) = (folder.path().join("gt"), folder.path().join("RESULT.json"));
    let failed = limited(0, &baseline("gt", dataset(), &submission)).ends_with(2);
    assert!(failed.error().contains("base_color.png"), "{}", failed.stderr);
    assert!(!submission.exists());
    run(&mut baseline("gt", dataset(), &submission)).ends_with(0);
    let failed = limited(2, &score(&submission, dataset(), &result)).ends_with(2);
    assert!(failed.error().contains("RESULT.json"), "{}", failed.stderr);
    assert!(!result.exists());
    assert_eq!(partial_files(folder.path()), [""; 0]);
}

/// A place below a file can be written to by nobody, not even by root.
#[test]
fn a_place_that_cannot_be_written_to() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
    let file = folder.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let below = file.join("out");
    let mut sample = mateval();
    sample.arg("sample").arg(&below);
    for mut command in [build(&recipe, &below), baseline("grey", dataset(), &below), sample] {
        let failed = run(&mut command).ends_with(2);
        assert!(failed.error().contains("file/"), "{}", failed.stderr);
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
}

/// A result that could not be printed is not done; a reader that has gone away is no error.
#[test]
fn a_full_stdout() {
    let words = ["eval", "image", "--format", "json"];
    let picture = dataset().join("scenes/room/views/input/rgb.png");
    let command = || {
        let mut command = mateval();
        command.args(words).arg(&picture).arg(&picture);
        command
    };
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut child = command().stdout(full).stderr(Stdio::null()).spawn().unwrap();
    assert_eq!(child.wait().unwrap().code(), Some(2));

    let mut child = command().stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    drop(child.stdout.take());
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
