//! Commands on a dataset from which a scene is absent, and the exports from which such a dataset is unpacked.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_testkit::{copy_folder, kept_folder};

use super::command::{Run, baseline, build, run, run_words, score, verify};
use super::sample::{self, SMALL, json, write_source};

static DATASET: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("two_scenes");
    let recipe = write_source(&folder.join("source"), SMALL, &["room", "hall"]);
    let dataset = folder.join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    dataset
});

/// Two scenes without renders; tests must not write to it.
fn dataset() -> &'static Path {
    &DATASET
}

fn export(dataset: &Path, format: &str, out: &Path) -> Run {
    let words = ["prep", "export", "--as", format, "--out"].map(Path::new);
    run_words(words.into_iter().chain([out, dataset]))
}

/// A copy of the dataset without its scene `hall`.
fn partial() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(dataset(), folder.path());
    std::fs::remove_dir_all(folder.path().join("scenes/hall")).unwrap();
    folder
}

const ABSENCE: &str = "are absent; only the others are used\n";

#[test]
fn baselines_and_scores_cover_the_scenes_that_exist() {
    let (part, out) = (partial(), tempfile::tempdir().unwrap());
    let [grey, all, one] = ["grey", "all.json", "one.json"].map(|name| out.path().join(name));
    run(&mut baseline("grey", part.path(), &grey)).ends_with(0).says(ABSENCE);
    run(&mut score(&grey, part.path(), &all)).ends_with(0).says(ABSENCE);
    let named = run(score(&grey, part.path(), &one).args(["--scene", "room"])).ends_with(0);
    assert!(!named.stderr.contains("absent"), "{}", named.stderr);
    run(score(&grey, part.path(), &out.path().join("no.json")).args(["--scene", "hall"]))
        .ends_with(2)
        .says("unpack 'scenes/hall.tar' in the dataset's folder");
    // The result is that of one scene of the whole dataset.
    let whole = out.path().join("whole.json");
    run(score(&grey, dataset(), &whole).args(["--scene", "room"])).ends_with(0);
    let [all, one, whole] = [&all, &one, &whole].map(|path: &PathBuf| json(path));
    assert_eq!(all["dataset"], whole["dataset"]);
    assert_eq!(whole["dataset"]["total_scenes"], 2);
    assert_eq!(all["protocols"], whole["protocols"]);
    assert_eq!(all["protocols"], one["protocols"]);
}

#[test]
fn verify_checks_the_scenes_that_exist() {
    let part = partial();
    run(&mut verify(part.path())).ends_with(0).prints("absent_scenes");
    std::fs::write(part.path().join("scenes/room/views/input/valid.png"), "x").unwrap();
    run(&mut verify(part.path())).ends_with(1);
}

#[test]
fn what_needs_every_scene_says_how_many_are_absent() {
    let (part, out) = (partial(), tempfile::tempdir().unwrap());
    let [public, private] = ["public", "private"].map(|name| out.path().join(name));
    let words = ["prep", "publish", "--withhold", "ground_truth", "--public"].map(Path::new);
    let publish = run_words(words.into_iter().chain([public.as_path(), Path::new("--private"), &private, part.path()]));
    let render = run_words([Path::new("prep"), Path::new("render"), part.path()]);
    for run in [publish, render, export(part.path(), "tar", &out.path().join("tars"))] {
        run.ends_with(2)
            .says("the folders of 1 of the 2 scenes that '")
            .says("unpack 'scenes/hall.tar' in the dataset's folder");
    }
    assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
}

#[test]
fn every_format_is_exported() {
    let out = tempfile::tempdir().unwrap();
    let formats = ["tar", "croissant", "huggingface", "nerfstudio", "colmap"];
    for format in formats {
        let place = out.path().join(format);
        export(sample::dataset(), format, &place).ends_with(0).prints(&format!("{}: ", place.display()));
        export(sample::dataset(), format, &place).ends_with(2).says("choose another --out");
    }
    assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), formats.len());
}
