//! Same command, same bytes, on any number of threads. `eval/tests/suite/same_bytes.rs` shows the same for scores.

use std::path::Path;

use super::command::{build, render, run};
use super::sample::{self, SMALL, manifest, write_source};

/// With three threads, which are fewer or more than the dataset of all tests was made with, and atlases made anew.
#[test]
fn a_second_build_and_render_give_the_same_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
    let dataset = folder.path().join("dataset");
    let threads = if std::thread::available_parallelism().is_ok_and(|cores| cores.get() == 3) { "2" } else { "3" };
    run(build(&recipe, &dataset).env("MATEVAL_CACHE", folder.path()).env("RAYON_NUM_THREADS", threads)).ends_with(0);
    let built = manifest(&dataset).lines().count();
    run(render(&dataset, 1).env("RAYON_NUM_THREADS", threads)).ends_with(0);
    assert_eq!(manifest(&dataset), manifest(sample::dataset()), "{threads} threads give another manifest");
    let described = |dataset: &Path| std::fs::read(dataset.join("dataset.json")).unwrap();
    assert_eq!(described(&dataset), described(sample::dataset()));
    assert!(built > 100 && manifest(&dataset).lines().count() > built);
}

/// `prep/src/atlas/mod.rs` tests what becomes of damaged ones.
#[test]
fn a_build_from_kept_atlases_is_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let head = "resolution = [32, 24]\natlas_size = 64\nviews = []";
    let recipe = write_source(&folder.path().join("source"), head, &["room"]);
    let cache = folder.path().join("cache");
    let build_again = |name: &str| {
        let dataset = folder.path().join(name);
        let run = run(build(&recipe, &dataset).env("MATEVAL_CACHE", &cache)).ends_with(0);
        (manifest(&dataset), run.stderr)
    };
    let kept =
        || -> Vec<_> { std::fs::read_dir(cache.join("atlases")).unwrap().map(|entry| entry.unwrap().path()).collect() };
    let (first, _) = build_again("first");
    let files = kept();
    assert!(files.len() > 10, "{} atlases", files.len());
    let (second, messages) = build_again("second");
    assert_eq!(second, first);
    assert!(!messages.contains("damaged"), "{messages}");
    assert_eq!(kept().len(), files.len());
}

/// The twin: manifests that must differ.
#[test]
fn another_recipe_and_other_samples_give_another_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let head = "resolution = [96, 71]\natlas_size = 64\nviews = []";
    let recipe = write_source(&folder.path().join("source"), head, &["room"]);
    let dataset = folder.path().join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let depth = |text: &str| text.lines().find(|line| line.ends_with("views/input/depth.exr")).unwrap().to_owned();
    assert_ne!(depth(&manifest(&dataset)), depth(&manifest(sample::dataset())));

    let copy = sample::copied_dataset();
    run(&mut render(copy.path(), 2)).ends_with(2).says("or --force to replace them");
    run(render(copy.path(), 2).arg("--force")).ends_with(0);
    assert_ne!(manifest(copy.path()), manifest(sample::dataset()));
}
