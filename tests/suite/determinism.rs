//! Same command, same bytes, on any number of threads. `eval/tests/suite/same_bytes.rs` shows the same for scores.

use std::path::Path;

use super::command::{Run, build, render, run};
use super::sample::{self, SMALL, manifest, write_source};

/// Runs the command on this number of threads.
fn on_threads(threads: usize, command: &mut std::process::Command) -> Run {
    run(command.env("RAYON_NUM_THREADS", threads.to_string())).ends_with(0)
}

fn build_and_render(recipe: &Path, dataset: &Path, threads: usize) -> [String; 2] {
    on_threads(threads, &mut build(recipe, dataset));
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
        build_and_render(&recipe, &dataset, threads)
    });
    assert!(one == two, "1 and 2 threads give different manifests");
    assert_eq!(one[1], manifest(sample::dataset()));
    let described =
        |threads: usize| std::fs::read(folder.path().join(format!("dataset{threads}/dataset.json"))).unwrap();
    assert_eq!(described(1), described(2));
    assert!(one[0].lines().count() > 100 && one[1].lines().count() > one[0].lines().count());
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
    run(&mut render(copy.path(), 2)).ends_with(0);
    assert_ne!(manifest(copy.path()), manifest(sample::dataset()));
}
