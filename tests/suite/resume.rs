//! A build or a render that was killed resumes when it is started again, and its result is that of an uninterrupted
//! run.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use super::command::{build, mateval, render, run, verify};
use super::sample::{copied_dataset, dataset, manifest, recipe_text, write_source};
use mateval_testkit::{copy_folder, kept_folder};

/// Of small pictures and atlases. A render that is killed within the view `up_left` has yet to render another one.
const HEAD: &str = "resolution = [64, 48]\natlas_size = 64\n\
                    views = [{ id = \"up_left\", x_deg = 5, y_deg = 5 }, { id = \"up_right\", x_deg = 5, y_deg = -5 }]";

/// A source whose recipe has two scenes, its whole dataset, and that one's manifest.
struct Whole {
    recipe: PathBuf,
    dataset: PathBuf,
    manifest: String,
}

static WHOLE: LazyLock<Whole> = LazyLock::new(|| {
    let folder = kept_folder("resume");
    let recipe = write_source(&folder.join("source"), HEAD, &["first", "second"]);
    let dataset = folder.join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let manifest = manifest(&dataset);
    Whole { recipe, dataset, manifest }
});

/// Starts the command and kills it (SIGKILL) once `is_time` returns true. Panics if it ends by itself.
pub fn kill_when(command: &mut Command, is_time: impl Fn() -> bool) {
    let mut child: Child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let start = Instant::now();
    while !is_time() {
        assert!(child.try_wait().unwrap().is_none(), "it ended before it could be killed");
        assert!(start.elapsed() < Duration::from_secs(300), "the time to kill it never came");
        std::thread::sleep(Duration::from_micros(200));
    }
    child.kill().unwrap();
    assert!(child.wait().unwrap().code().is_none(), "it ended before it could be killed");
}

/// The unfinished folder of a scene.
fn unfinished(out: &Path, scene: &str) -> Option<PathBuf> {
    let entries = std::fs::read_dir(out.join("scenes")).ok()?;
    let mut paths = entries.flatten().map(|entry| entry.path());
    paths.find(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(&format!(".{scene}."))))
}

/// Asserts that the folder cannot be mistaken for a finished dataset.
fn assert_unfinished(out: &Path) {
    assert!(!out.join("dataset.json").exists());
    run(&mut verify(out)).ends_with(2).says("no dataset.json");
}

#[test]
fn killed_after_the_first_scene() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("dataset");
    let mark = out.join(".build/scenes/first.json");
    kill_when(&mut build(&WHOLE.recipe, &out), || mark.is_file());
    assert_unfinished(&out);
    run(&mut build(&WHOLE.recipe, &out)).ends_with(0).says("scene 'first' was already made by an earlier run");
    assert!(manifest(&out) == WHOLE.manifest);
    assert_eq!(std::fs::read_dir(out.join(".build/leases/scenes")).unwrap().count(), 0);
    run(&mut verify(&out)).ends_with(0);
}

#[test]
fn killed_at_once_and_within_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("dataset");
    let holds = |file: &str| unfinished(&out, "first").is_some_and(|work| work.join(file).is_file());
    let moments: [&dyn Fn() -> bool; 3] =
        [&|| out.exists(), &|| holds("views/input/depth.exr"), &|| holds("geometry/parts.glb")];
    for is_time in moments {
        // Files of the previous run must not be mistaken for those of this run.
        let _ = unfinished(&out, "first").map(std::fs::remove_dir_all);
        kill_when(&mut build(&WHOLE.recipe, &out), is_time);
        assert_unfinished(&out);
        assert!(!out.join("scenes/first").exists());
    }
    let second = run(&mut build(&WHOLE.recipe, &out)).ends_with(0);
    assert!(!second.stderr.contains("already made"), "{}", second.stderr);
    assert!(manifest(&out) == WHOLE.manifest);
}

/// A kill between two steps leaves a scene's folder without its mark. Such a scene is built again, complete or not.
#[test]
fn half_written_scenes_are_made_again() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("dataset");
    kill_when(&mut build(&WHOLE.recipe, &out), || out.join(".build/scenes/first.json").is_file());
    std::fs::remove_file(out.join(".build/scenes/first.json")).unwrap();
    std::fs::write(out.join("scenes/first/views/input/depth.exr"), "half").unwrap();
    std::fs::create_dir_all(out.join("scenes/second")).unwrap();
    std::fs::write(out.join("scenes/second/scene.json"), "{").unwrap();
    std::fs::write(out.join(".build/scenes/second.json"), "[").unwrap();
    std::fs::write(out.join("scenes/second/stray"), "half").unwrap();
    let again = run(&mut build(&WHOLE.recipe, &out)).ends_with(0);
    assert!(!again.stderr.contains("already made"), "{}", again.stderr);
    assert!(manifest(&out) == WHOLE.manifest);
}

/// If a file that was missing when the scene was built exists now, the scene is built again, as in a fresh build.
#[test]
fn files_that_were_missing_before_are_used() {
    let folder = tempfile::tempdir().unwrap();
    let (source, out) = (folder.path().join("source"), folder.path().join("dataset"));
    let recipe = write_source(&source, HEAD, &["first", "second"]);
    let [texture, aside] = ["room/textures/outside.png", "outside.png"].map(|name| source.join(name));
    std::fs::rename(&texture, &aside).unwrap();
    kill_when(&mut build(&recipe, &out), || out.join(".build/scenes/first.json").is_file());
    // The twin: while the file is still missing, the scene is the same.
    kill_when(&mut build(&recipe, &out), || {
        unfinished(&out, "second").is_some_and(|work| work.join("views/input/depth.exr").is_file())
    });
    assert!(out.join(".build/scenes/first.json").is_file() && unfinished(&out, "first").is_none());
    std::fs::rename(&aside, &texture).unwrap();
    let again = run(&mut build(&recipe, &out)).ends_with(0);
    assert!(!again.stderr.contains("already made"), "{}", again.stderr);
    assert!(manifest(&out) == WHOLE.manifest);
}

#[test]
fn another_recipe_does_not_resume() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("dataset");
    kill_when(&mut build(&WHOLE.recipe, &out), || out.join(".build/scenes/first.json").is_file());
    let other = WHOLE.recipe.with_file_name("other.toml");
    std::fs::write(&other, recipe_text(&HEAD.replace("[64, 48]", "[48, 36]"), &["first", "second"])).unwrap();
    run(&mut build(&other, &out)).ends_with(2).says("1 scene would be made otherwise: 'first'").says("--force");
    assert_unfinished(&out);
    assert!(out.join(".build/scenes/first.json").is_file(), "the refusal changed the folder");

    let forced = run(build(&other, &out).arg("--force")).ends_with(0);
    assert!(!forced.stderr.contains("already made"), "{}", forced.stderr);
    assert!(manifest(&out) != WHOLE.manifest);
    run(&mut verify(&out)).ends_with(0);
    run(&mut build(&WHOLE.recipe, &out)).ends_with(2).says("2 scenes would be made otherwise").says("--force");
    run(&mut build(&other, &out)).ends_with(0).says("scene 'second' was already made");
}

#[test]
fn a_killed_render_resumes() {
    let copy = copied_dataset();
    let renders = copy.path().join("scenes/room/ground_truth/renders/builtin");
    std::fs::remove_dir_all(&renders).unwrap();
    kill_when(&mut render(copy.path(), 1), || renders.join("up_left/rgb_a.exr").is_file());
    let again = run(&mut render(copy.path(), 1)).ends_with(0);
    let kept: usize = again.stdout.split(", ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!((1..5).contains(&kept), "{}", again.stdout);
    assert!(manifest(copy.path()) == manifest(dataset()));
}

/// The build is resumed over what a killed render left, as `mateval demo` does it. `prep finish` refuses that.
#[test]
fn a_build_resumes_after_a_killed_render() {
    // As many as it takes for the last view to be rendered after `up_left` for a while.
    const SAMPLES: u32 = 8;
    let folder = tempfile::tempdir().unwrap();
    let [whole, out] = ["whole", "cut_off"].map(|name| folder.path().join(name));
    [&whole, &out].into_iter().for_each(|copy| copy_folder(&WHOLE.dataset, copy));
    run(&mut render(&whole, SAMPLES)).ends_with(0);
    let renders = out.join("scenes/first/ground_truth/renders/builtin");
    kill_when(&mut render(&out, SAMPLES), || renders.join("up_left/rgb_a.exr").is_file());
    let resumes = format!("mateval prep render {} --renderer builtin", out.display());
    run(mateval().args(["prep", "finish"]).arg(&out)).ends_with(2).says("unlisted_file").says(&resumes);
    run(mateval().args(["prep", "stats"]).arg(&out)).ends_with(0);
    assert!(run(&mut verify(&out)).ends_with(1).stdout.contains(&resumes));
    run(&mut build(&WHOLE.recipe, &out)).ends_with(0).says("scene 'first' was already made");
    run(&mut render(&out, SAMPLES)).ends_with(0);
    assert!(manifest(&out) == manifest(&whole));

    // Only pictures of a scene that was being rendered: anything else is still a fault.
    std::fs::write(renders.join("up_left/notes.txt"), "by hand").unwrap();
    run(&mut build(&WHOLE.recipe, &out)).ends_with(2).says("unlisted_file");
}
