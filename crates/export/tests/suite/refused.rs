//! Datasets and outputs that are refused before anything is written.

use mateval_export::{ExportError, Format, export};
use mateval_scene::dataset::DatasetFile;
use mateval_scene::{SceneError, json, manifest};

use super::sample::{FORMATS, copy, exported, options, root};

/// The code of a finding, and a change that causes it.
type Change = (&'static str, fn(&std::path::Path));

/// Makes the manifest and `dataset.json` agree with the files again.
fn renew(root: &std::path::Path, text: Option<String>) {
    let sha256 = match text {
        Some(text) => {
            std::fs::write(root.join("MANIFEST.sha256"), &text).unwrap();
            manifest::sha256_of_bytes(text.as_bytes())
        }
        None => manifest::write(root).unwrap(),
    };
    let path = root.join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.manifest_sha256 = sha256;
    json::write(&path, &file).unwrap();
}

#[test]
fn changed_missing_and_unlisted_files() {
    let changes: [Change; 3] = [
        ("changed_file", |root| std::fs::write(root.join("scenes/room/views/input/rgb.png"), "x").unwrap()),
        ("missing_file", |root| std::fs::remove_file(root.join("scenes/room/geometry/parts.glb")).unwrap()),
        ("unlisted_file", |root| std::fs::write(root.join("scenes/room/.DS_Store"), "x").unwrap()),
    ];
    for (code, change) in changes {
        let folder = copy();
        change(folder.path());
        for format in FORMATS {
            let (out, found) = exported(folder.path(), format);
            let Err(ExportError::Dataset(SceneError::Invalid { findings, .. })) = found else { panic!("{found:?}") };
            assert_eq!(findings.iter().map(|finding| finding.code.as_str()).collect::<Vec<_>>(), [code]);
            assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
        }
    }
}

#[test]
fn hidden_files_even_if_they_are_listed() {
    let folder = copy();
    std::fs::write(folder.path().join("scenes/room/.secret"), "x").unwrap();
    renew(folder.path(), None);
    let text = exported(folder.path(), Format::Tar).1.unwrap_err().to_string();
    assert!(text.contains("lists 1 hidden files ('scenes/room/.secret' first), which are never exported"), "{text}");
}

/// A manifest that lists a file outside the dataset, with its right hash.
#[test]
fn names_that_lead_out_of_the_dataset() {
    let above = tempfile::tempdir().unwrap();
    let inside = above.path().join("dataset");
    mateval_testkit::kept_folder::copy_folder(root(), &inside);
    std::fs::write(above.path().join("secret"), "x").unwrap();
    let absolute = above.path().join("secret").to_str().unwrap().to_owned();
    let listed = std::fs::read_to_string(inside.join("MANIFEST.sha256")).unwrap();
    for name in ["../secret", "scenes/../../secret", absolute.as_str()] {
        let line = format!("{}  {name}\n", manifest::sha256_of_bytes(b"x"));
        renew(&inside, Some(format!("{listed}{line}")));
        for format in FORMATS {
            let (out, found) = exported(&inside, format);
            let text = found.unwrap_err().to_string();
            assert!(text.contains("bad_manifest_line"), "{text}");
            assert_eq!(std::fs::read_dir(out.path()).unwrap().count(), 0);
        }
    }
}

#[test]
fn outputs_that_exist_or_lie_in_the_dataset() {
    let folder = copy();
    let inside = options(folder.path(), Format::Tar, folder.path().join("scenes/out"));
    assert!(matches!(export(&inside, &|_| ()), Err(ExportError::OutputInDataset { .. })));
    let place = tempfile::tempdir().unwrap();
    let taken = options(folder.path(), Format::Tar, place.path().to_owned());
    let text = export(&taken, &|_| ()).unwrap_err().to_string();
    assert!(text.ends_with("already exists; choose another --out, or remove it"), "{text}");
}

#[test]
fn pictures_that_were_not_rendered() {
    let folder = copy();
    let path = folder.path().join("dataset.json");
    let mut file: DatasetFile = json::read(&path).unwrap();
    file.photo_renderer = None;
    json::write(&path, &file).unwrap();
    for format in FORMATS {
        let found = exported(folder.path(), format).1;
        match format {
            Format::Tar => assert!(found.is_ok()),
            _ => assert!(matches!(found, Err(ExportError::NoPictures { .. })), "{found:?}"),
        }
    }
}

/// A copy without its ground truth is whole; only the pictures of novel views are missing.
#[test]
fn withheld_truth_is_no_fault() {
    let folder = copy();
    for scene in ["living", "room"] {
        std::fs::remove_dir_all(folder.path().join("scenes").join(scene).join("ground_truth")).unwrap();
    }
    for format in FORMATS {
        let found = exported(folder.path(), format).1.unwrap();
        let expected = match format {
            Format::Tar => (None, 0),
            Format::Croissant | Format::Huggingface => (Some(10), 8),
            Format::Nerfstudio | Format::Colmap => (Some(2), 8),
        };
        assert_eq!((found.views, found.without_picture), expected, "{format:?}");
    }
}
