//! Same command, same bytes, on any number of threads. `eval/tests/suite/same_bytes.rs` shows the same for scores.

use std::path::Path;

use super::command::{Run, build, render, run};
use super::sample::{self, SMALL, manifest, write_source};

/// Runs the command on this number of threads.
fn on_threads(threads: usize, command: &mut std::process::Command) -> Run {
    run(command.env("RAYON_NUM_THREADS", threads.to_string())).ends_with(0)
}

/// Atlases are kept in `cache`.
fn build_and_render(recipe: &Path, dataset: &Path, threads: usize, cache: &Path) -> [String; 2] {
    on_threads(threads, build(recipe, dataset).env("MATEVAL_CACHE", cache));
    let built = manifest(dataset);
    on_threads(threads, &mut render(dataset, 1));
    [built, manifest(dataset)]
}

#[test]
fn a_second_build_and_render_give_the_same_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
    let [one, two] = [1, 2].map(|threads| {
        let dataset = folder.path().join(format!("dataset{threads}"));
        build_and_render(&recipe, &dataset, threads, &folder.path().join(format!("cache{threads}")))
    });
    assert!(one == two, "1 and 2 threads give different manifests");
    assert_eq!(one[1], manifest(sample::dataset()));
    let described =
        |threads: usize| std::fs::read(folder.path().join(format!("dataset{threads}/dataset.json"))).unwrap();
    assert_eq!(described(1), described(2));
    assert!(one[0].lines().count() > 100 && one[1].lines().count() > one[0].lines().count());
}

#[test]
fn a_build_from_kept_atlases_is_the_same_and_damaged_ones_are_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), SMALL, &["room"]);
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

    std::fs::write(&files[0], "edited").unwrap();
    let (third, messages) = build_again("third");
    assert_eq!(third, first);
    assert!(messages.contains("damaged") && messages.contains(&*files[0].to_string_lossy()), "{messages}");
    assert_eq!(kept().len(), files.len());
}

/// The twin: manifests that must differ.
#[test]
fn another_recipe_and_other_samples_give_another_manifest() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), "resolution = [96, 71]\natlas_size = 128", &["room"]);
    let dataset = folder.path().join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let depth = |text: &str| text.lines().find(|line| line.ends_with("views/input/depth.exr")).unwrap().to_owned();
    assert_ne!(depth(&manifest(&dataset)), depth(&manifest(sample::dataset())));

    let copy = sample::copied_dataset();
    run(&mut render(copy.path(), 2)).ends_with(2).says("or --force to replace them");
    run(render(copy.path(), 2).arg("--force")).ends_with(0);
    assert_ne!(manifest(copy.path()), manifest(sample::dataset()));
}
