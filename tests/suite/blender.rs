//! `prep render --renderer blender`: with the Blender that `mateval fetch blender` installs, and with programs that
//! stand in for a failing Blender.

use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, Mutex, MutexGuard};

use mateval_image::{LinearRgb, Picture, exr_io, png_io};
use mateval_testkit::report_missing;

use super::command::{Run, build, mateval, render, run, verify};
use super::sample::{copied_dataset, files_below, json, manifest, write_source};
use mateval_testkit::{copy_folder, kept_folder};

/// One view of the sample's room: each render takes seconds.
const TINY: &str = "resolution = [64, 48]\natlas_size = 64\nviews = [{ id = \"left\", x_deg = 0, y_deg = 5 }]";

static UNRENDERED: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = kept_folder("blender");
    let recipe = write_source(&folder.join("source"), TINY, &["room"]);
    run(&mut build(&recipe, &folder.join("dataset"))).ends_with(0);
    folder.join("dataset")
});

/// A copy of the dataset without renders.
fn unrendered() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copy_folder(&UNRENDERED, folder.path());
    folder
}

/// The Python that has `bpy`, and a lock, because Blender uses every processor. Prints a message if there is none.
pub fn blender() -> Option<(PathBuf, MutexGuard<'static, ()>)> {
    static TURN: Mutex<()> = Mutex::new(());
    let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let cache = set("MATEVAL_CACHE")
        .or_else(|| set("XDG_CACHE_HOME").map(|folder| folder.join("mateval")))
        .or_else(|| set("HOME").map(|folder| folder.join(".cache/mateval")))?;
    let python = set("MATEVAL_BLENDER").unwrap_or(cache.join("blender/bin/python"));
    if !python.exists() {
        report_missing("there is no Blender; run: mateval fetch blender");
        return None;
    }
    Some((python, TURN.lock().unwrap_or_else(std::sync::PoisonError::into_inner)))
}

fn by_blender(dataset: &Path, program: &Path, words: &[&str]) -> Command {
    let mut command = render(dataset, 2);
    command.args(["--renderer", "blender", "--attempts", "1"]).args(words).arg("--blender").arg(program);
    command
}

/// A program that stands in for Blender: `$JOB` is the job's folder.
fn stand_in(folder: &Path, body: &str) -> PathBuf {
    let path = folder.join("stand-in.sh");
    let text = format!("#!/bin/sh\nfor word; do :; done\nJOB=$(dirname \"$word\")\n{body}\n");
    std::fs::write(&path, text).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
    path
}

fn renders(dataset: &Path) -> PathBuf {
    dataset.join("scenes/room/ground_truth/renders/blender")
}

fn light(dataset: &Path, file: &str) -> Picture<LinearRgb> {
    exr_io::read_linear(&renders(dataset).join(file)).unwrap()
}

#[track_caller]
fn fails(run: Run, words: &[&str]) -> Run {
    let run = run.ends_with(2);
    for word in words.iter().chain(&["blender_failed", "to repeat the failure: "]) {
        assert!(run.stderr.contains(word), "'{word}' not in {}", run.stderr);
    }
    run
}

#[test]
fn a_dataset_is_rendered_whole_and_twice_to_the_same_bytes() {
    let Some((python, _turn)) = blender() else { return };
    let copy = unrendered();
    let dataset = copy.path();
    run(&mut by_blender(dataset, &python, &[])).ends_with(0);
    run(&mut verify(dataset)).ends_with(0);
    assert_eq!(json(&dataset.join("dataset.json"))["photo_renderer"], "blender");
    assert!(!dataset.join(".render").exists());
    let first = manifest(dataset);
    // Existing renders are kept; a forced second render is the same.
    run(&mut by_blender(dataset, Path::new("/nowhere"), &[])).ends_with(2).says("which does not exist");
    let kept = run(&mut by_blender(dataset, &python, &[])).ends_with(0);
    assert!(kept.stdout.contains("0 views rendered, 2 kept"), "{}", kept.stdout);
    run(&mut by_blender(dataset, &python, &["--force"])).ends_with(0);
    assert!(manifest(dataset) == first);

    // The groups add up, the halves differ, and the input picture is the denoised one.
    let lights = json(&dataset.join("scenes/room/ground_truth/lights.json"))["groups"].as_array().unwrap().len();
    let groups: Vec<_> = (0..lights).map(|k| light(dataset, &format!("input/group_{k:02}_a.exr"))).collect();
    let (a, b) = (light(dataset, "input/rgb_a.exr"), light(dataset, "input/rgb_b.exr"));
    for (x, y) in (0..48).flat_map(|y| (0..64).map(move |x| (x, y))) {
        let sum: f32 = groups.iter().map(|group| group.get(x, y).0[1]).sum();
        assert!((sum - a.get(x, y).0[1]).abs() <= 1e-4 * (1.0 + sum), "({x}, {y}): {sum}");
    }
    assert!(a != b && lights > 2);
    let photo = exr_io::read_linear(&dataset.join("scenes/room/views/input/rgb.exr")).unwrap();
    assert!(photo == light(dataset, "input/rgb.exr") && photo != a);
    let record = json(&renders(dataset).join("input/render.json"));
    assert!(record["noise"]["mean_of_halves_mse"].as_f64().unwrap() > 0.0, "{record}");
    // Converted materials mean the same to both renderers; glass alone is approximated.
    assert!(record["approximations"].as_array().unwrap().iter().all(|line| line.as_str().unwrap().contains("glass")));

    // Ids and depth are those of our own tracer; those of the turned view differ.
    let agree = |ours: &str, theirs: &str| {
        let read = |path: PathBuf| png_io::read_ids(&path.join("instance.png")).unwrap();
        let ours = read(dataset.join("scenes/room/views").join(ours));
        let theirs = read(renders(dataset).join(theirs));
        let same = ours.pixels().iter().zip(theirs.pixels()).filter(|(a, b)| a == b).count();
        same as f64 / ours.pixels().len() as f64
    };
    assert!(agree("input", "input") > 0.999 && agree("left", "left") > 0.999);
    assert!(agree("left", "input") < 0.95);

    // Our own tracer's pictures change neither what is scored nor what is shown.
    run(&mut render(dataset, 1)).ends_with(0);
    assert_eq!(json(&dataset.join("dataset.json"))["photo_renderer"], "blender");
    run(&mut verify(dataset)).ends_with(0);
}

/// Blender is killed after its first view; the next run renders the other.
#[test]
fn a_killed_blender_is_a_finding_and_the_next_run_resumes() {
    let Some((python, _turn)) = blender() else { return };
    let copy = unrendered();
    let tools = tempfile::tempdir().unwrap();
    let body = format!(
        "'{}' -I -B \"$JOB/scripts/render.py\" \"$JOB/job.json\" & child=$!\n\
         until [ -f \"$JOB/result.json\" ]; do sleep 0.02; done\nkill -9 $child; wait $child",
        python.display()
    );
    let failed = run(&mut by_blender(copy.path(), &stand_in(tools.path(), &body), &[]));
    assert!(failed.stdout.contains("1 view rendered, 0 kept"), "{}", failed.stdout);
    fails(failed, &["exit status: 137", "Killed"]);
    assert!(renders(copy.path()).join("input/render.json").is_file());
    assert!(!renders(copy.path()).join("left/render.json").exists());
    let whole = run(&mut by_blender(copy.path(), &python, &[])).ends_with(0);
    assert!(whole.stdout.contains("1 view rendered, 1 kept"), "{}", whole.stdout);
    run(&mut verify(copy.path())).ends_with(0);
}

#[test]
fn a_hanging_growing_or_crashing_blender_is_ended_and_reported() {
    let tools = tempfile::tempdir().unwrap();
    let copy = unrendered();
    let before = manifest(copy.path());
    let try_body = |body: &str, words: &[&str]| run(&mut by_blender(copy.path(), &stand_in(tools.path(), body), words));
    let start = std::time::Instant::now();
    fails(
        try_body("echo here I sleep; exec sleep 600", &["--time-limit", "1"]),
        &["took longer than 1 s", "here I sleep"],
    );
    // When the shell is ended, its child must end too, because it would keep the test's pipes open.
    assert!(start.elapsed().as_secs() < 60);
    let swell =
        "exec python3 -c 'import time; x = bytearray(3 << 29); x[::4096] = b\"1\" * len(x[::4096]); time.sleep(600)'";
    fails(try_body(swell, &["--memory-limit", "1"]), &["more than 1024 MiB"]);
    fails(try_body("echo no graphics >&2; exit 11", &[]), &["exit status: 11", "no graphics"]);
    fails(try_body("exit 0", &[]), &["the process ended with exit status: 0", "(the log is empty)"]);
    fails(try_body("echo '{\"format\": 3}' > \"$JOB/result.json\"; sleep 1", &[]), &["result.json"]);
    assert!(manifest(copy.path()) == before, "a failed render changed the dataset");
    assert_eq!(files_below(&renders(copy.path())), [""; 0].map(PathBuf::from));
}

/// A scene that fails is tried again and does not affect the others, which are rendered at the same time.
#[test]
fn attempts_are_counted_and_other_scenes_are_rendered() {
    let Some((python, _turn)) = blender() else { return };
    let folder = tempfile::tempdir().unwrap();
    let recipe = write_source(&folder.path().join("source"), &TINY.replace("[{", "[] #"), &["one", "two"]);
    let dataset = folder.path().join("dataset");
    run(&mut build(&recipe, &dataset)).ends_with(0);
    let real = format!("exec '{}' -I -B \"$JOB/scripts/render.py\" \"$JOB/job.json\"", python.display());
    // Scenes are rendered at once: the first ends with 4 unless the second begins meanwhile.
    let body = format!(
        "case \"$JOB\" in */one) tries=0; until [ -e '{0}/two' ]; do [ $tries -lt 300 ] || exit 4; tries=$((tries + 1)); \
         sleep 0.1; done; exit 3;; esac\ntouch '{0}/two'\n{real}",
        folder.path().display()
    );
    let failed = run(by_blender(&dataset, &stand_in(folder.path(), &body), &[]).args(["--jobs", "2"]));
    fails(failed, &["'scenes/one'", "exit status: 3", "1 scene could not be rendered"]).says("attempt 1 failed");
    assert!(dataset.join("scenes/two/ground_truth/renders/blender/input/render.json").is_file());
    // The first attempt fails, the second does not.
    let body = format!("[ -f '{0}/tried' ] || {{ touch '{0}/tried'; exit 3; }}\n{real}", folder.path().display());
    let mut command = render(&dataset, 2);
    command.args(["--renderer", "blender", "--attempts", "2", "--blender"]).arg(stand_in(folder.path(), &body));
    let whole = run(&mut command).ends_with(0).says("scene 'one': attempt 1 failed");
    assert!(whole.stdout.contains("1 view rendered, 1 kept"), "{}", whole.stdout);
}

/// A texture that is missing or no picture, and files that cannot be written.
#[test]
fn blenders_own_errors_are_reported() {
    let Some((python, _turn)) = blender() else { return };
    let copy = unrendered();
    let tools = tempfile::tempdir().unwrap();
    let real = format!("exec '{}' -I -B \"$JOB/scripts/render.py\" \"$JOB/job.json\"", python.display());
    let try_body = |body: &str| {
        let program = stand_in(tools.path(), &format!("{body}\n{real}"));
        run(&mut by_blender(copy.path(), &program, &[]))
    };
    fails(try_body("rm \"$JOB\"/textures/0000.exr"), &["JobError", "'textures/0000.exr'"]);
    fails(try_body("echo x > \"$JOB\"/textures/0000.exr"), &["0000.exr"]);
    // Blocks of 512 bytes: enough for the log and the scripts' results, too little for a picture.
    fails(try_body("trap '' XFSZ; ulimit -f 24"), &["ended with"]);
    let whole = run(&mut by_blender(copy.path(), &python, &[])).ends_with(0);
    assert!(whole.stdout.contains("2 views rendered"), "{}", whole.stdout);
}

/// On a machine without a graphics card. The choice among several is tested in `blender_scripts/tests`.
#[test]
fn a_device_that_is_absent_is_named_and_views_of_two_devices_never_meet() {
    let Some((python, _turn)) = blender() else { return };
    let copy = unrendered();
    let on = |device: &str| {
        let mut command = by_blender(copy.path(), &python, &["--device", device]);
        // A machine with a card is made one without.
        run(command.env("CUDA_VISIBLE_DEVICES", "").env("HIP_VISIBLE_DEVICES", "-1"))
    };
    fails(on("optix"), &["no device of the kind optix", "choose another --device"]);
    let whole = on("auto").ends_with(0).says("--device auto rendered on the processor: Cycles found no graphics card");
    assert!(whole.stdout.contains("2 views rendered"), "{}", whole.stdout);
    let file = renders(copy.path()).join("input/render.json");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(!text.contains("device"), "{text}");
    let card = "\"device\": { \"kind\": \"hip\", \"name\": \"a card\", \"driver\": null },\n  \"samples_each_half\"";
    std::fs::write(&file, text.replace("\"samples_each_half\"", card)).unwrap();
    fails(on("auto"), &["no device of the kind hip", "other views of this scene were rendered by it"]);
    let again = on("cpu").ends_with(0);
    assert!(again.stdout.contains("1 view rendered, 1 kept"), "{}", again.stdout);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), text);
    let mut builtin = render(copy.path(), 2);
    run(builtin.args(["--device", "cuda"])).ends_with(2).says("--renderer blender");
}

#[test]
fn without_a_blender_it_says_what_to_do() {
    let copy = copied_dataset();
    let empty = tempfile::tempdir().unwrap();
    let mut command = mateval();
    command.args(["prep", "render", "--renderer", "blender"]).arg(copy.path());
    let refused = run(command.env("MATEVAL_CACHE", empty.path()).env_remove("MATEVAL_BLENDER"));
    refused.ends_with(2).says("mateval fetch blender");
}
