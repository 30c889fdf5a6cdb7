//! Cached scores are used by the next run if everything that they depend on is the same, and only then.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use mateval_eval::protocol::Protocol;
use mateval_eval::result::ResultFile;
use mateval_eval::score::ScorePlan;
use mateval_image::texture_io::{Encoding, read_texture};
use mateval_image::{Picture, Wrap, png_io};
use serde_json::Value;

use super::sample::{hasty, plan, scored, text, write_truth};
use mateval_testkit::kept_folder;

/// A submission, its result without any cache, and a cache that a run has filled.
struct Kept {
    submission: PathBuf,
    result: String,
    cache: PathBuf,
}

static KEPT: LazyLock<Kept> = LazyLock::new(|| {
    let folder = kept_folder("cache");
    let (submission, cache) = (folder.join("gt"), folder.join("cache"));
    write_truth(&submission);
    std::fs::create_dir(&cache).unwrap();
    let result = text(&scored(&plan(&[&submission], &hasty(), &[]))[0]);
    let filled = score_with(&submission, &cache, &hasty());
    assert!(text(&filled) == result, "keeping scores changes them");
    Kept { submission, result, cache }
});

fn score_with(submission: &Path, cache: &Path, protocol: &Protocol) -> ResultFile {
    score_scenes(submission, cache, protocol, &[])
}

fn score_scenes(submission: &Path, cache: &Path, protocol: &Protocol, scenes: &[&str]) -> ResultFile {
    scored(&ScorePlan { cache: Some(cache), ..plan(&[submission], protocol, scenes) }).remove(0)
}

fn files(cache: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(cache).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

fn read(file: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(file).unwrap()).unwrap()
}

/// A copy of the cache's entries for these scenes; each has one.
fn copied(scenes: &[&str]) -> tempfile::TempDir {
    let copy = tempfile::tempdir().unwrap();
    let all = files(&KEPT.cache);
    assert_eq!(all.len(), 2);
    let is_wanted = |file: &&PathBuf| scenes.iter().any(|scene| read(file)["texels"][0]["scene"] == *scene);
    let chosen: Vec<&PathBuf> = all.iter().filter(is_wanted).collect();
    assert_eq!(chosen.len(), scenes.len());
    for file in chosen {
        std::fs::copy(file, copy.path().join(file.file_name().unwrap())).unwrap();
    }
    copy
}

/// The first value of a poisoned cache entry.
const POISON: f64 = 12345.5;

/// A cache whose entries are all wrong, which shows whether they are used.
fn poisoned(scenes: &[&str]) -> tempfile::TempDir {
    let cache = copied(scenes);
    for file in files(cache.path()) {
        let mut entry = read(&file);
        entry["pictures"][0]["values"]["mse"] = Value::from(POISON);
        std::fs::write(&file, entry.to_string()).unwrap();
    }
    cache
}

/// Scenes whose entry was used.
fn poisons(result: &ResultFile) -> Vec<String> {
    let pictures = result.protocols.values().flat_map(|protocol| &protocol.pictures);
    pictures
        .filter(|picture| picture.values.values().any(|value| *value == POISON))
        .map(|picture| picture.scene.to_string())
        .collect()
}

#[test]
fn half_a_cache_gives_the_same_result() {
    let cache = copied(&["room"]);
    let result = score_with(&KEPT.submission, cache.path(), &hasty());
    assert!(text(&result) == KEPT.result);
    assert_eq!(files(cache.path()).len(), 2, "the other scene is kept too");
    // The twin: an existing entry is used.
    let cache = poisoned(&["room"]);
    assert_eq!(poisons(&score_with(&KEPT.submission, cache.path(), &hasty())), ["room"]);
}

#[test]
fn half_written_entries_are_computed_again() {
    let cache = copied(&["living", "room"]);
    let whole = std::fs::read(&files(&KEPT.cache)[0]).unwrap();
    let torn = &files(cache.path())[0];
    for length in [0, 1, whole.len() / 2, whole.len() - 2] {
        std::fs::write(torn, &whole[..length]).unwrap();
        assert!(text(&score_with(&KEPT.submission, cache.path(), &hasty())) == KEPT.result, "{length} bytes");
        assert!(std::fs::read(torn).unwrap() == whole, "{length} bytes: not replaced");
    }
}

#[test]
fn another_texel_is_another_submission() {
    let folder = tempfile::tempdir().unwrap();
    let changed = folder.path().join("gt");
    write_truth(&changed);
    let scene = changed.join("scenes/room");
    let instance = std::fs::read_dir(&scene).unwrap().map(|entry| entry.unwrap().path()).min().unwrap();
    for map in ["base_color.png", "roughness.png"] {
        let cache = poisoned(&["living", "room"]);
        assert_eq!(poisons(&score_with(&changed, cache.path(), &hasty())), ["living", "room"], "the twin");
        let path = instance.join(map);
        let before = std::fs::read(&path).unwrap();
        if map == "base_color.png" {
            let texture = read_texture(&path, Encoding::Linear, Wrap::Clamp).unwrap();
            let word = |v: f32| (v * 65535.0).round() as u16;
            let mut texels = Picture::from_fn(texture.width(), texture.height(), |x, y| texture.texel(x, y).map(word));
            let [r, g, b] = texels.get(0, 0);
            texels.set(0, 0, [r ^ 1, g, b]);
            png_io::write_rgb_words(&path, &texels).unwrap();
        } else {
            std::fs::remove_file(&path).unwrap();
        }
        assert_eq!(poisons(&score_with(&changed, cache.path(), &hasty())), ["living"], "{map}");
        std::fs::write(&path, before).unwrap();
    }
}

/// The link has no hash, but the map beside it is ambiguous and no longer scored.
#[test]
fn a_file_that_cannot_be_read_is_another_score() {
    let folder = tempfile::tempdir().unwrap();
    let changed = folder.path().join("gt");
    write_truth(&changed);
    let cache = poisoned(&["room"]);
    let room = || poisons(&score_scenes(&changed, cache.path(), &hasty(), &["room"]));
    assert_eq!(room(), ["room"], "the twin");
    let scene = changed.join("scenes/room");
    let instance = std::fs::read_dir(&scene).unwrap().map(|entry| entry.unwrap().path()).min().unwrap();
    std::os::unix::fs::symlink("nowhere.exr", instance.join("base_color.exr")).unwrap();
    assert_eq!(room(), [""; 0]);
}

#[test]
fn another_protocol_is_another_score() {
    let cache = poisoned(&["room"]);
    let room = |protocol: &Protocol| poisons(&score_scenes(&KEPT.submission, cache.path(), protocol, &["room"]));
    // The key contains the whole protocol, so one value stands for all.
    let mut other = hasty();
    other.light.fit.pool = 4;
    assert_eq!(room(&other), [""; 0]);
    let protocol = hasty();
    let plan = plan(&[&KEPT.submission], &protocol, &["room"]);
    let tool = ScorePlan { tool: "another".into(), cache: Some(cache.path()), ..plan };
    assert_eq!(poisons(&scored(&tool)[0]), [""; 0]);
    // The twin.
    assert_eq!(room(&hasty()), ["room"]);
}
