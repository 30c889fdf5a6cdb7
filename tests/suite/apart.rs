//! Scenes that several processes make, render and score apart: nothing is lost, and the whole equals that of one process.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;

use super::command::{Run, baseline, build, mateval, render, run, score, verify};
use super::sample::{manifest, write_source};
use mateval_testkit::{copy_folder, kept_folder};

/// The smallest scenes of more than one view, since each test makes them many times.
const TINY: &str = "resolution = [32, 24]\natlas_size = 64\nviews = [{ id = \"left\", x_deg = 0, y_deg = 5 }]";
const SCENES: [&str; 4] = ["first", "second", "third", "fourth"];

/// A source whose recipe has four scenes, and its dataset as one process makes it.
struct Serial {
    recipe: PathBuf,
    /// Built only.
    built: PathBuf,
    /// With pictures.
    rendered: PathBuf,
}

static SERIAL: LazyLock<Serial> = LazyLock::new(|| {
    let folder = kept_folder("apart");
    let recipe = write_source(&folder.join("source"), TINY, &SCENES);
    let [built, rendered] = ["built", "rendered"].map(|name| folder.join(name));
    run(&mut build(&recipe, &built)).ends_with(0);
    copy_folder(&built, &rendered);
    run(&mut render(&rendered, 1)).ends_with(0);
    Serial { recipe, built, rendered }
});

fn of_scene(mut command: Command, scene: &str) -> Command {
    command.args(["--scene", scene]);
    command
}

fn finish(dataset: &Path) -> Command {
    let mut command = mateval();
    command.args(["prep", "finish"]).arg(dataset);
    command
}

/// Starts all commands, and returns how they ended.
fn at_once(commands: impl IntoIterator<Item = Command>) -> Vec<Run> {
    let start = |mut command: Command| command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let started: Vec<Child> = commands.into_iter().map(start).collect();
    started.into_iter().map(|child| Run::of(child.wait_with_output().unwrap())).collect()
}

#[test]
fn four_builds_at_once_lose_nothing() {
    for round in 0..3 {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("dataset");
        for done in at_once(SCENES.map(|scene| of_scene(build(&SERIAL.recipe, &out), scene))) {
            done.ends_with(0).says("run `mateval prep finish");
        }
        assert!(!out.join("dataset.json").exists());
        run(&mut finish(&out)).ends_with(0).prints("4 scenes");
        assert!(manifest(&out) == manifest(&SERIAL.built), "round {round}");
        run(&mut verify(&out)).ends_with(0);
    }
}

/// Renders alone, which write most files a second: these lost files when each removed the unfinished files of the others.
#[test]
fn ten_rounds_of_renders_at_once() {
    for round in 0..10 {
        let copy = tempfile::tempdir().unwrap();
        copy_folder(&SERIAL.built, copy.path());
        at_once(SCENES.map(|scene| of_scene(render(copy.path(), 1), scene)))
            .into_iter()
            .for_each(|done| drop(done.ends_with(0)));
        run(&mut finish(copy.path())).ends_with(0).prints("photos by builtin");
        assert!(manifest(copy.path()) == manifest(&SERIAL.rendered), "round {round}");
        let json = |dataset: &Path| std::fs::read_to_string(dataset.join("dataset.json")).unwrap();
        assert_eq!(json(copy.path()), json(&SERIAL.rendered));
    }
}

#[test]
fn the_second_of_two_at_one_scene_says_who_is_at_work() {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&SERIAL.built, copy.path());
    // Long enough for the others to meet it.
    let mut first = of_scene(render(copy.path(), 2000), "first");
    let mut first = first.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let lease = copy.path().join(".build/leases/scenes/first");
    while !lease.exists() {
        assert!(first.try_wait().unwrap().is_none());
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    let who = format!("process {} on ", first.id());
    let second = run(&mut of_scene(render(copy.path(), 1), "first")).ends_with(2);
    assert!(second.error().contains(&who) && second.error().contains("scene 'first'"), "{}", second.stderr);
    run(&mut finish(copy.path())).ends_with(2).says(&who);
    // Another scene is free meanwhile.
    run(&mut of_scene(render(copy.path(), 1), "second")).ends_with(0);
    first.kill().unwrap();
    first.wait().unwrap();
    // Its lease is left, and its process gone.
    assert!(lease.exists());
    for scene in ["first", "third", "fourth"] {
        run(&mut of_scene(render(copy.path(), 1), scene)).ends_with(0);
    }
    assert!(!lease.exists());
    // Until then the manifest lists none of it.
    let faults = run(&mut verify(copy.path())).ends_with(1);
    assert_eq!(faults.stdout.matches("run `mateval prep finish ").count(), 4, "{}", faults.stdout);
    let finished = at_once([finish(copy.path()), finish(copy.path())]);
    assert!(finished.iter().any(|done| done.code == Some(0)), "{finished:?}");
    assert!(
        finished
            .iter()
            .all(|done| done.code == Some(0) || done.stderr.contains("is at work on the dataset's manifest"))
    );
    assert!(manifest(copy.path()) == manifest(&SERIAL.rendered));
}

#[test]
fn a_scene_that_is_missing_copied_or_changed_by_hand_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("dataset");
    for scene in ["first", "second", "third"] {
        run(&mut of_scene(build(&SERIAL.recipe, &out), scene)).ends_with(0);
    }
    run(&mut finish(&out)).ends_with(2).says("lacks 1 scene of the recipe: 'fourth'").says("--without");
    copy_folder(&out.join("scenes/first"), &out.join("scenes/fourth"));
    run(&mut finish(&out)).ends_with(2).says("lacks 1 scene of the recipe: 'fourth'");
    run(finish(&out).args(["--without", "fourth"])).ends_with(0).prints("3 scenes");
    assert!(!out.join("scenes/fourth").exists());
    copy_folder(&out.join("scenes/first"), &out.join("scenes/copy"));
    run(finish(&out).args(["--without", "fourth"])).ends_with(2).says("no scene of the dataset: 'copy'");
    std::fs::remove_dir_all(out.join("scenes/copy")).unwrap();
    // What stands aside is no scene either: it has no mark.
    run(&mut of_scene(build(&SERIAL.recipe, &out), "fourth")).ends_with(0);
    run(&mut finish(&out)).ends_with(0);
    assert!(manifest(&out) == manifest(&SERIAL.built));
    std::fs::write(out.join("scenes/second/views/input/depth.exr"), "by hand").unwrap();
    run(&mut finish(&out)).ends_with(2).says("scenes/second/views/input/depth.exr").says("changed_file");
    run(of_scene(build(&SERIAL.recipe, &out), "second").arg("--force")).ends_with(0);
    run(&mut finish(&out)).ends_with(0);
    assert!(manifest(&out) == manifest(&SERIAL.built));
}

#[test]
fn a_scene_that_was_left_out_is_taken_in_again() {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&SERIAL.rendered, copy.path());
    let without = |scene: &str| run(finish(copy.path()).args(["--without", scene]));
    without("fourth").ends_with(0).prints("3 scenes");
    run(&mut verify(copy.path())).ends_with(0);
    // Others are built and rendered meanwhile, and so is a newer one of its name.
    run(&mut of_scene(build(&SERIAL.recipe, copy.path()), "first")).ends_with(0);
    run(of_scene(build(&SERIAL.recipe, copy.path()), "fourth").arg("--force")).ends_with(0);
    without("fourth").ends_with(0);
    run(&mut finish(copy.path())).ends_with(0).prints("4 scenes, without photos");
    run(&mut of_scene(render(copy.path(), 1), "fourth")).ends_with(0);
    run(&mut finish(copy.path())).ends_with(0).prints("photos by builtin");
    assert!(manifest(copy.path()) == manifest(&SERIAL.rendered));
    without("third").ends_with(0);
    run(&mut finish(copy.path())).ends_with(0);
    assert!(manifest(copy.path()) == manifest(&SERIAL.rendered));
    without("fifth").ends_with(2).says("no scene 'fifth'");
    run(finish(copy.path()).args(SCENES.iter().flat_map(|scene| ["--without", scene])))
        .ends_with(2)
        .says("no scene left");
    // A refusal has moved nothing.
    std::fs::create_dir(copy.path().join("scenes/stray")).unwrap();
    without("third").ends_with(2).says("no scene of the dataset: 'stray'");
    assert!(copy.path().join("scenes/third").exists());
}

/// What a lost node leaves is of another host, so that nobody can know whether its process lives; a lease decides.
#[test]
fn the_unfinished_files_of_a_lost_node_do_not_stay() {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&SERIAL.built, copy.path());
    let left = copy.path().join("scenes/.first.node7_1-12-ff-0.partial");
    copy_folder(&SERIAL.built.join("scenes/first"), &left);
    let file = copy.path().join("scenes/first/.scene.json.node7_1-12-ff-0.partial");
    std::fs::write(&file, "half").unwrap();
    run(&mut of_scene(render(copy.path(), 1), "first")).ends_with(0);
    run(&mut finish(copy.path())).ends_with(0);
    assert!(!left.exists() && !file.exists());
    run(&mut verify(copy.path())).ends_with(0);
}

/// As after a download: the manifest alone says what the files were.
#[test]
fn a_killed_render_resumes_where_nothing_is_kept_of_the_build() {
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&SERIAL.built, copy.path());
    std::fs::remove_dir_all(copy.path().join(".build")).unwrap();
    let mut killed = of_scene(render(copy.path(), 2000), "first");
    let mut killed = killed.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    while !copy.path().join(".build/changed/first").exists() {
        assert!(killed.try_wait().unwrap().is_none());
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    run(&mut render(copy.path(), 1)).ends_with(0);
    assert!(manifest(copy.path()) == manifest(&SERIAL.rendered));
    run(finish(copy.path()).args(["--without", "first"])).ends_with(2).says("was not built here");
}

#[test]
fn a_recipe_with_one_scene_more_makes_that_scene_alone() {
    let folder = tempfile::tempdir().unwrap();
    let (three, out) = (SERIAL.recipe.with_file_name("three.toml"), folder.path().join("dataset"));
    let text = std::fs::read_to_string(&SERIAL.recipe).unwrap();
    std::fs::write(&three, &text[..text.rfind("[[scene]]").unwrap()]).unwrap();
    run(&mut build(&three, &out)).ends_with(0).prints("3 scenes");
    run(&mut render(&out, 1)).ends_with(0);
    let more = run(&mut build(&SERIAL.recipe, &out)).ends_with(0).says("scene 'third' was already made");
    assert!(!more.stderr.contains("'fourth' was already made"));
    run(&mut render(&out, 1)).ends_with(0).prints("2 views rendered, 6 kept");
    assert!(manifest(&out) == manifest(&SERIAL.rendered));
    // The other way round a scene would be lost, with its pictures.
    run(&mut build(&three, &out))
        .ends_with(2)
        .says("1 scene not in the recipe: 'fourth'")
        .says("prep finish --without");
    assert!(manifest(&out) == manifest(&SERIAL.rendered));
}

#[test]
fn scores_that_are_kept_are_put_together_and_missing_ones_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let [grey, cache, whole, merged] =
        ["grey", "cache", "whole.json", "merged.json"].map(|name| folder.path().join(name));
    run(&mut baseline("grey", &SERIAL.built, &grey)).ends_with(0);
    let apart = tempfile::tempdir().unwrap();
    copy_folder(&SERIAL.built, apart.path());
    run(&mut of_scene(render(apart.path(), 1), "first")).ends_with(0);
    run(&mut score(&grey, apart.path(), &merged)).ends_with(2).says("scene 'first' changed since").says("prep finish");
    let scored = |result: &Path, words: &[&str]| {
        let mut command = score(&grey, &SERIAL.built, result);
        command.arg("--cache").arg(&cache).args(words);
        run(&mut command)
    };
    scored(&merged, &["--only-cached"]).ends_with(2);
    assert!(!cache.exists());
    let parts = ["first", "second"].map(|scene| {
        let mut command = score(&grey, &SERIAL.built, &folder.path().join(format!("{scene}.json")));
        command.arg("--cache").arg(&cache).args(["--scene", scene]);
        command
    });
    at_once(parts).into_iter().for_each(|done| drop(done.ends_with(0)));
    let missing = scored(&merged, &["--only-cached"]).ends_with(2);
    assert!(
        missing.error().contains("'third', 'fourth'") && missing.error().contains("grey': 2 scenes"),
        "{}",
        missing.stderr
    );
    assert!(!merged.exists());
    // A file that the manifest does not list would make the dataset unsound.
    run(&mut score(&grey, &SERIAL.built, &SERIAL.built.join("r.json"))).ends_with(2).says("would lie in the dataset");
    // Two of the four scenes were in the cache, and then all.
    scored(&whole, &[]).ends_with(0).says("scored on 2 scenes in ");
    let recalled = scored(&merged, &["--only-cached"]).ends_with(0);
    assert!(!recalled.stderr.contains("scored on"), "{}", recalled.stderr);
    let text = |path: &Path| std::fs::read_to_string(path).unwrap();
    assert_eq!(text(&merged), text(&whole));
}
