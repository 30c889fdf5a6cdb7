//! Brings a dataset of the format before this one up to date, from what it holds.
//!
//! `mateval/3` differs from `mateval/2` in the word of its JSON files, in a key of `dataset.json` and in the pictures that
//! scores under light are computed from. These are made by the caller; everything else happens here, and no other file
//! changes. A run that was killed resumes.

use std::path::Path;

use mateval_dataset::changes::{SceneHashes, change_scene};
use mateval_dataset::dataset::{DatasetFile, FORMAT, PREVIOUS_FORMAT};
use mateval_dataset::layout::{DATASET, MANIFEST, SceneFolder, TARGETS};
use mateval_dataset::manifest;
use mateval_dataset::open::check_whole;
use mateval_dataset::{DatasetError, Progress, Report, SceneId, json};
use mateval_files::FileError;
use mateval_files::untrusted::{sha256_of_bytes, sha256_of_file};
use mateval_files::whole::write_whole;
use mateval_files::work_folder;
use serde::Deserialize;

use super::finish::finish_again;
use crate::error::PrepError;

/// Rewrites the dataset in `root` from [`PREVIOUS_FORMAT`] to [`FORMAT`] and renews its manifest; pictures, meshes and
/// textures keep their bytes. Returns whether there was anything to do. Fails, before anything of a scene is written,
/// where one of its files is not the one that is listed.
pub fn bring_up_to_date(root: &Path, progress: Progress<'_>) -> Result<bool, PrepError> {
    let path = root.join(DATASET);
    let bytes = std::fs::read(&path).map_err(FileError::io("read", &path))?;
    if format_of(&bytes).as_deref() != Some(PREVIOUS_FORMAT) {
        return Ok(false);
    }
    let text = raised(&path, &bytes)?.replacen(r#""scored_renderer":"#, r#""photo_renderer":"#, 1);
    let dataset: DatasetFile = json::parse_format(&path, text.as_bytes(), FORMAT)?;
    check_can_change(root, &dataset)?;
    for (at, id) in dataset.scenes.iter().enumerate() {
        progress(Report::part(&format!("scene {id}"), at, dataset.scenes.len()));
        raise_scene(root, id)?;
    }
    raise_file(&root.join(TARGETS))?;
    // From here on this version opens the dataset, and asks to finish it if this run is killed.
    write_whole(&path, text.as_bytes()).map_err(DatasetError::from)?;
    finish_again(root, progress)?;
    Ok(true)
}

/// Fails where scenes are missing, where the geometry is not the true one, or where a file outside of scenes is not the
/// one that the manifest lists. Those of scenes are checked scene by scene.
fn check_can_change(root: &Path, dataset: &DatasetFile) -> Result<(), PrepError> {
    check_whole(root, dataset)?;
    if dataset.geometry.is_some() {
        let what = "perturbed geometry in an old format; run `mateval prep perturb` on the dataset with the true geometry, \
                    whose identity changes too";
        return Err(DatasetError::Unsupported { path: root.to_owned(), what: what.to_owned() }.into());
    }
    let found = sha256_of_file(&root.join(MANIFEST))?;
    if found != dataset.manifest_sha256 {
        let what = format!("manifest_sha256 is {}, but MANIFEST.sha256 hashes to {found}", dataset.manifest_sha256);
        return Err(DatasetError::Unsupported { path: root.join(DATASET), what }.into());
    }
    let mut findings = manifest::check_those(root, |file| !file.starts_with("scenes/"))?;
    let listed = manifest::entries(root)?;
    let is_raised = |file: &str| {
        listed
            .iter()
            .any(|entry| entry.file == file && JsonState::of(&root.join(file), &entry.sha256) == JsonState::Raised)
    };
    findings.retain(|finding| !is_raised(&finding.file));
    match findings.is_empty() {
        true => Ok(()),
        false => Err(DatasetError::Invalid { path: root.to_owned(), findings }.into()),
    }
}

/// Rewrites the JSON files of a scene and removes its companions, which are no longer part of the format.
fn raise_scene(root: &Path, id: &SceneId) -> Result<(), PrepError> {
    let is_companion = |file: &str| file.starts_with(&format!("scenes/{id}/ground_truth/companions/"));
    let list = SceneHashes::open(root, id)?;
    let json_files = list.entries().filter(|(file, _)| file.ends_with(".json") && !is_companion(file));
    let states: Vec<(String, JsonState)> =
        json_files.map(|(file, sha256)| (file.to_owned(), JsonState::of(&root.join(file), sha256))).collect();
    let companions = SceneFolder::of(root, id).truth().join("companions");
    if !companions.exists() && states.iter().all(|(_, state)| *state == JsonState::Other) {
        return Ok(());
    }
    let is_ours = |path: &str| {
        is_companion(path) || states.iter().any(|(file, state)| file == path && *state != JsonState::Other)
    };
    change_scene(root, id, is_ours, || {
        for (file, _) in states.iter().filter(|(_, state)| *state == JsonState::Previous) {
            raise_file(&root.join(file))?;
        }
        Ok(work_folder::remove(&companions)?)
    })
}

/// What a JSON file is, compared with the hash that is listed for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum JsonState {
    /// The listed file, in the previous format.
    Previous,
    /// Was the listed file until a run that was killed rewrote it.
    Raised,
    /// The listed file, in a format of its own; or changed or missing, which the check of the hashes reports.
    Other,
}

impl JsonState {
    fn of(path: &Path, listed: &str) -> Self {
        let Ok(bytes) = std::fs::read(path) else { return Self::Other };
        let before = || String::from_utf8_lossy(&bytes).replacen(&quoted(FORMAT), &quoted(PREVIOUS_FORMAT), 1);
        match format_of(&bytes).as_deref() {
            Some(PREVIOUS_FORMAT) if sha256_of_bytes(&bytes) == listed => Self::Previous,
            Some(FORMAT) if sha256_of_bytes(before().as_bytes()) == listed => Self::Raised,
            _ => Self::Other,
        }
    }
}

/// Rewrites a file that has the previous format; leaves any other.
fn raise_file(path: &Path) -> Result<(), PrepError> {
    let bytes = std::fs::read(path).map_err(FileError::io("read", path))?;
    if format_of(&bytes).as_deref() == Some(PREVIOUS_FORMAT) {
        write_whole(path, raised(path, &bytes)?.as_bytes()).map_err(DatasetError::from)?;
    }
    Ok(())
}

/// The text with the new format in place of the previous one. Only that word is replaced, so that numbers keep their
/// digits.
fn raised(path: &Path, bytes: &[u8]) -> Result<String, PrepError> {
    let text = String::from_utf8_lossy(bytes).replacen(&quoted(PREVIOUS_FORMAT), &quoted(FORMAT), 1);
    if format_of(text.as_bytes()).as_deref() == Some(FORMAT) {
        return Ok(text);
    }
    let what =
        format!("expected 'format' as the first key with the value '{PREVIOUS_FORMAT}'; build the dataset again");
    Err(DatasetError::Unsupported { path: path.to_owned(), what }.into())
}

fn quoted(format: &str) -> String {
    format!("\"{format}\"")
}

/// The value of the key `format`; absent if the file has no such key or is no JSON.
fn format_of(bytes: &[u8]) -> Option<String> {
    #[derive(Deserialize)]
    struct Head {
        format: String,
    }
    serde_json::from_slice::<Head>(bytes).ok().map(|head| head.format)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::PathBuf;
    use std::sync::LazyLock;

    use mateval_dataset::open::Dataset;
    use mateval_testkit::sample_dataset;
    use mateval_testkit::{copy_folder, kept_folder};

    use crate::render::{RenderOptions, render};

    use super::*;

    fn hashes(root: &Path) -> BTreeMap<String, String> {
        let files = manifest::list_files(root).unwrap().into_iter().chain([DATASET.to_owned(), MANIFEST.to_owned()]);
        files.map(|file| (file.clone(), sha256_of_file(&root.join(file)).unwrap())).collect()
    }

    /// Replaces a text in a file once, which must hold it.
    fn replace(path: &Path, from: &str, to: &str) {
        let text = std::fs::read_to_string(path).unwrap();
        assert!(text.contains(from), "{}", path.display());
        std::fs::write(path, text.replacen(from, to, 1)).unwrap();
    }

    fn list_again(root: &Path) {
        let path = root.join(DATASET);
        let known = json::read::<serde_json::Value>(&path).unwrap()["manifest_sha256"].as_str().unwrap().to_owned();
        let sha256 = manifest::write(root).unwrap();
        replace(&path, &known, &sha256);
    }

    /// A rendered dataset of this format, and the same one as the previous version wrote it. Tests only read them.
    static BOTH_FORMATS: LazyLock<[PathBuf; 2]> = LazyLock::new(|| {
        let new = sample_dataset::built_with_input_views();
        render(&new, &RenderOptions { samples: Some(1), ..RenderOptions::default() }, &|_| ()).unwrap();
        let old = new.with_file_name("previous");
        copy_folder(&new, &old);
        let mut count = 0;
        for file in manifest::list_files(&old).unwrap().into_iter().chain([DATASET.to_owned()]) {
            let path = old.join(file);
            if std::fs::read(&path).is_ok_and(|bytes| format_of(&bytes).as_deref() == Some(FORMAT)) {
                replace(&path, &quoted(FORMAT), &quoted(PREVIOUS_FORMAT));
                count += 1;
            }
        }
        assert!(count >= 8, "dataset.json, targets.json and at least three files of each scene: {count}");
        replace(&old.join(DATASET), "\"photo_renderer\":", "\"scored_renderer\":");
        let dataset = Dataset::open(&new).unwrap();
        for scene in &dataset.scenes {
            let companions = SceneFolder::of(&old, &scene.id).truth().join("companions/turned");
            std::fs::create_dir_all(&companions).unwrap();
            std::fs::write(companions.join("companions.json"), r#"{"format": "mateval-companions/2"}"#).unwrap();
        }
        list_again(&old);
        [new, old]
    });

    /// A copy of a dataset that a test may change.
    fn copied(root: &Path) -> PathBuf {
        let copy = kept_folder("up_to_date").join("dataset");
        copy_folder(root, &copy);
        copy
    }

    #[test]
    fn the_previous_format_becomes_this_one_byte_for_byte() {
        let [new, old] = &*BOTH_FORMATS;
        let error = Dataset::open(old).unwrap_err().to_string();
        assert!(error.contains("mateval prep render --only scorer DATASET"), "{error}");
        // Another version's list of hashes must not be needed.
        let whole = copied(old);
        std::fs::remove_dir_all(whole.join(".build")).unwrap();
        assert!(bring_up_to_date(&whole, &|_| ()).unwrap());
        assert_eq!(hashes(&whole), hashes(new));
        assert!(!bring_up_to_date(&whole, &|_| ()).unwrap(), "nothing is left to do");
        Dataset::open(&whole).unwrap();

        // A run that was killed between two files of a scene.
        let old = copied(old);
        let scene = Dataset::open(new).unwrap().scenes[1].id.clone();
        let scene_file = SceneFolder::of(&old, &scene).scene_file();
        SceneHashes::open(&old, &scene).unwrap().note_change().unwrap();
        raise_file(&scene_file).unwrap();
        raise_file(&old.join(TARGETS)).unwrap();
        assert!(bring_up_to_date(&old, &|_| ()).unwrap());
        assert_eq!(hashes(&old), hashes(new));
    }

    #[test]
    fn a_changed_file_is_refused() {
        let old = copied(&BOTH_FORMATS[1]);
        let dataset: serde_json::Value = json::read(&old.join(DATASET)).unwrap();
        let picture = format!("scenes/{}/views/input/depth.exr", dataset["scenes"][0].as_str().unwrap());
        std::fs::write(old.join(&picture), "changed").unwrap();
        let before = hashes(&old);
        let error = bring_up_to_date(&old, &|_| ()).unwrap_err().to_string();
        assert!(error.contains("changed_file") && error.contains(&picture), "{error}");
        assert_eq!(hashes(&old), before);
    }
}
