//! `eval lint` as a user runs it, on folders and archives; scores of an archive.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use super::command::{Run, baseline, mateval, run, score};
use super::sample::{dataset, json, unrendered};
use mateval_testkit::packed::{ZipEntry, gzip, tar_header, tarred, zip, zipped};

fn truth(folder: &Path) -> PathBuf {
    let submission = folder.join("gt");
    run(&mut baseline("gt", dataset(), &submission)).ends_with(0);
    submission
}

fn lint_command(submission: &Path, words: &[&str]) -> Command {
    let mut command = mateval();
    command.args(["eval", "lint"]).arg(submission).arg("--dataset").arg(dataset()).args(words);
    command
}

fn lint(submission: &Path, words: &[&str]) -> Run {
    run(&mut lint_command(submission, words))
}

/// Exit code, stdout and stderr for a good submission, for a bad one, and for a path that does not exist.
#[test]
fn the_verdict_is_one_line_and_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    let submission = truth(folder.path());
    let (good, cost) = watched(&mut lint_command(&submission, &[]));
    let good = good.ends_with(0);
    assert!(cost.cpu_seconds < 5.0, "{} s", cost.cpu_seconds);
    let lines: Vec<&str> = good.stdout.lines().collect();
    assert_eq!(lines.len(), 2, "{}", good.stdout);
    assert!(lines[0].starts_with("note [copy_of_truth] 'scenes/room': "), "{}", good.stdout);
    assert!(lines[1].starts_with("good: 0 errors, 0 warnings, 1 note; "), "{}", good.stdout);
    assert_eq!(good.stderr, "");

    let room = submission.join("scenes/room");
    for instance in ["floor", "rug", "sofa"] {
        std::fs::remove_file(room.join(instance).join("base_color.png")).unwrap();
    }
    std::fs::rename(room.join("wall_paper"), room.join("wallpaper")).unwrap();
    let bad = lint(&submission, &[]).ends_with(1);
    let expected = "error [misnamed_object] 'scenes/room/wallpaper': no instance has this name, and 'wall_paper' is missing; \
                    rename it to 'wall_paper'\n\
                    error [missing_map] 'scenes/room/floor/base_color.png': expected a PNG or an EXR, found none; write it; a \
                    missing one scores as linear 0.5 (3 times; also 'scenes/room/rug/base_color.png', \
                    'scenes/room/sofa/base_color.png')\n";
    assert!(bad.stdout.starts_with(expected), "{}", bad.stdout);
    assert!(bad.stdout.contains("\nnot good: 4 errors, "), "{}", bad.stdout);
    let instances = std::fs::read_dir(&room).unwrap().flatten().map(|entry| entry.path());
    for instance in instances {
        for map in ["roughness.png", "metallic.png"] {
            std::fs::remove_file(instance.join(map)).unwrap();
        }
    }
    let bare = lint(&submission, &[]).ends_with(1);
    for (map, value) in [("roughness", "0.5"), ("metallic", "0")] {
        let line = bare.stdout.lines().find(|line| line.starts_with(&format!("note [default_{map}] "))).unwrap();
        assert!(
            line.contains(&format!(
                "{map} is missing, which the format allows; rendered as {value}; scored as {value} too"
            )),
            "{line}"
        );
    }
    let none = lint(&folder.path().join("none"), &[]).ends_with(2);
    assert!(none.stdout.is_empty() && none.error().contains("none'"), "{}", none.stderr);
    std::fs::write(folder.path().join("a.rar"), "Rar!").unwrap();
    lint(&folder.path().join("a.rar"), &[]).ends_with(2).says("expected a folder, a .zip or a .tar.gz");
}

#[test]
fn an_archive_is_checked_and_scored_like_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let submission = truth(folder.path());
    std::fs::remove_file(submission.join("scenes/room/rug/base_color.png")).unwrap();
    let out = folder.path().join("lint.json");
    let words = ["--format", "json", "--out", out.to_str().unwrap()];
    let expected = lint(&submission, &words).ends_with(1).stdout;
    assert_eq!(std::fs::read_to_string(&out).unwrap(), expected);
    lint(&submission, &words).ends_with(2).says("add --force to overwrite it");
    let [zip, tar] = ["gt.zip", "gt.tar.gz"].map(|name| folder.path().join(name));
    std::fs::write(&zip, zipped(&submission, "mine/")).unwrap();
    std::fs::write(&tar, tarred(&submission, "./")).unwrap();
    for archive in [&zip, &tar] {
        assert_eq!(lint(archive, &["--format", "json"]).ends_with(1).stdout, expected);
    }
    let file: serde_json::Value = serde_json::from_str(&expected).unwrap();
    assert_eq!((&file["good"], &file["errors"]), (&false.into(), &1.into()));
    assert_eq!(file["findings"][0]["code"], "missing_map");

    // The score and its findings are those of the folder. Without renders scoring takes a second.
    let [of_folder, of_zip] = ["folder.json", "zip.json"].map(|name| folder.path().join(name));
    let scored = |submission: &Path, out: &Path| {
        run(score(submission, unrendered(), out).env("MATEVAL_CACHE", folder.path())).ends_with(0);
        json(out)
    };
    assert_eq!(scored(&submission, &of_folder), scored(&zip, &of_zip));
}

/// Resources that a run used.
struct Cost {
    cpu_seconds: f64,
    peak_mib: f64,
}

/// Runs a command and measures it. The kernel keeps the counters of an ended process until it is waited for, except for
/// its memory.
fn watched(command: &mut Command) -> (Run, Cost) {
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let proc_file = |file: &str| std::fs::read_to_string(format!("/proc/{}/{file}", child.id())).unwrap();
    let mut peak_kib = 0.0;
    let cpu_seconds = loop {
        let stat = proc_file("stat");
        // After the name, which may hold any characters: the state, and ten numbers later the ticks in user and system
        // mode.
        let fields: Vec<&str> = stat.rsplit_once(") ").unwrap().1.split(' ').collect();
        if fields[0] == "Z" {
            const TICKS_A_SECOND: f64 = 100.0;
            break (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / TICKS_A_SECOND;
        }
        let status = proc_file("status");
        if let Some(line) = status.lines().find_map(|line| line.strip_prefix("VmHWM:")) {
            peak_kib = line.trim().trim_end_matches(" kB").parse::<f64>().unwrap();
        }
        std::thread::sleep(Duration::from_millis(1));
    };
    (Run::of(child.wait_with_output().unwrap()), Cost { cpu_seconds, peak_mib: peak_kib / 1024.0 })
}

/// Zips of 10 MB that would unpack to 80 GB, in three ways: entries that share their data, entries whose stated size
/// is that large, and entries whose stated size is too small.
fn zip_bombs() -> Vec<(&'static str, Vec<u8>)> {
    let zeros = ZipEntry::new("0", &vec![0; 400 << 20]);
    let filler = ZipEntry::stored("filler", &vec![7; (10 << 20) - zeros.data.len()]);
    let bomb = |change: fn(usize, ZipEntry) -> ZipEntry| {
        let rest = (2..202).map(|at| change(at, ZipEntry { name: at.to_string().into(), ..zeros.clone() }));
        zip(&[zeros.clone(), filler.clone()].into_iter().chain(rest).collect::<Vec<_>>(), b"")
    };
    let sharing = bomb(|_, entry| ZipEntry { shares: Some(0), ..entry });
    let boasting = bomb(|_, entry| ZipEntry { data: vec![0; 9], ..entry });
    let modest = zip(&[ZipEntry { size: 1000, ..zeros.clone() }, filler.clone()], b"");
    vec![("overlapping_entries", sharing), ("archive_too_large", boasting), ("wrong_size", modest)]
}

/// The same for compressed streams, of at most a thousandth of their unpacked size: a file of ten gigabytes, ten
/// gigabytes of skipped entries, and a file whose stated size is 8 GB.
fn tar_bombs() -> Vec<(&'static str, Vec<u8>)> {
    let zeros = gzip(&vec![0; 64 << 20]);
    let body = zeros.repeat((10 << 20) / zeros.len());
    let bomb = |kind: u8, size: u64| [gzip(&tar_header("scenes/a.png", kind, size)), body.clone()].concat();
    let most = 8_589_934_591;
    vec![
        ("archive_bomb", bomb(b'0', 500 << 20)),
        ("archive_bomb", bomb(b'2', most)),
        ("file_too_large", bomb(b'0', most)),
    ]
}

/// Each check ends within a second of processor time and 200 MB of memory, and states the reason.
#[test]
fn bombs_end_early_and_take_no_memory() {
    let folder = tempfile::tempdir().unwrap();
    let bomb = folder.path().join("bomb");
    for (code, bytes) in zip_bombs().into_iter().chain(tar_bombs()) {
        assert!(bytes.len() < 12 << 20, "{} bytes", bytes.len());
        std::fs::write(&bomb, bytes).unwrap();
        let (run, cost) = watched(lint_command(&bomb, &[]).env("TMPDIR", folder.path()));
        run.ends_with(1).prints(&format!("error [{code}]")).prints("not good: 1 error, ");
        assert!(
            cost.cpu_seconds < 1.0 && cost.peak_mib < 200.0,
            "{code}: {} s, {} MiB",
            cost.cpu_seconds,
            cost.peak_mib
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "files were left behind");
    }
    // The twin: the measurement detects a costly run.
    let (run, cost) = watched(Command::new("dd").args(["if=/dev/zero", "of=/dev/null", "bs=300M", "count=10"]));
    run.ends_with(0);
    assert!(cost.cpu_seconds > 0.1 && cost.peak_mib > 300.0, "{} s, {} MiB", cost.cpu_seconds, cost.peak_mib);
}
